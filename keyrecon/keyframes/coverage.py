"""Greedy choice of keyframes whose neighbourhoods cover a sequence (Section 4.3, Eq. 1-4).

W, the frames that a set of keyframes represents, cuts time into gaps. Both objectives here are
sums over the gaps:

- as printed (Eq. 2), the summed distance of every frame to the represented frames before and
  after it. With a gap from frame l to frame r and virtual represented frames just outside the
  sequence this is (r - l)^2 per gap, less (r - l) at either end: minimising Eq. 2 is minimising
  the sum of squared gaps;
- uncovered frames, those in gaps longer than T or at the ends: what Eq. 1 counts.

So the gain of a candidate is a sum over the gaps that its frames fall in, and all candidates
are measured by a few array operations. The printed objective is submodular (a gain never grows
as the set does), hence lazy evaluation (Minoux 1978) finds the very same keyframes as trying
all candidates each time.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.numerics.ragged import ranges

LAZY_BATCH = 64
"""Candidates that lazy evaluation measures together."""

Gaps = Int[np.ndarray, "P"]
GapCost = Callable[[Gaps, Gaps], Gaps]
"""Cost of the gaps between represented frames `left` and `right`, -1 and T at the ends."""


def printed_cost(n_frames: int) -> GapCost:
    """Eq. 2 in closed form, up to a constant."""

    def cost(left: Gaps, right: Gaps) -> Gaps:
        length = right - left
        return length * (length - (left < 0) - (right == n_frames))

    return cost


def uncovered_cost(n_frames: int, reach: int) -> GapCost:
    """Frames that are neither represented nor in a gap of at most `reach` (Eq. 1)."""

    def cost(left: Gaps, right: Gaps) -> Gaps:
        bridged = (left >= 0) & (right < n_frames) & (right - left <= reach)
        return (right - left - 1) * ~bridged

    return cost


@dataclass(frozen=True, eq=False)
class Neighborhoods:
    """w(k): the frames that each candidate represents."""

    first: Int[np.ndarray, "ends"]
    """Where each candidate's frames start in `frame`, and the end of the last."""
    frame: Int[np.ndarray, "P"]
    """Frame numbers, ascending within each candidate."""
    n_frames: int

    def of(self, candidate: int) -> Int[np.ndarray, "p"]:
        """Frames that one candidate represents."""
        return self.frame[self.first[candidate] : self.first[candidate + 1]]

    def union(self, candidates: list[int]) -> Bool[np.ndarray, "T"]:
        """W: frames that any of the candidates represents."""
        represented = np.zeros(self.n_frames, dtype=bool)
        for candidate in candidates:
            represented[self.of(candidate)] = True
        return represented

    def without(self, represented: Bool[np.ndarray, "T"]) -> "Neighborhoods":
        """The same, less frames that need no more attention."""
        kept = ~represented[self.frame]
        first = np.concatenate([[0], np.cumsum(kept)])[self.first]
        return Neighborhoods(first, self.frame[kept], self.n_frames)


def total_cost(represented: Bool[np.ndarray, "T"], cost: GapCost) -> int:
    """Sum of the costs of all gaps."""
    edges = np.concatenate([[-1], np.flatnonzero(represented), [len(represented)]])
    return int(cost(edges[:-1], edges[1:]).sum())


def measure_gains(
    open_frames: Neighborhoods,
    candidates: Int[np.ndarray, "m"],
    represented: Bool[np.ndarray, "T"],
    cost: GapCost,
) -> tuple[Int[np.ndarray, "m"], Int[np.ndarray, "m"]]:
    """By how much each candidate lowers the cost, and how many frames it adds to W.

    `open_frames` must hold no represented frame.
    """
    count = open_frames.first[candidates + 1] - open_frames.first[candidates]
    frame = open_frames.frame[ranges(open_frames.first[candidates], count)]
    owner = np.repeat(np.arange(len(candidates)), count)
    before, after = _bounds(represented)
    left, right = before[frame], after[frame]
    follows = np.zeros(len(frame), dtype=bool)
    follows[1:] = (owner[1:] == owner[:-1]) & (left[1:] == left[:-1])
    closes = np.ones(len(frame), dtype=bool)
    closes[:-1] = ~follows[1:]
    previous = np.where(follows, np.roll(frame, 1), left)
    change = -cost(previous, frame)
    change[closes] += cost(left[closes], right[closes]) - cost(frame[closes], right[closes])
    gain = np.bincount(owner, change, minlength=len(candidates))
    return gain.round().astype(np.int64), count


def _bounds(
    represented: Bool[np.ndarray, "T"],
) -> tuple[Int[np.ndarray, "T"], Int[np.ndarray, "T"]]:
    """The represented frames next before and after each frame; -1 and T where there is none."""
    n = len(represented)
    index = np.arange(n)
    before = np.maximum.accumulate(np.where(represented, index, -1))
    after = np.minimum.accumulate(np.where(represented, index, n)[::-1])[::-1]
    return before, after


def choose_greedily(
    hoods: Neighborhoods, reach: int, uncovered: int, most: int, tie: Float[np.ndarray, "M"]
) -> list[int]:
    """Candidates that each bridge or represent the most further frames, at most `most`.

    Stops when at most `uncovered` frames are left. Among equals the one that represents most
    wins, then the one with the largest `tie` (0-1).
    """
    cost = uncovered_cost(hoods.n_frames, reach)
    everyone = np.arange(len(tie))
    chosen: list[int] = []
    represented = np.zeros(hoods.n_frames, dtype=bool)
    while total_cost(represented, cost) > uncovered and len(chosen) < most:
        hoods = hoods.without(represented)
        gain, added = measure_gains(hoods, everyone, represented, cost)
        if not added.any():
            break
        best = largest_gain(gain, added, tie)
        chosen.append(best)
        represented[hoods.of(best)] = True
    return chosen


def largest_gain(
    gain: Int[np.ndarray, "M"], added: Int[np.ndarray, "M"], tie: Float[np.ndarray, "M"]
) -> int:
    """Position of the largest gain, then the largest number added, then the largest tie."""
    equals = np.flatnonzero(gain == gain.max())
    equals = equals[added[equals] == added[equals].max()]
    return int(equals[tie[equals].argmax()])


def choose_as_printed(hoods: Neighborhoods, reach: int, uncovered: int, most: int) -> list[int]:
    """Eq. 2-4 as printed: the frame that lowers Eq. 2 most, until Eq. 1 holds.

    Lazy: a gain measured earlier bounds the present one from above, so only candidates whose
    bound could win are measured again. Ties go to the earliest frame.
    """
    cost = printed_cost(hoods.n_frames)
    left_over = uncovered_cost(hoods.n_frames, reach)
    bound = np.full(len(hoods.first) - 1, np.iinfo(np.int64).max)
    chosen: list[int] = []
    represented = np.zeros(hoods.n_frames, dtype=bool)
    while total_cost(represented, left_over) > uncovered and len(chosen) < most:
        hoods = hoods.without(represented)
        best = _lazily_best(hoods, bound, represented, cost)
        if bound[best] <= 0:
            break
        chosen.append(best)
        represented[hoods.of(best)] = True
    return chosen


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
