"""Marked joints followed by optical flow, from the mark before and from the mark after.

Between two marks near in time, each joint is followed forwards from the first and backwards from
the second by pyramidal Lucas-Kanade (Bouguet, Intel 2001). The two ways know nothing of one
another: where they meet, and the place looks like one of the marks, the joint is there, whatever
colours and edges say. Where they part, limbs have turned or hidden one another, and flow says
nothing. Before the first mark, after the last, and where marks are far apart there is one way only:
then every step must lead back to where it came from (Kalal, Mikolajczyk and Matas, ICPR 2010), and
the place must look like the mark all the more.
"""

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

from keyrecon.io.video import Video
from keyrecon.numerics.picture_points import track_there_and_back
from keyrecon.progress import Progress, silent
from keyrecon.records import Annotations, FlowTracks


@dataclass(frozen=True)
class FlowOptions:
    """How marked joints are followed."""

    player: float = 240.0
    """Height of the player in the pictures, px; larger follows thin limbs better and is slower."""
    window: float = 0.1
    """Side of the window that is matched, player heights: a forearm's length, two wrists."""
    longest: float = 3.0
    """Marks farther apart than this are not joined, seconds."""
    gap: float = 0.03
    """Distance of the two ways at which they begin to disagree, player heights: two eyes mark the
    same joint .016 apart in the median, .042 in the worst tenth."""
    likeness: float = 0.5
    """Correlation with the better of both marks' patches at which a place is half believed."""
    lone_likeness: float = 0.7
    """The same with the only mark's, where there is one way only."""

    def side(self, height: float) -> int:
        """Side of the window for a player of some px, odd."""
        return max(7, 2 * round(self.window * height / 2) + 1)


def track_marked_joints(
    video: Video,
    marks: Annotations,
    options: FlowOptions = FlowOptions(),
    progress: Progress = silent,
) -> FlowTracks:
    """Joints between marks, and how sure they are; NaN and 0 where flow says nothing."""
    follower = _Follower.start(video, marks, options)
    last = np.full(len(marks.skeleton.names), -1)
    pictures = progress(video.frames(width=follower.width), "Following marks", len(video))
    for t, picture in enumerate(pictures):
        follower.remember(t, picture)
        if t in follower.row_of:
            marked = np.isfinite(marks.joints[follower.row_of[t], :, 0])
            for first in np.unique(last[marked]).tolist():
                follower.close(first, t, np.flatnonzero(marked & (last == first)))
            last[marked] = t
        age = np.where(last >= 0, t - last, 0)
        ending = (age == follower.longest) | ((t == len(video) - 1) & (age > 0))
        ending &= age <= follower.longest
        for first in np.unique(last[ending]).tolist():
            group = np.flatnonzero(ending & (last == first))
            follower.follow_on(first, range(first, t + 1), group)
    return FlowTracks(follower.joints, follower.confidence)


@dataclass(frozen=True, eq=False)
class _Follower:
    """The last pictures, the marks in their pixels, and what was followed so far."""

    marks: Annotations
    options: FlowOptions
    width: int
    """Of the pictures, px."""
    shrink: float
    """Their pixels per pixel of the video."""
    height: float
    """Of the player in them, px."""
    longest: int
    """Frames that flow is followed over."""
    row_of: dict[int, int]
    """Row of each marked frame."""
    joints: Float[np.ndarray, "T J 2"]
    confidence: Float[np.ndarray, "T J"]
    pictures: dict[int, UInt8[np.ndarray, "h w"]]

    @classmethod
    def start(cls, video: Video, marks: Annotations, options: FlowOptions) -> "_Follower":
        height, shape = _marked_height(marks), (len(video), len(marks.skeleton.names))
        width = min(video.width, max(64, round(video.width * options.player / height)))
        shrink = width / video.width
        return cls(
            marks=marks,
            options=options,
            width=width,
            shrink=shrink,
            height=height * shrink,
            longest=round(options.longest * video.fps),
            row_of={int(frame): row for row, frame in enumerate(marks.frames)},
            joints=np.full((*shape, 2), np.nan),
            confidence=np.zeros(shape),
            pictures={},
        )

    def remember(self, t: int, picture: UInt8[np.ndarray, "h w 3"]) -> None:
        """Keep a picture for as long as marks are followed."""
        self.pictures[t] = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
        self.pictures.pop(t - self.longest - 1, None)

    def close(self, first: int, t: int, group: Int[np.ndarray, "g"]) -> None:
        """Joints marked in frame t, and before in frame `first` (-1: never)."""
        if first < 0 or t - first > self.longest:
            earliest = max(0, t - self.longest, first + self.longest + 1 if first >= 0 else 0)
            self.follow_on(t, range(t, earliest - 1, -1), group)
        elif t - first > 1:
            start, stop = (self._marks(frame, group) for frame in (first, t))
            between = [self.pictures[u] for u in range(first, t + 1)]
            way = _join_ways(between, start, stop, self.height, self.options)
            self._note(range(first, t), group, way.without_last())

    def follow_on(self, first: int, frames: range, group: Int[np.ndarray, "g"]) -> None:
        """One way from the marks of frame `first`, the first of `frames`."""
        cut = [self.pictures[u] for u in frames]
        way = _follow_one_way(cut, self._marks(first, group), self.height, self.options)
        self._note(frames, group, way)

    def _marks(self, frame: int, group: Int[np.ndarray, "g"]) -> Float[np.ndarray, "g 2"]:
        return self.shrink * self.marks.joints[self.row_of[frame], group]

    def _note(self, frames: range, group: Int[np.ndarray, "g"], way: "_Way") -> None:
        """Take over what is surer than what was known; the first frame is marked."""
        at = np.ix_(np.array(frames[1:], dtype=np.int64), group)
        better = way.confidence[1:] > self.confidence[at]
        self.joints[at] = np.where(better[..., None], way.places[1:] / self.shrink, self.joints[at])
        self.confidence[at] = np.where(better, way.confidence[1:], self.confidence[at])


@dataclass(frozen=True, eq=False)
class _Way:
    """Points in a row of pictures, the first of which is marked."""

    places: Float[np.ndarray, "n g 2"]
    confidence: Float[np.ndarray, "n g"]

    def without_last(self) -> "_Way":
        """Without the last picture, which is marked too."""
        return _Way(self.places[:-1], self.confidence[:-1])


def _marked_height(marks: Annotations) -> float:
    """Size of the player, px: the upper fifth of the marked extents, as half bodies show half."""
    marked = marks.joints[np.isfinite(marks.joints[..., 1]).any(axis=1), :, 1]
    return float(np.percentile(np.nanmax(marked, axis=1) - np.nanmin(marked, axis=1), 80))


def _join_ways(
    pictures: list[UInt8[np.ndarray, "h w"]],
    first: Float[np.ndarray, "g 2"],
    last: Float[np.ndarray, "g 2"],
    height: float,
    options: FlowOptions,
) -> _Way:
    """Places from marks in the first and in the last picture; sure where both ways meet."""
    side = options.side(height)
    ahead, _ = _follow(pictures, first, side)
    back = _follow(pictures[::-1], last, side)[0][::-1]
    share = np.linspace(0, 1, len(pictures))[:, None]
    apart = np.linalg.norm(ahead - back, axis=-1) / height
    places = (1 - share)[..., None] * ahead + share[..., None] * back
    ends = [_patches(pictures[0], first, side), _patches(pictures[-1], last, side)]
    alike = np.max([_likeness(pictures, places, end, side) for end in ends], axis=0)
    believed = _ramp(alike, options.likeness)
    return _Way(places, np.exp(-0.5 * (apart / options.gap) ** 2) * believed)


def _follow_one_way(
    pictures: list[UInt8[np.ndarray, "h w"]],
    start: Float[np.ndarray, "g 2"],
    height: float,
    options: FlowOptions,
) -> _Way:
    """Places from marks in the first picture alone; sure while every step leads back."""
    side = options.side(height)
    places, returned = _follow(pictures, start, side)
    apart = np.cumsum(returned, axis=0) / height
    alike = _likeness(pictures, places, _patches(pictures[0], start, side), side)
    believed = np.minimum.accumulate(_ramp(alike, options.lone_likeness), axis=0)
    return _Way(places, np.exp(-0.5 * (apart / options.gap) ** 2) * believed)


def _follow(
    pictures: list[UInt8[np.ndarray, "h w"]], start: Float[np.ndarray, "g 2"], side: int
) -> tuple[Float[np.ndarray, "n g 2"], Float[np.ndarray, "n g"]]:
    """Points followed from picture to picture, and how far each step back ends from its start."""
    places, returned = [start], [np.zeros(len(start))]
    for before, after in pairwise(pictures):
        here = places[-1].astype(np.float32)[:, None]
        there, off, _ = track_there_and_back(before, after, here, side)
        places.append(there[:, 0].astype(np.float64))
        returned.append(off.astype(np.float64))
    return np.stack(places), np.stack(returned)


def _ramp(value: Float[np.ndarray, "*n"], half: float) -> Float[np.ndarray, "*n"]:
    """0-1, a half at `half`, 1 halfway from there to 1."""
    return np.clip(0.5 + (value - half) / (1 - half), 0, 1)


def _likeness(
    pictures: list[UInt8[np.ndarray, "h w"]],
    places: Float[np.ndarray, "n g 2"],
    patches: list[Float[np.ndarray, "s s"]],
    side: int,
) -> Float[np.ndarray, "n g"]:
    """Correlation of the pictures around the places with one patch for each point."""
    return np.array(
        [
            [
                _correlation(own, patch)
                for own, patch in zip(_patches(picture, spots, side), patches, strict=True)
            ]
            for picture, spots in zip(pictures, places, strict=True)
        ]
    )


def _patches(
    picture: UInt8[np.ndarray, "h w"], places: Float[np.ndarray, "g 2"], side: int
) -> list[Float[np.ndarray, "s s"]]:
    return [_patch(picture, place, side) for place in places]


def _patch(
    picture: UInt8[np.ndarray, "h w"], place: Float[np.ndarray, "2"], side: int
) -> Float[np.ndarray, "s s"]:
    x, y = (float(np.clip(v, -1e4, 1e4)) for v in place)
    cut = cv2.getRectSubPix(picture, (side, side), (x, y)).astype(np.float32)
    return cut - cut.mean()


def _correlation(one: Float[np.ndarray, "s s"], other: Float[np.ndarray, "s s"]) -> float:
    """Normalised correlation of two patches without their means."""
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return float((one * other).sum()) / size if size > 0 else 0.0
