"""Player coordinates: every frame seen from the player, in player heights.

The origin of a frame is the midpoint of head and feet, smoothed over time after the camera's own
motion is taken out, so that what moves in these coordinates is the body and neither the camera
nor the noise of the tracker. Points are complex numbers x + iy: turning and stretching a limb is
then one product.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.numerics.geometry import from_complex, to_complex, warp_points
from keyrecon.records import CameraPath, Track

STABILISING_SECONDS = 2.5
"""Spread of the smoothing of the origin, frames: short against a step, long against jitter."""


@dataclass(frozen=True, eq=False)
class BodyFrame:
    """Where the player's own coordinates lie in every frame."""

    origin: Complex[np.ndarray, "T"]
    """px"""
    height: Float[np.ndarray, "T"]
    """px"""

    def from_pixels(
        self, points: Float[np.ndarray, "*n 2"], frames: int | Int[np.ndarray, "..."]
    ) -> Complex[np.ndarray, "*n"]:
        """Pixels to player coordinates; `frames` broadcasts against the points."""
        return (to_complex(points) - self.origin[frames]) / self.height[frames]

    def to_pixels(
        self, points: Complex[np.ndarray, "*n"], frames: int | Int[np.ndarray, "..."]
    ) -> Float[np.ndarray, "*n 2"]:
        """Player coordinates to pixels."""
        return from_complex(points * self.height[frames] + self.origin[frames])


def stabilise_player(track: Track, camera: CameraPath) -> BodyFrame:
    """Player coordinates from head, feet and the camera's motion."""
    middle = (track.head + track.mid_feet) / 2
    reach = int(np.ceil(2.5 * STABILISING_SECONDS))
    last = len(middle) - 1
    now = np.arange(len(middle))
    back = np.linalg.inv(camera.to_reference)
    total, weights = np.zeros_like(middle), np.zeros(len(middle))
    for lag in range(-reach, reach + 1):
        # mirrored, so that the mean stays at the frame itself at both ends of the video
        other = np.clip(now + lag, 0, last)
        there = back @ camera.to_reference[other]
        weight = np.exp(-0.5 * (lag / STABILISING_SECONDS) ** 2) * (other == now + lag)
        total += weight[:, None] * warp_points(there, middle[other])
        weights += weight
    return BodyFrame(to_complex(total / weights[:, None]), track.height.astype(float))
