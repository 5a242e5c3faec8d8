"""Lines of sight, the axes about them in which a lifted pose lives, and what of it was seen."""

import numpy as np
from jaxtyping import Bool, Float

from keyrecon.records import SOURCES, Motion
from keyrecon.world.records import WorldCamera


def sight_lines(
    camera: WorldCamera, pixels: Float[np.ndarray, "T 2"]
) -> tuple[Float[np.ndarray, "T 3"], Float[np.ndarray, "T 3"]]:
    """Unit lines of sight through pixels, in camera axes and in the world's."""
    flat = (pixels - camera.K[:, :2, 2]) / camera.K[:, 0, :1]
    ray = np.concatenate([flat, np.ones((len(flat), 1))], axis=1)
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    return ray, np.einsum("tji,tj->ti", camera.R, ray)


def sight_axes(camera: WorldCamera, pixels: Float[np.ndarray, "T 2"]) -> Float[np.ndarray, "T 3 3"]:
    """Columns: right, down and away along the line of sight through a pixel, in the world.

    Scaled orthography has its picture plane at right angles to the line of sight to the player,
    not to the camera's own axis.
    """
    ray, _ = sight_lines(camera, pixels)
    right = np.cross(np.array([0.0, 1.0, 0.0]), ray)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    return np.einsum("tji,tjk->tik", camera.R, np.stack([right, np.cross(ray, right), ray], axis=2))


def unseen_joints(motion: Motion) -> Bool[np.ndarray, "T J"]:
    """Joints that nothing in the picture told of: where they are says nothing of the ground."""
    return (motion.confidence == 0) & (motion.source == SOURCES.index("interpolated"))
