"""The printed descent: where it ends, and what it says."""

import numpy as np

from keyrecon.paper.gradient_descent import descend, low_pass


def wave(frames=80):
    """A smooth path of two joints."""
    time = np.linspace(0, 4, frames)[:, None, None]
    return np.concatenate([np.sin(time), np.cos(time), 0 * time], axis=-1) * [[1.0], [0.5]]


def test_the_descent_stops_where_it_no_longer_moves():
    truth = wave()
    once = descend(truth + 0.3, truth[..., :2], (low_pass(0.5),), 0.2, 3000)
    again = descend(once, truth[..., :2], (low_pass(0.5),), 0.2, 3000)
    assert np.abs(again - once).max() < 1e-4


def test_a_step_of_one_lands_on_the_data():
    truth = wave()
    found = descend(truth + 0.3, truth[..., :2], (), 1.0, 5)
    np.testing.assert_allclose(found[..., :2], truth[..., :2], atol=1e-12)


def test_a_descent_that_is_cut_short_says_so(caplog):
    truth = wave()
    descend(truth + 0.3, truth[..., :2], (low_pass(0.5),), 0.2, 3)
    assert "not converged after 3 iterations" in caplog.text


def test_missing_joints_stay_where_the_initial_motion_has_them():
    truth = wave()
    observed = truth[..., :2].copy()
    observed[:, 1] = np.nan
    found = descend(truth + 0.3, observed, (), 0.2, 3000)
    np.testing.assert_allclose(found[:, 1], truth[:, 1] + 0.3)
    np.testing.assert_allclose(found[:, 0, :2], observed[:, 0], atol=1e-3)
