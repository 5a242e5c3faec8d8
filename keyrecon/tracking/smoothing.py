"""Places in every frame from the states of a path: gaps interpolated, weak detections smoothed.

Gaps are interpolated in stabilised coordinates, where a camera's own motion is undone: a foot that
stands still while the camera turns stays where it stands.

A foot that is occluded for a moment, or whose shoe hardly shows, is placed frame by frame with
little confidence, and its places jump. Whittaker's smoother (Proc. Edinburgh Math. Soc. 41, 1923;
Eilers, Anal. Chem. 75, 2003) weighs every place y_t by its probability and asks for little
acceleration,

    min_x  sum_t w_t |x_t - y_t|^2 + r sum_t |x_(t-1) - 2 x_t + x_(t+1)|^2,

so that uncertain places give way to certain ones before and after them. r = (fps / (2 pi f))^4
halves what moves at the frequency f where places are certain.
"""

import numpy as np
from jaxtyping import Float, Int

from keyrecon.errors import KeyreconError
from keyrecon.numerics.banded_least_squares import (
    second_difference_bands,
    solve_banded,
    upper_form,
)
from keyrecon.numerics.geometry import warp_points

CERTAINTY_POWER = 3.0
"""A place counts by the power of this of the probability that its cost tells. Halved, others with
it: at most 0.7 points, 0.2 mm on one clip."""
MIN_WEIGHT = 1e-4
"""Places count at least this much, which keeps the equations solvable. Halved: the same bits on one
clip."""


def to_reference_frame(
    places: list[Float[np.ndarray, "_ 2"]], to_reference: Float[np.ndarray, "n 3 3"]
) -> list[Float[np.ndarray, "_ 2"]]:
    """Places of each frame in the coordinates of the reference frame."""
    return [warp_points(path, p) for path, p in zip(to_reference, places, strict=True)]


def taken_states(
    states: list[Float[np.ndarray, "_ *d"]], chosen: Int[np.ndarray, "n"]
) -> Float[np.ndarray, "n *d"]:
    """The states that a path takes, or anything known of them; NaN where it takes none."""
    taken = np.full((len(chosen), *states[0].shape[1:]), np.nan)
    for t in np.flatnonzero(chosen >= 0):
        taken[t] = states[t][chosen[t]]
    return taken


def fill_gaps(
    stable: Float[np.ndarray, "n p 2"],
    numbers: Int[np.ndarray, "n"],
    from_reference: Float[np.ndarray, "T 3 3"],
) -> Float[np.ndarray, "T p 2"]:
    """Places in the pictures of all frames, from stabilised ones at some of them.

    Each of several points stays near its predecessor. Between known frames, and where a place is
    NaN, places are interpolated linearly.
    """
    placed = interpolate(stable, numbers, np.arange(len(from_reference)))
    return warp_points(from_reference[:, None], placed)


def interpolate(
    places: Float[np.ndarray, "n p d"], numbers: Int[np.ndarray, "n"], wanted: Int[np.ndarray, "T"]
) -> Float[np.ndarray, "T p d"]:
    """Values at the wanted frames, linear between those that are known, and held beyond them."""
    known = np.flatnonzero(np.isfinite(places).reshape(len(places), -1).all(axis=1))
    if not len(known):
        raise KeyreconError(
            "Neither a head nor two feet below it make a path through the video; pick the colours "
            "of head and shoes again, on another frame too."
        )
    ordered = keep_order(places[known])
    columns = ordered.reshape(len(known), -1).T
    between = [np.interp(wanted, numbers[known], column) for column in columns]
    return np.stack(between, axis=1).reshape(len(wanted), *ordered.shape[1:])


def keep_order(places: Float[np.ndarray, "n p d"]) -> Float[np.ndarray, "n p d"]:
    """Swap the members of each pair so that each stays near its predecessor.

    The first two of `d` values are the place; others go along.
    """
    both = places.copy()
    for t in range(1, len(both)):
        here, before = both[t, :, :2], both[t - 1, :, :2]
        direct = np.linalg.norm(here - before, axis=1).sum()
        if np.linalg.norm(here[::-1] - before, axis=1).sum() < direct:
            both[t] = both[t, ::-1].copy()
    return both


def state_confidence(
    costs: list[Float[np.ndarray, "_"]], chosen: Int[np.ndarray, "n"]
) -> Float[np.ndarray, "n"]:
    """How good the states of a path are, 0-1; 0 where it takes none."""
    taken = [c[s] if s >= 0 else np.inf for c, s in zip(costs, chosen, strict=True)]
    return np.exp(-0.5 * np.maximum(0.0, taken))


def smooth_pairs(
    places: Float[np.ndarray, "T p 2"], cost: Float[np.ndarray, "T p"], stiffness: float
) -> Float[np.ndarray, "T p 2"]:
    """Smooth paths of several points, each near its predecessor; NaN where a frame has none.

    `cost` is -log of the probability of each place.
    """
    frames = np.arange(len(places))
    known = np.concatenate([places, cost[..., None]], axis=2)
    filled = interpolate(known, frames, frames)
    weight = np.exp(-CERTAINTY_POWER * filled[..., 2])
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
    weight = np.maximum(weight, MIN_WEIGHT)
    bands = stiffness * second_difference_bands(count)
    bands[0] += weight
    return solve_banded(upper_form(bands), weight[:, None] * places, lower=False)
