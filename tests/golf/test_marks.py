"""Marks of several makers."""

import numpy as np
import pytest

from keyrecon.golf.marks import correct_tracks, join_marks
from keyrecon.golf.records import SwingMarks


def test_marks_of_two_makers_are_joined_and_the_first_counts():
    first = SwingMarks(
        np.array([3]), np.full((1, 14, 2), np.nan), np.ones((1, 2, 2)),
        np.array([1, np.nan, np.nan, np.nan]),
    )  # fmt: skip
    first.joints[0, 2] = 5, 6
    second = SwingMarks.of_joints(np.array([3, 7]), np.full((2, 14, 2), 9.0))
    both = join_marks(first, second)
    assert both.frames.tolist() == [3, 7]
    assert both.joints[0, 2].tolist() == [5, 6]
    assert (both.joints[0, 3:] == 9).all() and (both.joints[1] == 9).all()
    assert np.isfinite(both.shafts).all(axis=(1, 2)).tolist() == [True, False]
    np.testing.assert_array_equal(both.keys, first.keys)


def tracks_off_by(off, *frames):
    """Two still tracks, and marks of the first one some px beside it."""
    joints = np.full((60, 14, 2), np.nan)
    joints[:, :2] = 100, 200
    marked = np.full((len(frames), 14, 2), np.nan)
    marked[:, 0] = 100 + np.array(off), 200
    return joints, SwingMarks.of_joints(np.array(frames), marked)


@pytest.mark.parametrize("clicked", [0, 20])
def test_a_mark_in_the_clicked_frame_corrects_a_joint_that_was_clicked_beside_its_place(clicked):
    """Nothing drifts: the whole track was as much beside."""
    joints, marks = tracks_off_by(40, clicked)
    corrected = correct_tracks(joints, marks, clicked)
    np.testing.assert_allclose(corrected[:, 0], np.tile([140, 200], (60, 1)))
    np.testing.assert_array_equal(corrected[:, 1:], joints[:, 1:])


def test_a_track_drifts_evenly_from_the_click_to_a_mark():
    joints, marks = tracks_off_by(40, 10)
    corrected = correct_tracks(joints, marks, clicked=0)
    np.testing.assert_allclose(corrected[[0, 5, 10, 59], 0, 0], [100, 120, 140, 140])


def test_from_a_click_outside_of_the_film_nothing_drifts():
    """Such a track entered the film beside its place, by nobody knows how much."""
    joints, marks = tracks_off_by(40, 10)
    corrected = correct_tracks(joints, marks, clicked=None)
    np.testing.assert_allclose(corrected[:, 0, 0], 140)
