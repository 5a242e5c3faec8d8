"""The paper's windows on swings whose every number is known."""

from dataclasses import replace

import numpy as np
import pytest
from golf_truth import camera_before, even_times, observe

from keyrecon.golf.prior.kinematics import find_club, find_joints, fitted_pose
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import Camera, SwingFit, SwingState
from keyrecon.io.formats.model_file import read_motion_model
from keyrecon.metrics import pa_mpjpe
from keyrecon.paper.sliding_windows import (
    WindowOptions,
    fit_sliding_windows,
    predict_window,
    projection_residuals,
)

CAMERA = Camera(1000.0, np.array([640.0, 360.0]))
FRAMES = 40


@pytest.fixture(scope="module")
def played():
    """A swing with a style of its own, filmed from the front."""
    model = read_motion_model()
    rotation, position = camera_before(180.0)
    coefficients = np.zeros(len(model.components))
    coefficients[:4] = 1.0, -0.8, 0.6, 0.5
    state = SwingState(
        coefficients, even_times(FRAMES, 5), np.tile(rotation, (FRAMES, 1, 1)),
        np.tile(position, (FRAMES, 1)),
    )  # fmt: skip
    return SwingFit(model, size_body(1.8), state)


def observed(fit, noise):
    pose = fitted_pose(fit)
    return observe(find_joints(fit.body, pose), find_club(fit.body, pose), CAMERA, noise)


def test_windows_of_three_frames_find_a_swing_of_the_model(played):
    initial = replace(played, state=replace(played.state, coefficients=np.zeros(0)))
    fit = fit_sliding_windows(observed(played, 0.5), initial)
    joints = [find_joints(f.body, fitted_pose(f)) for f in (fit, played)]
    assert 1000 * pa_mpjpe(*joints) < 50


def moving_evenly():
    """Phase, root and place that go on at one speed."""
    time = np.arange(6.0)
    angle = 0.1 * time
    turn = np.zeros((6, 3, 3))
    turn[:, 0, 0] = turn[:, 2, 2] = np.cos(angle)
    turn[:, 0, 2], turn[:, 2, 0], turn[:, 1, 1] = np.sin(angle), -np.sin(angle), 1
    return SwingState(np.zeros(4), 0.02 * time, turn, np.outer(time, [0.1, -0.2, 0.3]))


@pytest.mark.parametrize("first", [1, 2, 3])
def test_every_frame_is_expected_to_go_on_at_the_speed_before_it(first):
    moving = moving_evenly()
    window = slice(first, first + 3)
    expected = predict_window(moving, window, np.zeros(6))
    np.testing.assert_allclose(expected.phase, moving.phase[window])
    np.testing.assert_allclose(expected.position, moving.position[window])
    np.testing.assert_allclose(expected.rotation, moving.rotation[window], atol=1e-12)


def test_residuals_of_joints_and_hands_are_distances_in_pixels(played):
    observations = observed(played, 0.0)
    off = replace(observations, joints=observations.joints + 3.0, club=observations.club + 3.0)
    rows = projection_residuals(off, played.body, fitted_pose(played))
    np.testing.assert_allclose(rows.values, -3.0, atol=1e-9)


def test_every_frame_keeps_the_coefficients_of_the_last_window_that_has_it(played):
    options = WindowOptions(steps=1)
    initial = replace(played, state=replace(played.state, coefficients=np.zeros(0)))
    state = fit_sliding_windows(observed(played, 0.5), initial, options).state
    assert state.frame_coefficients.shape == (FRAMES, options.components)
    assert (state.frame_coefficients[-3:] == state.coefficients).all()
    assert not np.array_equal(state.frame_coefficients[0], state.frame_coefficients[-1])
