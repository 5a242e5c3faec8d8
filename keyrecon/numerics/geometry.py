"""Points, directions, cameras and crops.

Two cameras: perspective for rendering, scaled orthography for reconstruction. Both map points in
camera axes (x right, y down, z away) to pixels (x right, y down). Scaled orthography, u = s X, is
what a distant player looks like and what Taylor's method assumes (CVIU 80, 2000); it leaves the
depth of the whole body open.
"""

import cv2
import numpy as np
from jaxtyping import Complex, Float, UInt8


def project_perspective(
    points: Float[np.ndarray, "*n 3"], focal: float, principal: Float[np.ndarray, "2"]
) -> Float[np.ndarray, "*n 2"]:
    """Pixels of points in camera axes; NaN behind the camera."""
    depth = np.where(points[..., 2:] > 0, points[..., 2:], np.nan)
    return focal * points[..., :2] / depth + principal


def project_orthographic(
    points: Float[np.ndarray, "T J 3"], scale: Float[np.ndarray, "T"]
) -> Float[np.ndarray, "T J 2"]:
    """Pixels of points in camera axes under scaled orthography; scale in px per unit.

    The origin of space projects to pixel (0, 0): where the body is in the picture is in `points`.
    """
    return scale[:, None, None] * points[..., :2]


def unit_vectors(
    vectors: Float[np.ndarray, "*n D"], min_length: float = 1e-30
) -> Float[np.ndarray, "*n D"]:
    """Vectors of length one; those below `min_length` are divided by it, so that zero stays zero.

    With a `min_length` of zero a zero vector becomes NaN.
    """
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), min_length)


def tangents(directions: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3 2"]:
    """Two unit vectors at right angles to every direction."""
    helper = np.eye(3)[np.abs(directions).argmin(axis=-1)]
    first = unit_vectors(np.cross(directions, helper))
    return np.stack([first, np.cross(directions, first)], axis=-1)


def signed_angles(
    first: Float[np.ndarray, "n 2"], second: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "n"]:
    """Radians by which vectors are turned into others, from x to y, -pi to pi."""
    cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    return np.arctan2(cross, (first * second).sum(axis=-1))


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


def cut_affine(
    picture: UInt8[np.ndarray, "h w *c"],
    to_picture: Float[np.ndarray, "2 3"],
    size: tuple[int, int],
) -> UInt8[np.ndarray, "y x *c"]:
    """A crop of `size` (rows, columns) whose pixels lie where `to_picture` maps them.

    Beyond the picture its last pixels go on, so that a crop has no edge there.
    """
    return cv2.warpAffine(
        picture,
        to_picture,
        size[::-1],
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )


def to_complex(points: Float[np.ndarray, "*n 2"]) -> Complex[np.ndarray, "*n"]:
    """x + iy"""
    return points[..., 0] + 1j * points[..., 1]


def from_complex(points: Complex[np.ndarray, "*n"]) -> Float[np.ndarray, "*n 2"]:
    """(x, y)"""
    return np.stack([points.real, points.imag], axis=-1)
