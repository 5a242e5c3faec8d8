"""Shoulders that follow the arms, on swings drawn from the built-in model."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from keyrecon.app.golf_demo import draw_swing
from keyrecon.body import LSP14
from keyrecon.golf.prior.captured_swing import place_turns
from keyrecon.golf.prior.shoulder_rhythm import follow_arms, shown_share
from keyrecon.golf.prior.skeleton import NAMES, REST, chain_turns, size_body, turns_from_swing
from keyrecon.io.formats.model_file import read_motion_model

SHOULDERS = [LSP14.index("right_shoulder"), LSP14.index("left_shoulder")]
SIDES = ("right", "left")
ARMS = [NAMES.index(f"{side}_upper_arm") for side in SIDES]
CLAVICLES = [NAMES.index(f"{side}_clavicle") for side in SIDES]
TRUNK = NAMES.index("trunk")


@pytest.fixture(scope="module")
def rigid():
    """Turns and place of a swing whose shoulders are fixed to the trunk, as captures have them."""
    turns, place = turns_from_swing(draw_swing(read_motion_model(), 0))
    turns[:, ARMS] = turns[:, CLAVICLES] @ turns[:, ARMS]
    turns[:, CLAVICLES] = np.eye(3)
    return turns, place


def shoulder_heights(turns, place):
    """How high both shoulders lie on the trunk, from the pelvis along the spine, metres."""
    joints, _ = place_turns(size_body(1.8), turns, place)
    spine = chain_turns(turns)[:, TRUNK] @ [0.0, 1.0, 0.0]
    hips = joints[:, [LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=1)
    return np.einsum("tij,tj->ti", joints[:, SHOULDERS] - hips[:, None], spine)


def arm_ways(turns):
    """Directions of both upper arms in the swing's axes."""
    return (chain_turns(turns)[:, ARMS] @ REST[ARMS][..., None])[..., 0]


def test_mean_golfer_holds_his_shoulders_higher_at_the_finish_than_at_address():
    model = read_motion_model()
    vectors, place = np.split(model.mean, [3 * len(NAMES)], axis=1)
    moved = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix()
    turns = model.centre @ moved.reshape(len(vectors), -1, 3, 3)
    heights = shoulder_heights(turns, place).mean(axis=1)
    assert heights[-1] - heights[0] > 0.02


def test_raised_arms_raise_the_shoulders_and_keep_their_directions(rigid):
    turns, place = rigid
    followed = follow_arms(turns)
    np.testing.assert_allclose(arm_ways(followed), arm_ways(turns), atol=1e-9)
    in_trunk = np.einsum("tji,tkj->tki", chain_turns(turns)[:, TRUNK], arm_ways(turns))
    is_raised = in_trunk[..., 1] > np.sin(np.radians(10))
    raised = shoulder_heights(followed, place) - shoulder_heights(turns, place)
    assert is_raised.any(axis=0).all()
    assert (raised[is_raised] > 0.015).all()


def test_nothing_is_added_where_shoulders_follow_already(rigid):
    followed = follow_arms(rigid[0])
    assert shown_share(rigid[0]) < 0.05
    assert shown_share(followed) > 0.9
    assert np.abs(follow_arms(followed) - followed).max() < 0.02
