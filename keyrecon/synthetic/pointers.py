"""Where chest, face, feet and racket point, which the 14 joints do not say.

Knees and pelvis tell the toes, the trunk the face, the forearm and the speed of the hand the
racket. Near the floor a foot lies flat or stands on its toes, and never reaches below it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from keyrecon.body import LSP14

UP = np.array([0.0, 1.0, 0.0])
STATURE = 1.75
"""Metres; stature that sizes of the figure belong to."""
ANKLE_HEIGHT = 0.085
"""Metres from the sole to the ankle joint at that stature."""
FOOT_LENGTH = 0.17
"""Metres from the ankle to the toes along the floor at that stature."""


@dataclass(frozen=True, eq=False)
class Pointers:
    """Directions that joints do not tell; unit vectors in the world, and the stature."""

    front: Float[np.ndarray, "T 3"]
    """Out of the chest."""
    face: Float[np.ndarray, "T 3"]
    toes: Float[np.ndarray, "T 2 3"]
    """Right, left foot, from the ankle to the toes along the sole."""
    racket: Float[np.ndarray, "T 3"]
    """From the hand to the tip of the racket."""
    strings: Float[np.ndarray, "T 3"]
    """Normal of the racket face."""
    stature: float
    left_handed: bool


def joint(points: Float[np.ndarray, "*t J 3"], name: str) -> Float[np.ndarray, "*t 3"]:
    """One joint by name."""
    return points[..., LSP14.index(name), :]


def unit(vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """Vectors made of length 1."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)


def estimate_stature(points: Float[np.ndarray, "T 14 3"]) -> float:
    """Stature from the median lengths of both legs and of trunk and head, metres."""
    bones = LSP14.bones
    lengths = np.median(np.linalg.norm(points[:, bones[:, 0]] - points[:, bones[:, 1]], axis=-1), 0)
    return float(lengths.sum() / LSP14.lengths.sum())


def point_figure(
    points: Float[np.ndarray, "T 14 3"], fps: float, left_handed: bool = False
) -> Pointers:
    """Directions of chest, face, feet and racket for every frame of a motion in the world."""
    stature = estimate_stature(points)
    trunk = joint(points, "neck") - (joint(points, "right_hip") + joint(points, "left_hip")) / 2
    across = joint(points, "left_shoulder") - joint(points, "right_shoulder")
    front = unit(_smooth(np.cross(across, trunk), fps, 0.04))
    racket, strings = _point_racket(points, fps, left_handed, front)
    neck_to_top = unit(joint(points, "head_top") - joint(points, "neck"))
    face = front - 0.8 * (front * neck_to_top).sum(-1, keepdims=True) * neck_to_top
    toes = np.stack([_point_toes(points, fps, side, stature) for side in ("right", "left")], axis=1)
    return Pointers(
        front, unit(_smooth(face, fps, 0.08)), toes, racket, strings, stature, left_handed
    )


def _smooth(vectors: Float[np.ndarray, "T 3"], fps: float, seconds: float) -> np.ndarray:
    """Low-pass along time."""
    return gaussian_filter1d(vectors, max(seconds * fps, 1e-3), axis=0, mode="nearest")


def _point_toes(
    points: Float[np.ndarray, "T 14 3"], fps: float, side: str, stature: float
) -> Float[np.ndarray, "T 3"]:
    """Toes point where the knee bends to; near the floor the sole does not go below it."""
    hip, knee, ankle = (joint(points, f"{side}_{name}") for name in ("hip", "knee", "ankle"))
    pelvis = joint(points, "left_hip") - joint(points, "right_hip")
    ahead = unit(np.cross(pelvis, UP))
    shank, thigh = unit(ankle - knee), unit(knee - hip)
    bend = thigh - (thigh * shank).sum(-1, keepdims=True) * shank
    ahead = unit(ahead + 2.0 * bend)
    heading = _smooth(ahead * [1, 0, 1], fps, 0.06)
    heading = unit(heading)
    hanging = unit(ahead - (ahead * shank).sum(-1, keepdims=True) * shank + 0.35 * shank)
    scale = stature / STATURE
    height = ankle[:, 1] - np.percentile(ankle[:, 1], 5)
    drop = np.clip(height / (FOOT_LENGTH * scale), -0.2, 0.85)
    flat = heading * np.sqrt(1 - drop**2)[:, None] - UP * drop[:, None]
    lifted = np.clip((height / scale - 0.12) / 0.2, 0, 1)[:, None]
    return unit(_smooth(unit(flat * (1 - lifted) + hanging * lifted), fps, 0.02))


def _point_racket(
    points: Float[np.ndarray, "T 14 3"], fps: float, left_handed: bool, front: np.ndarray
) -> tuple[Float[np.ndarray, "T 3"], Float[np.ndarray, "T 3"]]:
    """The racket leans off the forearm, up at rest and behind the hand when it is fast."""
    side = "left" if left_handed else "right"
    wrist, elbow = joint(points, f"{side}_wrist"), joint(points, f"{side}_elbow")
    forearm = unit(wrist - elbow)
    velocity = np.gradient(_smooth(wrist, fps, 0.03), 1 / fps, axis=0)
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    lag = velocity / (speed + 4.0) * np.clip(speed / 4, 0, 1)
    lean = UP * (1 - np.clip(speed / 8, 0, 1)) + 0.3 * front
    lean = lean - 0.2 * fps * np.gradient(lag, axis=0)
    lean = lean - (lean * forearm).sum(-1, keepdims=True) * forearm
    racket = unit(_smooth(forearm + 0.8 * unit(lean), fps, 0.03))
    swing = velocity + 1.5 * front + 0.3 * UP
    swing = swing - (swing * racket).sum(-1, keepdims=True) * racket
    return racket, unit(_smooth(unit(swing), fps, 0.05))
