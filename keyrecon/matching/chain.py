"""Least squares along a chain of frames.

The unknowns are the joints of all frames. Each frame has observations of its own, and the second
difference of every joint is small. The matrix has blocks on three diagonals, so the work grows with
the number of frames only.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.linalg import solveh_banded

from keyrecon.matching.rows import DAMPING, Normals, joints_from_unknowns


@dataclass(frozen=True, eq=False)
class Chain:
    """Symmetric blocks (t, t), (t, t + 1), (t, t + 2) and right sides."""

    here: Float[np.ndarray, "T N N"]
    beside: Float[np.ndarray, "T N N"]
    beyond: Float[np.ndarray, "T N N"]
    right: Float[np.ndarray, "T N"]


def link_frames(alone: Normals, calm: Float[np.ndarray, "J"]) -> Chain:
    """Join observations of single frames and smoothness.

    `calm` is the spread of each joint's second difference, player heights.
    """
    here = alone.matrix.copy()
    beside, beyond = np.zeros_like(here), np.zeros_like(here)
    if len(here) > 2:
        weight = np.diag(np.tile(1 / calm**2, 2))
        here[:-2] += weight
        here[1:-1] += 4 * weight
        here[2:] += weight
        beside[:-2] -= 2 * weight
        beside[1:-1] -= 2 * weight
        beyond[:-2] += weight
    return Chain(here, beside, beyond, alone.right)


def solve_chain(chain: Chain) -> Complex[np.ndarray, "T J"]:
    """Joints of all frames."""
    count, size = chain.right.shape
    band = np.zeros((3 * size, count * size))
    row, column = np.indices((size, size))
    first = np.arange(count)[:, None] * size
    for ahead, blocks in enumerate((chain.here, chain.beside, chain.beyond)):
        below = ahead * size + column - row
        stored = below >= 0
        place, depth = first + row[stored], np.broadcast_to(below[stored], (count, stored.sum()))
        inside = place + depth < count * size
        band[depth[inside], place[inside]] = blocks[:, stored][inside]
    band[0] += DAMPING
    found = solveh_banded(band, chain.right.ravel(), lower=True, check_finite=False)
    return joints_from_unknowns(found.reshape(count, size))
