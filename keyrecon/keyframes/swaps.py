"""Make a choice of keyframes better by swapping them one at a time, as k-medoids does.

A greedy choice is never reconsidered. Three moves repair that: drop a keyframe whose frames the
others cover; replace one by the candidate that leaves fewest frames uncovered, so that fewer
keyframes (or a smaller beta) suffice; and, with the coverage held, replace one by the candidate
that brings all frames nearest to their keyframes: keyframes move from the edge of the poses they
stand for to their middle, and away from blurred frames. The last is the swap phase of k-medoids
(Kaufman and Rousseeuw, "Finding Groups in Data", 1990), `add_medoids` its build phase.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.keyframes.coverage import (
    TIME_UNIT,
    GapCost,
    Neighborhoods,
    largest_gain,
    measure_gains,
    total_cost,
    uncovered_cost,
)

MAX_ROUNDS = 8
"""Times all keyframes are reconsidered at most; two or three usually change nothing more. A quarter
more or less, others with it: at most 0.9 points, 1.5 mm on four clips."""


@dataclass(frozen=True, eq=False)
class CoverageGoal:
    """What keyframes must cover."""

    hoods: Neighborhoods
    reach: int
    """T of the paper, frames."""
    max_uncovered_frames: int
    """(1 - alpha) of all frames."""
    visibility_score: Float[np.ndarray, "M"]
    """0-1: how well each candidate could be annotated."""
    elapsed: Int[np.ndarray, "ends"] | None = None
    """Time before each frame and at the end, hundredths of a frame, where it is measured in pose
    change (`pose_time`): of it, too, no more than (1 - alpha) may be left uncovered."""
    shot: Int[np.ndarray, "T"] | None = None
    """The shot of each frame: no gap is bridged from one to the next; None where there is one."""

    @property
    def max_uncovered_time(self) -> int:
        """The same in the units of `uncovered_time`."""
        return self.max_uncovered_frames * (1 if self.elapsed is None else TIME_UNIT)

    def uncovered_frames(self, represented: Bool[np.ndarray, "T"]) -> int:
        """How many frames are not covered (Eq. 1)."""
        return total_cost(represented, self.frame_cost())

    def uncovered_time(self, represented: Bool[np.ndarray, "T"]) -> int:
        """Measured time that is not covered, hundredths of a frame; frames without `elapsed`."""
        return total_cost(represented, self._time_cost())

    def reached(self, chosen: list[int]) -> bool:
        """Whether Eq. 1 holds, for frames and for measured time."""
        represented = self.hoods.union(chosen)
        enough = self.uncovered_time(represented) <= self.max_uncovered_time
        return enough and self.uncovered_frames(represented) <= self.max_uncovered_frames

    def excluding(self, uncoverable: int, coverage: float) -> "CoverageGoal":
        """The goal with `coverage` of the frames that can be covered at all.

        `uncoverable` is the `uncovered_time` with every candidate chosen.
        """
        unit = 1 if self.elapsed is None else TIME_UNIT
        frames = uncoverable / unit
        return replace(
            self, max_uncovered_frames=int(frames + (1 - coverage) * (self.hoods.n_frames - frames))
        )

    def frame_cost(self) -> GapCost:
        """What gaps cost where every frame counts alike."""
        return uncovered_cost(self.hoods.n_frames, self.reach, shot=self.shot)

    def _time_cost(self) -> GapCost:
        return uncovered_cost(self.hoods.n_frames, self.reach, self.elapsed, self.shot)

    def replacements(self, others: list[int]) -> tuple[Int[np.ndarray, "M"], Int[np.ndarray, "M"]]:
        """`uncovered_time` with each candidate beside `others`, and how many frames it adds."""
        return self._replacements(others, self._time_cost())

    def sufficient(self, others: list[int]) -> Bool[np.ndarray, "M"]:
        """Candidates beside `others` with which the goal is reached."""
        uncovered, _ = self.replacements(others)
        enough = uncovered <= self.max_uncovered_time
        if self.elapsed is not None:
            enough &= self._replacements(others, self.frame_cost())[0] <= self.max_uncovered_frames
        return enough

    def _replacements(
        self, others: list[int], cost: GapCost
    ) -> tuple[Int[np.ndarray, "M"], Int[np.ndarray, "M"]]:
        represented = self.hoods.union(others)
        gain, added = measure_gains(
            self.hoods.without(represented),
            np.arange(len(self.visibility_score)),
            represented,
            cost,
        )
        return total_cost(represented, cost) - gain, added


def drop_redundant(goal: CoverageGoal, chosen: list[int]) -> list[int]:
    """Fewer keyframes: the last chosen go first."""
    for candidate in reversed(chosen):
        others = [c for c in chosen if c != candidate]
        if goal.reached(others):
            chosen = others
    return chosen


def swap_for_coverage(goal: CoverageGoal, chosen: list[int]) -> list[int]:
    """As many keyframes that leave fewer frames uncovered; stops when the goal is reached."""
    chosen = list(chosen)
    uncovered = goal.uncovered_time(goal.hoods.union(chosen))
    for _ in range(MAX_ROUNDS):
        before = uncovered
        for place in range(len(chosen)):
            if uncovered <= goal.max_uncovered_time:
                return chosen
            uncovered_with, added = goal.replacements(chosen[:place] + chosen[place + 1 :])
            best = largest_gain(-uncovered_with, added, goal.visibility_score)
            if uncovered_with[best] < uncovered:
                chosen[place], uncovered = best, int(uncovered_with[best])
        if uncovered == before:
            break
    return chosen


def shrink_by_swaps(goal: CoverageGoal, chosen: list[int]) -> list[int]:
    """Fewer keyframes by dropping one and swapping the others, as long as that succeeds."""
    while len(chosen) > 1:
        others = [chosen[:place] + chosen[place + 1 :] for place in range(len(chosen))]
        least = min(others, key=lambda kept: goal.uncovered_time(goal.hoods.union(kept)))
        fewer = swap_for_coverage(goal, least)
        if not goal.reached(fewer):
            break
        chosen = fewer
    return chosen


def add_medoids(
    chosen: list[int],
    max_keyframes: int,
    distance: Float[np.ndarray, "M M"],
    weight: Float[np.ndarray, "M"],
) -> list[int]:
    """`max_keyframes` keyframes: each further one brings frames nearest to their keyframes."""
    chosen = list(chosen)
    while len(chosen) < min(max_keyframes, len(weight)):
        nearest = distance[chosen].min(axis=0, initial=np.inf)
        total = np.minimum(distance, nearest) @ weight
        total[chosen] = np.inf
        chosen.append(int(total.argmin()))
    return chosen


def swap_medoids(
    goal: CoverageGoal,
    chosen: list[int],
    distance: Float[np.ndarray, "M M"],
    weight: Float[np.ndarray, "M"],
) -> list[int]:
    """Keyframes nearer to the frames they stand for; the goal stays reached.

    distance(k, i) is what it costs that candidate k stands for row i, `weight` how many frames
    row i stands for, or how much time.
    """
    chosen = list(chosen)
    for _ in range(MAX_ROUNDS):
        changed = False
        for place, present in enumerate(chosen):
            others = chosen[:place] + chosen[place + 1 :]
            sufficient = goal.sufficient(others)
            sufficient[others] = False
            eligible = np.flatnonzero(sufficient)
            nearest = distance[others].min(axis=0, initial=np.inf)
            total = np.full(len(weight), np.inf, distance.dtype)
            total[eligible] = np.minimum(distance[eligible], nearest) @ weight
            best = int(total.argmin())
            if total[best] < total[present] * (1 - 1e-6):
                chosen[place], changed = best, True
        if not changed:
            break
    return chosen
