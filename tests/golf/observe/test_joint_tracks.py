"""Tracked joints of the legs."""

import numpy as np

from keyrecon.body import LSP14
from keyrecon.golf.observe.appearance_tracker import PointTrack
from keyrecon.golf.observe.joint_tracks import (
    REPEATED_CLICK,
    TRACK_SPREAD,
    drop_climbing_foot,
    drop_slid_knees,
    head_spread,
    hold_leading_foot,
)

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


def click_spreads():
    """Of a click in frame 2, px."""
    spread = np.full((10, 14), np.inf)
    spread[2, ANKLE] = 3.0
    return spread


def test_a_leading_foot_that_is_not_tracked_stays_where_it_was_clicked():
    joints, spread = legs(), click_spreads()
    joints[:, LSP14.mirror[ANKLE]] = (60.0, 210.0)
    joints[np.arange(10) != 2, ANKLE] = np.nan
    hold_leading_foot(joints, spread, "left", clicked=2)
    assert (joints[:, ANKLE] == (100.0, 200.0)).all()
    assert (spread[np.arange(10) != 2, ANKLE] == REPEATED_CLICK * spread[2, ANKLE]).all()


def test_a_foot_that_is_hidden_may_have_stepped_as_far_as_the_other_one():
    joints, spread = legs(), click_spreads()
    other = LSP14.mirror[ANKLE]
    joints[:, other], joints[6:, other], joints[9, other] = (60.0, 210.0), (90.0, 250.0), np.nan
    joints[np.arange(10) != 2, ANKLE] = np.nan
    hold_leading_foot(joints, spread, "left", clicked=2)
    assert (spread[6:9, ANKLE] > 50).all() and (spread[3:6, ANKLE] < 10).all()
    assert np.isnan(joints[9, ANKLE]).all()


def test_a_leading_foot_that_nobody_clicked_is_not_known():
    joints, spread = np.full((10, 14, 2), np.nan), np.full((10, 14), np.inf)
    joints[:, LSP14.mirror[ANKLE]] = (60.0, 210.0)
    hold_leading_foot(joints, spread, "left", clicked=2)
    assert np.isnan(joints[:, ANKLE]).all()


def test_a_leading_foot_that_climbs_the_leg_is_lost_for_good():
    joints = legs()
    joints[:, LSP14.mirror[ANKLE]] = (60.0, 210.0)
    joints[6:, ANKLE] = (104.0, 150.0)
    joints[9, ANKLE] = (100.0, 190.0)
    drop_climbing_foot(joints, "left", clicked=2, height=400.0)
    assert np.isfinite(joints[:6, ANKLE]).all() and np.isnan(joints[6:, ANKLE]).all()


def test_a_leading_foot_that_steps_back_with_the_other_one_is_not_lost():
    joints = legs()
    joints[:2, ANKLE], joints[:, LSP14.mirror[ANKLE]] = (104.0, 150.0), (60.0, 210.0)
    joints[:2, LSP14.mirror[ANKLE]] = (64.0, 160.0)
    drop_climbing_foot(joints, "left", clicked=2, height=400.0)
    assert np.isfinite(joints[:, ANKLE]).all()


def test_a_head_that_turns_is_known_while_it_is_seen_and_not_once_it_is_lost():
    confidence = np.array([1.0, 1.0, 0.5, 0.2, 0.0])
    turns = np.array([0.0, -2.0, -2.0, -2.0, -2.0])
    straight, turned, half_seen, lost, gone = head_spread(
        PointTrack(np.zeros((5, 2)), turns, confidence)
    )
    assert straight == TRACK_SPREAD["head_top"]
    assert straight < turned == half_seen < 0.1
    assert 0.5 < lost < gone
