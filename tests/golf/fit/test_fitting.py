"""The fit on swings whose every number is known."""

from dataclasses import replace

import numpy as np
import pytest
from golf_truth import camera_before, even_times, observe
from scipy.spatial.transform import Rotation

from keyrecon.body import LSP14
from keyrecon.golf.fit import fitting
from keyrecon.golf.fit.fitting import FitOptions, fit_swing, surface_blocks
from keyrecon.golf.fit.handedness import mirror_initial, mirror_observations
from keyrecon.golf.fit.initial_pose import Placement, estimate_initial_pose, repeat_pose
from keyrecon.golf.fit.residuals import MODEL_ERROR, project
from keyrecon.golf.fit.result import describe_fit
from keyrecon.golf.prior.kinematics import find_club, find_joints, fitted_pose, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import Camera, InitialJoints, SwingFit, SwingMarks, SwingState
from keyrecon.io.formats.model_file import read_motion_model
from keyrecon.metrics import mpjpe

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
    coefficients = np.zeros(len(model.components))
    coefficients[:4] = 1.0, -0.8, 0.6, 0.5
    state = SwingState(
        coefficients, even_times(FRAMES, 5), np.tile(rotation, (FRAMES, 1, 1)),
        np.tile(position, (FRAMES, 1)),
    )  # fmt: skip
    body = size_body(1.8)
    pose = place_body(body, posture_at(model, state.phase, state.coefficients), state)
    return state, find_joints(body, pose), find_club(body, pose)


def fitted_joints(fit):
    return find_joints(fit.body, fitted_pose(fit))


def late(state, by=0.03):
    """A start with the mean motion and times that are off."""
    return replace(state, coefficients=np.zeros(0), phase=np.clip(state.phase - by, 0, 1))


def test_a_swing_of_the_model_is_found_again(model, played):
    state, joints, club = played
    observations = observe(joints, club, CAMERA, noise=0.5)
    initial = SwingFit(model, size_body(1.8), late(state))
    fit = fit_swing(observations, initial, FPS)
    before, after = fitted_joints(initial), fitted_joints(fit)
    assert 1000 * mpjpe(after, joints, ROOT) < 45 < 1000 * mpjpe(before, joints, ROOT)
    assert np.abs(fit.state.phase - state.phase).max() < 0.03


def test_normalised_time_never_runs_backwards(model, played):
    state, joints, club = played
    observations = observe(joints, club, CAMERA, noise=8.0)
    fit = fit_swing(observations, SwingFit(model, size_body(1.8), late(state)), FPS)
    assert (np.diff(fit.state.phase) >= 0).all()
    assert fit.state.phase.min() >= 0 and fit.state.phase.max() <= 1


@pytest.mark.parametrize("azimuth", [180.0, 88.0])
def test_clicks_on_the_first_frame_place_the_player(model, azimuth):
    rotation, position = camera_before(azimuth, height=0.9)
    body, phase = size_body(1.8), np.zeros(1)
    state = SwingState(np.zeros(0), phase, rotation[None], position[None])
    joints = fitted_joints(SwingFit(model, body, state))[0]
    names = ("head_top", "right_knee", "left_knee", "right_ankle", "left_ankle")
    pixels = {n: joints[LSP14.index(n)] for n in names}
    pixels["root"] = joints[ROOT].mean(axis=0)
    places = [CAMERA.focal * p[:2] / p[2] + CAMERA.principal for p in pixels.values()]
    clicked = InitialJoints(0, tuple(pixels), np.array(places))
    turn = estimate_initial_pose(clicked, 0.0, CAMERA, model, body).rotation
    assert np.degrees(Rotation.from_matrix(turn @ rotation.T).magnitude()) < 3


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
    observations = replace(left, left_handed=True)
    fit = SwingFit(model, size_body(1.8), state)
    fitted = describe_fit(fit, observations, np.arange(FRAMES) / FPS)
    assert np.allclose(fitted.motion.points3d, joints[:, LSP14.mirror] * flip)
    assert np.allclose(fitted.club2d, left.club)
    places = np.array([[100.0, 5.0], [10.0, 7.0]])
    initial = mirror_initial(InitialJoints(3, ("left_knee", "root"), places), width)
    assert initial.frame == 3 and initial.names == ("right_knee", "root")
    assert initial.places.tolist() == [[1179.0, 5.0], [1269.0, 7.0]]


def test_a_repeated_pose_stays_in_one_place_in_all_frames():
    state = repeat_pose(Placement(np.eye(3), np.arange(3.0)), np.linspace(0, 1, 5))
    assert state.rotation.shape == (5, 3, 3) and (state.position == np.arange(3.0)).all()


def test_what_is_an_outlier_does_not_depend_on_the_size_of_the_pictures(played):
    _, joints, club = played
    small = observe(joints, club, CAMERA, noise=0.5)
    large = replace(small, height=2 * small.height)
    blocks = [surface_blocks(o, size_body(1.8), FitOptions()) for o in (small, large)]
    shares = [two.robust / one.robust for one, two in zip(*blocks, strict=True)]
    assert shares == [1, 2, 2]  # lines of sight are in metres, masks and matches in px


def test_postures_that_no_capture_has_move_the_time_by_less_than_a_frame(
    model, played, monkeypatch
):
    """Arms lead the club by a tenth of a metre; club and legs tell the time. Were the marks due
    within the error of the model, the time would move by two frames."""
    state, joints, club = played
    seen = observe(joints, club, CAMERA, noise=0.5)
    initial = SwingFit(model, size_body(1.8), late(state, 0.0))
    arms = [LSP14.index(f"{side}_{n}") for side in ("right", "left") for n in ("wrist", "elbow")]
    frames = np.array([14, 17, 20])
    marked = joints[frames].copy()
    way = (joints[frames + 1] - joints[frames])[:, arms]
    marked[:, arms] += 0.1 * way / np.linalg.norm(way, axis=2, keepdims=True)
    places = np.full((3, 14, 2), np.nan)
    places[:, arms] = project(marked[:, arms].reshape(-1, 3), CAMERA)[0].reshape(3, -1, 2)
    marks = SwingMarks.of_joints(frames, places)
    without = fit_swing(seen, initial, FPS).state.phase
    marked_too = replace(seen, marks=marks)

    def frames_moved():
        moved = fit_swing(marked_too, initial, FPS).state.phase - without
        return np.abs(moved[frames] / np.gradient(without)[frames]).max()

    assert frames_moved() < 0.7
    monkeypatch.setattr(fitting, "UNFOLLOWED", MODEL_ERROR)
    assert frames_moved() > 1.5
