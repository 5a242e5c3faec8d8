"""The gain in coverage of each mark: keyframes in greedy order (Section 4.3).

Chosen keyframes cover a video together, and in no order. A person who marks one after the other
wants the one first that covers most, then the one that adds most to it, and to know what one more
than were asked for would add. Greedy choice among the chosen tells the first, a look at all
candidates the second.
"""

import numpy as np
from jaxtyping import Int

from keyrecon.keyframes.coverage import measure_gains, total_cost
from keyrecon.keyframes.swaps import CoverageGoal
from keyrecon.records import MarkGains, PoseDistances


def order_by_gain(
    goal: CoverageGoal, beta: float, comparison: PoseDistances, keyframes: Int[np.ndarray, "K"]
) -> MarkGains:
    """Keyframes by what they add to the coverage of `goal`, whose neighbourhoods `beta` made."""
    n_frames = goal.hoods.n_frames
    cost = goal.frame_cost()
    rows = comparison.row[keyframes]
    hoods = goal.hoods.only(rows)
    represented = np.zeros(n_frames, dtype=bool)
    open_ones = np.arange(len(keyframes))
    order: list[int] = []
    coverage: list[float] = []
    while len(open_ones):
        left = hoods.without(represented)
        gain, added = measure_gains(left, open_ones, represented, cost)
        best = int(open_ones[np.lexsort((-added, -gain))[0]])
        represented[hoods.of(best)] = True
        represented[keyframes[best]] = True
        order.append(best)
        coverage.append(1 - total_cost(represented, cost) / n_frames)
        open_ones = open_ones[open_ones != best]
    everyone = np.arange(len(comparison.frames))
    gain, _ = measure_gains(goal.hoods.without(represented), everyone, represented, cost)
    return MarkGains(
        beta=beta,
        order=keyframes[np.array(order, dtype=np.int64)],
        coverage=np.array(coverage),
        next_gain=float(max(gain.max(), 0)) / n_frames,
    )
