"""Marks that call the one limb by the other's name."""

import numpy as np
import pytest

from keyrecon.propagation.mark_sides import (
    RIGHT_FOR_EACH_EXCHANGED,
    _exchange_gains,
    exchange_confidence,
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
def test_the_one_mark_that_limbs_would_have_to_jump_for_is_named(wrong):
    found = exchange_confidence(crossed_on(wrong), APART, MARKED)
    assert np.flatnonzero(found).tolist() == [wrong]
    assert found[wrong] > 0.99


def test_two_wrong_marks_are_both_named_and_those_between_them_are_not():
    found = exchange_confidence(crossed_on(10, 29), APART, MARKED)
    assert np.flatnonzero(found).tolist() == [10, 29]


def test_right_marks_are_not_named():
    assert not exchange_confidence(crossed_on(), APART, MARKED).any()
    everywhere = exchange_confidence(crossed_on(*MARKED), APART, MARKED)
    assert not everywhere.any()  # only threads without a name are told


def test_where_limbs_meet_on_both_sides_of_a_mark_nothing_is_said_of_it():
    price = APART.copy()
    price[[12, 20]] = 0.5
    assert not exchange_confidence(crossed_on(17), price, MARKED).any()


def test_odds_have_to_outweigh_that_most_marks_are_right():
    for nats, named in ((0.9, False), (1.1, True)):
        price = np.full(40, np.log(RIGHT_FOR_EACH_EXCHANGED) * nats / 2)
        assert exchange_confidence(crossed_on(17), price, MARKED).any() == named


def test_few_marks_tell_nothing_or_which_of_two():
    assert not exchange_confidence(crossed_on(), APART, np.array([], dtype=int)).any()
    assert not exchange_confidence(crossed_on(3), APART, MARKED[:1]).any()
