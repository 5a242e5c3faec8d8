"""Which frames of a video are fitted, and the one picture that they are all seen in.

A video is not always one picture per moment from one place. Slow motion and conversions between
frame rates show pictures twice: those are fitted once, since a player who rests on every second
frame would be another motion. High frame rates and slow motion show more than a swing needs. A cut
shows another scene: only the shot with the clicks is fitted. And a camera held by hand moves: its
frames are warped into the clicked one, where the scene then stands still.

Frames of the film are numbered from 0; `Film.file_frames` and `Film.film_index` convert between
them and the frames of the video file.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import gaussian_filter1d, percentile_filter

from keyrecon.io.frame_reader import read_grey
from keyrecon.io.steady_video import steady_video
from keyrecon.io.video import Video
from keyrecon.numerics.geometry import warp_points
from keyrecon.records import CameraPath
from keyrecon.segmentation.repeated_frames import COMPARED_WIDTH, find_repeats, picture_change

AROUND = 12
"""Frames on either side of a cut."""
OFTEN_REPEATED = 0.08
"""Share of repeated frames from which on they are a conversion of the frame rate, and pictures are
evenly spaced in the world; fewer are faults of a recording."""
CUT = 25.0
"""Mean change of a whole picture at a cut, grey levels, and how much more than around it."""
CUT_OUTSTANDS = 6.0
MOST_FPS = 130.0
"""Frames per second of the world beyond which every second one is fitted: hands move by 0.1 m."""
WIDEST_MARGIN = 0.4
"""Share of the picture by which the common picture may be wider than one frame."""
STILL = 0.002
"""Share of the picture's width by which a camera may move and count as standing still."""


@dataclass(frozen=True, eq=False)
class Film:
    """The T of a file's F frames that are fitted."""

    file_frames: Int[np.ndarray, "T"]
    """Their frames of the file."""
    time: Float[np.ndarray, "T"]
    """When they were taken, seconds of the world."""
    film_index: Float[np.ndarray, "F"]
    """Position of each frame of the file among these; a fraction where it is not one of them."""
    warps: Float[np.ndarray, "F 3 3"]
    """Homographies from every frame of the file to the common picture."""
    size: tuple[int, int]
    """Width and height of the common picture, px."""
    corner: Float[np.ndarray, "2"]
    """Where the first pixel of the clicked frame lies in the common picture, px."""
    still: bool
    """Whether the camera stood still: all warps are the identity then."""
    shot: tuple[int, int]
    """First and last frame of the file in the shot that was clicked."""
    repeated: float
    """Share of the file's frames that repeat the one before."""
    file_range: tuple[int, int]
    """First and last frame of the file that these frames show."""

    @property
    def shows(self) -> Bool[np.ndarray, "F"]:
        """Which frames of the file these frames show; all others come before or after."""
        frames = np.arange(len(self.film_index))
        return (frames >= self.file_range[0]) & (frames <= self.file_range[1])

    @property
    def fps(self) -> float:
        """Frames per second of the world."""
        return 1 / float(np.median(np.diff(self.time))) if len(self.time) > 1 else 25.0

    def open(self, video: Video) -> Video:
        """These frames of the file, as a camera that stands still sees them."""
        if self.is_whole(video) and np.array_equal(self.time, video.time):
            return video
        warps = None if self.still else self.warps[self.file_frames]
        return steady_video(video, self.file_frames, self.time, warps, self.size)

    def is_whole(self, video: Video) -> bool:
        """Whether these are all frames of the file, as they are."""
        return self.still and len(self.file_frames) == len(video)

    def keys_in_file(self, keys: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
        """Frames of the file for places among these frames; the middle of repeated ones."""
        pictures = np.arange(len(self.file_frames))
        first = np.searchsorted(self.film_index, pictures, side="left")
        last = np.searchsorted(self.film_index, pictures, side="right") - 1
        middles = (first + np.maximum(last, first)) / 2
        # The first and last frame stand for all before and after them, but are not among these.
        begin, end = self.file_range
        middles[0] = (begin + min(last[0], end)) / 2
        middles[-1] = (max(first[-1], begin) + end) / 2
        return np.interp(keys, pictures, middles)

    def frame_in_file(self, frame: int) -> int:
        """The frame of the file that is a frame of these."""
        return int(self.file_frames[frame])

    def take(self, chosen: Int[np.ndarray, "m"], slow_motion: float = 1.0) -> "Film":
        """Some of these frames, `slow_motion` times faster than was thought."""
        if len(chosen) == len(self.file_frames) and slow_motion == 1:
            return self
        begin, end = self.file_range
        if chosen[0] > 0:
            begin = int(self.file_frames[chosen[0]])
        step = int(chosen[1] - chosen[0]) if len(chosen) > 1 else 1
        if chosen[-1] + step < len(self.file_frames):
            end = int(self.file_frames[chosen[-1] + 1]) - 1
        return replace(
            self, file_frames=self.file_frames[chosen], time=self.time[chosen] / slow_motion,
            film_index=np.interp(self.film_index, chosen, np.arange(len(chosen))),
            file_range=(begin, end),
        )  # fmt: skip


def choose_frames(video: Video, camera: CameraPath, clicked: int) -> Film:
    """The frames that are fitted, in the picture of the clicked one."""
    greys = np.stack(list(read_grey(video, min(COMPARED_WIDTH, video.width)))).astype(np.int16)
    change = np.array([0.0] + [picture_change(a, b) for a, b in pairwise(greys)])
    whole = np.array([0.0] + [float(np.abs(a - b).mean()) for a, b in pairwise(greys)])
    first, last = _shot(whole, clicked)
    repeats = find_repeats(change)
    inside = np.arange(first, last + 1)
    kept = inside[~repeats[inside]]
    kept = np.unique(np.append(kept, first))
    picture = np.searchsorted(kept, inside, side="right") - 1  # the picture that each frame shows
    time = _times(video.time[inside], picture, float(repeats[inside].mean()))
    film_index = np.interp(np.arange(len(video)), inside, picture)
    steady = _steady(video, camera, clicked, inside)
    shot, repeated = (int(first), int(last)), float(repeats.mean())
    film = Film(
        kept, time, film_index, steady.warps, steady.size, steady.corner, steady.still, shot,
        repeated, shot,
    )  # fmt: skip
    return film.take(np.arange(0, len(kept), frame_step(film.fps)))


def _shot(whole: Float[np.ndarray, "F"], clicked: int) -> tuple[int, int]:
    """First and last frame without a cut around the clicked one."""
    usual = percentile_filter(whole, 50, size=2 * AROUND + 1, mode="nearest")
    cuts = np.flatnonzero((whole > CUT) & (whole > CUT_OUTSTANDS * usual))
    before, after = cuts[cuts <= clicked], cuts[cuts > clicked]
    first = int(before[-1]) if len(before) else 0
    return first, int(after[0]) - 1 if len(after) else len(whole) - 1


def _times(
    shown: Float[np.ndarray, "n"], picture: Int[np.ndarray, "n"], repeated: float
) -> Float[np.ndarray, "m"]:
    """When the pictures were taken, seconds."""
    _, firsts = np.unique(picture, return_index=True)
    if repeated < OFTEN_REPEATED:
        return shown[firsts]
    middles = np.array([shown[picture == k].mean() for k in range(len(firsts))])
    steps = gaussian_filter1d(np.diff(middles), 4.0, mode="nearest")
    return middles[0] + np.append(0.0, np.cumsum(steps))


def frame_step(fps: float) -> int:
    """Every how manieth picture is fitted of so many per second."""
    return max(1, int(fps // (MOST_FPS / 2))) if fps > MOST_FPS else 1


@dataclass(frozen=True, eq=False)
class _Steady:
    """How frames are warped into one picture."""

    warps: Float[np.ndarray, "F 3 3"]
    size: tuple[int, int]
    corner: Float[np.ndarray, "2"]
    still: bool


def _steady(
    video: Video, camera: CameraPath, clicked: int, inside: Int[np.ndarray, "n"]
) -> _Steady:
    """The frames warped into the clicked one, with room for what others see beside it."""
    size = np.array([video.width, video.height])
    to_clicked = np.linalg.inv(camera.to_reference[clicked]) @ camera.to_reference
    corners = np.array([(0.0, 0.0), (size[0] - 1, 0), (size[0] - 1, size[1] - 1), (0, size[1] - 1)])
    there = warp_points(to_clicked[inside][:, None], corners[None])
    if np.abs(there - corners).max() < STILL * video.width:
        unmoved = np.tile(np.eye(3), (len(video), 1, 1))
        return _Steady(unmoved, (video.width, video.height), np.zeros(2), True)
    most = WIDEST_MARGIN * size
    low = np.floor(np.clip(np.percentile(there.min(axis=1), 2, axis=0), -most, 0))
    high = np.ceil(np.clip(np.percentile(there.max(axis=1), 98, axis=0), size - 1, size - 1 + most))
    shift = np.array([[1, 0, -low[0]], [0, 1, -low[1]], [0, 0, 1]])
    width, height = (high - low + 1).astype(int).tolist()
    return _Steady(shift @ to_clicked, (width, height), -low, False)
