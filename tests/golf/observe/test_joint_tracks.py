"""Tracked joints of the legs."""

import numpy as np

from keyrecon.body import LSP14
from keyrecon.golf.observe.joint_tracks import drop_slid_knees

KNEE, ANKLE = LSP14.index("left_knee"), LSP14.index("left_ankle")


def legs(frames=10):
    joints = np.full((frames, 14, 2), np.nan)
    joints[:, KNEE], joints[:, ANKLE] = (100.0, 100.0), (100.0, 200.0)
    return joints


def test_a_knee_that_runs_away_from_a_hidden_foot_is_lost():
    joints = legs()
    joints[4:, ANKLE] = np.nan
    joints[6:, KNEE] = (300.0, 20.0)
    drop_slid_knees(joints, "left", clicked=2)
    assert np.isfinite(joints[:6, KNEE]).all() and np.isnan(joints[6:, KNEE]).all()


def test_a_knee_before_the_clicked_frame_is_held_against_the_foot_after_it():
    joints = legs()
    joints[:3, ANKLE] = np.nan
    joints[0, KNEE] = (100.0, -50.0)
    drop_slid_knees(joints, "left", clicked=6)
    assert np.isnan(joints[0, KNEE]).all() and np.isfinite(joints[1:, KNEE]).all()
