"""Bone lengths corrected by what is learnt of bodies."""

from dataclasses import replace

import numpy as np
import pytest

from keyrecon.body import LSP14, standing_length
from keyrecon.io.formats.model_file import read_depth_model
from keyrecon.lifting.length_correction import correct_lengths
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.numerics.bone_directions import bone_vectors
from keyrecon.records import Shots
from keyrecon.synthetic.motion import MotionOptions, play_tennis

FPS, SCALE = 50.0, 300.0
BONE_OF = {LSP14.names[child]: bone for bone, (_, child) in enumerate(LSP14.bones)}
THIGHS = [BONE_OF["right_knee"], BONE_OF["left_knee"]]


@pytest.fixture(scope="module")
def model():
    return read_depth_model()


@pytest.fixture(scope="module")
def seen():
    """Joints in the picture, px, filmed obliquely from 20 degrees above, and their true size.

    Off by .9 % of the height, as propagated joints are.
    """
    points = play_tennis(MotionOptions(10.0, fps=FPS, seed=41))
    yaw, down = np.radians([40.0, 20.0])
    across = points[..., 0] * np.cos(yaw) + points[..., 2] * np.sin(yaw)
    away = points[..., 2] * np.cos(yaw) - points[..., 0] * np.sin(yaw)
    below = -points[..., 1] * np.cos(down) - away * np.sin(down)
    lengths = np.linalg.norm(bone_vectors(points, LSP14), axis=-1).mean(axis=0)
    joints = np.stack([across, below], axis=-1)
    joints += 0.009 * 1.8 * np.random.default_rng(0).standard_normal(joints.shape)
    scale = np.full(len(points), SCALE)
    return SCALE * joints, BodySize(LSP14, lengths, np.ones(2), scale)


def correct(size, joints, model, rounds=4):
    return correct_lengths(size, joints, model, FPS, rounds, Shots.between((), len(joints)))


def seen_lengths(size):
    return size.lengths * size.scale[0]


@pytest.mark.parametrize("factor", [0.88, 1.12])
def test_a_length_that_is_wrong_comes_nearer_to_the_truth(model, seen, factor):
    joints, true = seen
    lengths = true.lengths.copy()
    lengths[THIGHS] *= factor
    after = correct(replace(true, lengths=lengths), joints, model)
    off = np.log(seen_lengths(after) / seen_lengths(true))[THIGHS]
    assert (np.abs(off) < 0.5 * abs(np.log(factor))).all()


@pytest.mark.parametrize("factor", [0.92, 1.08])
def test_a_scale_that_is_wrong_comes_nearer_to_the_truth(model, seen, factor):
    joints, true = seen
    after = correct(replace(true, scale=true.scale * factor), joints, model)
    off = np.log(seen_lengths(after) / seen_lengths(true)).mean()
    assert abs(off) < 0.5 * abs(np.log(factor))


@pytest.mark.parametrize("seed", range(3))
def test_a_body_of_wrong_proportions_comes_nearer_to_the_truth(model, seen, seed):
    joints, true = seen
    wrong = np.random.default_rng(seed).choice([-0.15, 0.15], len(true.lengths))
    wrong = wrong[np.minimum(np.arange(len(wrong)), LSP14.bone_mirror)]
    after = correct(replace(true, lengths=true.lengths * np.exp(wrong)), joints, model)
    off = np.log(seen_lengths(after) / seen_lengths(true))
    assert np.sqrt((off**2).mean()) < 2 / 3 * 0.15


def test_both_sides_stay_alike_and_the_body_as_tall(model, seen):
    joints, true = seen
    after = correct(true, joints, model)
    ratio = after.lengths / true.lengths
    np.testing.assert_allclose(ratio, ratio[LSP14.bone_mirror])
    standing = [standing_length(size.lengths, LSP14) for size in (true, after)]
    np.testing.assert_allclose(*standing)


def test_a_bone_that_is_never_observed_keeps_its_length(model, seen):
    joints, true = seen
    joints = joints.copy()
    joints[:, [LSP14.index("right_wrist"), LSP14.index("left_wrist")]] = np.nan
    after = correct(true, joints, model)
    wrists = [BONE_OF["right_wrist"], BONE_OF["left_wrist"]]
    np.testing.assert_allclose(seen_lengths(after)[wrists], seen_lengths(true)[wrists])


def test_frames_in_which_a_joint_is_not_observed_say_nothing_of_the_other_bones(model, seen):
    joints, true = seen
    half = len(joints) // 2
    hidden = joints.copy()
    hidden[half:, [LSP14.index("right_knee"), LSP14.index("left_wrist")]] = np.nan
    lengths = correct(true, hidden, model).lengths
    seen_before = replace(true, scale=true.scale[: half - round(0.4 * FPS)])
    only_before = correct(seen_before, joints[: half - round(0.4 * FPS)], model).lengths
    np.testing.assert_allclose(lengths, only_before, rtol=0.01)


def test_a_larger_picture_has_a_larger_scale_and_the_same_body(model, seen):
    joints, true = seen
    small = correct(true, joints, model)
    large = correct(replace(true, scale=2 * true.scale), 2 * joints, model)
    np.testing.assert_allclose(large.lengths, small.lengths)
    np.testing.assert_allclose(large.scale, 2 * small.scale)


def test_no_round_changes_nothing(model, seen):
    joints, true = seen
    assert correct(true, joints, model, rounds=0) is true
