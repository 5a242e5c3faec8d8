from bisect import bisect_left, bisect_right

import numpy as np
import pytest

from keyrecon.keyframes.coverage import (
    Neighborhoods,
    choose_greedily,
    measure_gains,
    total_cost,
    uncovered_cost,
)
from keyrecon.paper.keyframe_choice import choose_as_printed, printed_cost


def random_near(rng, n):
    """Frames near one another in time and in a pose that comes back."""
    pose = np.cumsum(rng.normal(size=(n, 2)), axis=0) * 0.3
    pose = np.sin(pose)
    apart = np.linalg.norm(pose[:, None] - pose[None], axis=-1)
    return apart < rng.uniform(0.1, 0.4)


def literal_eq2(represented):
    """Eq. 2 frame by frame, with represented frames just outside the sequence."""
    n = len(represented)
    inside = [-1, *np.flatnonzero(represented).tolist(), n]
    total = 0
    for i in range(n):
        before = inside[bisect_left(inside, i) - 1]
        after = inside[bisect_right(inside, i)]
        total += (i - before) + (after - i)
    return total


def literal_uncovered(represented, reach, shot=None):
    """Eq. 1 frame by frame; nothing is bridged from one shot to the next."""
    n, left = len(represented), 0
    shot = np.zeros(n) if shot is None else shot
    for i in range(n):
        before = [f for f in range(i) if represented[f] and shot[f] == shot[i]]
        after = [f for f in range(i + 1, n) if represented[f] and shot[f] == shot[i]]
        bridged = before and after and min(after) - max(before) <= reach
        left += not (represented[i] or bridged)
    return left


def test_squared_gaps_are_equation_2():
    rng = np.random.default_rng(0)
    for n in (1, 2, 17, 60):
        cost = printed_cost(n)
        constant = n + 1
        for share in (0, 0.05, 0.5, 1):
            represented = rng.random(n) < share
            assert total_cost(represented, cost) + constant == literal_eq2(represented)


def test_equation_2_of_several_shots_is_the_sum_of_those_of_each():
    rng = np.random.default_rng(3)
    lengths = np.array([13, 1, 4, 40, 1, 1, 20])
    shot, ends = np.repeat(np.arange(7), lengths), np.cumsum(lengths)[:-1]
    cost = printed_cost(80, shot)
    constants = set()
    for share in (0, 0.05, 0.1, 0.4, 0.8, 1):
        represented = rng.random(80) < share
        alone = sum(literal_eq2(part) for part in np.split(represented, ends))
        constants.add(alone - total_cost(represented, cost))
    assert len(constants) == 1


def test_gaps_count_uncovered_frames_as_equation_1_does():
    rng = np.random.default_rng(1)
    for n, reach in ((1, 3), (50, 4), (80, 10)):
        for share in (0, 0.1, 0.4, 1):
            represented = rng.random(n) < share
            counted = total_cost(represented, uncovered_cost(n, reach))
            assert counted == literal_uncovered(represented, reach)


def test_no_gap_is_bridged_from_one_shot_to_the_next():
    rng = np.random.default_rng(4)
    shot = np.repeat([0, 1, 2, 3], [13, 4, 40, 23])
    for share in (0, 0.1, 0.4, 1):
        represented = rng.random(80) < share
        counted = total_cost(represented, uncovered_cost(80, 10, shot=shot))
        assert counted == literal_uncovered(represented, 10, shot)
    ends = np.zeros(80, dtype=bool)
    ends[[0, 79]] = True
    even = 100 * np.arange(81)
    for cost in (uncovered_cost(80, 80, shot=shot), uncovered_cost(80, 80, even, shot)):
        assert total_cost(ends, cost) in (78, 7800)


@pytest.mark.parametrize(
    "make_cost",
    [
        printed_cost,
        lambda n: uncovered_cost(n, 6),
        lambda n: uncovered_cost(n, 6, shot=np.arange(n) // 17),
        lambda n: printed_cost(n, np.arange(n) // 17),
    ],
)
def test_gains_of_all_candidates_are_differences_of_the_total(make_cost):
    rng = np.random.default_rng(2)
    hoods = Neighborhoods.of_members(random_near(rng, 90))
    cost = make_cost(90)
    represented = hoods.union([3, 40])
    gain, added = measure_gains(hoods.without(represented), np.arange(90), represented, cost)
    for candidate in range(90):
        more = represented | hoods.union([candidate])
        assert gain[candidate] == total_cost(represented, cost) - total_cost(more, cost)
        assert added[candidate] == more.sum() - represented.sum()


def test_lazy_choice_is_the_exhaustive_one():
    for seed in range(6):
        rng = np.random.default_rng(seed)
        n, reach = 150, 5
        near = random_near(rng, n)
        chosen, represented = [], np.zeros(n, dtype=bool)
        while literal_uncovered(represented, reach) > 0.05 * n:
            totals = [literal_eq2(represented | near[k]) for k in range(n)]
            chosen.append(int(np.argmin(totals)))
            represented |= near[chosen[-1]]
        assert choose_as_printed(Neighborhoods.of_members(near), reach, int(0.05 * n), n) == chosen


def test_the_printed_choice_takes_every_shot_for_a_sequence_of_its_own():
    for seed in range(6):
        rng = np.random.default_rng(seed)
        n, reach = 150, 5
        lengths = np.array([30, 1, 49, 60, 10])
        shot, ends = np.repeat(np.arange(5), lengths), np.cumsum(lengths)[:-1]
        near = random_near(rng, n)
        np.fill_diagonal(near, True)
        near[30] = near[:, 30] = np.arange(n) == 30
        chosen, represented = [], np.zeros(n, dtype=bool)
        while literal_uncovered(represented, reach, shot) > 0:
            totals = [
                sum(literal_eq2(part) for part in np.split(represented | near[k], ends))
                for k in range(n)
            ]
            best = int(np.argmin(totals))
            if represented[near[best]].all():  # a shot of one frame has no distances in Eq. 2
                best = 30
            chosen.append(best)
            represented |= near[best]
        hoods = Neighborhoods.of_members(near)
        assert choose_as_printed(hoods, reach, 0, n, shot) == chosen


def test_equation_2_only_ever_gains_less_as_keyframes_are_added():
    rng = np.random.default_rng(7)
    hoods, cost = Neighborhoods.of_members(random_near(rng, 80)), printed_cost(80)
    few, more = hoods.union([5]), hoods.union([5, 30, 60])
    early, _ = measure_gains(hoods.without(few), np.arange(80), few, cost)
    late, _ = measure_gains(hoods.without(more), np.arange(80), more, cost)
    assert (late <= early).all()
    assert (late >= 0).all()


def test_choosing_for_coverage_takes_no_more_keyframes_than_the_printed_choice():
    taken = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        hoods = Neighborhoods.of_members(random_near(rng, 200))
        for_coverage = choose_greedily(hoods, 6, 10, 200, np.ones(200))
        taken.append((len(for_coverage), len(choose_as_printed(hoods, 6, 10, 200))))
    for_coverage, as_printed = np.sum(taken, axis=0)
    assert for_coverage < as_printed


def test_among_equal_candidates_the_clearer_frame_is_chosen():
    near = np.ones((5, 5), dtype=bool)
    visibility_score = np.array([0.1, 0.4, 0.2, 0.9, 0.3])
    assert choose_greedily(Neighborhoods.of_members(near), 3, 0, 5, visibility_score) == [3]
