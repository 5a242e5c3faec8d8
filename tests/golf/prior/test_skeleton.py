"""Turns from joints and joints from turns; every rate against finite differences."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from keyrecon.body import ANKLE_HEIGHT, LSP14
from keyrecon.golf.prior.kinematics import find_club, find_joints, place_body, pose_rates
from keyrecon.golf.prior.motion_model import left_jacobian, posture_at
from keyrecon.golf.prior.skeleton import (
    CLUB,
    LENGTHS,
    NECK_MARK,
    REST,
    SEGMENTS,
    mark_neck,
    size_body,
    turns_from_swing,
)
from keyrecon.golf.records import MotionModel, Swing, SwingState

P = len(SEGMENTS)


@pytest.fixture(scope="module")
def model():
    rng = np.random.default_rng(1)
    centre = Rotation.random(P, random_state=2).as_matrix()
    knots = rng.normal(0, 0.4, (3, 6, 3 * P + 3))
    time = np.linspace(0, 1, 40)
    smooth = np.stack(
        [np.stack([np.interp(time, np.linspace(0, 1, 6), c) for c in k.T], axis=1) for k in knots]
    )
    return MotionModel(
        1, centre, smooth[0], 0.3 * smooth[1:], np.array([0, 0.5, 0.7, 1.0]), np.ones(2), "drawn"
    )


@pytest.fixture(scope="module")
def state():
    phase = np.array([0.1, 0.337, 0.521, 0.9])
    return SwingState(
        np.array([0.7, -1.2]), phase, Rotation.random(4, random_state=3).as_matrix(),
        np.random.default_rng(4).normal(size=(4, 3)),
    )  # fmt: skip


def put(model, state):
    body = size_body(1.8)
    return body, place_body(body, posture_at(model, state.phase, state.coefficients), state)


def test_joints_of_a_placed_body_give_its_pose_back(model, state):
    body, pose = put(model, state)
    joints, club = find_joints(body, pose), find_club(body, pose)
    feet = pose.origins[:, 13:15] + 0.2 * (pose.rotations[:, 13:15] @ REST[13, :, None])[..., 0]
    swing = Swing("drawn", joints, feet, club, np.arange(4), 30.0, 1.8)
    turns, place = turns_from_swing(swing)
    still = SwingState(
        state.coefficients, state.phase, np.tile(np.eye(3), (4, 1, 1)), np.zeros((4, 3))
    )
    posture = posture_at(model, state.phase, state.coefficients)
    again = place_body(
        body, type(posture)(turns, place, posture.turn_rates, posture.place_rates), still
    )
    # Pelvis and trunk are not twist-free in the drawn model, and the neck lies off their axes
    # by as much; every other bone keeps its direction in the picture.
    bones = [(p, LSP14.index(s.end)) for p, s in enumerate(SEGMENTS) if s.end and p > 1]
    for p, j in bones:
        bone = again.rotations[:, p] @ REST[p]
        true = pose.rotations[:, p] @ REST[p]
        assert np.allclose(bone, true, atol=1e-9), (SEGMENTS[p].name, LSP14.names[j])
    assert np.allclose(find_club(body, again)[:, 1] - find_club(body, again)[:, 0],
                       club[:, 1] - club[:, 0])  # fmt: skip


def test_bones_of_a_placed_body_have_the_lengths_of_the_table(model, state):
    body, pose = put(model, state)
    joints = find_joints(body, pose)
    for name, parent in (("elbow", "shoulder"), ("wrist", "elbow"), ("knee", "hip")):
        ends = [joints[:, LSP14.index(f"left_{n}")] for n in (name, parent)]
        part = {"elbow": "upper_arm", "wrist": "forearm", "knee": "thigh"}[name]
        assert np.allclose(np.linalg.norm(ends[0] - ends[1], axis=1), 1.8 * LENGTHS[part])
    assert np.allclose(np.linalg.norm(np.diff(find_club(body, pose), axis=1), axis=2), body.club)


def test_an_upright_body_is_as_tall_as_it_is_said_to_be():
    legs = ANKLE_HEIGHT + LENGTHS["shank"] + LENGTHS["thigh"]
    assert abs(legs + LENGTHS["trunk"] + LENGTHS["head"] - 1) < 0.001


def test_left_jacobian_is_the_derivative_of_the_exponential_map():
    rng = np.random.default_rng(0)
    for v in [*rng.normal(size=(5, 3)), np.zeros(3), np.array([1e-6, 0, 0])]:
        step = 1e-6 * rng.normal(size=3)
        before, after = Rotation.from_rotvec(v - step), Rotation.from_rotvec(v + step)
        velocity = (after * before.inv()).as_rotvec() / 2
        assert np.allclose(left_jacobian(v) @ step, velocity, atol=1e-11)


def moved_by(model, state, unknown, step):
    coefficients, phase = state.coefficients.copy(), state.phase.copy()
    rotation, position = state.rotation, state.position
    if unknown < 2:
        coefficients[unknown] += step
    elif unknown == 2:
        phase += step
    elif unknown < 6:
        rotation = Rotation.from_rotvec(step * np.eye(3)[unknown - 3]).as_matrix() @ rotation
    else:
        position = position + step * np.eye(3)[unknown - 6]
    return put(model, SwingState(coefficients, phase, rotation, position))[1]


@pytest.mark.parametrize("unknown", range(9))
def test_rates_of_all_segments_agree_with_finite_differences(model, state, unknown):
    body, pose = put(model, state)
    posture = posture_at(model, state.phase, state.coefficients)
    rates = pose_rates(body, posture, state, pose)
    h = 1e-6
    after, before = (moved_by(model, state, unknown, s) for s in (h, -h))
    assert np.allclose(
        rates.origins[..., unknown], (after.origins - before.origins) / (2 * h), atol=1e-6
    )
    spin = after.rotations @ np.swapaxes(before.rotations, 2, 3)
    velocity = Rotation.from_matrix(spin.reshape(-1, 3, 3)).as_rotvec().reshape(4, P, 3) / (2 * h)
    assert np.allclose(rates.rotations[..., unknown], velocity, atol=1e-6)


def test_a_player_stands_still_before_and_after_the_swing(model):
    outside = posture_at(model, np.array([-0.3, 0.0, 1.0, 1.4]), np.zeros(2))
    assert np.array_equal(outside.turns[0], outside.turns[1])
    assert np.array_equal(outside.turns[2], outside.turns[3])
    assert not outside.turn_rates[[0, 3], ..., -1].any()


def test_the_slope_by_normalised_time_is_continuous(model):
    times = np.linspace(0.2, 0.8, 4001)
    rates = posture_at(model, times, np.zeros(2)).turn_rates[:, CLUB, :, -1]
    jumps = np.abs(np.diff(rates, axis=0)).max()
    assert jumps < 0.01 * np.abs(rates).max()


def test_a_marked_neck_lies_above_the_shoulders_and_nothing_hangs_on_it(model, state):
    posture = posture_at(model, state.phase, state.coefficients)
    bodies = size_body(1.8), mark_neck(size_body(1.8))
    plain, marked = (find_joints(body, place_body(body, posture, state)) for body in bodies)
    neck = LSP14.index("neck")
    moved = np.linalg.norm(marked - plain, axis=2)
    assert moved[:, neck] == pytest.approx(NECK_MARK * 1.8)
    assert not np.delete(moved, neck, axis=1).any()
    hips = plain[:, [LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=1)
    spine = plain[:, neck] - hips
    assert np.cross(spine, marked[:, neck] - plain[:, neck]) == pytest.approx(0, abs=1e-9)
