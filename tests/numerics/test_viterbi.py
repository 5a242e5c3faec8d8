from itertools import pairwise, product

import numpy as np
import pytest

from keyrecon.numerics.viterbi import TransitionModel, cheapest_path


def cost_of(path, costs, points, motion):
    """Cost of a path, state or -1 per frame, written down as the module docstring tells it."""
    taken = [t for t, s in enumerate(path) if s >= 0]
    if not taken:
        return len(path) * motion.miss
    total = taken[0] * motion.miss + (len(path) - 1 - taken[-1]) * motion.miss
    total += sum(costs[t][path[t]] for t in taken)
    for before, after in pairwise(taken):
        g = after - before
        if g > motion.gap:
            return np.inf
        a, b = points[before][path[before]], points[after][path[after]]
        square = ((a - b) ** 2).sum(axis=-1).mean()
        if len(a) == 2:
            square = min(square, ((a - b[::-1]) ** 2).sum(axis=-1).mean())
        total += min(square / (2 * g * motion.sigma**2), motion.jump) + (g - 1) * motion.miss
    return total


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("members", [1, 2])
def test_the_path_is_as_cheap_as_exhaustive_search_finds(seed, members):
    generator = np.random.default_rng(seed)
    counts = generator.integers(0, 4, 6)
    costs = [generator.uniform(0, 6, n) for n in counts]
    points = [generator.uniform(0, 10, (n, members, 2)) for n in counts]
    motion = TransitionModel(sigma=2.0, jump=6.0, miss=2.5, gap=3)
    found = cost_of(cheapest_path(costs, points, motion), costs, points, motion)
    every = product(*(range(-1, n) for n in counts))
    assert found == pytest.approx(min(cost_of(p, costs, points, motion) for p in every))


def test_a_lost_player_is_remembered_where_they_were_last_seen():
    near, far = np.array([[[0.0, 0.0]]]), np.array([[[90.0, 0.0]]])
    empty = np.zeros((0, 1, 2))
    both = np.concatenate([far, near])
    points = [near, near, empty, empty, both, both]
    path = cheapest_path([np.zeros(len(p)) for p in points], points, TransitionModel(sigma=1.0))
    assert path.tolist() == [0, 0, -1, -1, 1, 1]


def test_feet_that_swap_their_order_have_not_moved():
    pair = np.array([[[0.0, 0.0], [5.0, 0.0]]])
    points = [pair, pair[:, ::-1], pair]
    costs = [np.array([1.0])] * 3
    assert cheapest_path(costs, points, TransitionModel(sigma=0.1, miss=2.0)).tolist() == [0, 0, 0]


def test_without_candidates_there_is_no_path():
    empty = np.zeros((0, 1, 2))
    path = cheapest_path([np.zeros(0)] * 4, [empty] * 4, TransitionModel(sigma=1.0))
    assert path.tolist() == [-1] * 4
