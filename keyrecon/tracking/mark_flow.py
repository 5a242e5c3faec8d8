"""Marked joints followed by optical flow, from the mark before and from the mark after.

Between two marks near in time, each joint is followed forwards from the first and backwards from
the second by pyramidal Lucas-Kanade (Bouguet, Intel 2001). The two ways know nothing of one
another: where they meet, and the place looks like one of the marks, the joint is there, whatever
colours and edges say. Where they part, limbs have turned or hidden one another, and flow says
nothing. Before the first mark, after the last, and where marks are far apart there is one way only:
then every step must lead back to where it came from (Kalal, Mikolajczyk and Matas, ICPR 2010), and
the place must look like the mark all the more.

All joints of a frame are followed by one call, forwards while the video is read, and back as soon
as the later mark is reached, in the reduced grey pictures that are held until then.
"""

from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from keyrecon.io.frame_reader import read_grey
from keyrecon.io.video import Video
from keyrecon.numerics.picture_points import (
    sample_picture,
    track_points,
    track_there_and_back,
)
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within
from keyrecon.records import Annotations, FlowTracks

WHOLE_BODY = 0.8
"""Share of the joints that are marked where a whole body is. A quarter more or less, others with
it: at most 1.9 points, 2.4 mm on four clips."""

LEAST_HEIGHT = 12.0
"""px that marks must span from top to bottom: half of a body 24 px high, the smallest taken."""

HEAD_ENDS = ("neck", "head_top")
GROWN = 1.15
"""A head longer than the longest marked one by more than this factor has lost an end on the way:
as its drift counts what is too much. Two eyes mark an end .016 to .042 player heights apart, a
tenth to a fifth of a head. Evidence: of heads so followed in 18 real clips and eight rendered
sequences 276 had grown by 1.3 or more with a drift below .1, the true ones by .9 to 1.1 in the
median. Shorter ones are as often right as others: heads bend to the camera."""


@dataclass(frozen=True)
class FlowOptions:
    """How marked joints are followed."""

    player: Annotated[float, within(24, 1000)] = 160.0
    """Height of the player in the pictures, px; smaller is faster.

    Tried on a rendered and three real videos: 240 and 120 have as many joints right (within half a
    point).
    """
    window: Annotated[float, within(0.03, 1)] = 0.13
    """Side of the patch about a joint that is followed, player heights; larger holds longer and is
    less exact.

    A forearm's length, two wrists. Tried: with .1, of the joints that flow is sure of, 1-4 of a
    hundred more are wrong. A quarter more or less, others with it: at most 1.9 points, 2.4 mm on
    four clips.
    """
    longest: Annotated[float, within(0, 60)] = 3.0
    """Joints are followed between marks that lie no farther apart than this, seconds.

    A quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips.
    """
    gap: Annotated[float, within(0.002, 0.6)] = 0.03
    """Distance, in player heights, at which what is followed from the mark before and from the mark
    after begin to disagree.

    Two eyes mark the same joint .016 apart in the median, .042 in the worst tenth.
    """
    likeness: Annotated[float, within(0, 1)] = 0.5
    """How much a place must look like the better of both marks to be half believed, a correlation
    from 0 to 1.

    A quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips.
    """
    lone_likeness: Annotated[float, within(0, 1)] = 0.7
    """The same where there is a mark on one side only.

    A quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips.
    """

    def side(self, height: float) -> int:
        """Side of the window for a player of some px, odd."""
        return max(7, 2 * round(self.window * height / 2) + 1)


def track_marked_joints(
    video: Video,
    marks: Annotations,
    options: FlowOptions = FlowOptions(),
    progress: Progress = silent,
) -> FlowTracks:
    """Joints between marks, and how sure they are; NaN and 0 where flow says nothing.

    It says nothing where so little is marked that the player's size is not known.
    """
    if _marked_height(marks) < LEAST_HEIGHT:
        shape = (len(video), len(marks.skeleton.names))
        unknown = np.full((*shape, 2), np.nan)
        none, nothing = np.zeros(shape, dtype=bool), np.full(shape, np.nan)
        return FlowTracks(unknown, np.zeros(shape), none, nothing, nothing)
    follower = _Follower.start(video, marks, options)
    pictures = progress(read_grey(video, follower.width), "Following marks", len(video))
    for t, picture in enumerate(pictures):
        follower.advance(t, picture)
    return follower.tracks()


@dataclass(frozen=True, eq=False)
class _Schedule:
    """Which joint is marked when."""

    marked: Bool[np.ndarray, "T J"]
    last: Int[np.ndarray, "T J"]
    """Latest marked frame before each one; -1 where there is none."""
    next: Int[np.ndarray, "T J"]
    """The first at it or after it; T where there is none."""
    longest: int
    """Frames that a joint is followed over."""

    @classmethod
    def of(cls, marks: Annotations, n_frames: int, longest: int) -> "_Schedule":
        marked = np.zeros((n_frames, len(marks.skeleton.names)), dtype=bool)
        marked[marks.frames] = np.isfinite(marks.joints).all(axis=2)
        number = np.arange(n_frames)[:, None]
        upto = np.maximum.accumulate(np.where(marked, number, -1))
        last = np.concatenate([np.full((1, marked.shape[1]), -1), upto[:-1]])
        coming = np.where(marked, number, n_frames)
        return cls(marked, last, np.minimum.accumulate(coming[::-1])[::-1], longest)

    def joined(self, t: int | slice) -> Bool[np.ndarray, "*n J"]:
        """Joints that are followed in some frames both ways."""
        between = (self.last[t] >= 0) & (self.next[t] < len(self.last))
        return between & (self.next[t] - self.last[t] <= self.longest)

    def ahead(self, t: int) -> Bool[np.ndarray, "J"]:
        """Joints that are followed into frame t from a mark before it."""
        return (self.last[t] >= 0) & (t - self.last[t] <= self.longest) & ~self.marked[t]

    def back(self, t: int) -> Bool[np.ndarray, "J"]:
        """Joints that are followed into frame t from a mark after it."""
        free = self.joined(t) | (self.last[t] < 0) | (t - self.last[t] > self.longest)
        return free & (self.next[t] - t <= self.longest) & (self.next[t] < len(self.last))


@dataclass(frozen=True, eq=False)
class _Follower:
    """The last pictures, the marks in their pixels, and what was followed so far."""

    schedule: _Schedule
    options: FlowOptions
    width: int
    """Of the pictures, px."""
    shrink: float
    """Their pixels per pixel of the video."""
    height: float
    """Of the player in them, px."""
    head: tuple[int, ...]
    """Both ends of it among the joints; none where the skeleton has none."""
    longest: float
    """Length that a head may have, px; infinite where none is marked."""
    marks: Float[np.ndarray, "T J 2"]
    ahead: Float[np.ndarray, "T J 2"]
    """Places followed forwards, and the marks."""
    joints: Float[np.ndarray, "T J 2"]
    confidence: Float[np.ndarray, "T J"]
    drift: Float[np.ndarray, "T J"]
    likeness: Float[np.ndarray, "T J"]
    doubt: Float[np.ndarray, "J"]
    """Forwards: by how much the steps since the mark have not led back, player heights."""
    alike: Float[np.ndarray, "J"]
    """Forwards: least belief in the likeness with the mark so far."""
    patches: Float[np.ndarray, "J s s"]
    """Around the last mark."""
    pictures: dict[int, UInt8[np.ndarray, "h w"]]

    @classmethod
    def start(cls, video: Video, marks: Annotations, options: FlowOptions) -> "_Follower":
        tall = _marked_height(marks)
        width = min(video.width, max(64, round(video.width * options.player / tall)))
        shrink = width / video.width
        height, shape = tall * shrink, (len(video), len(marks.skeleton.names))
        places = np.full((*shape, 2), np.nan)
        places[marks.frames] = shrink * (marks.joints + 0.5) - 0.5
        side = options.side(height)
        names = marks.skeleton.names
        head = tuple(names.index(end) for end in HEAD_ENDS if end in names)
        return cls(
            schedule=_Schedule.of(marks, len(video), round(options.longest * video.fps)),
            options=options,
            width=width,
            shrink=shrink,
            height=height,
            head=head,
            longest=GROWN * _longest(places[:, head]),
            marks=places,
            ahead=places.copy(),
            joints=np.full((*shape, 2), np.nan),
            confidence=np.zeros(shape),
            drift=np.full(shape, np.nan),
            likeness=np.full(shape, np.nan),
            doubt=np.zeros(shape[1]),
            alike=np.ones(shape[1]),
            patches=np.zeros((shape[1], side, side)),
            pictures={},
        )

    def tracks(self) -> FlowTracks:
        """What was followed, in pixels of the video."""
        joints = (self.joints + 0.5) / self.shrink - 0.5
        joined = self.schedule.joined(np.s_[:])
        return FlowTracks(joints, self.confidence, joined, self.drift, self.likeness)

    def advance(self, t: int, picture: UInt8[np.ndarray, "h w"]) -> None:
        """Take the next picture: follow joints into it, and back from those marked in it."""
        self.pictures[t] = picture
        self.pictures.pop(t - self.schedule.longest - 1, None)
        going = np.flatnonzero(self.schedule.ahead(t))
        if len(going):
            self._step_ahead(t, going)
        marked = np.flatnonzero(self.schedule.marked[t])
        if len(marked):
            patches = self._patches(t, self.marks[t, marked])
            self._follow_back(t, marked, patches)
            self.doubt[marked], self.alike[marked], self.patches[marked] = 0, 1, patches

    def _step_ahead(self, t: int, going: Int[np.ndarray, "g"]) -> None:
        """Joints from the frame before; those with no mark to come are done with."""
        alone = ~self.schedule.joined(t)[going]
        places, returned = self._step(t - 1, t, self.ahead[t - 1, going], alone)
        self.ahead[t, going] = places
        self.doubt[going] += returned
        self.doubt[going] = np.maximum(self.doubt[going], self._slid(going, places))
        lone = going[alone]
        if len(lone):
            alike = _correlations(self._patches(t, places[alone]), self.patches[lone])
            self.alike[lone] = np.minimum(
                self.alike[lone], _ramp(alike, self.options.lone_likeness)
            )
            self.drift[t, lone], self.likeness[t, lone] = self.doubt[lone], alike
            self._note(t, lone, places[alone], self._agreement(self.doubt[lone]) * self.alike[lone])

    def _follow_back(
        self, marked_at: int, group: Int[np.ndarray, "g"], ends: Float[np.ndarray, "g s s"]
    ) -> None:
        """From marks in one frame to those before them, or as far as flow is followed."""
        places = self.marks[marked_at, group]
        doubt, least = np.zeros(len(group)), np.ones(len(group))
        for t in range(marked_at - 1, -1, -1):
            # joints that are marked in t end there
            kept = self.schedule.back(t)[group] & (self.schedule.next[t, group] == marked_at)
            if not kept.any():
                break
            group, ends, doubt, least = group[kept], ends[kept], doubt[kept], least[kept]
            joined = self.schedule.joined(t)[group]
            places, returned = self._step(t + 1, t, places[kept], ~joined)
            doubt = np.maximum(doubt + returned, self._slid(group, places))
            last = self.schedule.last[t, group]
            share = np.where(joined, (t - last) / (marked_at - last), 1.0)[:, None]
            ahead = np.where(joined[:, None], self.ahead[t, group], places)
            middle = (1 - share) * ahead + share * places
            parted = np.linalg.norm(ahead - places, axis=1) / self.height
            apart = np.where(joined, np.maximum(parted, self._slid(group, middle)), doubt)
            here = self._patches(t, middle)
            alike = _correlations(here, ends)
            either = np.maximum(alike, _correlations(here, self.patches[group]))
            least = np.minimum(least, _ramp(alike, self.options.lone_likeness))
            believed = np.where(joined, _ramp(either, self.options.likeness), least)
            self.drift[t, group], self.likeness[t, group] = apart, np.where(joined, either, alike)
            self._note(t, group, middle, self._agreement(apart) * believed)

    def _step(
        self, start: int, stop: int, places: Float[np.ndarray, "g 2"], alone: Bool[np.ndarray, "g"]
    ) -> tuple[Float[np.ndarray, "g 2"], Float[np.ndarray, "g"]]:
        """Points from one picture to its neighbour; how far from there the steps of those that are
        followed one way only lead back, player heights."""
        before, after = self.pictures[start], self.pictures[stop]
        side, returned = self.patches.shape[1], np.zeros(len(places))
        there = np.empty_like(places)
        here = places.astype(np.float32)[:, None]
        if alone.any():
            moved, off, _ = track_there_and_back(before, after, here[alone], side)
            there[alone], returned[alone] = moved[:, 0], off / self.height
        if not alone.all():
            there[~alone] = track_points(before, after, here[~alone], side)[0][:, 0]
        return there, returned

    def _slid(
        self, group: Int[np.ndarray, "g"], places: Float[np.ndarray, "g 2"]
    ) -> Float[np.ndarray, "g"]:
        """By how much a head is longer than it may be, player heights, at its ends; others 0."""
        slid = np.zeros(len(group))
        ends = np.flatnonzero(np.isin(group, self.head))
        if len(ends) == len(HEAD_ENDS):
            length = float(np.linalg.norm(places[ends[1]] - places[ends[0]]))
            slid[ends] = max(0.0, length - self.longest) / self.height
        return slid

    def _agreement(self, apart: Float[np.ndarray, "g"]) -> Float[np.ndarray, "g"]:
        """0-1, for two ways that end so many player heights apart."""
        return np.exp(-0.5 * (apart / self.options.gap) ** 2)

    def _note(
        self,
        t: int,
        group: Int[np.ndarray, "g"],
        places: Float[np.ndarray, "g 2"],
        confidence: Float[np.ndarray, "g"],
    ) -> None:
        self.joints[t, group], self.confidence[t, group] = places, confidence

    def _patches(self, t: int, places: Float[np.ndarray, "g 2"]) -> Float[np.ndarray, "g s s"]:
        """The picture around points, less its mean there, all by one call."""
        side = self.patches.shape[1]
        across = np.arange(side) - side // 2
        grid = np.stack(np.meshgrid(across, across), axis=-1) + np.clip(
            places[:, None, None], -1e4, 1e4
        )
        cut = sample_picture(self.pictures[t], grid.reshape(-1, side, 2), cv2.BORDER_REPLICATE)
        cut = cut.reshape(-1, side, side).astype(np.float64)
        return cut - cut.mean(axis=(1, 2), keepdims=True)


def _marked_height(marks: Annotations) -> float:
    """Size of the player, px: the upper fifth of the marked extents of whole bodies, or of both
    halves one above the other where no frame has a whole one."""
    known = np.isfinite(marks.joints).all(axis=2)
    whole = known.mean(axis=1) >= WHOLE_BODY
    if whole.any():
        return _extent(marks.joints[whole, :, 1])
    lower = marks.skeleton.is_lower
    return sum(_extent(marks.joints[:, half, 1]) for half in (lower, ~lower))


def _longest(ends: Float[np.ndarray, "n e 2"]) -> float:
    """Length of the longest part of which both ends are known, px; infinite where there is none."""
    if ends.shape[1] < len(HEAD_ENDS):
        return np.inf
    longest = np.fmax.reduce(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), initial=0.0)
    return float(longest) or np.inf


def _extent(y: Float[np.ndarray, "n j"]) -> float:
    """Upper fifth of the extents of some frames, 0 where nothing is marked."""
    y = y[np.isfinite(y).any(axis=1)]
    return float(np.percentile(np.nanmax(y, axis=1) - np.nanmin(y, axis=1), 80)) if len(y) else 0.0


def _ramp(value: Float[np.ndarray, "*n"], half: float) -> Float[np.ndarray, "*n"]:
    """0-1, a half at `half`, 1 halfway from there to 1."""
    return np.clip(0.5 + (value - half) / (1 - half), 0, 1)


def _correlations(
    some: Float[np.ndarray, "g s s"], others: Float[np.ndarray, "g s s"]
) -> Float[np.ndarray, "g"]:
    """Normalised correlations of patches without their means, pair by pair; 0 for even ones."""
    size = np.linalg.norm(some, axis=(1, 2)) * np.linalg.norm(others, axis=(1, 2))
    return (some * others).sum(axis=(1, 2)) / np.where(size > 0, size, np.inf)
