"""Tracks of a head that walks, is lost, and jumps to somebody else."""

import numpy as np
import pytest

from keyrecon.records import CameraPath, Track
from keyrecon.tracking.scale import player_boxes
from keyrecon.tracking.tracklets import linked_to_player

COUNT, FPS, TALL = 150, 30.0, 100.0
STILL = CameraPath(np.tile(np.eye(3), (COUNT, 1, 1)), np.ones(COUNT))
WALK = np.stack([100 + 2.0 * np.arange(COUNT), np.full(COUNT, 80.0)], axis=1)
"""Head of a player who walks .6 heights a second."""
OTHER = WALK[::-1] + np.array([600, 150])
"""Head of somebody else, always more than two heights away."""


def track_of(head, lost=()):
    """A track of that head; in the `lost` frames it lies between those around them."""
    head, frames = np.array(head), np.arange(COUNT)
    seen = ~np.isin(frames, lost)
    for axis in (0, 1):
        head[:, axis] = np.interp(frames, frames[seen], head[seen, axis])
    feet = head[:, None] + np.array([(-10.0, TALL), (10.0, TALL)])
    height = np.full(COUNT, TALL)
    return Track(head, feet, height, player_boxes(head, feet, height), seen.astype(float))


def with_other(first, end):
    return np.where(np.isin(np.arange(COUNT), range(first, end))[:, None], OTHER, WALK)


def runs(linked):
    turns = np.flatnonzero(np.diff(linked, prepend=False, append=False))
    return [(int(a), int(b) - 1) for a, b in turns.reshape(-1, 2)]


@pytest.mark.parametrize(("marked", "linked"), [(20, (0, 89)), (120, (90, 149))])
def test_what_lies_beyond_a_jump_is_not_the_player_who_was_marked(marked, linked):
    track = track_of(with_other(90, COUNT))
    head = track.head[[marked]]
    assert runs(linked_to_player(track, STILL, np.array([marked]), head, FPS)) == [linked]


def test_of_a_short_slip_only_the_slip_is_left_out():
    track = track_of(with_other(60, 75))
    linked = linked_to_player(track, STILL, np.array([20]), WALK[[20]], FPS)
    assert runs(linked) == [(0, 59), (75, 149)]


def test_who_walks_does_not_move_aside_faster_than_a_sprinter_starts():
    beside = WALK + np.where(np.arange(COUNT)[:, None] < 90, (0, 0), (50, 35))
    linked = linked_to_player(track_of(beside), STILL, np.array([20]), WALK[[20]], FPS)
    assert runs(linked) == [(0, 89)]


def test_who_runs_is_no_other():
    fast = np.stack([100 + 22.0 * np.arange(COUNT), np.full(COUNT, 80.0)], axis=1)
    assert linked_to_player(track_of(fast), STILL, np.array([20]), fast[[20]], FPS).all()


def test_who_is_found_again_beyond_what_a_person_can_go_is_somebody_else():
    track = track_of(with_other(90, COUNT), lost=range(80, 95))
    linked = linked_to_player(track, STILL, np.array([20]), WALK[[20]], FPS)
    assert linked[:80].all() and not linked[95:].any()


def test_a_player_who_was_hidden_for_a_while_is_the_same():
    track = track_of(WALK, lost=range(60, 100))
    assert linked_to_player(track, STILL, np.array([20]), WALK[[20]], FPS).all()


def test_nobody_jumps_where_the_camera_does():
    shift = np.tile(np.eye(3), (COUNT, 1, 1))
    shift[90:, 0, 2] = 500.0
    track = track_of(np.where(np.arange(COUNT)[:, None] < 90, WALK, WALK - np.array([500, 0])))
    camera = CameraPath(shift, np.ones(COUNT))
    assert linked_to_player(track, camera, np.array([20]), WALK[[20]], FPS).all()


def test_marks_on_both_sides_and_no_marks_leave_the_track_as_it_is():
    track = track_of(with_other(90, COUNT))
    marked = np.array([20, 120])
    assert linked_to_player(track, STILL, marked, track.head[marked], FPS).all()
    assert linked_to_player(track, STILL, marked[:0], track.head[marked[:0]], FPS).all()


def test_a_mark_that_lies_off_the_track_tells_nothing_of_it():
    track = track_of(with_other(90, COUNT))
    assert linked_to_player(track, STILL, np.array([120]), WALK[[120]], FPS).all()
