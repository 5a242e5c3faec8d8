"""A figure that swings its limbs, whose truth is known."""

import numpy as np

from keyrecon.body import LSP14
from keyrecon.numerics.geometry import unit_vectors

BREADTHS = np.array([breadth.length for breadth in LSP14.breadths])


def standing_directions():
    """Unit bone directions of an upright figure that faces the camera, arms down."""
    named = {
        "head_top": (0, -1, 0),
        "right_shoulder": (-0.99, 0.1, 0),
        "left_shoulder": (0.99, 0.1, 0),
        "right_hip": (-0.303, 0.95, 0),
        "left_hip": (0.303, 0.95, 0),
    }
    down = {"knee": (0, 1, -0.25), "ankle": (0, 1, 0.25), "elbow": (0, 1, 0.2)}
    down["wrist"] = (0, 0.6, -0.8)
    rows = [named.get(LSP14.names[c]) or down[LSP14.names[c].split("_")[1]] for _, c in LSP14.bones]
    return unit_vectors(np.array(rows, dtype=float))


def turned(directions, yaw):
    """Directions turned about the vertical."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    return directions @ np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]]).T


def swinging_motion(frames=240, seed=0):
    """Bone directions of a figure that turns and swings arms and legs, smooth in time."""
    rng = np.random.default_rng(seed)
    time = np.arange(frames) / 50
    phase, rate = rng.uniform(0, 6, (13, 2)), rng.uniform(0.3, 0.9, (13, 2))
    wave = 0.35 * np.sin(2 * np.pi * rate * time[:, None, None] + phase)
    swing = np.stack([wave[..., 0], np.zeros_like(wave[..., 0]), wave[..., 1]], axis=-1)
    swing[:, :4] *= 0.2
    base = np.stack([turned(standing_directions(), 0.9 * np.sin(1.1 * t)) for t in time])
    return unit_vectors(base + swing)
