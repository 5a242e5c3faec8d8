"""Marks of several makers."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from keyrecon.golf import swing_fit
from keyrecon.golf.fit.handedness import mirror_marks
from keyrecon.golf.fit.residuals import project
from keyrecon.golf.marks import (
    add_shafts,
    carry_marks,
    correct_tracks,
    hold_club,
    join_marks,
    place_marks,
    unrefuted_shafts,
)
from keyrecon.golf.observe.film import Film, frame_step
from keyrecon.golf.observe.shaft_hypotheses import ShaftHypotheses
from keyrecon.golf.records import Camera, SwingMarks
from keyrecon.io.formats.model_file import read_motion_model
from keyrecon.io.video import Video
from tests.support.golf_truth import FPS, FRAMES, observed, swing_at


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


def film_of(numbers):
    place = np.interp(np.arange(FRAMES), numbers, np.arange(len(numbers)))
    still, whole = np.tile(np.eye(3), (FRAMES, 1, 1)), (0, FRAMES - 1)
    return Film(
        numbers, numbers / FPS, place, still, (1280, 720), np.zeros(2), True, whole, 0.0, whole
    )


def turned(shafts, others):
    """Angles between shafts, degrees."""
    one, other = shafts[:, 1] - shafts[:, 0], others[:, 1] - others[:, 0]
    cross = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    return np.degrees(np.abs(np.arctan2(cross, (one * other).sum(axis=1))))


def test_a_mark_between_fitted_frames_is_held_where_it_moved_on_to():
    numbers = np.arange(0, FRAMES, frame_step(FPS))
    filmed, fitted = swing_at(np.arange(FRAMES)), swing_at(numbers)
    between = np.arange(numbers[90], numbers[106], frame_step(FPS)) + 1
    at = np.zeros(4) * np.nan
    marks = SwingMarks(between, filmed.motion.points2d[between], filmed.club2d[between], at)
    placed = place_marks(marks, film_of(numbers))
    assert turned(placed.shafts, fitted.club2d[placed.frames]).max() > 5
    carried = carry_marks(placed, fitted)
    assert turned(carried.shafts, fitted.club2d[placed.frames]).max() < 1
    joints = fitted.motion.points2d[placed.frames]
    assert np.abs(carried.joints - joints).max() < 1.5 < np.abs(placed.joints - joints).max()
    assert mirror_marks(placed, 1280).late is placed.late


def test_a_fit_with_guided_detection_has_the_marks_that_go_along(monkeypatch):
    numbers = np.arange(0, FRAMES, frame_step(FPS))
    fitted, between = swing_at(numbers), np.array([numbers[98] + 1])
    marked = swing_at(np.arange(FRAMES)).club2d[between]
    marks = SwingMarks(between, np.full((1, 14, 2), np.nan), marked, np.full(4, np.nan))
    placed = place_marks(marks, film_of(numbers))
    seen = replace(observed(numbers), marks=placed)
    monkeypatch.setattr(swing_fit, "detect_club_guided", lambda seen, *_: seen)
    monkeypatch.setattr(swing_fit, "detect_swing_events", lambda *_: fitted.keys.copy())
    monkeypatch.setattr(swing_fit, "fit_observations", lambda *_: fitted)
    video = Video(Path("v.mp4"), 1280, 720, numbers, numbers / FPS, FPS / 3, 0, False, None)
    guided = swing_fit.fit_guided(seen, fitted, video, read_motion_model())
    for held in (guided.club, guided.update(seen).club):
        assert turned(held[98:99], fitted.club2d[98:99])[0] < 1


def shaft_marked(fitted, at, degrees):
    """A mark of the shaft of one frame, turned from the fitted one, held a little beside it."""
    hands, head = fitted.club2d[at]
    turn = np.radians(degrees)
    rotated = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    beside = hands + np.array([4, -3])
    marked = np.array([[beside, beside + 1.1 * rotated @ (head - hands)]])
    return SwingMarks(np.array([at]), np.full((1, 14, 2), np.nan), marked, np.full(4, np.nan))


def test_a_marked_shaft_is_where_it_was_marked_and_those_around_turn_along():
    """The head moves by tens of px a frame there, so that the angle is carried on, not the px."""
    fitted, at = swing_at(np.arange(FRAMES)), 280
    marks, unseen = shaft_marked(fitted, at, 20), np.full_like(fitted.club2d, np.nan)
    held = hold_club(fitted, marks, unseen, 1000.0)
    np.testing.assert_allclose(held.club2d[at], marks.shafts[0], atol=1e-3)
    around = turned(held.club2d, fitted.club2d)
    assert around[at - 8 : at + 9].min() > 15 and around[[0, -1]].max() < 0.1
    camera = Camera(1000.0, np.array([639.5, 359.5]))
    np.testing.assert_allclose(project(held.club[at], camera)[0], marks.shafts[0], atol=1e-3)


def test_a_club_that_was_detected_as_it_was_fitted_is_not_turned_by_a_mark_beside_it():
    fitted, at = swing_at(np.arange(FRAMES)), 280
    marks, detected = shaft_marked(fitted, at, 20), fitted.club2d.copy()
    detected[at - 4 : at + 5] = np.nan
    held = hold_club(fitted, marks, detected, 1000.0)
    np.testing.assert_allclose(held.club2d[at], marks.shafts[0], atol=1e-2)
    around = turned(held.club2d, fitted.club2d)
    assert around[at - 2 : at + 3].min() > 10
    assert np.delete(around, slice(at - 12, at + 13)).max() < 3


def test_what_an_earlier_fit_detected_stays_where_no_marked_shaft_near_by_refutes_it():
    numbers = np.arange(FRAMES)
    fitted, seen, at = swing_at(numbers), observed(numbers), 280
    right = unrefuted_shafts(fitted, seen, shaft_marked(fitted, at, 5))
    assert right.frames.tolist() == np.flatnonzero(np.isfinite(seen.club[:, 0, 0])).tolist()
    np.testing.assert_array_equal(right.shafts, seen.club[right.frames])
    wrong = unrefuted_shafts(fitted, seen, shaft_marked(fitted, at, 60))
    lost = np.setdiff1d(right.frames, wrong.frames) / FPS
    assert len(lost) and np.abs(lost - at / FPS).max() < 0.15


def test_a_shaft_that_was_detected_earlier_may_be_the_club_like_any_other():
    line = np.array([[[100.0, 100.0], [100.0, 200.0]]])
    shafts = [ShaftHypotheses(line, np.array([0.4]), np.array([True]))] * 3
    earlier = SwingMarks(
        np.array([1]), np.full((1, 14, 2), np.nan), line + 30, np.full(4, np.nan)
    )  # fmt: skip
    added = add_shafts(shafts, earlier, height=400.0)
    assert [len(a.ends) for a in added] == [1, 2, 1]
    np.testing.assert_array_equal(added[1].ends[1], line[0] + 30)
    assert added[1].weight.tolist() == [0.4, 0.25]


def test_a_swing_without_marked_shafts_keeps_its_club():
    fitted = swing_at(np.arange(0, FRAMES, 8))
    joints = SwingMarks.of_joints(np.array([3]), np.full((1, 14, 2), 5.0))
    assert hold_club(fitted, joints, fitted.club2d, 1000.0) is fitted
