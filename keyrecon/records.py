"""What stages hand to one another: frozen, complete values.

Axis letters, the same everywhere: T frames, K keyframes, J joints, B bones, E edge elements,
C colours. Unknown numbers are NaN. Pixels and axes as in the package docstring.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.body import Skeleton


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
    trust: Float[np.ndarray, "T"]
    """Share of background features that agree with it, 0-1."""


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
    """x0, y0, x1, y1 around the player and a raised arm; may leave the picture."""
    trust: Float[np.ndarray, "T"]
    """0-1; 0 where head or feet were not seen and are interpolated."""

    @property
    def mid_feet(self) -> Float[np.ndarray, "T 2"]:
        """Point between the feet, px."""
        return self.feet.mean(axis=1)


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


@dataclass(frozen=True, eq=False)
class Distances:
    """Pose distances between every two frames, one half of the body (Section 4.2)."""

    matched: Float[np.ndarray, "T T"]
    """C: truncated directed chamfer distance, made symmetric, in player heights."""
    smoothed: Float[np.ndarray, "T T"]
    """D: C averaged over frames of the same pose."""
    beta: float
    """Distance under which two frames show the same pose."""


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


@dataclass(frozen=True, eq=False)
class Keyframes:
    """Frames that a person is asked to annotate."""

    upper: HalfKeyframes
    lower: HalfKeyframes
    reach: int
    """T of the paper, frames."""
    alpha: float
    """Coverage asked for."""

    @property
    def frames(self) -> Int[np.ndarray, "K"]:
        """All keyframes, sorted."""
        return np.union1d(self.upper.frames, self.lower.frames)


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


@dataclass(frozen=True, eq=False)
class JointTracks:
    """2D joints in every frame, before anything is known in 3D."""

    joints: Float[np.ndarray, "T J 2"]
    """px; NaN where missing."""
    confidence: Float[np.ndarray, "T J"]
    """0-1; 0 where missing."""
    keyframe: Int[np.ndarray, "T J"]
    """Frame number of the keyframe that each joint comes from."""


SOURCES = ("annotated", "propagated", "interpolated", "refined")
"""Legend of `Motion.source`."""


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
