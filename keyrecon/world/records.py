"""What is known of the camera and the ground, and the motion there.

World axes: metres, z up, y away from the camera, x to the right. On a court the origin is at the
middle of the net (`keyrecon.world.court`), elsewhere under the player (`GROUND`).
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

Origin = Literal["court", "ground"]
COURT: Origin = "court"
"""The origin is at the middle of the net, x along it, y up the court away from the camera."""
GROUND: Origin = "ground"
"""The origin is on the ground where the player first stands, y away from the camera along its axis
in that frame."""


@dataclass(frozen=True, eq=False)
class WorldCamera:
    """Where every frame was taken from: x ~ K (R X + t), X in metres in the world.

    R and t in OpenCV's convention. NaN where the camera was not found.
    """

    K: Float[np.ndarray, "T 3 3"]
    R: Float[np.ndarray, "T 3 3"]
    t: Float[np.ndarray, "T 3"]
    found: Bool[np.ndarray, "T"]
    """Whether the camera is known; on a court, whether its lines lie where it puts them."""
    sd_centre: Float[np.ndarray, "T 3"]
    """Standard deviation of the camera's place, metres."""
    sd_focal: Float[np.ndarray, "T"]
    """Standard deviation of the focal length, px."""
    sd_tilt: Float[np.ndarray, "T"]
    """Standard deviation of the direction of the vertical, radians; NaN where unknown."""
    origin: Origin = COURT
    elsewhere: tuple[int, ...] = ()
    """First frames of shots that show the court from another place: they have no camera."""
    stature: float | None = None
    """The player's height, metres, where it alone set the scale; None where something else did."""

    @property
    def centre(self) -> Float[np.ndarray, "T 3"]:
        """Place of the camera, metres."""
        return -np.einsum("tji,tj->ti", self.R, self.t)

    @property
    def focal(self) -> Float[np.ndarray, "T"]:
        """px"""
        return self.K[:, 0, 0]

    def scaled(self, factor: float) -> "WorldCamera":
        """The same pictures of a world that is larger by `factor`."""
        stature = None if self.stature is None else factor * self.stature
        return replace(self, t=factor * self.t, sd_centre=factor * self.sd_centre, stature=stature)

    def part(self, frames: slice | Int[np.ndarray, "n"]) -> "WorldCamera":
        """Some of its frames, which are no shots any more."""
        return replace(
            self, elsewhere=(), **{name: getattr(self, name)[frames] for name in OF_CAMERA}
        )

    def project(self, frame: int, points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 2"]:
        """Pixels of points in the world in one frame; NaN behind the camera."""
        local = points @ self.R[frame].T + self.t[frame]
        depth = np.where(local[:, 2:] > 0, local[:, 2:], np.nan)
        return (local / depth @ self.K[frame].T)[:, :2]


OF_CAMERA = ("K", "R", "t", "found", "sd_centre", "sd_focal", "sd_tilt")
"""What a camera has of every frame."""


@dataclass(frozen=True)
class CourtClick:
    """A named point of the court that a person clicked."""

    name: str
    """See `keyrecon.world.court.POINTS`."""
    frame: int
    x: float
    y: float


Kind = Literal["vertical", "length", "horizon"]
KINDS: tuple[Kind, ...] = ("vertical", "length", "horizon")
"""What can be marked where there is no court."""


@dataclass(frozen=True)
class GroundMark:
    """What a person clicked: both ends of something in one frame, px."""

    kind: Kind
    frame: int
    start: tuple[float, float]
    end: tuple[float, float]
    metres: float | None = None
    """Length; of a vertical thing, that stands on the ground then; None where it is not known."""


@dataclass(frozen=True)
class GroundMarks:
    """All that a person marked of the ground and the camera."""

    marks: tuple[GroundMark, ...] = ()
    field_of_view: float | None = None
    """Degrees across the width of the picture."""


@dataclass(frozen=True, eq=False)
class WorldMotion:
    """A motion in the world, metres; NaN in frames whose camera was not found."""

    points: Float[np.ndarray, "T J 3"]
    """Joints."""
    root: Float[np.ndarray, "T 3"]
    """Middle of the hips."""
    contact: Bool[np.ndarray, "T 2"]
    """Whether the right foot, and the left, stands on the ground."""
    height_ratio: float
    """Size of the player by the camera over that of the motion; for a motion in body heights the
    player's height in metres."""
