"""Smooth paths through places that are seen or guessed."""

import numpy as np
import pytest

from keyrecon.tracking.smoothing import smooth_pairs, smooth_path


def test_the_smooth_path_solves_the_equations_written_out():
    generator = np.random.default_rng(3)
    places, weight = generator.normal(0, 5, (12, 2)), generator.uniform(0.1, 1, 12)
    second = np.diff(np.eye(12), 2, axis=0)
    expected = np.linalg.solve(np.diag(weight) + 7 * second.T @ second, weight[:, None] * places)
    assert smooth_path(places, weight, 7.0) == pytest.approx(expected)


def test_a_foot_that_moves_evenly_keeps_its_path():
    places = np.linspace((0, 0), (90, -30), 40)
    assert smooth_path(places, np.ones(40), 15.0) == pytest.approx(places, abs=1e-6)


def test_a_guess_gives_way_to_sure_places_before_and_after():
    places = np.zeros((60, 2, 2))
    places[:, 1] = 30, 0
    places[25:35, 0] = 0, 12
    cost = np.zeros((60, 2))
    cost[25:35, 0] = 2.0
    smooth = smooth_pairs(places, cost, 15.0)
    assert np.abs(smooth[25:35, 0, 1]).max() < 3
    assert smooth[:, 1] == pytest.approx(places[:, 1])


def test_certainty_goes_along_when_feet_change_places_in_their_pair():
    places = np.zeros((60, 2, 2))
    places[:, 1] = 30, 0
    places[25:35, 0] = 0, 12
    cost = np.zeros((60, 2))
    cost[25:35, 0] = 2.0
    swapped = places.copy(), cost.copy()
    for array in swapped:
        array[20:30] = array[20:30, ::-1].copy()
    assert smooth_pairs(*swapped, 15.0) == pytest.approx(smooth_pairs(places, cost, 15.0))


def test_frames_without_any_foot_are_bridged():
    places = np.stack([np.linspace((0, 0), (60, 0), 61), np.linspace((0, 9), (60, 9), 61)], axis=1)
    gone = places.copy()
    gone[20:40] = np.nan
    assert smooth_pairs(gone, np.zeros((61, 2)), 5.0) == pytest.approx(places, abs=1e-6)
