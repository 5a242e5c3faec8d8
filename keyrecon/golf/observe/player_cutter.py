"""The player cut out of single pictures by the colours that the clicked one shows.

GrabCut (Rother, Kolmogorov and Blake, SIGGRAPH 2004): the lines between the clicked joints seed the
player, everything farther away than an arm the scene, and the colours learnt there serve all other
frames unchanged, since colours that adapt drift into the scene. Where the core of the player was
and a picture has his colours, he is for sure.
"""

from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np
from jaxtyping import Bool, Int, UInt8

from keyrecon.errors import KeyreconError
from keyrecon.golf.clicks import ClickedPose
from keyrecon.io.frame_reader import reduce_picture, side_by_side
from keyrecon.segmentation.color_model import to_lab

SEED_LINES = (
    ("head_top", "neck", "root"), ("root", "right_knee", "right_ankle"),
    ("root", "left_knee", "left_ankle"), ("neck", "right_shoulder", "right_elbow", "right_wrist"),
    ("neck", "left_shoulder", "left_elbow", "left_wrist"),
)  # fmt: skip
"""Lines through the body; joints that were not clicked are left out."""
SURE_WIDTH, LIKELY_WIDTH = 0.02, 0.08
"""Widths of the lines that are certainly and probably player, player heights: a shin is .04 wide
and a click off by .01, a thigh .08 wide."""
REACH_ABOVE, REACH_ASIDE, REACH_BELOW = 0.35, 0.5, 0.08
"""How far the player's trunk, head and legs may get from the clicks, player heights."""
CUT_HEIGHT = 160.0
"""Height of the player in the pictures that are cut out, px; time goes with its square."""
NO_FRAME = (0, 0, 0, 0)
"""GrabCut reads its rectangle only where there is no mask."""
LEAST_COVERED = 0.8
"""Share of the lines between clicked joints that the colours of the whole picture cut out, at
least: else halves are learnt apart. Of eight swings six have .92 and more, those with dark clothes
before something dark .65 and .68. With halves always, joints of a rendered swing were 4 mm worse;
never, .80 instead of .94 of those of a player in black before trees were in place."""
CORE, EDGE = 0.03, 2.0
"""What lies so deep in the clicked figure is its core (player heights), and so deep has no colours
of the scene (px): a limb's half width, since limbs leave their place, and an edge's blur."""
SAME_PLACE, SAME_COLOR = 0.012, np.array((8, 3, 3), np.int16)
"""Player heights around a place, and steps of L, a and b beside the range of the player's colours
there, within which he counts as still there: folds and shading of cloth, and video noise."""
OVERLAP = 0.04
"""By how much the upper and the lower half overlap, player heights."""
MIN_ROWS = 4
"""Rows of a half, px."""
AROUND_UNKNOWN = 0.1
"""What is cut out around places of which no scene is known, so that its edges tell where the player
ends, player heights."""
GRABCUT_RIM = 2
"""Scenery around the reach that GrabCut is given, px."""
SMALLEST_PLAYER, LARGEST_PLAYER = 0.01, 0.4
"""Area of the player in squared heights: people fill .16 to .2, less or more is no player."""


@dataclass(frozen=True, eq=False)
class _Half:
    """Rows of a picture with colours of their own: black trousers on grass stand out, though there
    are black trees higher up."""

    rows: slice
    models: tuple[np.ndarray, np.ndarray]
    """GrabCut's colours of scene and player."""


@dataclass(frozen=True, eq=False)
class ClickedFigure:
    """The core of the player in the clicked picture, and the colours that he has around there.

    GrabCut's colours alone may take a dark shirt for dark scenery in all later frames, and then the
    median of these frames takes the trunk for the scene: so it was in two of five real swings.
    """

    core: Bool[np.ndarray, "h w"]
    low: Int[np.ndarray, "h w 3"]
    high: Int[np.ndarray, "h w 3"]

    @classmethod
    def of(
        cls, lab: UInt8[np.ndarray, "h w 3"], figure: Bool[np.ndarray, "h w"], height: float
    ) -> "ClickedFigure":
        """The figure in a Lab picture; `height` of the player in its pixels."""
        depth = cv2.distanceTransform(figure.astype(np.uint8), cv2.DIST_L2, 3)
        around = np.ones((2 * max(1, round(SAME_PLACE * height)) + 1,) * 2, np.uint8)
        inside = (depth > EDGE)[..., None]
        low = cv2.erode(np.where(inside, lab, np.uint8(255)), around)
        high = cv2.dilate(np.where(inside, lab, np.uint8(0)), around)
        return cls(depth > CORE * height, low.astype(np.int16), high.astype(np.int16))

    def stays(self, lab: UInt8[np.ndarray, "h w 3"]) -> Bool[np.ndarray, "h w"]:
        """Where a picture has the same colours: there the player still is."""
        values = lab.astype(np.int16)
        same = (values >= self.low - SAME_COLOR) & (values <= self.high + SAME_COLOR)
        there = (same.all(axis=2) & self.core).astype(np.uint8)
        return cv2.morphologyEx(there, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) > 0


@dataclass(frozen=True, eq=False)
class PlayerCutter:
    """Cuts the player out of single pictures by what was learnt in the clicked one."""

    pose: ClickedPose
    width: int
    """Of the pictures that are cut out, px."""
    halves: tuple[_Half, ...]
    """Above and below the root; they overlap."""
    clicked: ClickedFigure | None = None
    """The player as he was cut out of the clicked picture."""

    def __call__(
        self, picture: UInt8[np.ndarray, "h w 3"], wanted: Bool[np.ndarray, "h w"] | None = None
    ) -> Bool[np.ndarray, "h w"]:
        """The player in a picture; in and around the `wanted` pixels alone where they are told."""
        small = reduce_picture(picture, self.width)
        mask = np.zeros(small.shape[:2], np.uint8)
        x0, y0, x1, y1 = self._box(None if wanted is None else _reduce_mask(wanted, mask.shape))
        rim = GRABCUT_RIM
        trimap = np.full(mask.shape, cv2.GC_BGD, np.uint8)
        trimap[y0:y1, x0:x1] = cv2.GC_PR_FGD
        if self.clicked is not None:
            trimap[self.clicked.stays(to_lab(small))] = cv2.GC_FGD
        for half in self.halves:
            rows = slice(max(half.rows.start, y0 - rim, 0), min(half.rows.stop, y1 + rim))
            part = rows, slice(max(0, x0 - rim), x1 + rim)
            if rows.stop - rows.start < MIN_ROWS:
                continue
            labels, cropped = (np.ascontiguousarray(a[part]) for a in (trimap, small))
            scene, player = (m.copy() for m in half.models)
            cv2.grabCut(cropped, labels, NO_FRAME, scene, player, 1, cv2.GC_EVAL_FREEZE_MODEL)
            mask[part] |= labels & 1  # GC_FGD or GC_PR_FGD
        return cv2.resize(mask, picture.shape[1::-1], interpolation=cv2.INTER_NEAREST) > 0

    def _box(self, wanted: Bool[np.ndarray, "h w"] | None) -> tuple[int, int, int, int]:
        """Left, top, right and bottom of what is cut out."""
        shrink = self.width / self.pose.size[0]
        x0, y0, x1, y1 = find_reach(self.pose, shrink)
        if wanted is None:
            return x0, y0, x1, y1
        rows, columns = (np.flatnonzero(wanted[y0:y1, x0:x1].any(axis=k)) for k in (1, 0))
        if not len(rows):
            return x0, y0, x0, y0
        room = round(AROUND_UNKNOWN * self.pose.height * shrink)
        return (
            max(x0, x0 + int(columns[0]) - room), max(y0, y0 + int(rows[0]) - room),
            min(x1, x0 + int(columns[-1]) + 1 + room), min(y1, y0 + int(rows[-1]) + 1 + room),
        )  # fmt: skip


def learn_cutter(picture: UInt8[np.ndarray, "h w 3"], pose: ClickedPose) -> PlayerCutter:
    """Colours of the player and the scene in the clicked picture."""
    shrink = picture.shape[1] / pose.size[0]
    width = max(16, round(pose.size[0] * min(shrink, CUT_HEIGHT / pose.height)))
    small = reduce_picture(picture, width)
    trimap = _seed(small.shape[:2], pose)
    shrink = width / pose.size[0]
    root, overlap = (round(v * shrink) for v in (pose.place("root")[1], OVERLAP * pose.height))
    middle = int(np.clip(root, MIN_ROWS, len(small) - MIN_ROWS))
    both = slice(0, middle + overlap), slice(max(0, middle - overlap), len(small))
    # Half a picture is soon told apart from half a figure, of whatever scene: the whole is not.
    best = PlayerCutter(pose, width, (_learn_half(small, trimap, slice(0, len(small))),))
    figure = best(small)
    _check_player(figure, pose)
    if _covers(figure, trimap) <= LEAST_COVERED:
        learn = partial(_learn_half, small, trimap)
        halves = PlayerCutter(pose, width, tuple(side_by_side(learn, both)))
        other = halves(small)
        if _covers(other, trimap) > _covers(figure, trimap):
            best, figure = halves, other
    return replace(best, clicked=ClickedFigure.of(to_lab(small), figure, pose.height * shrink))


def _reduce_mask(mask: Bool[np.ndarray, "h w"], shape: tuple[int, ...]) -> Bool[np.ndarray, "y x"]:
    """A mask in fewer pixels, of which none is lost."""
    size = (shape[1], shape[0])
    return cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0


def _covers(mask: Bool[np.ndarray, "h w"], trimap: UInt8[np.ndarray, "h w"]) -> float:
    """Share of the lines between the clicked joints that was cut out."""
    return float(mask[trimap == cv2.GC_FGD].mean())


def _learn_half(
    picture: UInt8[np.ndarray, "h w 3"], trimap: UInt8[np.ndarray, "h w"], rows: slice
) -> _Half:
    """Colours of the player and the scene in some rows."""
    scene, player = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.setRNGSeed(0)  # its clusters begin at random; the same clicks give the same player
    part, labels = picture[rows].copy(), trimap[rows].copy()
    cv2.grabCut(part, labels, NO_FRAME, scene, player, 5, cv2.GC_INIT_WITH_MASK)
    return _Half(rows, (scene, player))


def _seed(shape: tuple[int, int], pose: ClickedPose) -> UInt8[np.ndarray, "h w"]:
    """GrabCut's beginning: lines through the body, what is around it, and the scene."""
    shrink = shape[1] / pose.size[0]
    trimap = np.full(shape, cv2.GC_BGD, np.uint8)
    x0, y0, x1, y1 = find_reach(pose, shrink)
    trimap[y0:y1, x0:x1] = cv2.GC_PR_BGD
    for width, label in ((LIKELY_WIDTH, cv2.GC_PR_FGD), (SURE_WIDTH, cv2.GC_FGD)):
        thick = max(1, round(width * pose.height * shrink))
        for names in SEED_LINES:
            line = [pose.place(n) for n in names if pose.has(n)]
            corners = np.round(np.array(line) * shrink).astype(np.int32)
            cv2.polylines(trimap, [corners], False, label, thick)
    return trimap


def find_reach(pose: ClickedPose, shrink: float) -> tuple[int, int, int, int]:
    """Left, top, right and bottom of where trunk, head and legs may come during the swing."""
    places = pose.joints.places
    low = places.min(axis=0) - pose.height * np.array([REACH_ASIDE, REACH_ABOVE])
    high = places.max(axis=0) + pose.height * np.array([REACH_ASIDE, REACH_BELOW])
    (x0, y0), (x1, y1) = np.maximum(low * shrink, 0).astype(int), (high * shrink).astype(int)
    return int(x0), int(y0), int(x1), int(y1)


def _check_player(mask: Bool[np.ndarray, "h w"], pose: ClickedPose) -> None:
    """What has the colours of the clicked figure must be as large as one, not the scene."""
    height = pose.height * mask.shape[1] / pose.size[0]
    area = float(mask.sum() / height**2)
    if not SMALLEST_PLAYER < area < LARGEST_PLAYER:
        raise KeyreconError(
            f"Around the clicks of frame {pose.frame} no player stands out from the scene; "
            "check that the clicks lie on the player."
        )
