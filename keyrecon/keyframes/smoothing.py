"""Average a distance matrix over frames that show the same pose (Section 4.2).

Frames i and j with C(i, j) < beta almost surely show the same pose, so that their rows (and
columns) differ by noise alone. With P(i, k) = 1 / |N_i| for the frames N_i closer than beta to
i, rows and columns are averaged by D = P C P^T. A frame's distance to itself stays 0.
"""

from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.sparse import csr_matrix

MIN_DENSE_SHARE = 0.1
"""Share of neighbours above which a dense product is faster than a sparse one. A quarter more or
less, others with it: at most 1.8 points, 1.2 mm on four clips."""


def smooth_distances(
    matched: Float[np.ndarray, "M M"],
    beta: float,
    form: Literal["both", "mean"] = "both",
) -> Float[np.ndarray, "M M"]:
    """D from C: rows then columns averaged ('both'), or (P C + C P^T) / 2 ('mean')."""
    averaging = _averaging(matched, beta)
    rows = averaging @ matched
    smoothed = (averaging @ rows.T).T if form == "both" else (rows + rows.T) / 2
    smoothed = (smoothed + smoothed.T) / 2
    np.fill_diagonal(smoothed, 0)
    return smoothed


def _averaging(
    matched: Float[np.ndarray, "M M"], beta: float
) -> csr_matrix | Float[np.ndarray, "M M"]:
    """P: each row gives equal weight to a frame's neighbours, itself among them."""
    near = matched < beta
    np.fill_diagonal(near, True)
    share = 1 / near.sum(axis=1, keepdims=True).astype(matched.dtype)
    if near.mean() > MIN_DENSE_SHARE:
        return near * share
    row, column = np.nonzero(near)
    return csr_matrix((share[row, 0], (row, column)), shape=near.shape)
