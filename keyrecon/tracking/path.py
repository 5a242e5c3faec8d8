"""From candidates to places in every frame: the cheapest path, and what lies between.

Paths are sought in stabilised coordinates, where a camera's own motion is undone, and gaps are
interpolated there too: a foot that stands still while the camera turns stays where it stands.
"""

import numpy as np
from jaxtyping import Float, Int

from keyrecon.camera import warp_points
from keyrecon.errors import KeyreconError


def stabilise(
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
    seen = np.flatnonzero(np.isfinite(places).reshape(len(places), -1).all(axis=1))
    if not len(seen):
        raise KeyreconError(
            "Neither a head nor two feet below it make a path through the video; pick the colours "
            "of head and shoes again, on another frame too."
        )
    known = keep_order(places[seen])
    columns = known.reshape(len(seen), -1).T
    between = [np.interp(wanted, numbers[seen], column) for column in columns]
    return np.stack(between, axis=1).reshape(len(wanted), *known.shape[1:])


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


def trust_states(
    costs: list[Float[np.ndarray, "_"]], chosen: Int[np.ndarray, "n"]
) -> Float[np.ndarray, "n"]:
    """How good the states of a path are, 0-1; 0 where it takes none."""
    taken = [c[s] if s >= 0 else np.inf for c, s in zip(costs, chosen, strict=True)]
    return np.exp(-0.5 * np.maximum(0.0, taken))
