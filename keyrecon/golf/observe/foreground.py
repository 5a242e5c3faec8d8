"""The player and the club against the scene of a camera that stands still.

A golfer hardly leaves the spot, so the temporal median alone would take the legs for scenery. In
a few frames, first of all the clicked one, the player is therefore cut out first
(`player_cutter`). The background model is the median of what these frames show outside of the
player. What is as thick as a limb and has come where the clicked frame shows scenery is no scenery,
whatever its colours: a dark shirt before dark trees was taken for such in two of five real swings.
Against the background every frame gives the probability that a pixel is no scenery (Section 4.1 of
the CVPR 2005 paper begins with such masks); where the player hardly ever leaves, he is cut out in
every frame anew.

Arms and the club move too fast to be in any background, whether GrabCut cut them out or not.
"""

from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from keyrecon.golf.clicks import ClickedPose
from keyrecon.golf.observe.player_cutter import (
    SEED_LINES,
    SURE_WIDTH,
    PlayerCutter,
    find_reach,
    learn_cutter,
)
from keyrecon.io.frame_reader import read_grey, read_small, reduce_picture, side_by_side
from keyrecon.io.video import Video
from keyrecon.numerics.picture_points import sample_picture
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within
from keyrecon.records import Background, CameraPath
from keyrecon.segmentation.background_model import median_background
from keyrecon.segmentation.color_model import to_lab
from keyrecon.segmentation.foreground_model import ForegroundModel

LIMB_WIDTH, HAND_LENGTH = 0.032, 0.03
"""A forearm is thicker, and a hand reaches no farther from it, player heights."""
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
        return disk(size * self.height * self.shrink)


def disk(size: float) -> UInt8[np.ndarray, "n n"]:
    """A disk of a diameter in pixels, three at least."""
    pixels = max(3, round(size)) | 1
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
    clicked = reduce_picture(video.frame(pose.frame), width)
    cutter = learn_cutter(clicked, pose)
    background = _learn_background(video, clicked, cutter, options, progress)
    scene = ForegroundModel(replace(background, sure=options.sure), _still(len(video)))
    compare = partial(_likely, scene, cutter)
    pictures = progress(read_small(video, width), "Separating the player", len(video))
    likely = np.stack(list(side_by_side(compare, pictures)))
    places = _places(likely.shape[1:], pose)
    return Foreground(likely, background.known, width / video.width, pose.height, places)


def _likely(
    scene: ForegroundModel, cutter: PlayerCutter, picture: UInt8[np.ndarray, "h w 3"]
) -> UInt8[np.ndarray, "h w"]:
    to_picture = np.linalg.inv(scene.background.from_reference)
    likely = scene.foreground(to_lab(picture), 0, to_picture)
    # A scene is compared with the pixels around too: next to the unknown it is unknown as well.
    unknown = cv2.dilate((~scene.background.known).astype(np.uint8), np.ones((3, 3))) > 0
    likely[unknown] = cutter(picture, unknown)[unknown]
    return (255 * cv2.GaussianBlur(likely, (0, 0), MASK_BLUR)).astype(np.uint8)


def _still(count: int) -> CameraPath:
    return CameraPath(np.tile(np.eye(3), (count, 1, 1)), np.ones(count))


def _learn_background(
    video: Video,
    clicked: UInt8[np.ndarray, "h w 3"],
    cutter: PlayerCutter,
    options: ForegroundOptions,
    progress: Progress,
) -> Background:
    """Median of the sampled frames outside of the player; `clicked` is the clicked picture."""
    numbers, width = _eventful_frames(video, cutter, options.cut), clicked.shape[1]
    small = read_small(video, width, set(numbers.tolist()))
    pictures = list(progress(small, "Reading the scene", len(numbers)))
    height = cutter.pose.height * width / video.width
    rim = np.ones((2 * max(1, round(SAFETY_RIM * height)) + 1,) * 2)
    limb = disk(LIMB_WIDTH * height)
    scenery = cv2.dilate(cutter(clicked).astype(np.uint8), rim) == 0

    def find_free(picture: UInt8[np.ndarray, "h w 3"]) -> Bool[np.ndarray, "h w"]:
        player = cutter(picture)
        changed = scenery & (cv2.absdiff(picture, clicked).max(axis=2) > PIXEL_NOISE)
        either = (player | changed).astype(np.uint8)
        come = changed & (cv2.morphologyEx(either, cv2.MORPH_OPEN, limb) > 0)
        come &= has_outline(come & ~player, picture, clicked)
        free: Bool[np.ndarray, "h w"] = cv2.dilate((player | come).astype(np.uint8), rim) == 0
        return free

    free = list(side_by_side(find_free, pictures))
    return median_background(
        [to_lab(p) for p in pictures], free, _still(len(numbers)).to_reference,
        width / video.width, min_share=LEAST_FREE,
    )  # fmt: skip


def has_outline(
    differs: Bool[np.ndarray, "h w"],
    picture: UInt8[np.ndarray, "h w 3"],
    other: UInt8[np.ndarray, "h w 3"],
) -> Bool[np.ndarray, "h w"]:
    """Which parts of what differs between two pictures have their outline in the first.

    What is there has an outline; where it was, or will be, the scene goes on across it. An arm that
    GrabCut missed in the clicked picture would else make scenery of itself, and the grass that it
    uncovers a player: on a rendered swing PA-MPJPE was 52 instead of 39 mm.
    """
    _, parts = cv2.connectedComponents(differs.astype(np.uint8))
    rim = differs & (cv2.erode(differs.astype(np.uint8), np.ones((3, 3))) == 0)
    here, there = (
        np.bincount(parts[rim], _contrast(shown)[rim], parts.max() + 1)
        for shown in (picture, other)
    )
    return differs & (here >= there)[parts]


def _contrast(picture: UInt8[np.ndarray, "h w 3"]) -> Float[np.ndarray, "h w"]:
    """How much a picture changes from each pixel to the next, grey levels."""
    across, down = (cv2.Sobel(picture, cv2.CV_64F, x, 1 - x) for x in (1, 0))
    return np.hypot(across, down).max(axis=2)


def _eventful_frames(video: Video, cutter: PlayerCutter, count: int) -> Int[np.ndarray, "n"]:
    """Frames at equal steps of change: few while the player stands still."""
    before, change = None, [0.0]
    for grey in read_grey(video, cutter.width):
        if before is not None:
            moved = cv2.absdiff(grey, before)
            change.append(CHANGE_FLOOR + float((moved > PIXEL_NOISE).mean()))
        before = grey
    passed = np.cumsum(change)
    return np.unique(np.searchsorted(passed, np.linspace(0, passed[-1], count)))


def _places(shape: tuple[int, int], pose: ClickedPose) -> UInt8[np.ndarray, "h w"]:
    """Where the player stands and may come, of a picture of some shape."""
    shrink = shape[1] / pose.size[0]
    places = np.full(shape, OUT_OF_REACH, np.uint8)
    x0, y0, x1, y1 = find_reach(pose, shrink)
    places[y0:y1, x0:x1] = IN_REACH
    knees = max(pose.place(f"{side}_knee")[1] for side in ("left", "right"))
    low = places[round(float(knees) * shrink) :]
    low[low == IN_REACH] = BELOW_KNEES
    thick = max(1, round(SURE_WIDTH * pose.height * shrink))
    for names in SEED_LINES[:3]:
        corners = np.round(np.array([pose.place(n) for n in names if pose.has(n)]) * shrink)
        cv2.polylines(places, [corners.astype(np.int32)], False, STANCE, thick)
    return places
