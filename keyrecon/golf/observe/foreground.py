"""The player and the club against the scene of a camera that stands still.

A golfer hardly leaves the spot, so the temporal median alone would take the legs for scenery. In
a few frames, first of all the clicked one, the player is therefore cut out first by GrabCut
(Rother, Kolmogorov and Blake, SIGGRAPH 2004): the lines between the clicked joints seed the
player, everything farther away than an arm the scene, and the colours learnt there serve all other
frames unchanged, since colours that adapt drift into the scene. The background model is the
median of what these frames show outside of the player. Against it every frame gives the
probability that a pixel is no scenery (Section 4.1 of the CVPR 2005 paper begins with such masks);
where the player hardly ever leaves, GrabCut decides in every frame anew.

Arms and the club move too fast to be in any background, whether GrabCut cut them out or not.
"""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from keyrecon.errors import KeyreconError
from keyrecon.golf.clicks import ClickedPose
from keyrecon.io.frame_reader import read_grey, read_small, reduce_picture, side_by_side
from keyrecon.io.video import Video
from keyrecon.numerics.picture_points import sample_picture
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within
from keyrecon.records import Background, CameraPath
from keyrecon.segmentation.background_model import ForegroundModel, median_background
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
LIMB_WIDTH, HAND_LENGTH = 0.032, 0.03
"""A forearm is thicker, and a hand reaches no farther from it, player heights."""
NO_FRAME = (0, 0, 0, 0)
"""GrabCut reads its rectangle only where there is no mask."""
LEAST_COVERED = 0.8
"""Share of the lines between clicked joints that the colours of the whole picture cut out, at
least: else halves are learnt apart. Of eight swings six have .92 and more, those with dark clothes
before something dark .65 and .68. With halves always, joints of a rendered swing were 4 mm worse;
never, .80 instead of .94 of those of a player in black before trees were in place."""
OVERLAP = 0.04
"""By how much the upper and the lower half overlap, player heights."""
MIN_ROWS = 4
"""Rows of a half, px."""
GRABCUT_RIM = 2
"""Scenery around the reach that GrabCut is given, px."""
ISLAND_GAP = 0.06
"""What is farther from the player than half of this does not belong to it, player heights."""
ISLAND_SHARE, ISLAND_REACH = 0.1, 0.35
"""What is as large as this share of the player, and no farther than this (player heights), belongs
to it nevertheless: of clothes with the scene's colours only head and arms may be left. What reaches
below the knees stands on its own feet."""
IN_REACH, OUT_OF_REACH, BELOW_KNEES, STANCE = 0, 1, 2, 3
"""Places of a picture as the clicks tell them: where the player may come, where he may not, where
he comes with his legs alone, and where he stands. Of two real swings with people drawn beside the
player, masks with a fifth and a sixth of others kept none of them in most frames; 27 masks of other
variants stayed as they were, but for a caption that was one's largest part."""
SAFETY_RIM = 0.012
"""Width of the rim around the player that belongs to nobody, player heights."""
SMALLEST_PLAYER, LARGEST_PLAYER = 0.01, 0.4
"""Area of the player in squared heights: people fill .16 to .2, less or more is no player."""
LEAST_FREE = 0.25
"""Share of the sampled frames in which a place must be free to count as known: GrabCut errs in
some. Chosen on rendered swings, as all that is not said to be measured; see benchmarks/golf.py."""
PIXEL_NOISE = 18
"""Change of a pixel that is more than noise, grey levels."""
CHANGE_FLOOR = 1e-3
"""Share of changed pixels that every frame counts for at least."""
MASK_BLUR = 0.6
"""Standard deviation that video noise is smoothed with, px of the mask."""


@dataclass(frozen=True)
class ForegroundOptions:
    """How the player is separated from the scene."""

    height: Annotated[float, within(40, 2000)] = 300.0
    """Height of the player in the masks, px; the club is a hundredth of it wide."""
    cut: Annotated[int, within(2, 1000)] = 20
    """Frames in which the player is cut out to learn the scene; fewer where little happens."""
    sure: Annotated[float, within(0.1, 60)] = 3.0
    """A pixel this many deviations off the scene is as likely the player as not."""


@dataclass(frozen=True, eq=False)
class FrameForeground:
    """What is no scenery in one frame, reduced."""

    frame: int
    likely: UInt8[np.ndarray, "h w"]
    """Probability in 1/255 that a pixel is player or club."""
    known: Bool[np.ndarray, "h w"]
    """Where the scene was observed; elsewhere colours alone separate the player from it."""
    shrink: float
    """Pixels of these pictures per pixel of the video."""
    height: float
    """The player from the head to the ankles, px of the video."""
    places: UInt8[np.ndarray, "h w"]
    """IN_REACH, OUT_OF_REACH, BELOW_KNEES or STANCE."""

    def to_mask(self, points: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
        """Points of the video in pixels of the mask."""
        return points * self.shrink + (self.shrink - 1) / 2

    def to_video(self, points: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
        """Points of the mask in pixels of the video."""
        return (points - (self.shrink - 1) / 2) / self.shrink

    def sample(self, points: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n"]:
        """Probability at points given in pixels of the video; 0 outside the picture."""
        if not points.size:
            return np.zeros(points.shape[:-1])
        flat = self.to_mask(points.reshape(-1, 2))
        read = sample_picture(self.likely, flat[:, None])
        return (read.ravel() / 255.0).reshape(points.shape[:-1])

    def mask(self) -> UInt8[np.ndarray, "h w"]:
        """1 where a pixel is rather player or club than scenery."""
        return (self.likely > 127).astype(np.uint8)

    def body(self) -> Bool[np.ndarray, "h w"]:
        """The player without what is thinner than a limb: without the club.

        Hands, feet and what else is thin but short comes back with the limb it hangs on.
        """
        mask = self.mask()
        limbs = cv2.morphologyEx(mask, cv2.MORPH_OPEN, self._disk(LIMB_WIDTH))
        return cv2.dilate(limbs, self._disk(2 * HAND_LENGTH)) & mask > 0

    def player(self) -> Bool[np.ndarray, "h w"]:
        """The body that stands where the player does, without what lies apart.

        Balls, the head of the club and people beside him are left out.
        """
        body = (self.body() & (self.places != OUT_OF_REACH)).astype(np.uint8)
        _, labels = cv2.connectedComponents(cv2.dilate(body, self._disk(ISLAND_GAP)))
        counts = np.bincount(labels[body > 0], minlength=2)
        standing = np.bincount(labels[(body > 0) & (self.places == STANCE)], minlength=len(counts))
        component = standing.argmax() if standing.any() else counts.argmax()
        player = (body > 0) & (labels == component)
        large = np.flatnonzero(counts > ISLAND_SHARE * counts[component])
        if len(large) < 2:
            return player
        away = cv2.distanceTransform((~player).astype(np.uint8), cv2.DIST_L2, 3)
        near = ISLAND_REACH * self.height * self.shrink
        feet = np.bincount(labels[(body > 0) & (self.places == BELOW_KNEES)], minlength=len(counts))
        parts = [
            k for k in large
            if k == component or standing[k]
            or (not feet[k] and away[(body > 0) & (labels == k)].min() < near)
        ]  # fmt: skip
        return (body > 0) & np.isin(labels, parts)

    def _disk(self, size: float) -> UInt8[np.ndarray, "n n"]:
        """A disk of a diameter in player heights."""
        pixels = max(3, round(size * self.height * self.shrink)) | 1
        return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (pixels, pixels))


@dataclass(frozen=True, eq=False)
class Foreground:
    """What is no scenery in all frames; fields as those of one frame."""

    likely: UInt8[np.ndarray, "T h w"]
    known: Bool[np.ndarray, "h w"]
    shrink: float
    height: float
    places: UInt8[np.ndarray, "h w"]

    def frame(self, number: int) -> FrameForeground:
        """That of one frame."""
        return FrameForeground(
            number, self.likely[number], self.known, self.shrink, self.height, self.places
        )


@dataclass(frozen=True, eq=False)
class _Half:
    """Rows of a picture with colours of their own: black trousers on grass stand out, though there
    are black trees higher up."""

    rows: slice
    models: tuple[np.ndarray, np.ndarray]
    """GrabCut's colours of scene and player."""


@dataclass(frozen=True, eq=False)
class _Cutter:
    """Cuts the player out of single pictures by what was learnt in the clicked one."""

    pose: ClickedPose
    width: int
    """Of the pictures that are cut out, px."""
    halves: tuple[_Half, ...]
    """Above and below the root; they overlap."""

    def __call__(self, picture: UInt8[np.ndarray, "h w 3"]) -> Bool[np.ndarray, "h w"]:
        small = reduce_picture(picture, self.width)
        mask = np.zeros(small.shape[:2], np.uint8)
        x0, y0, x1, y1 = _reach(self.pose, self.width / self.pose.size[0])
        rim = GRABCUT_RIM
        trimap = np.full(mask.shape, cv2.GC_BGD, np.uint8)
        trimap[y0:y1, x0:x1] = cv2.GC_PR_FGD
        for half in self.halves:
            rows = slice(max(half.rows.start, y0 - rim, 0), min(half.rows.stop, y1 + rim))
            part = rows, slice(max(0, x0 - rim), x1 + rim)
            if rows.stop - rows.start < MIN_ROWS:
                continue
            labels, cropped = (np.ascontiguousarray(a[part]) for a in (trimap, small))
            scene, player = (m.copy() for m in half.models)
            cv2.grabCut(cropped, labels, NO_FRAME, scene, player, 1, cv2.GC_EVAL_FREEZE_MODEL)
            mask[part] |= labels == cv2.GC_PR_FGD
        return cv2.resize(mask, picture.shape[1::-1], interpolation=cv2.INTER_NEAREST) > 0


def separate_player(
    video: Video,
    pose: ClickedPose,
    options: ForegroundOptions = ForegroundOptions(),
    progress: Progress = silent,
) -> Foreground:
    """Probability masks of all frames; the camera must stand still.

    Raises KeyreconError where the clicks do not lie on anything that differs from the scene.
    """
    width = max(16, round(video.width * min(1.0, options.height / pose.height)))
    cutter = _learn_cutter(reduce_picture(video.frame(pose.frame), width), pose)
    background = _learn_background(video, cutter, width, options, progress)
    scene = ForegroundModel(background, _still(len(video)), options.sure)
    compare = partial(_likely, scene, cutter)
    pictures = progress(read_small(video, width), "Separating the player", len(video))
    likely = np.stack(list(side_by_side(compare, pictures)))
    places = _places(likely.shape[1:], pose)
    return Foreground(likely, background.known, width / video.width, pose.height, places)


def _likely(
    scene: ForegroundModel, cutter: _Cutter, picture: UInt8[np.ndarray, "h w 3"]
) -> UInt8[np.ndarray, "h w"]:
    to_picture = np.linalg.inv(scene.background.from_reference)
    likely = scene.foreground(to_lab(picture), 0, to_picture)
    # A scene is compared with the pixels around too: next to the unknown it is unknown as well.
    unknown = cv2.dilate((~scene.background.known).astype(np.uint8), np.ones((3, 3))) > 0
    likely[unknown] = cutter(picture)[unknown]
    return (255 * cv2.GaussianBlur(likely, (0, 0), MASK_BLUR)).astype(np.uint8)


def _still(count: int) -> CameraPath:
    return CameraPath(np.tile(np.eye(3), (count, 1, 1)), np.ones(count))


def _learn_background(
    video: Video, cutter: _Cutter, width: int, options: ForegroundOptions, progress: Progress
) -> Background:
    """Median of the sampled frames outside of the player."""
    numbers = _eventful_frames(video, cutter, options.cut)
    small = read_small(video, width, set(numbers.tolist()))
    pictures = list(progress(small, "Reading the scene", len(numbers)))
    height = cutter.pose.height * width / video.width
    rim = np.ones((2 * max(1, round(SAFETY_RIM * height)) + 1,) * 2)
    free = [cv2.dilate(m.astype(np.uint8), rim) == 0 for m in side_by_side(cutter, pictures)]
    return median_background(
        [to_lab(p) for p in pictures], free, _still(len(numbers)).to_reference,
        width / video.width, min_share=LEAST_FREE,
    )  # fmt: skip


def _eventful_frames(video: Video, cutter: _Cutter, count: int) -> Int[np.ndarray, "n"]:
    """Frames at equal steps of change: few while the player stands still."""
    before, change = None, [0.0]
    for grey in read_grey(video, cutter.width):
        if before is not None:
            moved = cv2.absdiff(grey, before)
            change.append(CHANGE_FLOOR + float((moved > PIXEL_NOISE).mean()))
        before = grey
    passed = np.cumsum(change)
    return np.unique(np.searchsorted(passed, np.linspace(0, passed[-1], count)))


def _learn_cutter(picture: UInt8[np.ndarray, "h w 3"], pose: ClickedPose) -> _Cutter:
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
    whole = _Cutter(pose, width, (_learn_half(small, trimap, slice(0, len(small))),))
    _check_player(whole(small), pose)
    if _covers(whole(small), trimap) > LEAST_COVERED:
        return whole
    halves = _Cutter(pose, width, tuple(_learn_half(small, trimap, rows) for rows in both))
    return max((whole, halves), key=lambda cutter: _covers(cutter(small), trimap))


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
    x0, y0, x1, y1 = _reach(pose, shrink)
    trimap[y0:y1, x0:x1] = cv2.GC_PR_BGD
    for width, label in ((LIKELY_WIDTH, cv2.GC_PR_FGD), (SURE_WIDTH, cv2.GC_FGD)):
        thick = max(1, round(width * pose.height * shrink))
        for names in SEED_LINES:
            line = [pose.place(n) for n in names if pose.has(n)]
            corners = np.round(np.array(line) * shrink).astype(np.int32)
            cv2.polylines(trimap, [corners], False, label, thick)
    return trimap


def _reach(pose: ClickedPose, shrink: float) -> tuple[int, int, int, int]:
    """Left, top, right and bottom of where trunk, head and legs may come during the swing."""
    places = pose.joints.places
    low = places.min(axis=0) - pose.height * np.array([REACH_ASIDE, REACH_ABOVE])
    high = places.max(axis=0) + pose.height * np.array([REACH_ASIDE, REACH_BELOW])
    (x0, y0), (x1, y1) = np.maximum(low * shrink, 0).astype(int), (high * shrink).astype(int)
    return int(x0), int(y0), int(x1), int(y1)


def _places(shape: tuple[int, int], pose: ClickedPose) -> UInt8[np.ndarray, "h w"]:
    """Where the player stands and may come, of a picture of some shape."""
    shrink = shape[1] / pose.size[0]
    places = np.full(shape, OUT_OF_REACH, np.uint8)
    x0, y0, x1, y1 = _reach(pose, shrink)
    places[y0:y1, x0:x1] = IN_REACH
    knees = max(pose.place(f"{side}_knee")[1] for side in ("left", "right"))
    low = places[round(float(knees) * shrink) :]
    low[low == IN_REACH] = BELOW_KNEES
    thick = max(1, round(SURE_WIDTH * pose.height * shrink))
    for names in SEED_LINES[:3]:
        corners = np.round(np.array([pose.place(n) for n in names if pose.has(n)]) * shrink)
        cv2.polylines(places, [corners.astype(np.int32)], False, STANCE, thick)
    return places


def _check_player(mask: Bool[np.ndarray, "h w"], pose: ClickedPose) -> None:
    """What has the colours of the clicked figure must be as large as one, not the scene."""
    height = pose.height * mask.shape[1] / pose.size[0]
    area = float(mask.sum() / height**2)
    if not SMALLEST_PLAYER < area < LARGEST_PLAYER:
        raise KeyreconError(
            f"Around the clicks of frame {pose.frame} no player stands out from the scene; "
            "check that the clicks lie on the player."
        )
