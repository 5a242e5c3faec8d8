"""A motion as other programs want it: Y up, and at a constant frame rate.

Camera axes (x right, y down, z away) become x right, y up, z towards the camera: half a turn
about x, so that right-handed stays right-handed. Space stays relative to the camera; where the
camera is tilted, so is the ground.
"""

import numpy as np
from jaxtyping import Float

from keyrecon.errors import KeyreconError
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.records import Motion

UNEVEN = 0.1
"""Frame times that stray further than this share of a frame from an even spacing are uneven.
Some containers round times to milliseconds, 6 % of a frame at 120 fps."""


def y_up(points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """Points in camera axes with Y up and Z towards the camera."""
    return points * np.array([1.0, -1.0, -1.0])


def is_uneven(motion: Motion) -> bool:
    """Whether the frames of a motion are unevenly spaced in time."""
    even = motion.time[0] + np.arange(len(motion.time)) / motion.fps
    return bool(np.abs(motion.time - even).max() > UNEVEN / motion.fps)


def at_constant_rate(motion: Motion) -> Float[np.ndarray, "N J 3"]:
    """Joints with Y up, one frame every 1 / fps seconds; the motion's own frames if it is even.

    Between frames, bones turn along the chord of their directions and lengths are interpolated,
    so that a bone of constant length keeps it. Raises KeyreconError where joints are missing.
    """
    points = y_up(motion.points3d)
    if not np.isfinite(points).all():
        frame, joint = np.argwhere(~np.isfinite(points).all(axis=2))[0]
        raise KeyreconError(
            f"Frame {frame} has no {motion.skeleton.names[joint]}; this format needs every joint, "
            "use .csv or .npz."
        )
    if not is_uneven(motion):
        return points
    time = motion.time - motion.time[0]
    even = np.arange(int(np.floor(time[-1] * motion.fps + 1e-6)) + 1) / motion.fps
    resampled = np.empty((len(even), *points.shape[1:]))
    root = motion.skeleton.root
    resampled[:, root] = _interpolate(even, time, points[:, root])
    for parent, child in motion.skeleton.bones:
        bone = points[:, child] - points[:, parent]
        length = np.interp(even, time, np.linalg.norm(bone, axis=1))
        direction = unit_vectors(_interpolate(even, time, bone), 1e-12)
        resampled[:, child] = resampled[:, parent] + length[:, None] * direction
    return resampled


def _interpolate(
    at: Float[np.ndarray, "N"], time: Float[np.ndarray, "T"], values: Float[np.ndarray, "T 3"]
) -> Float[np.ndarray, "N 3"]:
    return np.stack([np.interp(at, time, values[:, k]) for k in range(3)], axis=1)
