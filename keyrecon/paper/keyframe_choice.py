"""The choice of keyframes as printed (Section 4.3, Eq. 2-4).

Eq. 2 sums the distance of every frame to the represented frames before and after it. With a gap
from frame l to frame r and virtual represented frames just outside the sequence this is (r - l)^2
per gap, less (r - l) at either end, up to a constant: minimising Eq. 2 is minimising the sum of
squared gaps, those at the ends by so much less. That objective is submodular (a gain never grows as
the set does), hence lazy evaluation (Minoux 1978) finds the very same keyframes as trying all
candidates each time. Every shot is a sequence with ends of its own.
"""

from dataclasses import dataclass
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
    hoods: Neighborhoods,
    reach: int,
    max_uncovered: int,
    max_keyframes: int,
    shot: Int[np.ndarray, "T"] | None = None,
) -> list[int]:
    """Eq. 2-4 as printed: the frame that lowers Eq. 2 most, until Eq. 1 holds.

    `shot` numbers the shot of each frame from 0; None is one shot. Lazy: a gain measured earlier
    bounds the present one from above, so only candidates whose bound could win are measured again.
    Ties go to the earliest frame. A shot of one frame adds nothing to Eq. 2 whether it is
    represented or not, so it is last.
    """
    cost = printed_cost(hoods.n_frames, shot)
    cost_of_uncovered = uncovered_cost(hoods.n_frames, reach, shot=shot)
    bound = np.full(len(hoods.first) - 1, np.iinfo(np.int64).max)
    chosen: list[int] = []
    represented = np.zeros(hoods.n_frames, dtype=bool)
    while (
        total_cost(represented, cost_of_uncovered) > max_uncovered and len(chosen) < max_keyframes
    ):
        hoods = hoods.without(represented)
        best = _lazily_best(hoods, bound, represented, cost)
        if bound[best] <= 0:
            if not len(hoods.start):
                break
            best = int(np.argmax(np.diff(hoods.first) > 0))
        chosen.append(best)
        represented[hoods.of(best)] = True
    return chosen


def printed_cost(n_frames: int, shot: Int[np.ndarray, "T"] | None = None) -> GapCost:
    """Eq. 2 in closed form, up to a constant; `shot` numbers the shot of each frame from 0."""
    number = np.zeros(n_frames, dtype=np.int64) if shot is None else shot
    return partial(_printed_gap, _ShotEnds.of(number))


@dataclass(frozen=True, eq=False)
class _ShotEnds:
    """Where shots begin and end; frames -1 and T, the ends of the video, in none of them."""

    number: Int[np.ndarray, "n"]
    """Shot of each frame; of T the number of shots S, of -1 (the last entry) -1."""
    before: Int[np.ndarray, "ends"]
    """The virtual frame before each shot, and T."""
    after: Int[np.ndarray, "ends"]
    """The virtual frame after each shot, and -1."""
    unrepresented: Int[np.ndarray, "ends"]
    """Cost of all shots before each one, and of all, when nothing is represented in them."""

    @staticmethod
    def of(number: Int[np.ndarray, "T"]) -> "_ShotEnds":
        """Those of shots whose numbers every frame has."""
        first = np.flatnonzero(np.diff(number, prepend=-1))
        frames, shots = len(number), len(first)
        length = np.diff(first, append=frames)
        return _ShotEnds(
            np.concatenate([number, [shots, -1]]),
            np.concatenate([first - 1, [frames]]),
            np.concatenate([first + length, [-1]]),
            np.concatenate([[0], np.cumsum((length + 1) * (length - 1))]),
        )


def _printed_gap(ends: _ShotEnds, left: Gaps, right: Gaps) -> Gaps:
    """What a gap costs: one from shot to shot is one at the end of each, with all between.

    Each cut in it costs one more, as neighbours within a shot do: all sums have as many.
    """
    one, other = ends.number[left], ends.number[right]
    tail, head = ends.after[one] - left, right - ends.before[other]
    between = ends.unrepresented[other] - ends.unrepresented[one + 1]
    cuts = np.minimum(other, len(ends.before) - 2) - np.maximum(one, 0)
    across = tail * (tail - 1) + between + head * (head - 1) + cuts
    inside: Gaps = np.where(one == other, (right - left) ** 2, across)
    return inside


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
