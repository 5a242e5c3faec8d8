"""A small motion to write into files."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from keyrecon.body import LSP14
from keyrecon.records import Motion

FPS = 50.0


DOWN, UP, RIGHT, LEFT = (0, 1, 0), (0, -1, 0), (-1, 0.1, 0), (1, 0.1, 0)  # facing the camera


POSE = {
    "right_hip": (-0.3, 1, 0), "left_hip": (0.3, 1, 0), "right_knee": DOWN, "left_knee": DOWN,
    "right_ankle": (0, 1, 0.3), "left_ankle": (0, 1, 0.3), "right_shoulder": RIGHT,
    "left_shoulder": LEFT, "right_elbow": (-1, 1, 0), "left_elbow": (1, 1, 0),
    "right_wrist": (-0.3, 1, -1), "left_wrist": (0.3, 1, -1), "head_top": UP,
}  # fmt: skip


def moving_points(frames, wildness=0.5, seed=0):
    """A person of 1.8 m in camera axes whose limbs swing smoothly and keep their lengths."""
    rng = np.random.default_rng(seed)
    points = np.zeros((frames, 14, 3))
    swing = gaussian_filter1d(rng.normal(0, 8 * wildness, (frames, 14, 3)), 8, axis=0)
    points[:, LSP14.root] = [0.2, -0.5, 12] + 0.3 * swing[:, LSP14.root]
    for parent, child in LSP14.bones:
        direction = np.array(POSE[LSP14.names[child]]) + swing[:, child]
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        points[:, child] = points[:, parent] + 1.8 * LSP14.proportions[child] * direction
    return points


def make_motion(frames=60, units="m", time=None, wildness=0.5):
    points = moving_points(frames, wildness)
    pixels = 100 * points[..., :2] + 300
    propagated = pixels.copy()
    propagated[3:4, 4] = np.nan
    return Motion(
        skeleton=LSP14,
        points3d=points,
        points2d=pixels,
        points2d_propagated=propagated,
        confidence=np.random.default_rng(1).uniform(0, 1, points.shape[:2]),
        source=np.random.default_rng(2).integers(0, 4, points.shape[:2]),
        scale=np.full(frames, 100.0),
        fps=FPS,
        time=np.arange(frames) / FPS if time is None else time,
        units=units,
        keyframes=np.array([0, min(30, frames - 1)]),
    )
