"""Stretches in which nobody is to be seen."""

from dataclasses import fields

import numpy as np
import pytest
from sporting_poses import comparison_of, sporting_poses

from keyrecon.io.formats.keyframes import keyframes_from_json, keyframes_to_json
from keyrecon.keyframes.absence import (
    absent_frames,
    legs_outside,
    select_frames,
    without_legs,
)
from keyrecon.keyframes.adoption import adopt_keyframes
from keyrecon.keyframes.selection import KeyframeOptions, choose_keyframes
from keyrecon.numerics.runs import list_runs
from keyrecon.records import Track
from keyrecon.report.sections import stands_for
from keyrecon.segmentation.player_crops import Cropping, Crops
from keyrecon.tracking.visibility import is_visible

AWAY = np.zeros(400, dtype=bool)
AWAY[150:230] = True
SPARSE = KeyframeOptions(budget=0.02)


@pytest.fixture(scope="module")
def poses():
    return sporting_poses(seed=1), sporting_poses(seed=2)


@pytest.mark.parametrize("stand_ins", [False, True])
def test_nobody_is_asked_to_mark_where_nobody_is(poses, stand_ins):
    row = None
    if stand_ins:  # every third frame stands for its neighbours, as in long videos
        row = np.arange(400) // 3
        poses = tuple(p[::3][: row[-1] + 1] for p in poses)
    chosen = choose_keyframes(comparison_of(*poses, 1.0 - AWAY, row), 50.0, SPARSE)
    for half in (chosen.upper, chosen.lower):
        assert not AWAY[half.frames].any() and not AWAY[half.nearest].any()
        assert not half.represented[AWAY].any() and half.coverage >= 0.95


def test_nobody_is_asked_to_mark_legs_below_the_edge_of_the_picture(poses):
    compared = without_legs(comparison_of(*poses, np.ones(400)), AWAY)
    chosen = choose_keyframes(compared, 50.0, SPARSE)
    assert chosen.upper.represented[AWAY].any()
    assert len(chosen.lower.frames) and not AWAY[chosen.lower.frames].any()
    assert np.isinf(chosen.lower.distance[AWAY]).all()
    assert not chosen.lower.represented[AWAY].any()


def test_legs_are_outside_where_the_picture_ends_above_the_knees():
    head = np.array([[50.0, 20.0], [50, 100], [50, 150]])
    feet = np.repeat(head[:, None] + [0.0, 200.0], 2, axis=1)
    feet[0, :, 1] = 199.0
    track = Track(head, feet, np.full(3, 200.0), np.zeros((3, 4)), np.ones(3))
    assert legs_outside(track, 250).tolist() == [False, False, True]


def test_no_keyframe_stands_for_frames_without_the_player(poses):
    chosen = choose_keyframes(comparison_of(*poses, 1.0 - AWAY), 50.0, SPARSE)
    again = keyframes_from_json(keyframes_to_json(chosen))
    for half in (chosen.upper, again.lower):
        assert np.isinf(half.distance[AWAY]).all() and np.isfinite(half.distance[~AWAY]).all()
        assert sum(stands_for(half, frame) for frame in half.frames.tolist()) == (~AWAY).sum()


def test_keyframes_are_those_of_the_video_with_the_stretch_cut_out(poses):
    whole = choose_keyframes(comparison_of(*poses, 1.0 - AWAY), 50.0, SPARSE)
    kept = np.flatnonzero(~AWAY)
    cut = comparison_of(*(p[kept] for p in poses))
    alone = choose_keyframes(cut, 50.0, KeyframeOptions(budget=0.02 * 400 / len(kept)))
    assert len(whole.upper.frames) == len(alone.upper.frames)
    assert whole.upper.beta == pytest.approx(alone.upper.beta, rel=0.1)


def test_unless_a_budget_is_set_an_absence_asks_for_no_more_marks(poses):
    whole = choose_keyframes(comparison_of(*poses, 1.0 - AWAY), 50.0)
    alone = choose_keyframes(comparison_of(*(p[~AWAY] for p in poses)), 50.0)
    for half, other in ((whole.upper, alone.upper), (whole.lower, alone.lower)):
        assert len(half.frames) == len(other.frames)


@pytest.mark.parametrize("method", ["coverage", "paper"])
@pytest.mark.parametrize("between", ["a cut", "an absence"])
def test_nothing_is_interpolated_over_a_cut_or_an_absence(method, between):
    """Nine odd poses around it are a gap that T would bridge, were they of one shot."""
    odd = np.zeros((260, 1))
    odd[[*range(26, 30), *range(230, 235)]] = 0.1
    away = np.zeros(260, dtype=bool)
    away[30:230] = between == "an absence"
    comparison = comparison_of(odd, visibility_score=1.0 - away)
    if between == "a cut":
        comparison = select_frames(comparison, np.r_[:30, 230:260])
    options = KeyframeOptions(0.1, coverage=1.0, method=method, beta_upper=0.03, beta_lower=0.03)
    half = choose_keyframes(comparison, 50.0, options).upper
    assert half.coverage == 1.0
    assert half.represented.sum() == 60


def test_some_of_some_frames_are_those_frames(poses):
    """As in long videos: the usable shots of a file, and of these a group of shots."""
    whole = comparison_of(*poses)
    usable, group = np.flatnonzero(~AWAY), np.r_[100:120, 200:320]
    twice, once = (
        select_frames(select_frames(whole, usable), group),
        select_frames(whole, usable[group]),
    )
    for field in fields(twice):
        np.testing.assert_array_equal(getattr(twice, field.name), getattr(once, field.name))
    steps = twice.consecutive_distance
    assert steps.shape == (2, len(group) - 1)
    assert np.flatnonzero(np.isnan(steps[0])).tolist() == [19]


def test_a_player_missed_for_a_moment_is_not_away():
    visibility_score, poses = np.ones(100), np.zeros((100, 2))
    visibility_score[40:50] = 0
    for_ten = comparison_of(poses, visibility_score=visibility_score.copy())
    assert not absent_frames(for_ten, reach=10).any()
    visibility_score[50] = 0
    for_eleven = comparison_of(poses, visibility_score=visibility_score)
    assert list_runs(absent_frames(for_eleven, reach=10)) == [(40, 50)]


def test_stretches_at_either_end_are_listed_whole():
    away = np.array([1, 1, 0, 1, 0, 0, 1], dtype=bool)
    assert list_runs(away) == [(0, 1), (3, 3), (6, 6)]


def test_what_a_person_marked_counts_wherever_it_is(poses):
    comparison = comparison_of(*poses, 1.0 - AWAY)
    asked = choose_keyframes(comparison, 50.0, SPARSE)
    marked = np.array([20, 180, 300])
    adopted = adopt_keyframes(comparison, asked, (marked, marked), SPARSE)
    np.testing.assert_array_equal(adopted.upper.frames, marked)
    assert adopted.upper.nearest[180] == 180


def test_a_comparison_of_present_frames_alone_is_left_as_it_is(poses):
    one, other = (
        choose_keyframes(comparison_of(*poses, visibility_score), 50.0, SPARSE).upper
        for visibility_score in (None, np.full(400, 0.5))
    )
    for record, same in ((one, other), (one.gains, other.gains)):
        for field in fields(record):
            if field.name != "gains":
                np.testing.assert_array_equal(
                    getattr(record, field.name), getattr(same, field.name)
                )


def test_an_empty_scene_between_head_and_feet_is_no_player():
    frames, height = 30, 100.0
    head = np.tile([200.0, 100.0], (frames, 1))
    feet = np.tile([[190.0, 200.0], [210.0, 200.0]], (frames, 1, 1))
    track = Track(head, feet, np.full(frames, height), np.zeros((frames, 4)), np.ones(frames))
    cropping = Cropping.below_heads(track, 56.0)
    rows, columns = cropping.size
    foreground = np.zeros((frames, rows, columns), np.uint8)
    foreground[:, :, columns // 2 - 6 : columns // 2 + 6] = 230
    foreground[10:14] //= 2  # half hidden behind the net
    foreground[20:25] = 0
    crops = Crops(np.zeros((frames, rows, columns, 3), np.uint8), foreground)
    np.testing.assert_array_equal(
        np.flatnonzero(~is_visible(crops, cropping, track, track.confidence > 0)), range(20, 25)
    )
