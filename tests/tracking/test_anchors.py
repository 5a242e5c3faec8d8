"""Marks of a person as fixed points of the track."""

from dataclasses import replace

import numpy as np
import pytest

from keyrecon.numerics.viterbi import TransitionModel, find_cheapest_track
from keyrecon.records import CameraPath, Pick, Track, TrackAnchors
from keyrecon.timeline import scatter_track, take_frames
from keyrecon.tracking.anchors import (
    DOUBT_SECONDS,
    FollowedHeads,
    anchored_states,
    distance_to_track,
    frames_off_anchors,
    least_sure_frames,
    outlier_marks,
    with_bridge_costs,
)


def standing(count, confidence=1.0):
    """A player of 100 px who stands still at x = 50."""
    head, feet = np.tile([50.0, 20.0], (count, 1)), np.tile([[44.0, 120], [56, 120]], (count, 1, 1))
    sure = np.broadcast_to(confidence, count).astype(float)
    return Track(head, feet, np.full(count, 100.0), np.zeros((count, 4)), sure)


def walking(count):
    """The same player at 2 px per frame."""
    still, way = standing(count), 2.0 * np.arange(count)[:, None] * [1, 0]
    return replace(still, head=still.head + way, feet=still.feet + way[:, None])


def replace_head(anchors, row, shift):
    """Anchors with one head moved."""
    head = anchors.head.copy()
    head[row] += shift
    return replace(anchors, head=head)


def marks(track, frames, shift=(0.0, 0.0)):
    """Anchors where the track is, moved by a shift."""
    frames = np.array(frames)
    head, feet = track.head[frames] + shift, track.feet[frames] + shift
    every, unknown = np.ones(len(frames), dtype=bool), np.full(len(frames), np.nan)
    nowhere = np.full((len(frames), 2), np.nan)
    return TrackAnchors(frames, head, feet, every, unknown, ~every, nowhere, unknown)


def test_a_path_passes_through_a_mark_however_cheap_the_way_around_it_is():
    states = [np.zeros((1, 1, 2))] * 9
    marked = np.full((9, 1, 2), np.nan)
    marked[4] = 500.0
    places, costs = anchored_states(states, [np.zeros(1)] * 9, marked)
    taken = find_cheapest_track(costs, places, TransitionModel(1.0, 25))
    assert taken[4] == 0
    assert (places[4] == 500).all()


def test_between_two_marks_a_head_is_not_taken_for_what_looks_more_like_one_far_away():
    marked = np.full((60, 1, 2), np.nan)
    marked[[0, 59]] = 0.0
    states, costs = [np.array([[[3.0, 0.0]], [[300.0, 0.0]]])] * 60, [np.array([1.5, 0.0])] * 60
    places, anchored = anchored_states(states, costs, marked)
    strayed = find_cheapest_track(anchored, places, TransitionModel(2.0, 25))
    assert (strayed[1:-1] == 1).all()
    costs = with_bridge_costs(states, costs, marked, 2.0)
    places, anchored = anchored_states(states, costs, marked)
    assert (find_cheapest_track(anchored, places, TransitionModel(2.0, 25)) == 0).all()


def test_who_runs_away_from_the_last_mark_is_not_given_up_for_who_stands_there():
    seconds = np.arange(60) / 30
    runner = np.stack([80 + 200 * seconds, 0 * seconds], axis=1)  # an athlete 80 px tall: 4.5 m/s
    marked = np.full((60, 1, 2), np.nan)
    marked[0] = runner[0]
    states = [np.array([[place], [[80.0, 8.0]]]) for place in runner]
    costs = [np.array([0.5, 1.5])] * 60
    costs = with_bridge_costs(states, costs, marked, 3.0 * 80 / 30)
    places, anchored = anchored_states(states, costs, marked)
    assert (find_cheapest_track(anchored, places, TransitionModel(3.0 * 80 / 30, 15)) == 0).all()


def test_a_bridge_forgives_more_the_farther_a_mark_is_and_most_between_marks():
    marked = np.full((101, 1, 2), np.nan)
    marked[[0, 40]] = 0.0
    costs = with_bridge_costs([np.full((1, 1, 2), 4.0)] * 101, [np.zeros(1)] * 101, marked, 2.0)
    cost = np.concatenate(costs)
    assert (np.diff(cost[1:21]) < 0).all()
    assert (np.diff(cost[21:40]) > 0).all()
    assert (np.diff(cost[41:]) < 0).all()
    assert with_bridge_costs([np.ones((1, 1, 2))], [np.ones(1)], marked[1:2], 2.0) == [np.ones(1)]


def followed(places, doubt, count=40):
    """A head at x = 0 that flow leads along `places`, with some doubt, in a camera that pans."""
    frames = np.arange(count)
    paths = np.tile(np.eye(3), (count, 1, 1))
    paths[:, 0, 2] = -3.0 * frames
    nothing = np.full((count, 2), np.nan)
    anchors = replace(
        marks(standing(count), frames),
        head=nothing,
        followed_head=places + 3.0 * frames[:, None] * [1, 0],
        head_doubt=np.full(count, doubt),
    )
    return FollowedHeads.of(anchors, frames, CameraPath(paths, np.ones(count)), 100.0)


def test_where_flow_leads_is_a_candidate_and_what_lies_elsewhere_pays_as_much_as_flow_is_sure():
    way = np.tile([50.0, 20.0], (40, 1))
    elsewhere = [np.array([[[50.0, 20.0]], [[90.0, 20.0]]])] * 40
    for doubt in (0.01, 0.3):
        states, costs = followed(way, doubt).with_costs(elsewhere, [np.zeros(2)] * 40)
        for state, cost in zip(states, costs, strict=True):
            np.testing.assert_allclose(state[2, 0], [50, 20])
            np.testing.assert_allclose(cost[:2], [0, -np.log(doubt)], atol=1e-6)


def test_a_shoulder_that_looks_like_a_head_is_left_where_flow_leads_the_head():
    shoulder = [np.array([[[70.0, 40.0]]])] * 40
    way = np.tile([50.0, 20.0], (40, 1))
    for doubt, expected in ((0.02, 1), (0.9, 0)):
        states, costs = followed(way, doubt).with_costs(shoulder, [np.zeros(1)] * 40)
        taken = find_cheapest_track(costs, states, TransitionModel(3.0, 25))
        assert (taken == expected).all()


def test_where_flow_leads_nowhere_nothing_is_added():
    states, costs = followed(np.full((40, 2), np.nan), 0.1).with_costs(
        [np.zeros((1, 1, 2))] * 40, [np.zeros(1)] * 40
    )
    assert all(len(state) == 1 for state in states)
    assert not np.any(costs)


def test_marks_where_the_track_is_contradict_nothing_and_others_are_named():
    track = standing(30)
    assert len(frames_off_anchors(track, marks(track, [3, 9]))) == 0
    assert frames_off_anchors(track, marks(track, [3, 9], (20.0, 0.0))).tolist() == [3, 9]


def test_feet_contradict_in_no_particular_order_and_what_is_not_marked_contradicts_nothing():
    track = standing(30)
    crossed = marks(track, [5])
    crossed = replace(crossed, head=crossed.head * np.nan, feet=crossed.feet[:, ::-1])
    assert len(frames_off_anchors(track, crossed)) == 0


def test_the_next_mark_is_asked_for_where_the_track_is_least_sure_and_no_mark_is_near():
    confidence = np.ones(200)
    confidence[120:150] = 0.0
    first, second = least_sure_frames(standing(200, confidence), np.array([0]), 50.0, 2)
    assert 115 < first < 155 or 115 < second < 155
    assert abs(first - second) > DOUBT_SECONDS * 50


def test_what_is_left_out_is_no_doubt_of_the_frames_beside_it():
    track = standing(200, np.full(200, 0.9))
    inside = np.r_[0:100, 150:200]
    left_out = scatter_track(take_frames(track, inside), inside, 200)
    (asked,) = least_sure_frames(left_out, np.array([60]), 25.0, 1)
    assert asked not in range(95, 155)  # as unsure as all others, and as far away as some


def test_a_mark_that_the_player_would_have_to_jump_to_is_named_and_others_are_not():
    track = walking(60)
    wrong = replace_head(marks(track, [10, 30, 50]), 1, (40.0, 0.0))
    (found,) = outlier_marks(track, wrong, 25.0)
    assert (found.frame, found.part) == (30, "head")
    assert found.distance == pytest.approx(0.4, abs=0.01)
    assert outlier_marks(track, marks(track, [0, 10, 30, 59]), 25.0) == []


def test_in_a_shot_that_is_left_out_no_mark_is_off_and_nothing_is_contradicted():
    track = standing(60)
    left_out = scatter_track(take_frames(track, slice(30)), np.arange(30), 60)
    far = marks(track, [10, 45], (60.0, 0.0))
    assert frames_off_anchors(left_out, far).tolist() == [10]
    assert {mark.frame for mark in outlier_marks(left_out, far, 25.0)} == {10}


def test_feet_in_either_order_lie_on_their_way():
    track = walking(60)
    crossed = marks(track, [30])
    crossed = replace(crossed, feet=crossed.feet[:, ::-1])
    assert outlier_marks(track, crossed, 25.0) == []
    off = replace(crossed, feet=crossed.feet + np.array([0, 60.0]))
    assert [mark.part for mark in outlier_marks(track, off, 25.0)] == ["feet"]


def test_a_click_lies_as_far_from_the_track_as_from_the_nearer_foot():
    track = standing(3)
    assert distance_to_track(track, Pick(1, "foot", 56.0, 120.0)) == 0
    assert distance_to_track(track, Pick(1, "head", 50.0, 70.0)) == pytest.approx(0.5)


def test_marks_of_a_player_who_turns_over_lie_on_their_way_and_wrong_ones_do_not():
    """A back flip in .6 s: head and feet go round the middle of the body, and no straight way."""
    track = somersaulting(60, 25.0)
    assert outlier_marks(track, marks(track, [20, 26, 31, 38]), 25.0) == []
    wrong = replace_head(marks(track, [20, 31, 50]), 1, (0.0, 130.0))
    assert [(m.frame, m.part) for m in outlier_marks(track, wrong, 25.0)] == [(31, "head")]


def somersaulting(count, fps):
    """Upright, once over from 1 s on within .6 s, upright again."""
    turn = np.clip((np.arange(count) / fps - 1.0) / 0.6, 0, 1) * 2 * np.pi
    axis = np.stack([np.sin(turn), -np.cos(turn)], axis=1)
    still = standing(count)
    middle, reach = np.array([50.0, 70.0]), 0.45 * still.height[:, None]
    feet = (middle - reach * axis)[:, None] + np.array([[-5.0, 0.0], [5.0, 0.0]])
    return replace(still, head=middle + reach * axis, feet=feet)
