"""Cameras: perspective for rendering, scaled orthography for reconstruction.

Both map points in camera axes (x right, y down, z away) to pixels (x right, y down). Scaled
orthography, u = s X + o, is what a distant player looks like and what Taylor's method assumes
(CVIU 80, 2000); it leaves the depth of the whole body open.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, eq=False)
class PerspectiveCamera:
    """A pinhole camera."""

    rotation: Float[np.ndarray, "3 3"]
    """World to camera axes."""
    center: Float[np.ndarray, "3"]
    """Position in the world, metres."""
    focal: float
    """px"""
    principal: Float[np.ndarray, "2"]
    """Principal point, px."""

    def to_camera(self, world: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """World points in camera axes."""
        return (world - self.center) @ self.rotation.T

    def project(self, world: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 2"]:
        """Pixels of world points."""
        return project_perspective(self.to_camera(world), self.focal, self.principal)


def project_perspective(
    points: Float[np.ndarray, "*n 3"], focal: float, principal: Float[np.ndarray, "2"]
) -> Float[np.ndarray, "*n 2"]:
    """Pixels of points in camera axes; NaN behind the camera."""
    depth = np.where(points[..., 2:] > 0, points[..., 2:], np.nan)
    return focal * points[..., :2] / depth + principal


def project_orthographic(
    points: Float[np.ndarray, "T J 3"],
    scale: Float[np.ndarray, "T"],
    offset: Float[np.ndarray, "T 2"],
) -> Float[np.ndarray, "T J 2"]:
    """Pixels of points in camera axes under scaled orthography; scale in px per unit."""
    return scale[:, None, None] * points[..., :2] + offset[:, None]


def look_at(
    center: Float[np.ndarray, "3"], target: Float[np.ndarray, "3"], up: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "3 3"]:
    """Rotation from world to the axes of a camera at `center` that looks at `target`."""
    forward = (target - center) / np.linalg.norm(target - center)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward])


def warp_points(
    homography: Float[np.ndarray, "*#n 3 3"], points: Float[np.ndarray, "*#n 2"]
) -> Float[np.ndarray, "... 2"]:
    """Points moved by homographies, one each or one for all."""
    moved = np.einsum("...ij,...j->...i", homography[..., :, :2], points) + homography[..., :, 2]
    return moved[..., :2] / moved[..., 2:]
