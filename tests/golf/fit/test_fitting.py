"""The fit on swings whose every number is known."""

from dataclasses import replace

import numpy as np
import pytest
from golf_truth import camera_before, even_times, observe
from scipy.spatial.transform import Rotation

from keyrecon.body import LSP14
from keyrecon.golf.fit.fitting import FitOptions, fit_sliding_windows, fit_swing
from keyrecon.golf.fit.initial_pose import estimate_initial_pose, start_state
from keyrecon.golf.fit.mirror import mirror_clicks, mirror_observations
from keyrecon.golf.fit.result import describe_fit
from keyrecon.golf.prior.kinematics import find_club, find_joints, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import Camera, SwingState
from keyrecon.io.formats.model_file import read_motion_model
from keyrecon.metrics import mpjpe, pa_mpjpe

CAMERA = Camera(1000.0, np.array([640.0, 360.0]))
ROOT = [LSP14.index("right_hip"), LSP14.index("left_hip")]
FRAMES, FPS = 40, 25.0


@pytest.fixture(scope="module")
def model():
    return read_motion_model()


@pytest.fixture(scope="module")
def played(model):
    """A swing with a style of its own, filmed from the front: state, joints and club."""
    rotation, position = camera_before(180.0)
    alpha = np.zeros(len(model.components))
    alpha[:4] = 1.0, -0.8, 0.6, 0.5
    state = SwingState(
        alpha, even_times(FRAMES, 5), np.tile(rotation, (FRAMES, 1, 1)),
        np.tile(position, (FRAMES, 1)),
    )  # fmt: skip
    body = size_body(1.8)
    pose = place_body(body, posture_at(model, state.mu, state.alpha), state)
    return state, find_joints(body, pose), find_club(body, pose)


def fitted_joints(found):
    model, body, state = found
    return find_joints(body, place_body(body, posture_at(model, state.mu, state.alpha), state))


def late(state, by=0.03):
    """A start with the mean motion and times that are off."""
    return replace(state, alpha=np.zeros(0), mu=np.clip(state.mu - by, 0, 1))


def test_a_swing_of_the_model_is_found_again(model, played):
    state, joints, club = played
    seen = observe(joints, club, CAMERA, noise=0.5)
    before = fitted_joints((model, size_body(1.8), replace(late(state), alpha=np.zeros(1))))
    found = fit_swing(seen, model, size_body(1.8), late(state), FPS)
    after = fitted_joints(found)
    assert 1000 * mpjpe(after, joints, ROOT) < 45 < 1000 * mpjpe(before, joints, ROOT)
    assert np.abs(found[2].mu - state.mu).max() < 0.03


def test_windows_of_three_frames_find_it_too(model, played):
    state, joints, club = played
    seen = observe(joints, club, CAMERA, noise=0.5)
    options = replace(FitOptions(), windows=replace(FitOptions().windows, steps=6))
    found = fit_sliding_windows(
        seen, model, size_body(1.8), replace(state, alpha=np.zeros(0)), FPS, options
    )
    assert 1000 * pa_mpjpe(fitted_joints(found), joints) < 50


def test_normalised_time_never_runs_backwards(model, played):
    state, joints, club = played
    seen = observe(joints, club, CAMERA, noise=8.0)
    _, _, found = fit_swing(seen, model, size_body(1.8), late(state), FPS)
    assert (np.diff(found.mu) >= 0).all()
    assert found.mu.min() >= 0 and found.mu.max() <= 1


@pytest.mark.parametrize("azimuth", [180.0, 88.0])
def test_clicks_on_the_first_frame_place_the_player(model, azimuth):
    rotation, position = camera_before(azimuth, height=0.9)
    body, mu = size_body(1.8), np.zeros(1)
    state = SwingState(np.zeros(0), mu, rotation[None], position[None])
    joints = find_joints(body, place_body(body, posture_at(model, mu, state.alpha), state))[0]
    names = ("head_top", "right_knee", "left_knee", "right_ankle", "left_ankle")
    pixels = {n: joints[LSP14.index(n)] for n in names}
    pixels["root"] = joints[ROOT].mean(axis=0)
    clicked = {
        n: tuple((CAMERA.focal * p[:2] / p[2] + CAMERA.principal).tolist())
        for n, p in pixels.items()
    }
    found, _ = estimate_initial_pose(clicked, 0.0, CAMERA, model, body)
    assert np.degrees(Rotation.from_matrix(found @ rotation.T).magnitude()) < 3


def test_a_left_hander_is_the_mirror_image(model, played):
    state, joints, club = played
    width = 1280
    flip = np.array([-1.0, 1, 1])
    camera = Camera(CAMERA.focal, np.array([width - 1 - CAMERA.principal[0], 360.0]))
    left = observe(joints[:, LSP14.mirror] * flip, club * flip, camera, noise=0.0)
    right = observe(joints, club, CAMERA, noise=0.0)
    mirrored = mirror_observations(left, width)
    known = np.isfinite(right.joints)
    assert np.array_equal(known, np.isfinite(mirrored.joints))
    assert np.allclose(mirrored.joints[known], right.joints[known])
    assert np.allclose(mirrored.club, right.club)
    seen = replace(left, left_handed=True)
    fitted = describe_fit(model, size_body(1.8), state, seen, np.arange(FRAMES) / FPS, 0)
    assert np.allclose(fitted.motion.points3d, joints[:, LSP14.mirror] * flip)
    assert np.allclose(fitted.club_seen, left.club)
    clicks = mirror_clicks({"left_knee": (100.0, 5.0), "root": (10.0, 7.0)}, width)
    assert clicks == {"right_knee": (1179.0, 5.0), "root": (1269.0, 7.0)}


def test_start_state_holds_one_place_for_all_frames():
    state = start_state((np.eye(3), np.arange(3.0)), np.linspace(0, 1, 5))
    assert state.rotation.shape == (5, 3, 3) and (state.position == np.arange(3.0)).all()
