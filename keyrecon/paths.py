"""The cheapest path through states that are sometimes missing, by dynamic programming (Viterbi).

A path pays for each state it takes, for moving from one to the next, and for frames it skips: an
edge may join frames up to `gap` apart and pays `miss` for each frame between them. Paths start and
end anywhere at `miss` per frame left out. The minimum over all such paths is exact.
"""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float, Int

Moving = Callable[[int, int], np.ndarray]
"""(before, t) -> cost of the way from every state of one frame to every state of a later one; none
below zero."""


def find_cheapest_path(
    costs: Sequence[Float[np.ndarray, "_"]], moving: Moving, gap: int, miss: float
) -> Int[np.ndarray, "T"]:
    """State taken in each frame, -1 where none; their number differs from frame to frame."""
    total: list[np.ndarray] = []
    came: list[np.ndarray] = []
    for t, own in enumerate(costs):
        best = np.full(len(own), t * miss)
        source = np.full((len(own), 2), -1)
        for g in range(1, min(gap, t) + 1):
            before = t - g
            if not len(own) or not len(total[before]):
                continue
            if total[before].min() + (g - 1) * miss >= best.max():
                continue  # no gap this long can be cheaper
            through = total[before][:, None] + moving(before, t) + (g - 1) * miss
            last = through.argmin(axis=0)
            cost = through[last, np.arange(len(own))]
            better = cost < best
            best = np.where(better, cost, best)
            source[better] = np.stack([np.full(len(last), before), last], axis=1)[better]
        total.append(best + own)
        came.append(source)
    return _trace_back(total, came, miss)


def _trace_back(
    total: list[np.ndarray], came: list[np.ndarray], miss: float
) -> Int[np.ndarray, "T"]:
    """Follow the cheapest path back from its end."""
    path = np.full(len(total), -1)
    ends = [
        (cost.min() + (len(total) - 1 - t) * miss, t) for t, cost in enumerate(total) if len(cost)
    ]
    if not ends or min(ends)[0] >= len(total) * miss:
        return path
    t = min(ends)[1]
    state = int(total[t].argmin())
    while t >= 0:
        path[t] = state
        t, state = came[t][state]
    return path
