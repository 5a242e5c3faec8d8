"""Joints follow the picture where it departs from the motion model."""

from functools import partial

import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.golf.fit.deviation import follow_picture
from keyrecon.golf.fit.residuals import club_residuals, joint_residuals, project
from keyrecon.golf.fit.solver import ResidualBlock
from keyrecon.golf.prior.kinematics import find_club, find_joints, fitted_pose
from keyrecon.golf.prior.skeleton import NAMES, size_body
from keyrecon.golf.records import Camera, SwingFit, SwingState
from keyrecon.io.formats.model_file import BUILT_IN_SWING_PRIOR, read_motion_model
from tests.support.golf_truth import camera_before, even_times, observe

FRAMES, FPS = 40, 30.0
CAMERA = Camera(900.0, np.array([319.5, 239.5]))


@pytest.fixture(scope="module")
def fit():
    rotation, position = camera_before(180.0)
    state = SwingState(
        np.zeros(2), even_times(FRAMES), np.tile(rotation, (FRAMES, 1, 1)),
        np.tile(position, (FRAMES, 1)),
    )  # fmt: skip
    return SwingFit(read_motion_model(BUILT_IN_SWING_PRIOR), size_body(1.8), state)


def followed(fit, observed):
    """The fit after it followed joints and club of another swing."""
    pose = fitted_pose(observed)
    joints, club = find_joints(fit.body, pose), find_club(fit.body, pose)
    observations = observe(joints, club, CAMERA, 0.0)
    blocks = [
        ResidualBlock(partial(joint_residuals, observations, fit.body), 1.0, 30.0),
        ResidualBlock(partial(club_residuals, observations, fit.body), 1.0, 30.0),
    ]
    return follow_picture(fit, blocks, FPS, steps=15), joints, club


def turned(fit, name, angle):
    deviation = np.zeros((FRAMES, len(NAMES), 3))
    deviation[:, NAMES.index(name), 2] = angle * np.sin(np.linspace(0, np.pi, FRAMES))
    state = SwingState(
        fit.state.coefficients, fit.state.phase, fit.state.rotation, fit.state.position,
        deviation=deviation,
    )  # fmt: skip
    return SwingFit(fit.model, fit.body, state)


def test_what_the_model_explains_is_left_alone(fit):
    same, joints, _ = followed(fit, fit)
    off = np.linalg.norm(find_joints(fit.body, fitted_pose(same)) - joints, axis=2)
    assert off.max() < 0.003


def test_a_club_that_the_model_does_not_know_is_followed(fit):
    own, _, club = followed(fit, turned(fit, "club", 0.5))
    ends = [project(c.reshape(-1, 3), CAMERA)[0].reshape(-1, 2, 2)
            for c in (club, find_club(fit.body, fitted_pose(own)),
                      find_club(fit.body, fitted_pose(fit)))]  # fmt: skip
    before, after = (np.linalg.norm(e[:, 1] - ends[0][:, 1], axis=1).max() for e in ends[:0:-1])
    assert after < 0.25 * before


def test_a_trunk_that_leans_otherwise_takes_the_head_to_where_it_is_seen(fit):
    own, joints, _ = followed(fit, turned(fit, "trunk", 0.25))
    head = LSP14.index("head_top")
    seen, ours, model = (
        project(j[:, head], CAMERA)[0]
        for j in (joints, *(find_joints(fit.body, fitted_pose(f)) for f in (own, fit)))
    )
    assert np.abs(ours - seen).max() < 0.3 * np.abs(model - seen).max()
