"""The cheapest path through a lattice of states, exactly, by dynamic programming (Viterbi, 1967).

A frame has any number of states. A path pays for each state that it takes and for each transition,
and the minimum over all paths is exact; of equally cheap ones it is that with the lowest indices.
Two extensions serve all users:

Skips. An edge may join frames up to `max_gap` apart and pays `skip_cost` for each frame between
them; a path may also start late and end early at that price. Without a skip cost every frame
takes a state.

Histories. The costs of a frame may have an axis for each of the last n frames, oldest first: a
state is then a history, and a transition drops its oldest entry and appends one. A second-order
chain, whose transitions look at three frames, is a chain of pairs. So are two chains a, b whose
states are chosen together: (a1, b1) -> (b1, a2) -> (a2, b2), which minimises over one at a time.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt

Transition = Callable[[int, int], np.ndarray]
"""(before, t) -> cost of the way from every state of one frame to every state of a later one, none
below zero. Its axes are those of the earlier frame and a last one for the state appended; an axis
that it does not depend on may have length 1."""


def find_cheapest_path(
    unary: Sequence[Float[np.ndarray, "..."]],
    transition: Transition,
    max_gap: int = 1,
    skip_cost: float = np.inf,
) -> Int[np.ndarray, "T"]:
    """State taken in each frame, -1 where none.

    With histories of n frames the first cost array stands for n frames, so that the path has
    n - 1 states more than there are arrays. Skips need histories of one frame.
    """
    frames, order = len(unary), max((cost.ndim for cost in unary), default=1)
    if order > 1 and max_gap > 1:
        raise ValueError("only a first-order path can skip frames")
    path = np.full(frames + order - 1, -1)
    recent: deque[np.ndarray] = deque(maxlen=max_gap)
    least = np.empty(frames)
    back: list[_Predecessors] = []
    cheapest, end = _times(frames, skip_cost), None
    for t, cost in enumerate(unary):
        arrival, predecessors = _arrive(cost.shape, recent, least, transition, t, skip_cost)
        total = arrival + cost
        least[t] = total.min(initial=np.inf)
        recent.appendleft(total)
        back.append(predecessors)
        ended = least[t] + _times(frames - 1 - t, skip_cost)
        if ended < cheapest:
            cheapest, end = ended, (t, np.unravel_index(total.argmin(), total.shape))
    while end is not None:
        t, state = end
        path[t : t + order] = state
        end = back[t].of(t, state)
    return path


def longest_gap(unary: Sequence[Float[np.ndarray, "_"]]) -> int:
    """Frames from one with a state that gains (cost below zero) to the next one, at most.

    A path that may not skip as many loses all on one side of a gap.
    """
    gaining = np.flatnonzero([cost.min(initial=0.0) < 0 for cost in unary])
    return int(np.diff(gaining).max(initial=1))


@dataclass(frozen=True, eq=False)
class _Predecessors:
    """Where the cheapest path to each state of a frame comes from."""

    step: UInt[np.ndarray, "*S"]
    """Frames back; 0 where the path starts here."""
    oldest: UInt[np.ndarray, "*S"]
    """The entry that the predecessor's history has and this one lacks."""

    def of(self, t: int, state: tuple[np.intp, ...]) -> tuple[int, tuple[np.intp, ...]] | None:
        """Frame and state before this one, None where the path starts."""
        step = int(self.step[state])
        return (t - step, (np.intp(self.oldest[state]), *state[:-1])) if step else None


def _arrive(
    shape: tuple[int, ...],
    recent: Sequence[np.ndarray],
    least: Float[np.ndarray, "T"],
    transition: Transition,
    t: int,
    skip_cost: float,
) -> tuple[Float[np.ndarray, "*S"], _Predecessors]:
    """Cheapest way to each state of frame t; `recent` has the totals of the frames before it, the
    last one first, `least` the least total of each frame."""
    best = np.full(shape, _times(t, skip_cost))
    step = np.zeros(shape, np.min_scalar_type(len(recent)))
    oldest = np.zeros(shape, np.min_scalar_type(max(map(len, recent), default=0)))
    dearest = _times(t, skip_cost) if best.size else -np.inf
    gaps = np.arange(1, len(recent) + 1)
    cheapest = least[t - gaps]
    cheapest[1:] += (gaps[1:] - 1) * skip_cost
    for gap in gaps[cheapest < dearest].tolist():
        if cheapest[gap - 1] >= dearest:
            continue  # no gap this long can be cheaper than the shorter ones are by now
        skipped = _times(gap - 1, skip_cost)
        through = recent[gap - 1][..., None] + transition(t - gap, t)
        if skipped:
            through += skipped
        last = through.argmin(axis=0)
        cost = through.min(axis=0)
        better = cost < best
        best = np.where(better, cost, best)
        dearest = best.max()
        step[better] = gap
        oldest[better] = last[better]
    return best, _Predecessors(step, oldest)


def _times(frames: int, cost: float) -> float:
    """Cost of some frames, nothing for none even where one costs infinitely much."""
    return frames * cost if frames else 0.0


def state_probabilities(
    unary: Sequence[Float[np.ndarray, "S"]], transition: Transition
) -> Float[np.ndarray, "T S"]:
    """Probability of each state of each frame, where costs are nats and all paths count.

    The sum-product twin of `find_cheapest_path` (forward-backward: Baum et al., 1970) for a chain
    in which every frame takes one of the same number of states.
    """
    frames = len(unary)
    ahead, back = -np.array(unary), np.zeros((frames, len(unary[0])))
    for t in range(1, frames):
        ahead[t] += np.logaddexp.reduce(ahead[t - 1][:, None] - transition(t - 1, t), axis=0)
        u = frames - 1 - t
        back[u] = np.logaddexp.reduce(back[u + 1] - unary[u + 1] - transition(u, u + 1), axis=1)
    return np.exp(ahead + back - np.logaddexp.reduce(ahead + back, axis=1, keepdims=True))


@dataclass(frozen=True)
class TransitionModel:
    """How points may move; all lengths in the unit of the positions."""

    sigma: float
    """Usual movement from one frame to the next."""
    max_gap: int
    """Longest gap that is bridged, frames."""
    max_cost: float = 8.0
    """Greatest cost of a movement: beyond it a jump is a jump."""
    skip_cost: float = 4.0
    """Cost of a frame without a state."""


def find_cheapest_track(
    unary: Sequence[Float[np.ndarray, "_"]],
    points: Sequence[Float[np.ndarray, "_ p 2"]],
    model: TransitionModel,
) -> Int[np.ndarray, "T"]:
    """The most consistent track through candidate points that are sometimes missing (Section 4.1).

    Frames g apart are joined at |p(t) - p(t - g)|^2 / (2 g sigma^2), at most `max_cost`, beside
    the price of what lies between: a player who was lost is remembered where last observed.
    Two points per candidate are an unordered pair: the cheaper assignment counts.
    """

    def transition(before: int, t: int) -> Float[np.ndarray, "l m"]:
        usual = 2 * (t - before) * model.sigma**2
        return np.minimum(_movement(points[before], points[t]) / usual, model.max_cost)

    return find_cheapest_path(unary, transition, model.max_gap, model.skip_cost)


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
