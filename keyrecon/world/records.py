"""What is known of the camera and the court; see `keyrecon.world.court` for the world's axes."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float


@dataclass(frozen=True, eq=False)
class CourtCamera:
    """Where every frame was taken from: x ~ K (R X + t), X in metres on the court.

    R and t in OpenCV's convention. NaN where the camera was not found.
    """

    K: Float[np.ndarray, "T 3 3"]
    R: Float[np.ndarray, "T 3 3"]
    t: Float[np.ndarray, "T 3"]
    found: Bool[np.ndarray, "T"]
    """Whether the court's lines lie where this camera puts them."""
    sd_centre: Float[np.ndarray, "T 3"]
    """Standard deviation of the camera's place, metres."""
    sd_focal: Float[np.ndarray, "T"]
    """Standard deviation of the focal length, px."""

    @property
    def centre(self) -> Float[np.ndarray, "T 3"]:
        """Place of the camera, metres."""
        return -np.einsum("tji,tj->ti", self.R, self.t)

    @property
    def focal(self) -> Float[np.ndarray, "T"]:
        """px"""
        return self.K[:, 0, 0]

    def project(self, frame: int, points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 2"]:
        """Pixels of points on the court in one frame; NaN behind the camera."""
        local = points @ self.R[frame].T + self.t[frame]
        depth = np.where(local[:, 2:] > 0, local[:, 2:], np.nan)
        return (local / depth @ self.K[frame].T)[:, :2]


@dataclass(frozen=True)
class CourtClick:
    """A named point of the court that a person clicked."""

    name: str
    """See `keyrecon.world.court.POINTS`."""
    frame: int
    x: float
    y: float


@dataclass(frozen=True, eq=False)
class WorldMotion:
    """A motion on the court, metres; NaN in frames whose camera was not found."""

    points: Float[np.ndarray, "T J 3"]
    """Joints."""
    root: Float[np.ndarray, "T 3"]
    """Middle of the hips."""
    contact: Bool[np.ndarray, "T 2"]
    """Whether the right foot, and the left, stands on the ground."""
    height_ratio: float
    """Size of the player by the court over that of the motion; for a motion in body heights the
    player's height in metres."""
