"""What motion says against exchanging two limbs."""

import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.propagation.half_body import split_body
from keyrecon.propagation.limb_identity import IdentityEvidence, identify_limbs
from keyrecon.propagation.limb_motion import (
    PLACE_SPREAD,
    exchange_cost,
    filter_motion,
    foot_exchange_cost,
)

LEGS = split_body(LSP14)[0]
ONE, OTHER = map(list, LEGS.sides)
FPS = 25.0
STEP = 12
"""Frames of a step: .24 s of standing, .24 s of swinging."""
STRIDE = 0.9
"""Player heights from one print of a foot to its next."""
ANKLE_SPREAD = 0.064


def ankle(frames):
    """Way of a running foot over the ground: it stands, then it swings."""
    step, phase = np.divmod(frames, STEP)
    swung = np.clip(2 * phase / STEP - 1, 0, 1)
    return STRIDE * (step + (1 - np.cos(np.pi * swung)) / 2)


def runner(count):
    """(joints in player coordinates, way of the player over the ground)."""
    frames = np.arange(count, dtype=float)
    ground = STRIDE * frames / STEP + 0j
    joints = np.zeros((count, len(LEGS.joints)), complex)
    for side, late in ((ONE, 0.0), (OTHER, STEP / 2)):
        foot = ankle(frames + late) - STRIDE * late / STEP - 0.3 * STRIDE
        joints[:, side[0]] = 0.1 if late else -0.1
        joints[:, side[2]] = foot - ground.real + 0.45j
        joints[:, side[1]] = 0.6 * joints[:, side[2]] + 0.05 - 0.05j
    return joints, ground


def with_legs_exchanged(joints, frames):
    """Below the hips, which a hypothesis has on their sides whichever legs it found."""
    result = joints.copy()
    result[np.ix_(frames, ONE[1:])] = joints[np.ix_(frames, OTHER[1:])]
    result[np.ix_(frames, OTHER[1:])] = joints[np.ix_(frames, ONE[1:])]
    return result


def test_limbs_far_apart_are_dearer_to_exchange_than_limbs_that_meet():
    time = np.linspace(-1, 1, 41)
    swing = np.array([0.1, 0.6, 1.0])
    one = np.array([0.0, 0.2j, 0.45j]) + np.outer(0.25 * time, swing)
    other = np.array([0.0, 0.2j, 0.45j]) - np.outer(0.25 * time, swing)
    cost = exchange_cost(np.stack([one, other], axis=1), np.array([0.016, 0.032, 0.064]))
    assert cost[19] < 0.5 * cost[4]
    assert cost[19] < 0.5 * cost[34]
    assert (cost > 0).all()


def feet_that_meet():
    """One foot stands while the other swings past it and stands ahead; they meet in frame 10."""
    time = np.arange(21.0)
    standing = np.zeros(21)
    passing = 0.45 * np.clip((time - 10) / 5, -1, 1)
    return np.stack([standing, passing], axis=1) + 0j


def test_one_frame_has_nothing_to_exchange_between():
    limbs = np.zeros((1, 2, 3), complex)
    assert exchange_cost(limbs, np.array([0.016, 0.032, 0.064])).shape == (0,)
    assert foot_exchange_cost(limbs[:, :, 2], ANKLE_SPREAD, FPS).shape == (0,)


def test_a_foot_that_stands_goes_on_standing_while_the_other_passes():
    feet = feet_that_meet()
    for gap in (9, 10):
        bounced = feet.copy()
        bounced[gap + 1 :] = feet[gap + 1 :, ::-1]
        right = foot_exchange_cost(feet, ANKLE_SPREAD, FPS)[gap]
        assert right > 2
        assert foot_exchange_cost(bounced, ANKLE_SPREAD, FPS)[gap] == pytest.approx(-right)
        # constant velocity hardly minds a foot that stops where the other leaves
        assert exchange_cost(feet[..., None], np.array([ANKLE_SPREAD]))[gap] < 0.75 * right


def test_where_the_ground_lies_changes_nothing():
    feet = feet_that_meet()
    cost = foot_exchange_cost(feet, ANKLE_SPREAD, FPS)
    moved = foot_exchange_cost(1j * feet + 3 - 2j, ANKLE_SPREAD, FPS)
    np.testing.assert_allclose(moved, cost, atol=1e-9)


def as_found(joints, seed):
    """With the errors of hypotheses: where legs are hard to tell apart, both have one place."""
    noise = np.random.default_rng(seed).standard_normal((2, *joints.shape))
    found = joints + 0.04 * (noise[0] + 1j * noise[1])
    near = np.abs(joints[:, ONE[-1]] - joints[:, OTHER[-1]]) < 0.25
    for one, other in zip(ONE[1:], OTHER[1:], strict=True):
        found[near, one] = found[near, other] = (found[near, one] + found[near, other]) / 2
    return found


@pytest.mark.parametrize("seed", range(5))
def test_a_runner_whose_steps_were_taken_for_bounces_gets_his_legs_back(seed):
    joints, ground = runner(60)
    apart = (joints[:, ONE[-1]] - joints[:, OTHER[-1]]).real
    wrong = with_legs_exchanged(as_found(joints, seed), np.flatnonzero(apart < 0))
    found = identify_limbs(
        LEGS, wrong, IdentityEvidence(np.zeros(60), ground), np.array([0, 59]), FPS
    )
    clear = np.abs(apart) > 0.25
    np.testing.assert_array_equal(found.exchanged[clear], (apart < 0)[clear])


def filtered_one_by_one(places, spread):
    """Place and velocity of one coordinate by the textbook's Kalman filter, and covariances."""
    change, seen = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    noise = spread**2 * np.outer([0.5, 1.0], [0.5, 1.0])
    state, covariance = np.array([places[0], 0]), np.diag([PLACE_SPREAD**2, (6 * spread) ** 2])
    for t, place in enumerate(places):
        if t:
            state, covariance = change @ state, change @ covariance @ change.T + noise
        gain = covariance @ seen.T / (seen @ covariance @ seen.T + PLACE_SPREAD**2)
        state = state + gain @ (place - seen @ state)
        covariance = covariance - gain @ seen @ covariance
        yield state, covariance


def test_all_joints_are_filtered_at_once_as_one_by_one():
    random = np.random.default_rng(0)
    places = random.standard_normal((20, 2, 3)) + 1j * random.standard_normal((20, 2, 3))
    spread = np.array([0.016, 0.032, 0.064])
    states, covariances = filter_motion(places, spread)
    for limb, joint in np.ndindex(2, 3):
        one = filtered_one_by_one(places[:, limb, joint], spread[joint])
        for t, (state, covariance) in enumerate(one):
            np.testing.assert_allclose(states[t, :, limb, joint], state, atol=1e-12)
            np.testing.assert_allclose(covariances[t, joint], covariance, atol=1e-12)
