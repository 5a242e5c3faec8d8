"""Linear least squares over joints, many poses at once.

Every observation is a row that says where a weighted sum of joints should be, with a 2x2 weight:
strong along a normal and weak along the contour for an edge element, strong along the bone and
weaker across it for a limb's shape. Unknowns of one pose are x of all joints, then y.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float

DAMPING = 1e-9
"""Keeps a joint that nothing observes from making the equations singular."""


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Normal equations of P poses: `matrix` x = `right`."""

    matrix: Float[np.ndarray, "P N N"]
    right: Float[np.ndarray, "P N"]

    def __add__(self, other: "NormalEquations") -> "NormalEquations":
        """Both sets of observations."""
        return NormalEquations(self.matrix + other.matrix, self.right + other.right)

    def solve(self) -> Complex[np.ndarray, "P J"]:
        """Joints that fit best."""
        matrix = self.matrix + DAMPING * np.eye(self.right.shape[1])
        return joints_from_unknowns(np.linalg.solve(matrix, self.right[..., None])[..., 0])


def joints_from_unknowns(unknowns: Float[np.ndarray, "P N"]) -> Complex[np.ndarray, "P J"]:
    """x + iy of every joint."""
    half = unknowns.shape[1] // 2
    return unknowns[:, :half] + 1j * unknowns[:, half:]


def point_equations(
    joint_weights: Float[np.ndarray, "P R J"],
    target: Complex[np.ndarray, "P R"],
    axis: Complex[np.ndarray, "P R"],
    along: Float[np.ndarray, "P R"],
    across: Float[np.ndarray, "P R"],
) -> NormalEquations:
    """Rows joint_weights @ joints = target, weighted `along` the unit `axis` and `across` it."""
    cosine, sine = axis.real, axis.imag
    xx = along * cosine**2 + across * sine**2
    yy = along * sine**2 + across * cosine**2
    xy = (along - across) * cosine * sine
    transposed = joint_weights.transpose(0, 2, 1)
    block_xx = transposed @ (xx[..., None] * joint_weights)
    block_xy = transposed @ (xy[..., None] * joint_weights)
    block_yy = transposed @ (yy[..., None] * joint_weights)
    matrix = np.block([[block_xx, block_xy], [block_xy, block_yy]])
    right_x = (transposed @ (xx * target.real + xy * target.imag)[..., None])[..., 0]
    right_y = (transposed @ (xy * target.real + yy * target.imag)[..., None])[..., 0]
    return NormalEquations(matrix, np.concatenate([right_x, right_y], axis=1))


def joint_equations(
    target: Complex[np.ndarray, "P J"], weight: Float[np.ndarray, "P J"]
) -> NormalEquations:
    """Joints themselves, weighted alike in all directions."""
    count = target.shape[1]
    matrix = np.zeros((len(target), 2 * count, 2 * count))
    at = np.arange(count)
    matrix[:, at, at] = matrix[:, at + count, at + count] = weight
    return NormalEquations(
        matrix, np.concatenate([weight * target.real, weight * target.imag], axis=1)
    )
