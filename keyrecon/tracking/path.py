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


def taken_places(
    places: list[Float[np.ndarray, "_ p 2"]], chosen: Int[np.ndarray, "n"]
) -> Float[np.ndarray, "n p 2"]:
    """The states that a path takes; NaN where it takes none."""
    points = next(p.shape[1] for p in places)
    taken = np.full((len(chosen), points, 2), np.nan)
    for t in np.flatnonzero(chosen >= 0):
        taken[t] = places[t][chosen[t]]
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
    seen = np.flatnonzero(np.isfinite(stable).all(axis=(1, 2)))
    if not len(seen):
        raise KeyreconError(
            "Neither a head nor two feet below it make a path through the video; pick the colours "
            "of head and shoes again, on another frame too."
        )
    known = keep_order(stable[seen]).reshape(len(seen), -1)
    every = np.arange(len(from_reference))
    between = [np.interp(every, numbers[seen], column) for column in known.T]
    placed = np.stack(between, axis=1).reshape(len(every), -1, 2)
    return warp_points(from_reference[:, None], placed)


def keep_order(places: Float[np.ndarray, "n p 2"]) -> Float[np.ndarray, "n p 2"]:
    """Swap the members of each pair so that each stays near its predecessor."""
    both = places.copy()
    for t in range(1, len(both)):
        direct = np.linalg.norm(both[t] - both[t - 1], axis=1).sum()
        if np.linalg.norm(both[t][::-1] - both[t - 1], axis=1).sum() < direct:
            both[t] = both[t][::-1]
    return both


def trust_states(
    costs: list[Float[np.ndarray, "_"]], chosen: Int[np.ndarray, "n"]
) -> Float[np.ndarray, "n"]:
    """How good the states of a path are, 0-1; 0 where it takes none."""
    taken = [c[s] if s >= 0 else np.inf for c, s in zip(costs, chosen, strict=True)]
    return np.exp(-0.5 * np.maximum(0.0, taken))
