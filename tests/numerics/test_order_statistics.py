"""Ranks found bit by bit are those of the sorted values."""

import numpy as np
import pytest

from keyrecon.numerics.order_statistics import value_of_rank


@pytest.mark.parametrize("count", [1, 2, 48, 255, 256, 300])
@pytest.mark.parametrize("shape", [(7, 5), (4, 3, 2), (11,)])
def test_sorting_gives_the_same(count, shape):
    rng = np.random.default_rng(count)
    values = rng.integers(0, 256, (count, *shape), dtype=np.uint8)
    values[:, 0] = rng.choice(np.array([0, 255], np.uint8), values[:, 0].shape)
    rank = rng.integers(0, count, shape)
    expected = np.take_along_axis(np.sort(values, axis=0), rank[None], axis=0)[0]
    assert (value_of_rank(values, rank) == expected).all()


def test_values_that_do_not_count_rank_last():
    values = np.array([[9], [1], [4], [2]], np.uint8)
    counts = np.array([[True], [False], [True], [True]])
    ranked = [int(value_of_rank(values, np.array([k]), counts)[0]) for k in range(4)]
    assert ranked == [2, 4, 9, 255]


def test_a_stack_of_many_blocks():
    rng = np.random.default_rng(0)
    values = rng.integers(0, 256, (40, 500, 300), dtype=np.uint8)
    rank = np.full((500, 300), 19)
    assert (value_of_rank(values, rank) == np.sort(values, axis=0)[19]).all()
