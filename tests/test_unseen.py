"""Where nobody is seen for long there is no motion."""

from dataclasses import replace

import numpy as np
import pytest
from small_motion import make_motion

from keyrecon.body import LSP14
from keyrecon.records import SOURCES, Annotations, JointTracks
from keyrecon.unseen import BRIDGED_SECONDS, without_hidden_legs, without_unseen

COUNT = 100
INTERPOLATED = SOURCES.index("interpolated")


def motion_unseen_in(*stretches, cuts=None):
    """A motion of which nothing was marked or carried in the stretches."""
    motion = make_motion(frames=COUNT)
    source = motion.source.copy()
    for first, end in stretches:
        source[first:end] = INTERPOLATED
    return replace(motion, source=source, cuts=None if cuts is None else np.array(cuts))


def runs(flags):
    turns = np.flatnonzero(np.diff(flags, prepend=False, append=False))
    return [(int(a), int(b)) for a, b in turns.reshape(-1, 2)]


def test_before_the_player_comes_and_when_the_player_has_left_there_is_no_motion():
    motion = motion_unseen_in((0, 30), (80, COUNT))
    shown = without_unseen(motion)
    assert runs(shown.known) == [(30, 80)]
    assert np.isnan(shown.points2d[~shown.known]).all()
    assert np.isfinite(shown.time).all() and (shown.confidence[~shown.known] == 0).all()
    assert (shown.points3d[shown.known] == motion.points3d[shown.known]).all()
    assert [s.start for s in shown.stretches] == [30]
    assert shown.cuts.tolist() == [30, 80]


@pytest.mark.parametrize(("seconds", "bridged"), [(0.9, True), (1.2, False)])
def test_a_moment_is_bridged_and_a_longer_time_is_not(seconds, bridged):
    fps = make_motion(frames=COUNT).fps
    end = 40 + round(seconds * BRIDGED_SECONDS * fps)
    assert without_unseen(motion_unseen_in((40, end))).known[40:end].all() == bridged


def test_from_one_side_half_as_much_is_told():
    fps = make_motion(frames=COUNT).fps
    count = round(0.7 * BRIDGED_SECONDS * fps)
    assert not without_unseen(motion_unseen_in((0, count))).known[:count].any()
    assert not without_unseen(motion_unseen_in((50, 50 + count), cuts=[50])).known[50]
    assert without_unseen(motion_unseen_in((50, 50 + count))).known.all()


def test_one_joint_that_was_carried_is_enough():
    motion = motion_unseen_in((0, 40))
    motion.source[:40, 3] = SOURCES.index("propagated")
    assert without_unseen(motion) is motion


def test_of_legs_below_the_picture_nothing_is_known_and_of_the_rest_what_was():
    tracks = JointTracks(np.zeros((4, 14, 2)), np.full((4, 14), 0.5))
    outside = np.array([False, True, True, False])
    legs = np.array([name.endswith(("knee", "ankle")) for name in LSP14.names])
    joints = np.where(LSP14.is_lower[:, None], np.nan, np.zeros((1, 14, 2)))
    joints[0, LSP14.index("left_knee")] = 0.0
    seen, signs = np.isfinite(joints[..., 0]), np.zeros((1, len(LSP14.bones)), int)
    marks = Annotations(LSP14, np.array([2]), joints, seen, signs)
    known = without_hidden_legs(tracks, marks, outside)
    confidence = known.confidence
    np.testing.assert_array_equal(np.isfinite(known.joints).all(axis=2), confidence > 0)
    assert (confidence[1, legs] == 0).all()
    assert (confidence[2, legs] > 0).sum() == 1
    assert (confidence[:, ~legs] == 0.5).all() and (confidence[[0, 3]] == 0.5).all()
