from itertools import pairwise, product

import numpy as np
import pytest

from keyrecon.numerics.viterbi import (
    TransitionModel,
    find_cheapest_path,
    find_cheapest_track,
    state_probabilities,
)


def cost_of(path, unary, points, model):
    """Cost of a path, state or -1 per frame, written down as the docstrings tell it."""
    taken = [t for t, s in enumerate(path) if s >= 0]
    if not taken:
        return len(path) * model.skip_cost
    total = (taken[0] + len(path) - 1 - taken[-1]) * model.skip_cost
    total += sum(unary[t][path[t]] for t in taken)
    for before, after in pairwise(taken):
        g = after - before
        if g > model.max_gap:
            return np.inf
        a, b = points[before][path[before]], points[after][path[after]]
        square = ((a - b) ** 2).sum(axis=-1).mean()
        if len(a) == 2:
            square = min(square, ((a - b[::-1]) ** 2).sum(axis=-1).mean())
        total += min(square / (2 * g * model.sigma**2), model.max_cost)
        total += (g - 1) * model.skip_cost
    return total


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("members", [1, 2])
def test_a_track_is_as_cheap_as_exhaustive_search_finds(seed, members):
    generator = np.random.default_rng(seed)
    counts = generator.integers(0, 4, 6)
    unary = [generator.uniform(0, 6, n) for n in counts]
    points = [generator.uniform(0, 10, (n, members, 2)) for n in counts]
    model = TransitionModel(sigma=2.0, max_cost=6.0, skip_cost=2.5, max_gap=3)
    cost = cost_of(find_cheapest_track(unary, points, model), unary, points, model)
    every = product(*(range(-1, n) for n in counts))
    assert cost == pytest.approx(min(cost_of(p, unary, points, model) for p in every))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("order", [1, 2, 3])
def test_chains_of_any_order_are_as_cheap_as_exhaustive_search_finds(seed, order):
    generator = np.random.default_rng(seed)
    counts = generator.integers(1, 4, 6)
    histories = [counts[t : t + order] for t in range(len(counts) - order + 1)]
    unary = [generator.uniform(-1, 1, history) for history in histories]
    steps = {t: generator.uniform(0, 1, counts[t - 1 : t + order]) for t in range(1, len(unary))}

    def price(path):
        total = sum(c[tuple(path[t : t + order])] for t, c in enumerate(unary))
        return total + sum(s[tuple(path[t - 1 : t + order])] for t, s in steps.items())

    path = find_cheapest_path(unary, lambda _, t: steps[t])
    assert price(path) == pytest.approx(min(price(p) for p in product(*map(range, counts))))


def test_of_equally_cheap_paths_the_one_with_the_lowest_states_is_taken():
    path = find_cheapest_path([np.zeros(3)] * 4, lambda _, t: np.zeros((3, 3)))
    assert path.tolist() == [0, 0, 0, 0]


def test_without_a_skip_cost_every_frame_takes_a_state():
    unary = [np.array([0.0, 9.0]), np.array([1e6, 1e6]), np.zeros(2)]
    assert (find_cheapest_path(unary, lambda _, t: np.zeros((2, 2))) >= 0).all()


def test_a_path_of_histories_cannot_skip_frames():
    with pytest.raises(ValueError, match="first-order"):
        find_cheapest_path([np.zeros((2, 2))] * 3, lambda _, t: np.zeros((2, 2, 2)), 2)


def test_a_lost_player_is_remembered_where_last_observed():
    near, far = np.array([[[0.0, 0.0]]]), np.array([[[90.0, 0.0]]])
    empty = np.zeros((0, 1, 2))
    both = np.concatenate([far, near])
    points = [near, near, empty, empty, both, both]
    unary = [np.zeros(len(p)) for p in points]
    path = find_cheapest_track(unary, points, TransitionModel(sigma=1.0, max_gap=25))
    assert path.tolist() == [0, 0, -1, -1, 1, 1]


def test_feet_that_swap_their_order_have_not_moved():
    pair = np.array([[[0.0, 0.0], [5.0, 0.0]]])
    points = [pair, pair[:, ::-1], pair]
    model = TransitionModel(sigma=0.1, max_gap=25, skip_cost=2.0)
    assert find_cheapest_track([np.array([1.0])] * 3, points, model).tolist() == [0, 0, 0]


def test_without_candidates_there_is_no_path():
    empty = np.zeros((0, 1, 2))
    model = TransitionModel(sigma=1.0, max_gap=25)
    path = find_cheapest_track([np.zeros(0)] * 4, [empty] * 4, model)
    assert path.tolist() == [-1] * 4


def test_probabilities_of_states_are_those_of_all_paths_together():
    generator = np.random.default_rng(3)
    unary = list(generator.uniform(0, 3, (5, 3)))
    steps = generator.uniform(0, 3, (5, 3, 3))
    expected = np.zeros((5, 3))
    for path in product(range(3), repeat=5):
        cost = sum(unary[t][s] for t, s in enumerate(path))
        cost += sum(steps[t][path[t - 1], path[t]] for t in range(1, 5))
        expected[np.arange(5), path] += np.exp(-cost)
    expected /= expected.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(state_probabilities(unary, lambda _, t: steps[t]), expected)
