"""Bone lengths from how long bones look."""

import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.lifting.limb_lengths import estimate_lengths
from keyrecon.numerics.bone_directions import pose_from_directions
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.records import Annotations, JointTracks

SCALE = 400.0
BONE_OF = {LSP14.names[child]: bone for bone, (_, child) in enumerate(LSP14.bones)}
ARMS, LEG = [BONE_OF["left_elbow"], BONE_OF["right_elbow"]], BONE_OF["left_ankle"]


@pytest.mark.parametrize(
    ("seed", "frames"), [(0, 600), (1, 600), (2, 600), (3, 600), (0, 1500), (1, 1500)]
)
def test_a_short_bone_that_points_at_the_camera_is_not_taken_for_a_long_one(seed, frames):
    rng = np.random.default_rng(seed)
    true = LSP14.lengths.copy()
    true[ARMS] *= 0.7
    directions = unit_vectors(rng.normal(size=(frames, 13, 3)))
    in_plane = 0.8 * np.sqrt(1 - rng.uniform(0, 1, (frames, 2, 1)) ** 2)
    flat = unit_vectors(directions[:, ARMS, :2])
    directions[:, ARMS] = np.concatenate([in_plane * flat, np.sqrt(1 - in_plane**2)], axis=-1)
    joints = SCALE * pose_from_directions(directions, true, LSP14)[..., :2]
    joints += 0.009 * SCALE * rng.standard_normal(joints.shape)
    marked = np.arange(0, frames, 60)
    nobody = np.zeros((len(marked), len(LSP14.bones)), dtype=np.int64)
    marks = Annotations(LSP14, marked, joints[marked], np.ones((len(marked), 14), bool), nobody)
    tracks = JointTracks(joints, np.ones((frames, 14)))
    found = estimate_lengths(tracks, marks, np.full(frames, SCALE), 25.0).lengths
    ratio = found[ARMS[0]] / found[LEG] / (true[ARMS[0]] / true[LEG])
    assert 0.75 < ratio < 1.1  # nobody can tell that eight tenths were not all


def test_elbows_of_no_confidence_that_lie_beyond_the_arm_make_no_arm_longer():
    rng, frames = np.random.default_rng(0), 600
    directions = unit_vectors(rng.normal(size=(frames, 13, 3)))
    joints = SCALE * pose_from_directions(directions, LSP14.lengths, LSP14)[..., :2]
    marked = np.arange(0, frames, 60)
    nobody = np.zeros((len(marked), len(LSP14.bones)), dtype=np.int64)
    marks = Annotations(LSP14, marked, joints[marked], np.ones((len(marked), 14), bool), nobody)
    elbows = [LSP14.index("left_elbow"), LSP14.index("right_elbow")]
    lost = np.setdiff1d(np.arange(420), marked)[:, None]
    confidence = np.ones((frames, 14))
    confidence[lost, elbows] = 0.0
    joints[lost, elbows] += [0.0, 1.6 * LSP14.lengths[ARMS[0]] * SCALE]
    tracks = JointTracks(joints, confidence)
    found = estimate_lengths(tracks, marks, np.full(frames, SCALE), 25.0).lengths
    assert found[ARMS[0]] / found[LEG] < 1.05 * LSP14.lengths[ARMS[0]] / LSP14.lengths[LEG]
