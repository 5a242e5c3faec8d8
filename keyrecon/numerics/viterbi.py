"""The cheapest path through states that are sometimes missing, by dynamic programming (Viterbi).

A path pays for each state it takes, for moving from one to the next, and for frames it skips: an
edge may join frames up to `gap` apart and pays `miss` for each frame between them. Paths start and
end anywhere at `miss` per frame left out. The minimum over all such paths is exact.

The most consistent path through candidates that are sometimes missing (Section 4.1).

States of a frame are candidates (one point each, or an unordered pair of feet). A path pays for
each state it takes, for movement, and for frames it skips: an edge may join frames up to `gap`
apart and costs

    |p(t) - p(t - g)|^2 / (2 g sigma^2), at most `jump`,   plus (g - 1) miss,

so that a player who was lost is remembered where they were last seen. Paths start and end
anywhere at `miss` per frame left out. Positions are given in stabilised coordinates, where a
camera's own motion is already undone. `keyrecon/paths.py` finds the cheapest path exactly.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

SkipTransitions = Callable[[int, int], np.ndarray]
"""(before, t) -> cost of the way from every state of one frame to every state of a later one; none
below zero."""


def find_cheapest_path(
    costs: Sequence[Float[np.ndarray, "_"]], moving: SkipTransitions, gap: int, miss: float
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


@dataclass(frozen=True)
class TransitionModel:
    """How a path may move; all lengths in the unit of the positions."""

    sigma: float
    """Usual movement from one frame to the next."""
    jump: float = 8.0
    """Greatest cost of a movement: beyond it a jump is a jump."""
    miss: float = 4.0
    """Cost of a frame without a state."""
    gap: int = 25
    """Longest gap that is bridged, frames."""


def cheapest_path(
    costs: Sequence[Float[np.ndarray, "_"]],
    points: Sequence[Float[np.ndarray, "_ p 2"]],
    motion: TransitionModel,
) -> Int[np.ndarray, "T"]:
    """State taken in each frame, -1 where none; m differs from frame to frame.

    Two points per state are an unordered pair: the cheaper assignment counts.
    """

    def moving(before: int, t: int) -> Float[np.ndarray, "l m"]:
        usual = 2 * (t - before) * motion.sigma**2
        return np.minimum(_movement(points[before], points[t]) / usual, motion.jump)

    return find_cheapest_path(costs, moving, motion.gap, motion.miss)


def _movement(
    before: Float[np.ndarray, "l p 2"], after: Float[np.ndarray, "m p 2"]
) -> Float[np.ndarray, "l m"]:
    """Mean squared movement of a state's points, under the cheaper assignment of a pair."""
    direct = _squares(before, after)
    if before.shape[1] == 1:
        return direct
    return np.minimum(direct, _squares(before, after[:, ::-1]))


def _squares(
    before: Float[np.ndarray, "l p 2"], after: Float[np.ndarray, "m p 2"]
) -> Float[np.ndarray, "l m"]:
    """Mean squared distance of corresponding points, as |a|^2 + |b|^2 - 2 a b."""
    a, b = before.reshape(len(before), -1), after.reshape(len(after), -1)
    square = (a * a).sum(axis=1)[:, None] + (b * b).sum(axis=1) - 2 * a @ b.T
    return np.maximum(square, 0.0) / before.shape[1]
