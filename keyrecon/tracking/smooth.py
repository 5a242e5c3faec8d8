"""A smooth path through places that are sure in some frames and guessed in others.

A foot that is hidden for a moment, or whose shoe hardly shows, is guessed frame by frame, and the
guesses jump. Whittaker's smoother (Proc. Edinburgh Math. Soc. 41, 1923; Eilers, Anal. Chem. 75,
2003) weighs every place y_t by how sure it is and asks for little acceleration,

    min_x  sum_t w_t |x_t - y_t|^2 + r sum_t |x_(t-1) - 2 x_t + x_(t+1)|^2,

so that guesses give way to the sure places before and after them. r = (fps / (2 pi f))^4 halves
what moves at the frequency f where places are sure.
"""

import numpy as np
from jaxtyping import Float
from scipy.linalg import solveh_banded

from keyrecon.tracking.path import interpolate

SURENESS = 3.0
"""A place counts by the power of this of the probability that its cost tells."""
LEAST_WEIGHT = 1e-4
"""Places count at least this much, which keeps the equations solvable."""


def smooth_pairs(
    places: Float[np.ndarray, "T p 2"], cost: Float[np.ndarray, "T p"], stiffness: float
) -> Float[np.ndarray, "T p 2"]:
    """Smooth paths of several points, each near its predecessor; NaN where a frame has none.

    `cost` is -log of the probability of each place.
    """
    frames = np.arange(len(places))
    known = np.concatenate([places, cost[..., None]], axis=2)
    filled = interpolate(known, frames, frames)
    weight = np.exp(-SURENESS * filled[..., 2])
    weight[np.isnan(places).any(axis=(1, 2))] = 0.0
    paths = [smooth_path(filled[:, k, :2], weight[:, k], stiffness) for k in range(places.shape[1])]
    return np.stack(paths, axis=1)


def smooth_path(
    places: Float[np.ndarray, "n 2"], weight: Float[np.ndarray, "n"], stiffness: float
) -> Float[np.ndarray, "n 2"]:
    """Places with little acceleration near those that weigh much; `stiffness` is r."""
    count = len(places)
    if count < 3:
        return places
    sure = np.maximum(weight, LEAST_WEIGHT)
    bend = np.zeros((3, count))  # upper bands of D^T D, D the second difference
    for first, second in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)):
        product = (1, -2, 1)[first] * (1, -2, 1)[second]
        bend[2 - (second - first), second : second + count - 2] += product
    bands = stiffness * bend
    bands[2] += sure
    return solveh_banded(bands, sure[:, None] * places)
