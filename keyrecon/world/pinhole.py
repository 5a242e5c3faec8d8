"""One camera with square pixels: points to pixels, and how pixels move as the camera does.

x ~ K (R X + t) in OpenCV's convention, K = [[f, 0, cx], [0, f, cy], [0, 0, 1]] and t = -R C. The
principal point is the middle of the picture.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, eq=False)
class Pinhole:
    """Where one picture was taken from."""

    focal: float
    """px"""
    principal: Float[np.ndarray, "2"]
    """px"""
    rotation: Float[np.ndarray, "3 3"]
    """World to camera axes."""
    centre: Float[np.ndarray, "3"]
    """World, metres."""

    def local(self, points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3"]:
        """World points in camera axes, metres."""
        return (points - self.centre) @ self.rotation.T

    def project(self, points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 2"]:
        """Pixels of world points; NaN behind the camera."""
        local = self.local(points)
        depth = np.where(local[:, 2:] > NEAREST, local[:, 2:], np.nan)
        return self.focal * local[:, :2] / depth + self.principal

    def moved(self, step: Float[np.ndarray, "7"]) -> "Pinhole":
        """The camera after a step: centre (metres), a small turn (radians), log focal length."""
        turn = cv2.Rodrigues(np.asarray(step[3:6], dtype=float))[0]
        return replace(
            self,
            centre=self.centre + step[:3],
            rotation=turn @ self.rotation,
            focal=float(self.focal * np.exp(np.clip(step[6], -0.7, 0.7))),
        )

    def resized(self, scale: float) -> "Pinhole":
        """The camera of the same picture made `scale` times as large."""
        shift = (scale - 1) / 2
        return replace(self, focal=self.focal * scale, principal=self.principal * scale + shift)


NEAREST = 0.1
"""Metres before the camera from which on a point is in front of it."""


def image_motion(
    camera: Pinhole, points: Float[np.ndarray, "N 3"], normals: Float[np.ndarray, "N 2"]
) -> Float[np.ndarray, "N 7"]:
    """How far each pixel goes along its normal per unit of `Pinhole.moved`'s step."""
    local = camera.local(points)
    depth = local[:, 2]
    flat = local[:, :2] / depth[:, None]
    row = np.empty_like(local)
    row[:, :2] = normals * (camera.focal / depth)[:, None]
    row[:, 2] = -(row[:, :2] * flat).sum(axis=1)
    zoom = camera.focal * (normals * flat).sum(axis=1)
    (x, y, z), (u, v, w) = local.T, row.T
    turn = y * w - z * v, z * u - x * w, x * v - y * u  # a fifth of the time of np.cross
    return np.column_stack([-row @ camera.rotation, *turn, zoom])


def pinhole_from_homography(
    homography: Float[np.ndarray, "3 3"], principal: Float[np.ndarray, "2"], focal: float
) -> Pinhole:
    """The camera that sees the ground by a homography from metres to pixels.

    The nearest rotation is taken. A homography has two signs; the one that puts the ground before
    the camera is that whose camera is above it.
    """
    inverse = np.array(
        [[1 / focal, 0, -principal[0] / focal], [0, 1 / focal, -principal[1] / focal], [0, 0, 1]]
    )
    plane = inverse @ homography
    plane /= np.sqrt(np.linalg.norm(plane[:, 0]) * np.linalg.norm(plane[:, 1]))
    for sign in (1.0, -1.0):
        first, second, shift = (sign * plane).T
        left, _, right = np.linalg.svd(np.column_stack([first, second, np.cross(first, second)]))
        rotation = left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
        centre = -rotation.T @ shift
        if centre[2] > 0:
            break
    return Pinhole(focal, principal, rotation, centre)


def carried_focal(
    camera: Pinhole, homographies: Float[np.ndarray, "n 3 3"]
) -> Float[np.ndarray, "n"]:
    """Focal lengths, px, after a camera has turned and zoomed, from the homographies of its picture
    into the later ones."""
    x, y = camera.principal
    shift = np.array([[1, 0, -x], [0, 1, -y], [0, 0, 1.0]])
    moved = shift @ homographies @ np.linalg.inv(shift) * [camera.focal, camera.focal, 1.0]
    across, down, axis = np.linalg.norm(moved, axis=2).T
    return np.sqrt(across * down) / axis
