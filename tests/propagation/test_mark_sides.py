"""Marks that call the one limb by the other's name."""

import numpy as np
import pytest

from keyrecon.propagation.mark_sides import (
    RIGHT_FOR_EACH_EXCHANGED,
    _exchange_gains,
    exchange_evidence,
)

MARKED = np.array([3, 10, 17, 29, 36])
APART = np.full(40, 20.0)
"""Limbs that never meet: a change of names costs 20 nats anywhere."""


def crossed_on(*frames):
    return np.isin(np.arange(41), frames)


def path_cost(name, between):
    """What the changes of names from mark to mark cost."""
    return between[name[1:] != name[:-1]].sum()


def test_what_an_exchange_saves_is_the_difference_of_two_paths(rng=np.random.default_rng(3)):
    for _ in range(20):
        name, between = rng.random(6) < 0.5, rng.exponential(5.0, 5)
        gains = _exchange_gains(name, between)
        for mark in range(6):
            flipped = name ^ (np.arange(6) == mark)
            saved = path_cost(name, between) - path_cost(flipped, between)
            assert gains[mark] == pytest.approx(saved)


@pytest.mark.parametrize("wrong", [3, 17, 36])
def test_the_one_mark_that_limbs_would_have_to_jump_for_is_in_doubt(wrong):
    found = exchange_evidence(crossed_on(wrong), APART, MARKED)
    assert np.flatnonzero(found > 0).tolist() == [wrong]
    jumps = 1 if wrong in MARKED[[0, -1]] else 2
    assert found[wrong] == pytest.approx(20.0 * jumps)
    assert np.flatnonzero(found).tolist() == MARKED.tolist()


def test_two_wrong_marks_are_both_in_doubt_and_those_between_them_are_not():
    found = exchange_evidence(crossed_on(10, 29), APART, MARKED)
    assert np.flatnonzero(found > 0).tolist() == [10, 29]


def test_right_marks_are_confirmed():
    for crossed in (crossed_on(), crossed_on(*MARKED)):  # which thread is which is not known
        found = exchange_evidence(crossed, APART, MARKED)
        np.testing.assert_allclose(found[MARKED], [-20, -40, -40, -40, -20])


def test_where_limbs_meet_on_both_sides_of_a_mark_little_is_said_of_it():
    cost = APART.copy()
    cost[[12, 20]] = 0.5
    assert exchange_evidence(crossed_on(17), cost, MARKED)[17] == pytest.approx(1.0)
    assert exchange_evidence(crossed_on(), cost, MARKED)[17] == pytest.approx(-1.0)


def test_a_mark_in_little_doubt_leaves_those_beside_it_in_theirs():
    for nats in (0.9, 1.1):
        cost = np.full(40, np.log(RIGHT_FOR_EACH_EXCHANGED) * nats / 2)
        found = exchange_evidence(crossed_on(17), cost, MARKED)
        beside = found[[10, 29]]
        np.testing.assert_allclose(beside, 0 if nats < 1 else -2 * cost[0], atol=1e-12)


def test_few_marks_tell_nothing():
    assert not exchange_evidence(crossed_on(), APART, np.array([], dtype=int)).any()
    assert not exchange_evidence(crossed_on(3), APART, MARKED[:1]).any()
