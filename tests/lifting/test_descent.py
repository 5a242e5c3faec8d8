"""The printed descent on a whole body: what of its motion passes."""

import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.lifting.preprocessing import PreparedTracks
from keyrecon.lifting.refinement import descend_motion
from keyrecon.lifting.solver import MotionState
from keyrecon.numerics.bone_directions import pose_from_directions
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.records import Shots

CUT_OFF = 6.94
"""Hz: what passes at -3 dB at 50 frames per second."""


def passed(frequency, fps):
    """Which part of its sway a body keeps that sways as a whole, at `frequency` Hz."""
    time = np.arange(round(6 * fps)) / fps
    directions = unit_vectors(np.random.default_rng(0).normal(size=(1, 13, 3)))
    directions = directions.repeat(len(time), axis=0)
    sway = 0.3 * np.sin(2 * np.pi * frequency * time)
    root = np.stack([sway, 0 * sway], axis=1)
    joints = pose_from_directions(directions, LSP14.lengths, LSP14)[..., :2] + root[:, None]
    tracks = PreparedTracks(joints, np.ones(joints.shape[:2]), np.ones(joints.shape[:2]))
    size = BodySize(LSP14, LSP14.lengths, np.array([0.145, 0.258]), np.ones(len(time)))
    still = MotionState(0 * root, directions)
    found = descend_motion(still, tracks, size, Shots.between((), len(time)), fps)
    middle = slice(len(time) // 4, -len(time) // 4)
    return found.root[middle, 0].std() / sway[middle].std()


@pytest.mark.parametrize("fps", [15.0, 25.0, 29.97, 50.0, 120.0])
def test_the_same_motion_passes_at_every_frame_rate(fps):
    assert passed(CUT_OFF, fps) == pytest.approx(0.707, abs=0.005)
    assert passed(0.5 * CUT_OFF, fps) > 0.84


def test_a_video_too_slow_for_what_the_low_pass_removes_is_left_alone():
    assert passed(3.0, 12.0) == pytest.approx(1.0, abs=0.005)
