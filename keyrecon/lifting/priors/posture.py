"""How people at work carry their arms and legs: what tells a pose from its mirror image in depth.

Joint limits alone leave most depth signs open. How limbs are usually held says more: hands work
before the body, elbows hang beside and behind it, a forward thigh goes with a bent knee. The
directions of a limb's two bones in the axes of the trunk, taken together, have a mean and a
covariance, which are tabled here: rounded values over a dance, a kick at a ball, jumping jacks
with squats and a jog, a forward jump and a golf swing, all weighing the same (CMU
motion capture, mocap.cs.cmu.edu: 05_12, 10_06, 13_30, 13_32, 64_07), left limbs mirrored,
spreads widened by 0.2 for other people and unsure trunks. Heavy tails
(Student) keep rare poses possible.
"""

from typing import Literal

import numpy as np
from jaxtyping import Float

_USUAL = {
    "arm": np.array([0.23, -0.73, 0.09, 0.02, -0.22, 0.50]),
    "leg": np.array([0.04, -0.81, 0.40, 0.00, -0.88, -0.32]),
}
"""Mean of the upper and the lower bone's direction: outward, up, forward of each."""

_COVARIANCE = {
    "arm": np.array(
        [
            [0.15, 0.00, -0.03, 0.04, 0.06, 0.02],
            [0.00, 0.20, 0.08, -0.06, 0.17, -0.06],
            [-0.03, 0.08, 0.18, -0.08, 0.15, -0.01],
            [0.04, -0.06, -0.08, 0.20, -0.08, 0.02],
            [0.06, 0.17, 0.15, -0.08, 0.45, -0.01],
            [0.02, -0.06, -0.01, 0.02, -0.01, 0.16],
        ]
    ),
    "leg": np.array(
        [
            [0.08, 0.01, 0.00, 0.02, 0.00, -0.01],
            [0.01, 0.10, 0.05, 0.00, -0.01, 0.02],
            [0.00, 0.05, 0.12, 0.00, -0.02, 0.04],
            [0.02, 0.00, 0.00, 0.08, -0.01, 0.01],
            [0.00, -0.01, -0.02, -0.01, 0.06, -0.03],
            [-0.01, 0.02, 0.04, 0.01, -0.03, 0.11],
        ]
    ),
}
_PRECISION = {kind: np.linalg.inv(matrix) for kind, matrix in _COVARIANCE.items()}
_FREEDOM = 8.0
"""Degrees of freedom of the Student tails."""


def posture_cost(
    upper: Float[np.ndarray, "*#n 3"],
    lower: Float[np.ndarray, "*#n 3"],
    axes: tuple[Float[np.ndarray, "*#n 3"], ...],
    kind: Literal["arm", "leg"],
) -> Float[np.ndarray, "..."]:
    """How unusual a limb is, nats: directions of its two bones by the trunk's axes.

    `axes`: outward on the limb's side, up, forward; they need not be at right angles.
    """
    parts = [(bone * axis).sum(-1) for bone in (upper, lower) for axis in axes]
    off = [part - usual for part, usual in zip(parts, _USUAL[kind], strict=True)]
    precision = _PRECISION[kind]
    squared = sum(
        (1 if i == j else 2) * precision[i, j] * off[i] * off[j]
        for i in range(6)
        for j in range(i, 6)
    )
    return 0.5 * (_FREEDOM + 6) * np.log1p(squared / _FREEDOM)
