"""Time measured in pose change."""

from dataclasses import replace

import numpy as np
import pytest
from sporting_poses import comparison_of, sporting_poses

from keyrecon.keyframes.coverage import TIME_UNIT
from keyrecon.keyframes.pose_time import elapsed_time, pose_change
from keyrecon.keyframes.selection import KeyframeOptions, choose_keyframes
from keyrecon.records import Shots
from keyrecon.timeline import without_steps_over_cuts

STROKES = np.concatenate([np.arange(120, 140), np.arange(420, 440)])


@pytest.fixture(scope="module")
def rare_strokes():
    """A player who shifts slowly from foot to foot and strikes twice in ten seconds: 8 in 100."""
    rng, poses = np.random.default_rng(4), np.zeros((500, 3))
    poses[:, 0] = 0.03 * np.sin(np.arange(500) / 40)
    swing = 0.06 * np.sin(np.linspace(0, 2 * np.pi, 20))
    poses[STROKES, 1] = np.tile(swing, 2)
    poses[STROKES, 2] = np.tile(np.abs(swing), 2)
    return comparison_of(poses + 0.0005 * rng.normal(size=poses.shape))


def test_all_frames_together_take_as_long_as_they_are_many():
    comparison = comparison_of(sporting_poses(seed=1))
    for share in (0.0, 0.35, 1.0):
        elapsed = elapsed_time(comparison, 0, 10, share)
        assert elapsed[0] == 0
        assert elapsed[-1] == pytest.approx(400 * TIME_UNIT, abs=1)
    assert np.array_equal(elapsed_time(comparison, 0, 10, 0.0), TIME_UNIT * np.arange(401))


def test_frames_whose_legs_lie_beneath_the_picture_leave_time_as_it_is_elsewhere():
    comparison = comparison_of(sporting_poses(seed=1))
    seen = comparison.seen.copy()
    seen[1, 200:203] = np.nan
    elapsed = elapsed_time(replace(comparison, seen=seen), 1, 10, 0.35)
    assert elapsed[-1] == pytest.approx(400 * TIME_UNIT, abs=1)
    usual = elapsed_time(comparison, 1, 10, 0.35)
    assert np.abs(elapsed - usual).max() < 3 * TIME_UNIT


def test_no_frame_takes_less_than_its_share_and_a_stroke_takes_longer(rare_strokes):
    time = np.diff(elapsed_time(rare_strokes, 0, 10, 0.35)) / TIME_UNIT
    assert time.min() >= 0.64
    assert time[STROKES].mean() > 3 * np.delete(time, STROKES).mean()


def test_a_pose_that_does_not_change_takes_as_long_as_any_other():
    still = comparison_of(np.zeros((60, 2)))
    assert np.array_equal(elapsed_time(still, 0, 10, 0.5), TIME_UNIT * np.arange(61))


def test_time_goes_more_slowly_where_the_body_is_hidden(rare_strokes):
    seen = np.ones((2, 500))
    seen[0, 100:200] = 0.0
    seen[0, 300:400] = 0.6
    hidden = replace(rare_strokes, seen=seen)
    before, after = (np.diff(elapsed_time(c, 0, 10, 0.2)) for c in (rare_strokes, hidden))
    assert after.sum() == pytest.approx(before.sum(), abs=1)
    ratio = after / before
    assert ratio[100:200].mean() == pytest.approx(ratio[:100].mean() / 2, rel=0.02)
    assert ratio[300:400].mean() == pytest.approx(ratio[:100].mean(), rel=0.02)
    paper = elapsed_time(hidden, 0, 10, 0.0)
    assert np.array_equal(paper, TIME_UNIT * np.arange(501))


def test_change_is_the_same_where_exemplars_stand_for_frames():
    poses = sporting_poses(count=200, seed=3)
    every = pose_change(comparison_of(poses[np.repeat(np.arange(200), 2)]), 0, 4)
    few = pose_change(comparison_of(poses, row=np.repeat(np.arange(200), 2)), 0, 4)
    assert np.allclose(every, few)


def test_rare_strokes_are_asked_for_and_waiting_stays_covered(rare_strokes):
    frames_alone, by_change = (
        choose_keyframes(rare_strokes, 50.0, KeyframeOptions(budget=0.012, pose_time=share)).upper
        for share in (0.0, KeyframeOptions().pose_time)
    )
    assert len(by_change.frames) == len(frames_alone.frames)
    inside = [np.isin(half.frames, STROKES).sum() for half in (frames_alone, by_change)]
    assert inside[1] > inside[0]
    assert by_change.coverage >= 0.95
    elapsed = elapsed_time(rare_strokes, 0, 10, KeyframeOptions().pose_time)
    assert np.diff(elapsed)[by_change.represented].sum() >= 0.8 * elapsed[-1]
    worst = [half.distance[STROKES].max() for half in (frames_alone, by_change)]
    assert worst[1] < worst[0]


def test_the_printed_choice_counts_frames_alone():
    comparison = comparison_of(sporting_poses(seed=1), sporting_poses(seed=2))
    chosen = [
        choose_keyframes(
            comparison, 50.0, KeyframeOptions(budget=0.02, method="paper", pose_time=share)
        )
        for share in (0.0, 0.35, 1.0)
    ]
    for other in chosen[1:]:
        assert np.array_equal(other.upper.frames, chosen[0].upper.frames)
        assert other.upper.beta == chosen[0].upper.beta


def test_a_cut_is_no_motion():
    """Two shots in which nobody moves, seen from two sides."""
    poses = np.repeat([[0.0, 0.0], [0.1, 0.0]], 150, axis=0)
    whole = comparison_of(poses)
    time = np.diff(
        elapsed_time(without_steps_over_cuts(whole, Shots.between((150,), 300)), 0, 10, 0.35)
    )
    assert (time == TIME_UNIT).all()
    assert np.diff(elapsed_time(whole, 0, 10, 0.35)).max() > 10 * TIME_UNIT
