"""Depth signs of marked frames."""

import numpy as np

from keyrecon.body import LSP14
from keyrecon.lifting.keyframe_signs import infer_keyframe_signs
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.lifting.preprocessing import KeyframeMarks, PreparedTracks
from keyrecon.numerics.bone_directions import pose_from_directions
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.records import Shots

FRAMES = 60
LEG = [LSP14.index("left_knee"), LSP14.index("left_ankle")]


def signs(joints):
    frames = np.array([10, 40])
    marked = np.isfinite(joints[frames]).all(axis=2)
    nobody = np.zeros((2, len(LSP14.bones)), dtype=np.int64)
    marks = KeyframeMarks(frames, marked, marked, nobody)
    tracks = PreparedTracks(joints, np.full((FRAMES, 14), 0.01), np.full((FRAMES, 14), 2.0))
    size = BodySize(LSP14, LSP14.lengths, np.array([0.145, 0.258]), np.full(FRAMES, 400.0))
    return infer_keyframe_signs(tracks, marks, size, Shots.between((), FRAMES), 50.0)


def test_where_in_the_picture_the_player_is_says_nothing_of_a_leg_that_is_never_seen():
    rng = np.random.default_rng(0)
    turn = rng.normal(size=(13, 3)) + 0.3 * np.sin(np.arange(FRAMES) / 9)[:, None, None]
    joints = pose_from_directions(unit_vectors(turn), LSP14.lengths, LSP14)[..., :2]
    joints[:, LEG] = np.nan
    here, there = signs(joints), signs(joints + 5.0)
    assert np.array_equal(here.sign, there.sign)
    assert np.allclose(here.probability, there.probability, atol=1e-6)
