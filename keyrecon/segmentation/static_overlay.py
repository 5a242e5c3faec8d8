"""What is laid over the picture, scores and logos: it stands still while the scene moves.

While the way of the camera is not known yet, edges that keep their place and direction in pictures
from all over the video are laid over it, or they run along the way the camera pans, like a base
line. Both mislead: a corner on such a line is tracked anywhere along it. A corner that once moved
with the scene is neither.

Where it is known, pictures of different directions are held against each other: what is laid over
them agrees place by place, and not where the camera says that the scene went. A player who runs
behind it is hidden there, and it is no part of them (`find_overlay`).
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from keyrecon.io.frame_reader import shrinking
from keyrecon.numerics.geometry import warp_points

MIN_PERSISTENCE = 0.85
"""An edge that keeps its place and direction to this degree all along is laid over the picture (or
the camera is static). What it lacks to 1 a quarter more or less, others with it: at most 1.9 points
on one clip."""
COMPARED_WIDTH = 480
"""Pictures that are held against each other are no wider, px: letters can be read in them."""
COMPARED_PAIRS = 16
"""Pairs of pictures that are held against each other at most."""
LEAST_SHIFT = 8.0
"""The scene lies so far apart in both pictures everywhere, px: twice as broad as a letter's line,
and farther than leaves are blown and the camera's way is wrong."""
SAME_COLOR, OTHER_COLOR = 20, 30
"""Sums of differences in L, a and b up to which two colours are the same, from which they are not:
compression and noise of broadcasts stay below the first."""
LEAST_SHARE = 0.4
"""Share of the pairs, either way round, in which a place speaks for something laid over it. Either
way round, as what it hides in one picture is missing from the other: its shadow would be taken for
it as well."""
LEAST_PAIRS = 0.3
"""Share of the pairs that show a place free of the player, at least: else nobody knows."""
GAP_SHARE, LEAST_SIDE = 0.03, 0.015
"""Letters nearer than this belong together; what is smaller is noise. Shares of the width."""
LEAST_FILLED = 0.7
"""Share of its convex outline that letters and their gaps fill of a panel."""


@dataclass(eq=False)
class StaticOverlay:
    """Running evidence of what keeps its place in the picture."""

    gradient: Float[np.ndarray, "2 h w"] | None = None
    strength: Float[np.ndarray, "h w"] | None = None
    moved: Int[np.ndarray, "h w"] | None = None
    """How much more often a corner there moved with the scene than it did not."""

    def add(self, grey: UInt8[np.ndarray, "h w"]) -> None:
        """Take one more picture into account."""
        soft = cv2.GaussianBlur(grey, (0, 0), 1.0)
        slope = np.stack([cv2.Sobel(soft, cv2.CV_32F, 1, 0), cv2.Sobel(soft, cv2.CV_32F, 0, 1)])
        size = np.hypot(*slope)
        self.gradient = slope if self.gradient is None else self.gradient + slope
        self.strength = size if self.strength is None else self.strength + size

    def count(
        self,
        shape: tuple[int, ...],
        corners: Float[np.ndarray, "n 2"],
        moves_along: Bool[np.ndarray, "n"],
    ) -> None:
        """Take corners into account at whose place the scene moved, and whether they did."""
        if self.moved is None:
            self.moved = np.zeros(shape[:2], int)
        x, y = corners.astype(int).T
        self.moved[y, x] += np.where(moves_along, 1, -1)

    def mask(self) -> Bool[np.ndarray, "h w"]:
        """Where persistent edges lie, if they are few against those that do not persist."""
        if self.gradient is None or self.strength is None:
            raise ValueError("no picture was added")
        strong = self.strength > np.percentile(self.strength, 90)
        persistent = strong & (np.hypot(*self.gradient) > MIN_PERSISTENCE * self.strength)
        if persistent.sum() > 0.5 * strong.sum():
            return np.zeros(strong.shape, bool)
        size = max(3, strong.shape[1] // 60)
        return cv2.dilate(persistent.astype(np.uint8), np.ones((size, size))) > 0

    def share(self, corners: Float[np.ndarray, "n 2"]) -> float:
        """Share of corners that lie on something laid over the picture."""
        x, y = corners.astype(int).T
        held = self.mask()
        if self.moved is not None:
            held &= self.moved <= 0
        return float(held[y, x].mean()) if len(x) else 0.0


def find_overlay(
    lab: list[UInt8[np.ndarray, "h w 3"]],
    free: list[Bool[np.ndarray, "h w"]],
    to_reference: Float[np.ndarray, "n 3 3"],
    shrink: float,
) -> Bool[np.ndarray, "h w"]:
    """Where pictures of one shot have something laid over them; nowhere for a static camera.

    They are asked where one of two is `free` of the player: a camera that follows them has them in
    the same place, too, in both. `to_reference` leads from the pixels of the whole pictures to
    those of the reference frame; these have `shrink` px for one of theirs.
    """
    rows, columns = lab[0].shape[:2]
    reduced = min(1.0, COMPARED_WIDTH / columns)
    size = (round(reduced * columns), round(reduced * rows))
    small = shrinking(reduced * shrink)
    paths = small @ to_reference @ np.linalg.inv(small)
    pairs = _distant_pairs(paths, size)
    if not len(pairs):
        return np.zeros((rows, columns), bool)
    seen = {n: cv2.resize(lab[n], size, interpolation=cv2.INTER_AREA) for n in np.unique(pairs)}
    clear = {n: cv2.resize(free[n].astype(np.uint8), size) > 0 for n in seen}
    held, asked = np.zeros((2, size[1], size[0]), int), np.zeros((size[1], size[0]), int)
    for pair in pairs:
        comparable = clear[pair[0]] | clear[pair[1]]
        asked += comparable
        for way, (one, other) in enumerate((pair, pair[::-1])):
            moved = np.linalg.inv(paths[one]) @ paths[other]
            held[way] += comparable & _stands_still(seen[one], seen[other], moved)
    share = np.where(asked >= LEAST_PAIRS * len(pairs), held / np.maximum(asked, 1), 0.0)
    either, both = (shares >= LEAST_SHARE for shares in (share.max(axis=0), share.min(axis=0)))
    usual = np.median([*seen.values()], axis=0)
    return _enlarge(_fill(_with_margins(_fill(both), either, usual)), (columns, rows))


def _distant_pairs(
    paths: Float[np.ndarray, "n 3 3"], size: tuple[int, int]
) -> Int[np.ndarray, "m 2"]:
    """Pictures in which no part of the scene is where it is in the other, spread over all such."""
    width, height = size
    corners = np.array([(0, 0), (width, 0), (width, height), (0, height)], float)
    places = np.stack([warp_points(path, corners) for path in paths])
    shift = np.linalg.norm(places[:, None] - places[None], axis=-1).min(axis=-1)
    pairs = np.argwhere(np.triu(shift > LEAST_SHIFT))
    chosen = np.linspace(0, len(pairs) - 1, min(COMPARED_PAIRS, len(pairs))).round().astype(int)
    return pairs[chosen]


def _stands_still(
    one: UInt8[np.ndarray, "h w 3"],
    other: UInt8[np.ndarray, "h w 3"],
    moved: Float[np.ndarray, "3 3"],
) -> Bool[np.ndarray, "h w"]:
    """Where one picture is as the other is in the same place, and not as its scene, moved here.

    The scene may be off by a pixel. What the other does not show of it says nothing.
    """
    size, around = (one.shape[1], one.shape[0]), np.ones((3, 3), np.uint8)
    scene = cv2.warpPerspective(other, moved, size, one.copy(), borderMode=cv2.BORDER_TRANSPARENT)
    low, high = cv2.erode(scene, around), cv2.dilate(scene, around)
    away = cv2.max(cv2.subtract(low, one), cv2.subtract(one, high))
    same = cv2.absdiff(one, other).sum(axis=-1, dtype=int) < SAME_COLOR
    return np.logical_and(same, away.sum(axis=-1, dtype=int) > OTHER_COLOR)


def _fill(still: Bool[np.ndarray, "y x"]) -> Bool[np.ndarray, "y x"]:
    """The panels that letters and borders which stand still belong to."""
    width = still.shape[1]
    gap, least = max(3, round(GAP_SHARE * width)), LEAST_SIDE * width
    near = cv2.morphologyEx(still.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((gap, gap), np.uint8))
    mask = np.zeros(near.shape, np.uint8)
    for contour in cv2.findContours(near, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)[0]:
        if min(cv2.boundingRect(contour)[2:]) < least:
            continue
        outline = cv2.convexHull(contour)
        filled = cv2.contourArea(contour) >= LEAST_FILLED * cv2.contourArea(outline)
        cv2.drawContours(mask, [outline if filled else contour], 0, 1, cv2.FILLED)
    return mask > 0


def _with_margins(
    panels: Bool[np.ndarray, "y x"],
    either: Bool[np.ndarray, "y x"],
    usual: Float[np.ndarray, "y x 3"],
) -> Bool[np.ndarray, "y x"]:
    """Panels with what is beside them, speaks for an overlay one way round and has their colour.

    Margins without letters and their shadows in the other picture do so alike.
    """
    number, parts = cv2.connectedComponents(panels.astype(np.uint8))
    whole = panels.copy()
    for part in range(1, number):
        color = np.median(usual[parts == part], axis=0)
        alike = np.abs(usual - color).sum(axis=-1) < SAME_COLOR
        grown = cv2.connectedComponents(((alike & either) | (parts == part)).astype(np.uint8))[1]
        whole |= grown == grown[parts == part].max()
    return whole


def _enlarge(mask: Bool[np.ndarray, "y x"], size: tuple[int, int]) -> Bool[np.ndarray, "h w"]:
    """A mask a pixel broader, for a picture of this size."""
    return cv2.resize(cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8)), size) > 0
