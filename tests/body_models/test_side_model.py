"""Left arms and right ones by the pose of the whole body."""

import sys

import numpy as np
import pytest
from bvh_files import bvh_text
from scipy.spatial.transform import Rotation

from keyrecon import cli
from keyrecon.body import LSP14, Skeleton
from keyrecon.body_models.side_model import SideModel, arm_log_odds
from keyrecon.body_models.side_training import SideTrainingOptions, train_side_model
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.model_file import (
    BUILT_IN_DEPTH_MODEL,
    read_side_model,
    write_side_model,
)
from keyrecon.propagation.half_body import split_body
from keyrecon.propagation.limb_identity import (
    ArmEvidence,
    IdentityEvidence,
    exchange_sides,
    identify_limbs,
)
from keyrecon.synthetic.motion import MotionOptions, play_tennis

FPS = 25.0
UPPER = split_body(LSP14)[1]
TRUNK = 0.52
"""Statures from the ankles to the middle of the body."""


@pytest.fixture(scope="module")
def model():
    return read_side_model()


def film(yaw, seconds=4.0, seed=100):
    """A player whom no model has learnt from, as a camera sees him that stands anywhere around."""
    world = play_tennis(MotionOptions(seconds=seconds, fps=FPS, seed=seed))
    local = world - world.mean(axis=1, keepdims=True)
    turned = local @ Rotation.from_euler("YX", [yaw, 8], degrees=True).as_matrix().T
    return (turned[..., 0] - 1j * turned[..., 1]) / 1.8


def exchange_arms(joints):
    crossed = joints.copy()
    arms = [LSP14.index(f"{side}_{part}") for side in ("left", "right")
            for part in ("shoulder", "elbow", "wrist")]  # fmt: skip
    crossed[:, arms] = joints[:, [LSP14.mirror[joint] for joint in arms]]
    return crossed


def test_arms_of_players_who_were_not_learnt_from_are_told_apart(model):
    for yaw in range(0, 360, 30):
        odds = arm_log_odds(model, LSP14, film(yaw), FPS)
        assert (odds > 0).mean() > 0.85, yaw


def test_exchanged_arms_say_the_opposite(model):
    joints = film(70)
    np.testing.assert_allclose(
        arm_log_odds(model, LSP14, exchange_arms(joints), FPS),
        -arm_log_odds(model, LSP14, joints, FPS),
    )


def test_neither_size_nor_place_in_the_picture_matters(model):
    joints = film(70)
    np.testing.assert_allclose(
        arm_log_odds(model, LSP14, 420 * joints + 300 + 100j, FPS),
        arm_log_odds(model, LSP14, joints, FPS),
        atol=1e-6,
    )


def test_a_skeleton_without_these_bones_is_told_nothing(model):
    names = ("hip", "knee", "ankle")
    leg = Skeleton(names, (-1, 0, 1), (), (0.0, 0.25, 0.25), (1, 2))
    joints = np.zeros((5, 3), complex)
    np.testing.assert_array_equal(arm_log_odds(model, leg, joints, FPS), np.zeros(5))


def test_a_joint_that_is_not_there_keeps_the_others_telling(model):
    joints = film(70)
    joints[:, LSP14.index("left_wrist")] = np.nan
    odds = arm_log_odds(model, LSP14, joints, FPS)
    assert np.isfinite(odds).all()
    assert (odds > 0).mean() > 0.8


def test_whole_bodies_tell_arms_apart_that_were_in_one_place(model):
    body = film(30, seconds=3.0)
    upper = body[:, UPPER.joints].copy()
    one, other = (list(side) for side in UPPER.sides)
    middle = (upper[:, one] + upper[:, other]) / 2
    upper[20:35, one] = upper[20:35, other] = middle[20:35]
    wrong = exchange_sides(UPPER, upper, np.arange(len(upper)) >= 28)
    nothing = np.zeros(len(body))
    arms = ArmEvidence(model, LSP14, UPPER, body)
    told = identify_limbs(UPPER, wrong, IdentityEvidence(nothing, arms=arms), np.array([0]), FPS)
    assert told.exchanged[40:].all()
    assert not told.exchanged[:18].any()
    assert told.probability[60] > 0.95


def test_a_model_is_learnt_from_captures(tmp_path):
    captures = [play_tennis(MotionOptions(seconds=8.0, fps=50.0, seed=s)) for s in range(3)]
    options = SideTrainingOptions(poses=120_000, units=32)
    learnt = train_side_model(captures, 50.0, "three players", options)
    write_side_model(tmp_path / "sides.npz", learnt)
    read = read_side_model(tmp_path / "sides.npz")
    assert read.provenance == "three players"
    right = [(arm_log_odds(read, LSP14, film(yaw), FPS) > 0).mean() for yaw in range(0, 360, 60)]
    assert np.mean(right) > 0.75


def test_layers_that_lead_elsewhere_and_files_of_another_kind_are_refused():
    with pytest.raises(KeyreconError, match="leads from 273 inputs to one answer"):
        SideModel((np.zeros((273, 2)),), (np.zeros(2),), "")
    with pytest.raises(KeyreconError, match="side model"):
        read_side_model(BUILT_IN_DEPTH_MODEL)


def test_the_command_learns_from_files_what_run_can_use(tmp_path, monkeypatch, capsys):
    out = tmp_path / "mine.npz"
    call = ["keyrecon", "sides", str(tmp_path), "--out", str(out), "--poses", "2000"]
    monkeypatch.setattr(sys, "argv", call)
    (tmp_path / "walk.bvh").write_text(bvh_text(frames=200)[0])
    cli.main()
    assert "1 captures (walk)" in capsys.readouterr().out
    assert "walk" in read_side_model(out).provenance


def test_learning_without_scikit_learn_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn.neural_network", None)
    with pytest.raises(KeyreconError, match=r"pip install 'keyrecon\[learn\]'"):
        train_side_model([play_tennis(MotionOptions(2.0))], 50.0, "")
