"""Posture prior: how people at work hold their arms and legs.

Joint limits alone leave most depth signs open. The posture says more and tells a pose from its
mirror image in depth: hands work before the body, elbows hang beside and behind it, a forward thigh
goes with a bent knee. The directions of a limb's two bones in the axes of the trunk, taken
together, have a mean and a covariance, which are tabled here over a dance, a kick at a ball,
jumping jacks with squats and a jog, a forward jump and a golf swing, all weighing the same (CMU
motion capture, mocap.cs.cmu.edu: 05_12, 10_06, 13_30, 13_32, 64_07), left limbs mirrored, spreads
widened by 0.2 for other people and unsure trunks. `python benchmarks/posture_table.py` prints the
tables. Heavy tails (Student) keep rare poses possible.
"""

from typing import Literal

import numpy as np
from jaxtyping import Float

_MEAN = {
    "arm": np.array([0.24, -0.74, 0.09, 0.02, -0.22, 0.51]),
    "leg": np.array([0.04, -0.81, 0.37, -0.01, -0.87, -0.33]),
}
"""Mean of the upper and the lower bone's direction: outward, up, forward of each."""

_COVARIANCE = {
    "arm": np.array(
        [
            [0.13, 0.00, -0.03, 0.04, 0.06, 0.02],
            [0.00, 0.18, 0.09, -0.05, 0.16, -0.05],
            [-0.03, 0.09, 0.19, -0.08, 0.16, -0.01],
            [0.04, -0.05, -0.08, 0.20, -0.07, 0.02],
            [0.06, 0.16, 0.16, -0.07, 0.45, 0.00],
            [0.02, -0.05, -0.01, 0.02, 0.00, 0.16],
        ]
    ),
    "leg": np.array(
        [
            [0.09, 0.02, -0.01, 0.03, 0.01, -0.01],
            [0.02, 0.11, 0.04, 0.00, -0.01, 0.02],
            [-0.01, 0.04, 0.13, 0.00, -0.02, 0.05],
            [0.03, 0.00, 0.00, 0.08, 0.00, 0.01],
            [0.01, -0.01, -0.02, 0.00, 0.06, -0.03],
            [-0.01, 0.02, 0.05, 0.01, -0.03, 0.11],
        ]
    ),
}
_PRECISION = {kind: np.linalg.inv(matrix) for kind, matrix in _COVARIANCE.items()}
_DEGREES_OF_FREEDOM = 8.0
"""Of the Student tails. Chosen on rendered sequences; see benchmarks/sensitivity.py."""


def posture_cost(
    upper: Float[np.ndarray, "*#n 3"],
    lower: Float[np.ndarray, "*#n 3"],
    axes: tuple[Float[np.ndarray, "*#n 3"], ...],
    kind: Literal["arm", "leg"],
) -> Float[np.ndarray, "..."]:
    """Cost of a limb's posture, nats: directions of its two bones by the trunk's axes.

    `axes`: outward on the limb's side, up, forward; they need not be at right angles.
    """
    parts = [(bone * axis).sum(-1) for bone in (upper, lower) for axis in axes]
    off = [part - mean for part, mean in zip(parts, _MEAN[kind], strict=True)]
    precision = _PRECISION[kind]
    squared = sum(
        (1 if i == j else 2) * precision[i, j] * off[i] * off[j]
        for i in range(6)
        for j in range(i, 6)
    )
    return 0.5 * (_DEGREES_OF_FREEDOM + 6) * np.log1p(squared / _DEGREES_OF_FREEDOM)
