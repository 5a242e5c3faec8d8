"""Key poses of tennis: ready stance, forehand, two-handed backhand and serve of a right-hander.

A pose says how pelvis and shoulders are turned, how the trunk leans, how deep the knees are bent
and where both wrists are. Wrists are given from the middle of the shoulder line in the axes of
the shoulders (right, up, forward), so a turn of the trunk takes the arms along, and poses
stay few. Times count from contact. Angles and timing follow the phases of the strokes as
described by Elliott, "Biomechanics and tennis", Br. J. Sports Med. 40 (2006).
"""

from dataclasses import astuple, dataclass

import numpy as np
from jaxtyping import Float

Place = tuple[float, float, float]


@dataclass(frozen=True)
class Pose:
    """One key pose; metres belong to a player of 1.75 m."""

    pelvis: float = 0.0
    """Turn of the pelvis to the right of the net, degrees."""
    shoulders: float = 0.0
    """Turn of the shoulders to the right of the net, degrees."""
    pitch: float = 17.0
    """Forward lean of the trunk, degrees."""
    roll: float = 0.0
    """Lean of the trunk to the right, degrees."""
    drop: float = 0.09
    """How far the pelvis is below standing straight."""
    right: float = 0.0
    """Weight shifted to the right of the middle of the stance."""
    ahead: float = 0.0
    """Weight shifted forward."""
    racket: Place = (0.10, -0.27, 0.37)
    """Wrist of the racket hand."""
    racket_elbow: Place = (0.8, -0.7, -0.3)
    """Where that elbow points."""
    free: Place = (-0.05, -0.24, 0.41)
    """Wrist of the other hand."""
    free_elbow: Place = (-0.8, -0.7, -0.3)

    def numbers(self) -> Float[np.ndarray, "C"]:
        """The pose as one vector: four angles, then lengths."""
        return np.hstack(astuple(self))


CHANNELS = len(Pose().numbers())
READY = Pose()
HOP = Pose(drop=-0.02)
LANDED = Pose(drop=0.17, pitch=21.0)

Stroke = tuple[tuple[float, Pose], ...]

FOREHAND: Stroke = (
    (-0.75, Pose(42.0, 66.0, 14.0, 0.0, 0.10, 0.05, 0.0, (0.22, -0.15, 0.36), (0.8, -0.6, -0.2),
                 (0.05, -0.12, 0.40), (-0.7, -0.7, 0.0))),
    (-0.42, Pose(58.0, 94.0, 12.0, 4.0, 0.17, 0.10, -0.04, (0.60, 0.08, -0.12), (0.6, -0.5, -0.6),
                 (0.12, -0.08, 0.47), (-0.5, -0.8, 0.1))),
    (-0.14, Pose(40.0, 72.0, 12.0, 5.0, 0.19, 0.08, 0.0, (0.60, -0.30, -0.22), (0.4, -0.6, -0.6),
                 (-0.25, -0.10, 0.43), (-0.7, -0.7, 0.0))),
    (0.0, Pose(6.0, 16.0, 13.0, 2.0, 0.13, 0.02, 0.06, (0.52, -0.26, 0.36), (0.6, -0.7, -0.3),
               (-0.36, -0.12, 0.25), (-0.8, -0.6, -0.2))),
    (0.13, Pose(-14.0, -20.0, 12.0, -2.0, 0.09, -0.02, 0.09, (0.14, 0.02, 0.49), (0.7, -0.7, 0.1),
                (-0.30, -0.06, 0.22), (-0.8, -0.6, -0.2))),
    (0.40, Pose(-34.0, -58.0, 11.0, -3.0, 0.09, -0.05, 0.10, (-0.26, 0.08, 0.22), (0.3, -0.4, 0.8),
                (-0.22, -0.12, 0.25), (-0.8, -0.6, -0.2))),
)  # fmt: skip

BACKHAND: Stroke = (
    (-0.75, Pose(-42.0, -62.0, 15.0, 0.0, 0.10, -0.05, 0.0, (-0.10, -0.22, 0.34), (0.7, -0.7, 0.0),
                 (-0.18, -0.18, 0.36), (-0.8, -0.6, -0.3))),
    (-0.42, Pose(-62.0, -102.0, 14.0, -3.0, 0.17, -0.10, -0.04, (-0.28, -0.18, 0.20),
                 (0.5, -0.8, 0.3), (-0.35, -0.12, 0.18), (-0.7, -0.5, -0.5))),
    (-0.15, Pose(-48.0, -78.0, 15.0, -4.0, 0.20, -0.06, 0.0, (-0.28, -0.37, 0.22),
                 (0.5, -0.8, 0.3), (-0.36, -0.34, 0.20), (-0.7, -0.4, -0.6))),
    (0.0, Pose(-16.0, -16.0, 16.0, -2.0, 0.14, 0.0, 0.07, (-0.04, -0.30, 0.44), (0.7, -0.7, 0.0),
               (-0.11, -0.27, 0.46), (-0.8, -0.6, -0.2))),
    (0.14, Pose(10.0, 24.0, 13.0, 1.0, 0.09, 0.03, 0.10, (0.18, -0.02, 0.45), (0.8, -0.5, 0.1),
                (0.11, 0.01, 0.47), (-0.6, -0.8, 0.1))),
    (0.40, Pose(36.0, 60.0, 11.0, 2.0, 0.09, 0.05, 0.10, (0.32, 0.13, 0.14), (0.9, -0.2, 0.4),
                (0.22, 0.15, 0.22), (-0.1, -0.6, 0.8))),
)  # fmt: skip

SERVE: Stroke = (
    (-2.7, Pose(58.0, 66.0, 8.0, 0.0, 0.03, 0.0, 0.0, (0.12, -0.30, 0.38), (0.8, -0.7, -0.3),
                (0.02, -0.28, 0.42), (-0.8, -0.7, -0.3))),
    (-1.9, Pose(60.0, 70.0, 12.0, 0.0, 0.05, 0.0, 0.06, (0.16, -0.46, 0.26), (0.8, -0.5, -0.5),
                (0.02, -0.44, 0.30), (-0.8, -0.5, -0.5))),
    (-1.35, Pose(64.0, 82.0, 6.0, 2.0, 0.07, 0.0, -0.05, (0.56, -0.34, -0.10), (0.4, -0.5, -0.7),
                 (-0.18, 0.00, 0.50), (-0.6, -0.8, 0.0))),
    (-0.95, Pose(68.0, 92.0, -2.0, 6.0, 0.13, 0.0, 0.0, (0.58, -0.02, -0.20), (0.5, -0.4, -0.8),
                 (-0.20, 0.48, 0.26), (-0.8, -0.2, 0.6))),
    (-0.52, Pose(70.0, 96.0, -10.0, 10.0, 0.24, 0.0, 0.10, (0.50, 0.22, -0.10), (0.7, -0.4, -0.6),
                 (-0.16, 0.54, 0.18), (-0.8, -0.2, 0.6))),
    (-0.17, Pose(42.0, 54.0, -6.0, -4.0, 0.02, 0.0, 0.20, (0.36, 0.14, -0.28), (0.8, 0.5, 0.2),
                 (-0.16, 0.24, 0.34), (-0.8, -0.5, 0.2))),
    (0.0, Pose(12.0, 4.0, 6.0, -16.0, -0.10, 0.0, 0.27, (0.32, 0.52, 0.18), (0.7, 0.3, 0.6),
               (-0.14, -0.18, 0.24), (-0.8, -0.6, 0.0))),
    (0.17, Pose(-12.0, -38.0, 26.0, -12.0, 0.02, 0.0, 0.32, (0.02, -0.04, 0.52), (0.8, -0.2, 0.5),
                (-0.20, -0.24, 0.20), (-0.8, -0.5, -0.3))),
    (0.42, Pose(-30.0, -64.0, 38.0, -4.0, 0.16, 0.0, 0.34, (-0.34, -0.40, 0.24), (0.5, -0.2, 0.8),
                (-0.22, -0.24, 0.12), (-0.8, -0.4, -0.5))),
)  # fmt: skip


def vary(stroke: Stroke, rng: np.random.Generator) -> list[tuple[float, np.ndarray]]:
    """The same stroke played again: a little slower or faster, larger or smaller, elsewhere."""
    tempo, size = rng.normal(1.0, 0.05), rng.normal(1.0, 0.06)
    offset = rng.normal(0, 1, CHANNELS) * _VARIATION
    varied = []
    for time, pose in stroke:
        numbers = pose.numbers() + offset + 0.35 * rng.normal(0, 1, CHANNELS) * _VARIATION
        numbers[:2] *= size
        varied.append((time * tempo, numbers))
    return varied


_VARIATION = np.array(
    [3.0, 3.0, 2.0, 2.0, 0.015, 0.015, 0.015, *[0.022] * 3, *[0.06] * 3, *[0.022] * 3, *[0.06] * 3]
)
"""Spread from stroke to stroke of one player, in the units of a pose's numbers."""
