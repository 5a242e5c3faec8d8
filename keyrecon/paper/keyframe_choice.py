"""The choice of keyframes as printed (Section 4.3, Eq. 2-4).

Eq. 2 sums the distance of every frame to the represented frames before and after it. With a gap
from frame l to frame r and virtual represented frames just outside the sequence this is (r - l)^2
per gap, less (r - l) at either end: minimising Eq. 2 is minimising the sum of squared gaps. That
objective is submodular (a gain never grows as the set does), hence lazy evaluation (Minoux 1978)
finds the very same keyframes as trying all candidates each time.
"""

from functools import partial

import numpy as np
from jaxtyping import Bool, Int

from keyrecon.keyframes.coverage import (
    GapCost,
    Gaps,
    Neighborhoods,
    measure_gains,
    total_cost,
    uncovered_cost,
)

LAZY_BATCH = 64
"""Candidates that lazy evaluation measures together; changes nothing but the time."""


def choose_as_printed(
    hoods: Neighborhoods, reach: int, uncovered: int, max_keyframes: int
) -> list[int]:
    """Eq. 2-4 as printed: the frame that lowers Eq. 2 most, until Eq. 1 holds.

    Lazy: a gain measured earlier bounds the present one from above, so only candidates whose
    bound could win are measured again. Ties go to the earliest frame.
    """
    cost = printed_cost(hoods.n_frames)
    left_over = uncovered_cost(hoods.n_frames, reach)
    bound = np.full(len(hoods.first) - 1, np.iinfo(np.int64).max)
    chosen: list[int] = []
    represented = np.zeros(hoods.n_frames, dtype=bool)
    while total_cost(represented, left_over) > uncovered and len(chosen) < max_keyframes:
        hoods = hoods.without(represented)
        best = _lazily_best(hoods, bound, represented, cost)
        if bound[best] <= 0:
            break
        chosen.append(best)
        represented[hoods.of(best)] = True
    return chosen


def printed_cost(n_frames: int) -> GapCost:
    """Eq. 2 in closed form, up to a constant."""
    return partial(_printed_gap, n_frames)


def _printed_gap(n_frames: int, left: Gaps, right: Gaps) -> Gaps:
    length = right - left
    return length * (length - (left < 0) - (right == n_frames))


def _lazily_best(
    open_frames: Neighborhoods,
    bound: Int[np.ndarray, "M"],
    represented: Bool[np.ndarray, "T"],
    cost: GapCost,
) -> int:
    """The earliest candidate of largest gain; tightens `bound` on the way."""
    fresh = np.zeros(len(bound), dtype=bool)
    while not fresh[best := int(bound.argmax())]:
        stale = np.flatnonzero(~fresh)
        top = stale[np.argsort(-bound[stale], kind="stable")[:LAZY_BATCH]]
        bound[top], _ = measure_gains(open_frames, top, represented, cost)
        fresh[top] = True
    return best
