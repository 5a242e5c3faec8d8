"""Least squares along a chain of frames whose second differences are small.

With D the second-difference operator, the smoothness penalty |D x|^2 puts D'D into the normal
equations: blocks on the diagonal (t, t) and on the two beside it, (t, t + 1) and (t, t + 2). The
matrix stays banded, one banded Cholesky factorisation solves it (LAPACK pbsv), and the work grows
with the number of frames only.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.linalg import solveh_banded

STENCIL = (1, -2, 1)
"""Of the second difference."""


def add_second_differences(
    diagonals: Sequence[Float[np.ndarray, "T *n"]], weight: float | Float[np.ndarray, "..."] = 1.0
) -> None:
    """Add D' `weight` D to the main, first and second diagonal, in place.

    `weight`: one, one for each column (*n), or one for each second difference too (T - 2, *n).
    Entry t of diagonal k couples frames t and t + k; the last k entries are not used. Fewer than
    three frames have no second difference.
    """
    count = len(diagonals[0])
    for first in range(3):
        for second in range(first, 3):
            couples = diagonals[second - first][first : first + max(count - 2, 0)]
            couples += STENCIL[first] * STENCIL[second] * weight


def second_difference_bands(count: int) -> Float[np.ndarray, "3 T"]:
    """Main, first and second diagonal of D'D for a chain of `count` frames."""
    bands = np.zeros((3, count))
    add_second_differences(list(bands))
    return bands


def apply_bands(
    bands: Float[np.ndarray, "3 T *m"], values: Float[np.ndarray, "T *n"]
) -> Float[np.ndarray, "T *n"]:
    """The symmetric matrix of these diagonals times `values`.

    The diagonals are the same for all columns of `values`, or each column has its own.
    """
    bands = bands.reshape(*bands.shape, *[1] * (values.ndim + 1 - bands.ndim))
    result = bands[0] * values
    for offset in (1, 2):
        band = bands[offset][:-offset]
        result[:-offset] += band * values[offset:]
        result[offset:] += band * values[:-offset]
    return result


def band_from_blocks(
    diagonals: Sequence[Float[np.ndarray, "T N N"]], rows: int
) -> Float[np.ndarray, "w n"]:
    """A symmetric block matrix in scipy's lower banded form, unknowns ordered frame by frame.

    Block t of diagonal k holds the coupling of frame t (rows) with frame t + k (columns); of the
    main diagonal the upper triangles are read. `rows` is the width of the band: the main diagonal
    and all below it that are not zero.
    """
    count, size, _ = diagonals[0].shape
    band = np.zeros((rows, count, size))
    for ahead, blocks in enumerate(diagonals):
        for row in range(size):
            first = row if ahead == 0 else 0
            last = min(size, rows - ahead * size + row)
            below = ahead * size - row
            part = blocks[: max(count - ahead, 0), row, first:last]
            band[below + first : below + last, : max(count - ahead, 0), row] = part.T
    return band.reshape(rows, count * size)


def upper_form(bands: Float[np.ndarray, "w n"]) -> Float[np.ndarray, "w n"]:
    """The same diagonals in scipy's upper banded form: the main one last, entry t under t + k."""
    upper = np.zeros_like(bands)
    width, count = bands.shape
    for offset in range(min(width, count)):
        upper[width - 1 - offset, offset:] = bands[offset, : count - offset]
    return upper


def solve_banded(
    band: Float[np.ndarray, "w n"], right: Float[np.ndarray, "n *k"], lower: bool = True
) -> Float[np.ndarray, "n *k"]:
    """Solve a symmetric positive definite system in banded form.

    Both forms hold the same matrix; their factorisations differ in the last digits.
    """
    return solveh_banded(band, right, lower=lower, check_finite=False)
