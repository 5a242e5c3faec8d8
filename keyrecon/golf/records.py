"""What the parts of the swing model hand to one another.

Axis letters: T frames, P segments, N samples of a motion, C components, n rows of residuals.
Swing axes: origin on the floor midway between the ankles at address, x to the player's right,
y up, z to the player's back, so that the player looks along -z. The model is right-handed; a
left-handed player is mirrored on the way in and out.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.records import Motion


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera that stands still; rough values do."""

    focal: float
    """px"""
    principal: Float[np.ndarray, "2"]
    """Where the optical axis meets the picture, px."""


@dataclass(frozen=True, eq=False)
class Swing:
    """One captured swing of a right-handed player, in swing axes, metres."""

    name: str
    joints: Float[np.ndarray, "T 14 3"]
    """In the order of LSP14."""
    toes: Float[np.ndarray, "T 2 3"]
    """Right, left."""
    club: Float[np.ndarray, "T 2 3"]
    """Grip between the hands, and club head."""
    keys: Int[np.ndarray, "4"]
    """Frames of the key postures: beginning of the upswing, top, ball hit, finish."""
    fps: float
    stature: float
    """Metres."""


@dataclass(frozen=True, eq=False)
class MotionModel:
    """Swings as mean + sum of alpha_i times component i (CVPR 2005, Eq. 2).

    A posture is one turn per segment relative to its parent, written as a rotation vector about
    `centre`, and the pelvis's place in swing axes in statures.
    """

    version: int
    centre: Float[np.ndarray, "P 3 3"]
    """Turn about which each segment's rotation vectors are taken."""
    mean: Float[np.ndarray, "N D"]
    """D = 3 P + 3: rotation vectors, then the pelvis's place."""
    components: Float[np.ndarray, "C N D"]
    """Scaled by their standard deviation: every coefficient has unit variance."""
    keys: Float[np.ndarray, "4"]
    """Normalised times of the key postures, from 0 to 1."""
    explained: Float[np.ndarray, "C"]
    """Share of the variance that the first 1, 2, ... C components explain."""
    provenance: str
    """What the model was learnt from."""


@dataclass(frozen=True, eq=False)
class Posture:
    """Local turns of all segments over T frames, with their rates."""

    turns: Float[np.ndarray, "T P 3 3"]
    """From segment axes to the parent's; the pelvis's parent are the swing axes."""
    place: Float[np.ndarray, "T 3"]
    """Pelvis in swing axes, statures."""
    turn_rates: Float[np.ndarray, "T P 3 K"]
    """Rotation velocity in the parent's axes by alpha_1 ... alpha_m and phase; K = m + 1."""
    place_rates: Float[np.ndarray, "T 3 K"]


@dataclass(frozen=True, eq=False)
class Body:
    """Sizes of a player, metres; `segments` gives the names and parents."""

    stature: float
    offsets: Float[np.ndarray, "P 3"]
    """Origin of each segment in its parent's axes."""
    joint_segment: Int[np.ndarray, "14"]
    """Segment that each joint of LSP14 moves with."""
    joint_place: Float[np.ndarray, "14 3"]
    """Joints in the axes of their segment."""
    club: float
    """From the grip to the end of the head."""


@dataclass(frozen=True, eq=False)
class Capsules:
    """Tapered capsules, the volumetric primitives; each belongs to one segment."""

    segment: Int[np.ndarray, "Q"]
    start: Float[np.ndarray, "Q 3"]
    """Axis in segment axes, metres."""
    end: Float[np.ndarray, "Q 3"]
    radii: Float[np.ndarray, "Q 2"]
    """At start and end, metres."""


@dataclass(frozen=True, eq=False)
class SwingState:
    """All that is unknown of a filmed swing: S of CVPR 2005, Eq. 3."""

    coefficients: Float[np.ndarray, "C"]
    """alpha of the paper: weights of the components."""
    phase: Float[np.ndarray, "T"]
    """mu of the paper: normalised time of every frame, 0-1."""
    rotation: Float[np.ndarray, "T 3 3"]
    """From swing axes to camera axes; with `position` G_t of the paper."""
    position: Float[np.ndarray, "T 3"]
    """Origin of the swing axes in the camera's, metres."""
    frame_coefficients: Float[np.ndarray, "T C"] | None = None
    """Coefficients of every frame, where they are not common to all: the paper's windows."""
    deviation: Float[np.ndarray, "T P 3"] | None = None
    """Turn of each segment away from the model's, a rotation vector in its parent's axes."""


@dataclass(frozen=True, eq=False)
class SwingFit:
    """A motion model, a body, and the state in which both together are a swing."""

    model: MotionModel
    body: Body
    state: SwingState


@dataclass(frozen=True, eq=False)
class RootPose:
    """All segments in camera axes."""

    origins: Float[np.ndarray, "T P 3"]
    """Metres."""
    rotations: Float[np.ndarray, "T P 3 3"]
    """Segment axes to camera axes."""


@dataclass(frozen=True, eq=False)
class InitialJoints:
    """Joints of one frame, from which the player's place is estimated."""

    frame: int
    names: tuple[str, ...]
    """Joints of LSP14, and `root` for the middle between the hips."""
    places: Float[np.ndarray, "n 2"]
    """px"""


@dataclass(frozen=True, eq=False)
class Matches:
    """The same surface points in consecutive frames, px."""

    frame: Int[np.ndarray, "n"]
    """Frame of `start`; `end` is in the next one."""
    start: Float[np.ndarray, "n 2"]
    end: Float[np.ndarray, "n 2"]


KEY_POSTURES = ("start", "top", "hit", "finish")
"""Of a golf swing, in the order of time."""


@dataclass(frozen=True, eq=False)
class SwingMarks:
    """What a person marked: joints and shaft in some frames, and when key postures are."""

    frames: Int[np.ndarray, "K"]
    """Ascending."""
    joints: Float[np.ndarray, "K 14 2"]
    """px; NaN where not marked; in the order of LSP14."""
    shafts: Float[np.ndarray, "K 2 2"]
    """Between the hands, and at the club's head, px; NaN where not marked."""
    keys: Float[np.ndarray, "4"]
    """Frames of start, top, hit and finish; NaN where not marked."""
    late: Float[np.ndarray, "K"] | None = None
    """By how much later than its frame each picture was taken in which was marked, frames: a film
    may lack that picture. None where all are those of their frames."""

    @classmethod
    def of_joints(
        cls, frames: Int[np.ndarray, "K"], joints: Float[np.ndarray, "K 14 2"]
    ) -> "SwingMarks":
        """Joints alone."""
        return cls(frames, joints, np.full((len(frames), 2, 2), np.nan), np.full(4, np.nan))

    @property
    def any(self) -> bool:
        """Whether anything was marked."""
        return len(self.frames) > 0 or bool(np.isfinite(self.keys).any())


NO_MARKS = SwingMarks.of_joints(np.zeros(0, np.int64), np.zeros((0, 14, 2)))
"""Nothing was marked."""


@dataclass(frozen=True, eq=False)
class Observations:
    """What was observed in the video, px; NaN where nothing was."""

    camera: Camera
    initial: InitialJoints
    height: float
    """Of the player in the initial frame, px."""
    stature: float
    """Of the player, metres."""
    joints: Float[np.ndarray, "T 14 2"]
    """In the order of LSP14."""
    spread: Float[np.ndarray, "T 14"]
    """Standard deviation of each joint."""
    club: Float[np.ndarray, "T 2 2"]
    """Hand end and head of the club."""
    club_spread: Float[np.ndarray, "T"]
    """Standard deviation of both ends across the shaft."""
    club_along: Float[np.ndarray, "T 2"]
    """Standard deviation of the hand end and of the head along the shaft; infinite where an end is
    hidden or outside of the picture."""
    foreground: tuple[Float[np.ndarray, "_ 2"], ...]
    """Samples of the player's mask, one array per frame."""
    silhouette_distance: Float[np.ndarray, "F y x"]
    """Distance to the mask in px at a quarter of the resolution; F = T, or 0 without masks."""
    matches: Matches
    keys: Float[np.ndarray, "4"]
    """Frames of the key postures."""
    phase: Float[np.ndarray, "T"]
    """First guess of the normalised time."""
    left_handed: bool
    marks: SwingMarks = NO_MARKS
    """What a person marked besides the initial joints."""


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals of one type of observation, and their derivatives by the points they depend on."""

    values: Float[np.ndarray, "n"]
    """px or metres, one unit per record."""
    frame: Int[np.ndarray, "n"]
    segment: Int[np.ndarray, "n"]
    """The segment that the point moves with."""
    point: Float[np.ndarray, "n 3"]
    """Camera axes, metres."""
    gradient: Float[np.ndarray, "n 3"]
    """Change of the value by the point."""
    group: Int[np.ndarray, "n"]
    """Rows with one number are one residual with several coordinates; robust weights go by it."""


@dataclass(frozen=True, eq=False)
class CameraTurns:
    """How a camera turned and zoomed, from where it is thought to stand still.

    A point of the standing camera's axes lies at turn @ point + shift in those of a frame.
    """

    turns: Float[np.ndarray, "T 3 3"]
    shifts: Float[np.ndarray, "T 3"]
    """Metres; zooming in brings the player closer."""

    def undo(
        self, points: Float[np.ndarray, "*n 3"], frames: int | slice = slice(None)
    ) -> Float[np.ndarray, "*n 3"]:
        """Points in the axes of some frames (T, n, 3), or of one, in the standing camera's."""
        return (points - self.shifts[frames, None]) @ self.turns[frames]


@dataclass(frozen=True, eq=False)
class FittedSwing:
    """A swing fitted to a video."""

    motion: Motion
    state: SwingState
    body: Body
    pose: RootPose
    """In the real camera, of the real player."""
    capsules: Capsules
    """On the segments of `pose`."""
    club: Float[np.ndarray, "T 2 3"]
    """Grip and head in camera axes, metres."""
    club2d: Float[np.ndarray, "T 2 2"]
    """The same in the picture, px."""
    keys: Float[np.ndarray, "4"]
    """Frames in which the fitted motion passes the key postures."""
    camera: CameraTurns | None = None
    """How the real camera moved; None where it stood still."""


@dataclass(frozen=True, eq=False)
class RecordedSwing:
    """A fitted swing as motion.npz keeps it: all that measures, reports and comparisons need."""

    motion: Motion
    club: Float[np.ndarray, "T 2 3"]
    """Grip and head in camera axes, metres."""
    club2d: Float[np.ndarray, "T 2 2"]
    """The same in the picture, px."""
    club_seen: Bool[np.ndarray, "T"]
    """Where the club was detected; elsewhere it is the model's."""
    keys: Float[np.ndarray, "4"]
    """Frames of the key postures."""
    vertical: Float[np.ndarray, "3"]
    """Unit vector up, axes of the camera where it stands still."""
    left_handed: bool
    doubts: tuple[str, ...] = ()
    """What speaks against the fit; its numbers are no measurements where anything does."""
    notes: tuple[str, ...] = ()
    """What a reader of its numbers should know of the film."""
    shown: tuple[bool, bool, bool, bool] = (True, True, True, True)
    """Which key postures the film shows; where one is not, its frame only bounds it."""
    camera: CameraTurns | None = None
    """How it moved; None where it stood still, or nobody knows (files of former versions)."""

    @property
    def standing_points(self) -> Float[np.ndarray, "T 14 3"]:
        """Joints as a camera sees them that stands still: only there frames can be compared."""
        points = self.motion.points3d
        return points if self.camera is None else self.camera.undo(points)

    @property
    def standing_club(self) -> Float[np.ndarray, "T 2 3"]:
        """Grip and head likewise."""
        return self.club if self.camera is None else self.camera.undo(self.club)

    @property
    def fitted(self) -> Bool[np.ndarray, "T"]:
        """Frames to which the swing was fitted."""
        return fitted_frames(self.motion)


def fitted_frames(motion: Motion) -> Bool[np.ndarray, "T"]:
    """Frames to which a swing was fitted: in the others joints have no confidence if not marked."""
    return motion.confidence.min(axis=1) > 0
