"""What stages hand to one another: frozen, complete values.

Axis letters, the same everywhere: T frames, K keyframes, J joints, B bones, E edge elements,
C colours. Unknown numbers are NaN. Pixels and axes as in the package docstring.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from keyrecon.body import Skeleton
from keyrecon.io.video import Video

HalfName = Literal["upper", "lower"]
"""The two halves of the body, which have keyframes of their own (Section 4.3)."""


@dataclass(frozen=True)
class Pick:
    """One click of a person on something whose colour matters."""

    frame: int
    part: str
    """'head', 'foot', or the name of a region: shirt, shorts, skin, hair, ..."""
    x: float
    y: float


@dataclass(frozen=True, eq=False)
class CameraPath:
    """How the picture of the background moves: the identity everywhere for a static camera."""

    to_reference: Float[np.ndarray, "T 3 3"]
    """Homography from the pixels of frame t to those of the reference frame."""
    confidence: Float[np.ndarray, "T"]
    """Share of background features that agree with it, 0-1."""
    cuts: tuple[int, ...] = ()
    """Frames with which another shot begins; the path means nothing across them."""
    dissolves: tuple[int, ...] = ()
    """Those of them with which one shot dissolves into the next."""
    exposure: Float[np.ndarray, "T"] | None = None
    """Brightness of the frames as factors on what is usual in their shot; None where the light
    hardly changes."""


PLAYER = "the player"
"""What a usable shot shows."""
PERHAPS = "perhaps the player"
"""What a shot shows of which a person must tell whether it is usable."""


@dataclass(frozen=True, eq=False)
class Shots:
    """The shots of a video: nothing moves on from one to the next."""

    first: tuple[int, ...]
    """First frame of each, ascending from 0."""
    n_frames: int
    """Of the video."""
    shows: tuple[str, ...]
    """What each shows: `PLAYER`, or what makes it of no use."""

    @classmethod
    def between(cls, cuts: tuple[int, ...], n_frames: int) -> "Shots":
        """The shots that begin with frame 0 and with every cut, all of them of the player."""
        return cls((0, *cuts), n_frames, (PLAYER,) * (1 + len(cuts)))

    @property
    def parts(self) -> tuple[slice, ...]:
        """The frames of each shot."""
        return tuple(slice(*ends) for ends in pairwise((*self.first, self.n_frames)))

    @property
    def usable(self) -> tuple[bool, ...]:
        """Whether each shot shows the player whole."""
        return tuple(shown == PLAYER for shown in self.shows)

    @property
    def number(self) -> Int[np.ndarray, "T"]:
        """The shot of each frame."""
        return np.searchsorted(self.first, np.arange(self.n_frames), side="right") - 1

    @property
    def usable_frames(self) -> Int[np.ndarray, "N"]:
        """Frames of usable shots, ascending."""
        return np.flatnonzero(np.array(self.usable)[self.number])

    def joined(self) -> "Shots":
        """The usable shots alone, one after the other without the frames between."""
        lengths = [part.stop - part.start for part in self.parts]
        usable = [length for length, good in zip(lengths, self.usable, strict=True) if good]
        return Shots.between(tuple(np.cumsum(usable[:-1]).tolist()), sum(usable))

    def in_each(self, work: Callable[..., np.ndarray], *values: np.ndarray) -> np.ndarray:
        """`work` done on the values of each shot by themselves; its results end to end."""
        return np.concatenate([work(*(value[part] for value in values)) for part in self.parts])


@dataclass(frozen=True, eq=False)
class Track:
    """Where the player is in every frame, px."""

    head: Float[np.ndarray, "T 2"]
    """Centre of the head."""
    feet: Float[np.ndarray, "T 2 2"]
    """Both feet, in no particular order (left and right come from annotation)."""
    height: Float[np.ndarray, "T"]
    """Standing length from head centre to mid-feet, smoothed over time: the unit of distance."""
    box: Float[np.ndarray, "T 4"]
    """x0, y0, x1, y1 around the player and a raised arm; may leave the picture. NaN in shots that
    do not show the player."""
    confidence: Float[np.ndarray, "T"]
    """0-1; 0 where head or feet were not seen and are interpolated."""

    @property
    def known(self) -> Bool[np.ndarray, "T"]:
        """Frames of shots that show the player."""
        return ~np.isnan(self.box).any(axis=1)

    def feet_inside(self, rows: int) -> Bool[np.ndarray, "T"]:
        """Frames in which both feet lie above the lower edge of a picture of so many rows."""
        return self.feet[..., 1].max(axis=1) < rows

    @property
    def mid_feet(self) -> Float[np.ndarray, "T 2"]:
        """Point between the feet, px."""
        return self.feet.mean(axis=1)


@dataclass(frozen=True, eq=False)
class TrackVerification:
    """Checks of the track against some frames of the video."""

    frames: Int[np.ndarray, "n"]
    """Those looked at."""
    truncated: Bool[np.ndarray, "n"]
    """Whether the lower edge of the picture cuts the player off."""
    distractor: Float[np.ndarray, "n 2"]
    """Head of another figure that looks like the player, px; NaN where there is none."""
    hidden: Bool[np.ndarray, "n"]
    """Whether something laid over the picture, such as a score, hides a part of the player."""
    unlinked: Bool[np.ndarray, "n"] | None = None
    """Whether the track there is not linked to a head that a person marked or clicked; None where
    that was not examined."""


@dataclass(frozen=True, eq=False)
class TrackAnchors:
    """Fixed points of the track: heads and feet that a person marked, or that flow between marks is
    sure of."""

    frames: Int[np.ndarray, "A"]
    """Ascending."""
    head: Float[np.ndarray, "A 2"]
    """Centre of the head, px; NaN where not fixed."""
    feet: Float[np.ndarray, "A 2 2"]
    """Both shoes, px; NaN where not both are fixed."""
    marked: Bool[np.ndarray, "A"]
    """False where flow between marks has found them, not a person."""
    height: Float[np.ndarray, "A"]
    """Standing length of the marked bodies from head centre to mid-feet by the lengths of their
    bones, px; NaN where too little is marked."""
    footless: Bool[np.ndarray, "A"]
    """Where hips or knees are marked and no foot is."""
    followed_head: Float[np.ndarray, "A 2"]
    """Where flow leads the head from marks, px, however sure it is; NaN where it says nothing or
    the head is fixed."""
    head_doubt: Float[np.ndarray, "A"]
    """Probability that the head is elsewhere than flow leads it; NaN where it leads nowhere."""

    @classmethod
    def none(cls) -> "TrackAnchors":
        """Nothing was marked."""
        return cls(
            np.zeros(0, dtype=np.int64),
            np.zeros((0, 2)),
            np.zeros((0, 2, 2)),
            np.zeros(0, dtype=bool),
            np.zeros(0),
            np.zeros(0, dtype=bool),
            np.zeros((0, 2)),
            np.zeros(0),
        )


@dataclass(frozen=True, eq=False)
class Edges:
    """Directed edge elements of one frame: contour samples with the region on their left.

    Left is as seen on the picture when walking along the tangent (y points down).
    """

    points: Float[np.ndarray, "E 2"]
    """px"""
    tangent: Float[np.ndarray, "E 2"]
    """Unit vectors."""
    color: Int[np.ndarray, "E"]
    """Which target colour the region has: index into the names of `Colors`."""
    upper: Bool[np.ndarray, "E"]
    """Counts for the upper body; near the waist an element counts for both."""
    lower: Bool[np.ndarray, "E"]
    inside: Float[np.ndarray, "P 2"] = field(default_factory=lambda: np.zeros((0, 2)))
    """Places on the player, px: the cells of a regular grid that regions cover by half and more."""


@dataclass(frozen=True, eq=False)
class Colors:
    """What the player's parts and the surroundings look like, as smoothed Lab histograms."""

    names: tuple[str, ...]
    """The parts picked: 'head', 'foot' and the regions. Labels and edges count in this order."""
    histograms: Float[np.ndarray, "C bins"]
    """Share of each part's pixels in each colour bin (see `keyrecon.segmentation.color_model`)."""
    surroundings: Float[np.ndarray, "bins"]
    """Share of the pixels around the player in each colour bin."""
    height: float
    """Length from head to mid-feet where both were picked, px."""


@dataclass(frozen=True, eq=False)
class Background:
    """The scene without the player, a mosaic in the coordinates of the reference frame."""

    color: UInt8[np.ndarray, "h w 3"]
    """Median, Lab."""
    spread: Float[np.ndarray, "h w"]
    """Usual deviation from the median, grey levels."""
    known: Bool[np.ndarray, "h w"]
    """False where the scene was never observed."""
    from_reference: Float[np.ndarray, "3 3"]
    """Homography from pixels of the reference frame to those of the background."""
    overlay: Bool[np.ndarray, "y x"]
    """Where something is laid over the picture, a score or a logo; pixels of reduced pictures."""
    shrink: float
    """Pixels of these that one of the full picture has."""
    first: int = 0
    """Frame from which on it holds."""
    later: tuple["Background", ...] = ()
    """Those that hold from later frames on, where one does not do for all: ascending, and without
    others in them."""
    sure: float = 3.0
    """A pixel that differs by this many standard deviations is as likely the player as not."""


@dataclass(frozen=True, eq=False)
class PoseDistances:
    """Pose distances between every two frames, each half of the body apart (Section 4.2).

    M frames are compared: all T of a short video, exemplars that stand for frames of poses like
    theirs in a long one.
    """

    upper: Float[np.ndarray, "M M"]
    """C: truncated directed chamfer distance, made symmetric, in player heights."""
    lower: Float[np.ndarray, "M M"]
    frames: Int[np.ndarray, "M"]
    """Frame number of each row, ascending."""
    row: Int[np.ndarray, "T"]
    """Row that stands for each frame."""
    exemplar_distance: Float[np.ndarray, "2 T"]
    """C between each frame and the one that stands for it, upper and lower body."""
    consecutive_distance: Float[np.ndarray, "2 S"]
    """C between each frame and the next, upper and lower body; S is T - 1. NaN at cuts, and where
    frames between the two were left out."""
    visibility_score: Float[np.ndarray, "T"]
    """0-1: how well a person could annotate each frame (tracked, not blurred)."""
    seen: Float[np.ndarray, "2 T"]
    """Share of its usual outline that each half of the body shows, upper and lower, 0-1; NaN where
    the picture ends above that half."""


@dataclass(frozen=True, eq=False)
class MarkGains:
    """What each mark is worth: a person may stop at any of them."""

    beta: float
    """Distance within which a keyframe stands for a frame here, player heights."""
    order: Int[np.ndarray, "K"]
    """The keyframes, the one that covers most first."""
    coverage: Float[np.ndarray, "K"]
    """Share of frames covered (Eq. 1) by each and those before it."""
    next_gain: float
    """What the best further mark would add to the coverage."""


@dataclass(frozen=True, eq=False)
class HalfKeyframes:
    """Keyframes of one half of the body."""

    frames: Int[np.ndarray, "K"]
    """Sorted frame numbers."""
    nearest: Int[np.ndarray, "T"]
    """Frame number of the keyframe that stands for each frame."""
    represented: Bool[np.ndarray, "T"]
    """W: frames closer than beta to a keyframe."""
    coverage: float
    """Share of frames represented, or between two such frames at most T apart (Eq. 1)."""
    beta: float
    """Distance under which a keyframe represents a frame, player heights."""
    distance: Float[np.ndarray, "T"]
    """D between each frame and its keyframe, player heights; infinite without the player."""
    printed_count: int
    """Keyframes that Eq. 2-4 as printed would take at this beta and coverage."""
    gains: MarkGains | None = None
    """What each of them is worth; None in files of older versions."""


@dataclass(frozen=True, eq=False)
class Keyframes:
    """Frames that a person is asked to annotate."""

    upper: HalfKeyframes
    lower: HalfKeyframes
    reach: int
    """T of the paper, frames."""
    alpha: float
    """Coverage asked for."""
    method: str = "coverage"
    """How they were chosen: 'coverage', or 'paper' for Eq. 2-4 as printed."""

    @property
    def frames(self) -> Int[np.ndarray, "K"]:
        """All keyframes, sorted."""
        return np.union1d(self.upper.frames, self.lower.frames)


@dataclass(frozen=True, eq=False)
class Preparation:
    """Everything known before a person annotates keyframes."""

    video: Video
    """Read as if all frames had been exposed alike."""
    camera: CameraPath
    colors: Colors
    track: Track
    edges: tuple[Edges, ...]
    """One for each frame; none in shots that are of no use."""
    pose_distances: PoseDistances
    keyframes: Keyframes
    shots: Shots
    verification: TrackVerification | None = None
    """Checks of the track against the video; None where they were not made."""


@dataclass(frozen=True, eq=False)
class Annotations:
    """What a person marked."""

    skeleton: Skeleton
    frames: Int[np.ndarray, "K"]
    """Sorted frame numbers."""
    joints: Float[np.ndarray, "K J 2"]
    """px; NaN where not marked."""
    visible: Bool[np.ndarray, "K J"]
    """False where the joint was placed though hidden, or not marked."""
    nearer: Int[np.ndarray, "K B"]
    """1 where the child end of a bone is nearer the camera, -1 farther, 0 unknown."""
    absent: tuple[tuple[int, str], ...] = ()
    """Sorted frames and names of joints of which the person said that they cannot be seen or
    placed: nothing is missing there, and nothing is carried there. Such a frame needs no row."""

    @property
    def never_marked(self) -> tuple[str, ...]:
        """Names of the joints that are marked on no frame."""
        marked = np.isfinite(self.joints).all(axis=2).any(axis=0)
        return tuple(np.array(self.skeleton.names)[~marked].tolist())


@dataclass(frozen=True, eq=False)
class JointTracks:
    """2D joints in every frame, before anything is known in 3D."""

    joints: Float[np.ndarray, "T J 2"]
    """px; NaN where missing."""
    confidence: Float[np.ndarray, "T J"]
    """0-1; 0 where missing."""
    exchange_evidence: Float[np.ndarray, "T 2"] | None = None
    """Log odds by the motion that left and right are exchanged in the marks of the lower body, and
    of the upper, nats; 0 in frames without marks, None where not computed."""
    elsewhere: Float[np.ndarray, "T J"] | None = None
    """Probability that a joint of a limb is a fifth of a trunk and more from here, by the limbs
    that a frame might show (0 of the trunk); None where there is one choice only."""


@dataclass(frozen=True, eq=False)
class FlowTracks:
    """Marked joints followed by optical flow between marks near in time."""

    joints: Float[np.ndarray, "T J 2"]
    """px; NaN where nothing was followed."""
    confidence: Float[np.ndarray, "T J"]
    """0-1: how well the ways from both marks agree, and the place with what was marked."""
    joined: Bool[np.ndarray, "T J"]
    """Whether there is a way from a mark before and one from a mark after."""
    drift: Float[np.ndarray, "T J"]
    """How far apart both ways end, or, where there is one, how far its steps did not lead back in
    sum; at the ends of a head that has grown at least by how much too long it is, or was on that
    way. Player heights; NaN where nothing was followed."""
    likeness: Float[np.ndarray, "T J"]
    """Correlation of the picture there with that around the mark, the better one of two; NaN where
    nothing was followed."""


SOURCES = ("annotated", "propagated", "interpolated", "refined")
"""Legend of `Motion.source`, the evidence behind each joint: marked by a person in this frame;
carried from a keyframe; no evidence (of confidence 0, or said to be absent), filled by the motion
before and after; carried, but taken for a slip and replaced by the refinement."""


@dataclass(frozen=True, eq=False)
class Motion:
    """The result: 3D joints in every frame, and how they came about."""

    skeleton: Skeleton
    points3d: Float[np.ndarray, "T J 3"]
    """Camera axes; metres or body heights, see `units`."""
    points2d: Float[np.ndarray, "T J 2"]
    """Projection of `points3d`, px."""
    points2d_propagated: Float[np.ndarray, "T J 2"]
    """Joints before refinement, px; NaN where missing."""
    confidence: Float[np.ndarray, "T J"]
    source: Int[np.ndarray, "T J"]
    """Index into SOURCES."""
    scale: Float[np.ndarray, "T"]
    """px per unit of length"""
    fps: float
    time: Float[np.ndarray, "T"]
    """Seconds."""
    units: str
    """'m' where a height was given, else 'body heights'."""
    keyframes: Int[np.ndarray, "K"]
    """Annotated frames."""
    expected_error: Float[np.ndarray, "T J"] | None = None
    """Expected distance of `points2d` from the joints, px; None where it is not known."""
    exchange_evidence: Float[np.ndarray, "T 2"] | None = None
    """As in `JointTracks`."""
    elsewhere: Float[np.ndarray, "T J"] | None = None
    """As in `JointTracks`; of `points2d_propagated`."""
    cuts: Int[np.ndarray, "C"] | None = None
    """Frames with which another shot begins, or a stretch of one in which nobody is seen, or is
    again; None where there is one stretch. Where nobody is everything but the time is unknown, and
    confidence is 0."""

    @property
    def known(self) -> Bool[np.ndarray, "T"]:
        """Frames in which there is a motion."""
        return np.isfinite(self.points3d).all(axis=(1, 2))

    @property
    def stretches(self) -> tuple[slice, ...]:
        """Frames that follow one another within a shot, and in which there is a motion."""
        known = self.known
        cut = np.zeros(len(known), dtype=bool)
        cut[[] if self.cuts is None else self.cuts] = True
        begins = known & (cut | ~np.append(False, known[:-1]))
        ends = known & np.append(cut[1:] | ~known[1:], True)
        pairs = zip(np.flatnonzero(begins).tolist(), np.flatnonzero(ends).tolist(), strict=True)
        return tuple(slice(first, last + 1) for first, last in pairs)
