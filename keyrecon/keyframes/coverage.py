"""Greedy choice of keyframes whose neighbourhoods cover a sequence (Section 4.3, Eq. 1).

W, the frames that a set of keyframes represents, cuts time into gaps, and what Eq. 1 counts, the
uncovered frames in gaps longer than T or at the ends, is a sum over them (as is the printed
objective, Eq. 2: see `paper/keyframe_choice.py`). So the gain of a candidate is a sum over the
gaps that its frames fall in, and all candidates are measured by a few array operations.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.numerics.ragged import ranges

Gaps = Int[np.ndarray, "P"]
GapCost = Callable[[Gaps, Gaps], Gaps]
"""Cost of the gaps between represented frames `left` and `right`, -1 and T at the ends; of a gap
without frames it is the same everywhere between the ends."""


def uncovered_cost(
    n_frames: int,
    reach: int,
    elapsed: Int[np.ndarray, "ends"] | None = None,
    shot: Int[np.ndarray, "T"] | None = None,
) -> GapCost:
    """Frames that are neither represented nor in a gap of at most `reach` (Eq. 1).

    With `elapsed`, the time before each frame and at the end in hundredths of a frame, frames count
    for the time that they take, and a gap is bridged that is no longer than `reach` in that time
    either. With `shot`, the number of the shot of each frame, none is bridged from one shot to the
    next: nothing moves on there.
    """
    # the ends of the video as shots of their own, from which nothing is bridged either
    number = np.zeros(n_frames, dtype=np.int64) if shot is None else shot
    shots = np.concatenate([number, [-1, -2]])
    if elapsed is None:
        return partial(_open_frames, reach, shots)
    return partial(_open_time, reach, shots, elapsed)


def _open_frames(reach: int, shots: Int[np.ndarray, "S"], left: Gaps, right: Gaps) -> Gaps:
    bridged = _in_one_shot(shots, left, right) & (right - left <= reach)
    return (right - left - 1) * ~bridged


def _open_time(
    reach: int,
    shots: Int[np.ndarray, "S"],
    elapsed: Int[np.ndarray, "ends"],
    left: Gaps,
    right: Gaps,
) -> Gaps:
    inside = elapsed[right] - elapsed[left + 1]
    short = (right - left <= reach) & (inside <= (reach - 1) * TIME_UNIT)
    return inside * ~(_in_one_shot(shots, left, right) & short)


def _in_one_shot(shots: Int[np.ndarray, "S"], left: Gaps, right: Gaps) -> Bool[np.ndarray, "P"]:
    """Whether both ends of a gap lie in one shot; -1 and T, the ends of the video, in none."""
    same: Bool[np.ndarray, "P"] = shots[left] == shots[right]
    return same


TIME_UNIT = 100
"""Of measured time, per frame: costs stay whole numbers, of which equal ones are found."""


@dataclass(frozen=True, eq=False)
class Neighborhoods:
    """w(k): the frames that each candidate represents, as runs of consecutive ones.

    Poses change slowly, so that a candidate represents some ten frames in a row: of hours of video
    there are far fewer runs than frames.
    """

    first: Int[np.ndarray, "ends"]
    """Where each candidate's runs begin in `start`, and the end of the last."""
    start: Int[np.ndarray, "P"]
    """First frames of the runs, ascending within each candidate."""
    stop: Int[np.ndarray, "P"]
    """The frames after their last ones."""
    n_frames: int

    @staticmethod
    def of_members(member: Bool[np.ndarray, "m T"]) -> "Neighborhoods":
        """Those of candidates of whom each row says which frames they represent."""
        count, n_frames = member.shape
        padded = np.zeros((count, n_frames + 2), dtype=bool)
        padded[:, 1:-1] = member
        owner, edge = np.nonzero(padded[:, 1:] != padded[:, :-1])
        runs = np.bincount(owner, minlength=count) // 2
        return Neighborhoods(_ends(runs), edge[0::2], edge[1::2], n_frames)

    def of(self, candidate: int) -> Int[np.ndarray, "p"]:
        """Frames that one candidate represents."""
        runs = slice(self.first[candidate], self.first[candidate + 1])
        return ranges(self.start[runs], self.stop[runs] - self.start[runs])

    def only(self, candidates: Int[np.ndarray, "m"]) -> "Neighborhoods":
        """Those of some candidates, numbered anew."""
        count = self.first[candidates + 1] - self.first[candidates]
        runs = ranges(self.first[candidates], count)
        return Neighborhoods(_ends(count), self.start[runs], self.stop[runs], self.n_frames)

    def union(self, candidates: list[int]) -> Bool[np.ndarray, "T"]:
        """W: frames that any of the candidates represents."""
        represented = np.zeros(self.n_frames, dtype=bool)
        runs = self.only(np.array(candidates, dtype=np.int64))
        represented[ranges(runs.start, runs.stop - runs.start)] = True
        return represented

    def without(self, represented: Bool[np.ndarray, "T"]) -> "Neighborhoods":
        """The same, less frames that are represented already."""
        still_open = Neighborhoods.of_members(~represented[None])
        before = np.searchsorted(still_open.stop, self.start, side="right")
        after = np.searchsorted(still_open.start, self.stop, side="left")
        parts = after - before
        gap, run = ranges(before, parts), np.repeat(np.arange(len(parts)), parts)
        return Neighborhoods(
            first=_ends(parts)[self.first],
            start=np.maximum(self.start[run], still_open.start[gap]),
            stop=np.minimum(self.stop[run], still_open.stop[gap]),
            n_frames=self.n_frames,
        )


def join_neighborhoods(parts: list[Neighborhoods]) -> Neighborhoods:
    """Those of one group of candidates after the other."""
    counts = [np.diff(part.first) for part in parts]
    return Neighborhoods(
        _ends(np.concatenate(counts)),
        np.concatenate([part.start for part in parts]),
        np.concatenate([part.stop for part in parts]),
        parts[0].n_frames,
    )


def _ends(count: Int[np.ndarray, "m"]) -> Int[np.ndarray, "ends"]:
    """Where lists of so many begin end to end, and the end of the last."""
    return np.concatenate([[0], np.cumsum(count)])


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
    runs = ranges(open_frames.first[candidates], count)
    start, last = open_frames.start[runs], open_frames.stop[runs] - 1
    owner = np.repeat(np.arange(len(candidates)), count)
    before, after = _bounds(represented)
    left, right = before[start], after[start]
    follows = np.zeros(len(start), dtype=bool)
    follows[1:] = (owner[1:] == owner[:-1]) & (left[1:] == left[:-1])
    closes = np.ones(len(start), dtype=bool)
    closes[:-1] = ~follows[1:]
    previous = np.where(follows, np.roll(last, 1), left)
    change = -cost(previous, start) - (last - start) * cost(start, start + 1)
    change[closes] += cost(left[closes], right[closes]) - cost(last[closes], right[closes])
    gain = np.bincount(owner, change, minlength=len(candidates))
    added = np.bincount(owner, last - start + 1, minlength=len(candidates))
    return gain.round().astype(np.int64), added.astype(np.int64)


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
    hoods: Neighborhoods,
    reach: int,
    max_uncovered: int,
    max_keyframes: int,
    tie: Float[np.ndarray, "M"],
    elapsed: Int[np.ndarray, "ends"] | None = None,
    shot: Int[np.ndarray, "T"] | None = None,
) -> list[int]:
    """Candidates that each bridge or represent the most further frames, at most `max_keyframes`.

    Stops when at most `max_uncovered` frames (with `elapsed`: hundredths of a frame of measured
    time) are uncovered.
    Among equals the one that represents most wins, then the one with the largest `tie` (0-1).
    """
    cost = uncovered_cost(hoods.n_frames, reach, elapsed, shot)
    everyone = np.arange(len(tie))
    chosen: list[int] = []
    represented = np.zeros(hoods.n_frames, dtype=bool)
    while total_cost(represented, cost) > max_uncovered and len(chosen) < max_keyframes:
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
