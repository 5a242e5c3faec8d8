"""What is expected to be wrong, and where."""

from dataclasses import replace

import numpy as np
import pytest

from keyrecon import uncertainty
from keyrecon.body import LSP14
from keyrecon.records import SOURCES, Motion, Shots, Track
from keyrecon.uncertainty import (
    describe_uncertainty,
    expected_error,
    measure_correction,
    player_height,
    uncertain_parts,
    uncertain_share,
    uncertain_stretches,
    unsure_track,
    worst_frames,
)

FRAMES, PIXELS, ARMS = 100, 200.0, slice(6, 12)


def make_motion(confidence=None, moved=None):
    """A body whose bones are the table's, `PIXELS` px tall; `moved` px by the refinement."""
    skeleton, points = LSP14, np.zeros((FRAMES, 14, 3))
    order = [skeleton.root]
    while order:
        joint = order.pop()
        for child in [c for c, p in enumerate(skeleton.parents) if p == joint]:
            points[:, child] = points[:, joint] + [0, skeleton.proportions[child], 0]
            order.append(child)
    points2d = points[..., :2] * PIXELS
    shift = np.zeros((FRAMES, 14)) if moved is None else moved
    motion = Motion(
        skeleton=skeleton,
        points3d=points,
        points2d=points2d,
        points2d_propagated=points2d + np.stack([shift, 0 * shift], axis=2),
        confidence=np.full((FRAMES, 14), 0.9) if confidence is None else confidence,
        source=np.ones((FRAMES, 14), int),
        scale=np.full(FRAMES, PIXELS),
        fps=25.0,
        time=np.arange(FRAMES) / 25.0,
        units="body heights",
        keyframes=np.array([0]),
    )
    return replace(motion, expected_error=expected_error(motion))


def with_lost_arms(first, last):
    confidence, moved = np.full((FRAMES, 14), 0.9), np.zeros((FRAMES, 14))
    confidence[first : last + 1, ARMS], moved[first : last + 1, ARMS] = 0.0, 0.2 * PIXELS
    motion = make_motion(confidence, moved)
    away = np.zeros((FRAMES, 14, 2))  # lost arms wander
    away[first : last + 1, ARMS, 1] = 0.01 * PIXELS * np.arange(last + 1 - first)[:, None]
    motion = replace(
        motion,
        points2d=motion.points2d + away,
        points2d_propagated=motion.points2d_propagated + away,
    )
    return replace(motion, expected_error=expected_error(motion))


def test_a_player_is_as_tall_as_the_bones_say():
    assert player_height(make_motion()) == pytest.approx(PIXELS)
    metres = make_motion()
    metres = replace(metres, points3d=1.8 * metres.points3d, scale=metres.scale / 1.8, units="m")
    assert player_height(metres) == pytest.approx(PIXELS)


def test_every_table_is_monotone_so_that_more_doubt_never_makes_an_error_smaller():
    for name, (edges, factors) in uncertainty.ERROR_TABLES.items():
        assert len(edges) == len(factors)
        assert (np.diff(edges) > 0).all()
        steps = np.diff(factors)
        assert (steps <= 0).all() if name == "part_confidence" else (steps >= 0).all()
    errors = make_motion().expected_error
    assert (errors > 0).all()
    lost = with_lost_arms(0, FRAMES - 1).expected_error
    assert errors.max() < lost[:, ARMS].min() <= uncertainty.MAX_ERROR * PIXELS


def test_a_joint_that_was_not_propagated_counts_as_moved_far():
    motion = make_motion()
    lost = motion.points2d_propagated.copy()
    lost[3, 4] = np.nan
    motion = replace(motion, points2d_propagated=lost)
    assert measure_correction(motion)[3, 4] == uncertainty.MAX_ERROR
    assert expected_error(motion)[3, 4] > 2 * expected_error(motion)[3, 5]


def test_a_joint_that_other_limbs_have_elsewhere_is_expected_to_be_farther_off():
    motion = make_motion()
    doubted = np.zeros((FRAMES, 14))
    sure = expected_error(replace(motion, elsewhere=doubted))
    assert (sure <= expected_error(motion)).all()  # of which nobody told
    doubted = doubted.copy()
    doubted[3, 4], doubted[3, 5] = 0.8, 0.15
    told = expected_error(replace(motion, elsewhere=doubted))
    assert told[3, 4] > told[3, 5] > sure[3, 5]
    np.testing.assert_array_equal(told[4], sure[4])


def test_a_stretch_is_told_with_its_part_its_size_and_the_frame_to_mark():
    (stretch,) = uncertain_stretches(with_lost_arms(41, 50))
    assert (stretch.first, stretch.last, stretch.what, stretch.half) == (41, 50, "arms", "upper")
    assert 43 <= stretch.frame <= 48
    assert stretch.error > uncertainty.UNCERTAIN * PIXELS
    assert stretch.text == (
        f"Frames 41-50: arms uncertain, about {stretch.error:.0f} px; marking frame "
        f"{stretch.frame} would help most."
    )


def test_frames_within_a_stretch_are_told_as_uncertain_and_others_are_not():
    assert uncertain_parts(with_lost_arms(41, 50), [20, 41, 46, 51]) == ["", "arms", "arms", ""]


def test_no_line_covers_more_than_one_mark_can_help():
    stretches = uncertain_stretches(with_lost_arms(5, 94), count=9)
    reach = round(uncertainty.TAUGHT_SECONDS * 25)
    for stretch in stretches:
        assert stretch.first <= stretch.frame <= stretch.last
        assert stretch.frame - stretch.first <= reach >= stretch.last - stretch.frame
    told = np.concatenate([np.arange(s.first, s.last + 1) for s in stretches])
    assert len(np.unique(told)) == len(told)
    assert len(told) >= 0.8 * 90


def test_a_player_is_measured_once_for_however_many_stretches(monkeypatch):
    """A motion of an hour has a thousand, and measuring takes all of its frames."""
    motion, measured, measure = with_lost_arms(5, 94), [], uncertainty.player_height
    monkeypatch.setattr(
        uncertainty, "player_height", lambda motion: measured.append(1) or measure(motion)
    )
    assert len(uncertain_stretches(motion, count=9)) > 1
    assert len(measured) == 1


def test_no_stretch_reaches_over_frames_without_a_motion_or_into_another_shot():
    motion = with_lost_arms(30, 60)
    points, errors = motion.points3d.copy(), motion.expected_error.copy()
    scale = motion.scale.copy()
    points[43:47], errors[43:47], scale[43:47] = np.nan, np.nan, np.nan  # under MERGED_SECONDS
    gone = replace(motion, points3d=points, expected_error=errors, scale=scale, cuts=np.array([52]))
    stretches = uncertain_stretches(gone, count=9)
    told = [(stretch.first, stretch.last) for stretch in stretches]
    assert told == [(30, 42), (47, 51), (52, 60)]
    assert all(s.first <= s.frame <= s.last for s in stretches)
    assert np.isclose([s.error for s in stretches], stretches[0].error, rtol=0.1).all()


def test_whatever_the_next_shot_begins_with_the_same_frame_of_this_one_is_asked_for():
    motion = replace(with_lost_arms(30, 39), cuts=np.array([40]))
    (asked,) = uncertain_stretches(motion)
    errors = motion.expected_error.copy()
    errors[40:61, ARMS] = uncertainty.MAX_ERROR * PIXELS
    followed = replace(motion, expected_error=errors)
    assert uncertain_stretches(followed, count=9)[0].frame == asked.frame


def test_the_share_of_uncertain_frames_is_that_of_the_frames_with_lost_parts():
    assert uncertain_share(make_motion()) == 0
    assert uncertain_share(with_lost_arms(41, 60)) == pytest.approx(0.2)
    assert uncertain_share(replace(make_motion(), expected_error=None)) == 0


def test_a_sure_motion_and_one_of_a_former_version_tell_nothing():
    assert uncertain_stretches(make_motion()) == []
    former = replace(with_lost_arms(41, 50), expected_error=None)
    assert uncertain_stretches(former) == []
    assert worst_frames(former) == []


def test_stretches_after_the_worst_are_named_in_one_line():
    """Whoever reads the output of a run sees every frame that is uncertain."""
    lines = describe_uncertainty(with_lost_arms(5, 94))
    every = uncertain_stretches(with_lost_arms(5, 94), count=FRAMES)
    assert len(every) > 3 and len(lines) == 1 + 3 + 1
    assert all(
        stretch.text in lines or f"{stretch.first}-{stretch.last} (arms)" in lines[-1]
        for stretch in every
    )
    assert describe_uncertainty(make_motion()) == []


def test_a_stretch_that_was_marked_since_is_no_longer_told():
    motion = with_lost_arms(41, 50)
    (stretch,) = uncertain_stretches(motion)
    assert uncertain_stretches(motion, np.array([stretch.frame])) == []
    assert uncertain_stretches(motion, np.array([stretch.frame + 30])) == [stretch]


def test_worst_frames_lie_apart_and_name_the_joints_that_are_lost():
    frames = worst_frames(with_lost_arms(41, 50), count=3)
    assert 41 <= frames[0][0] <= 50
    names = {name for name, _ in frames[0][1]}
    assert names <= set(LSP14.names[ARMS])
    assert min(np.diff(sorted(frame for frame, _ in frames))) > 10
    shown = [np.mean([error for _, error in joints]) for _, joints in frames]
    assert shown == sorted(shown, reverse=True)  # the reader sees what they are ordered by


def test_a_track_that_is_a_guess_for_long_asks_for_the_body_in_its_middle():
    nowhere = np.zeros((FRAMES, 2))
    confidence = np.full(FRAMES, 0.8)
    confidence[20:41] = 0.1
    confidence[70:73] = 0.1
    track = Track(
        head=nowhere,
        feet=np.zeros((FRAMES, 2, 2)),
        confidence=confidence,
        box=np.zeros((FRAMES, 4)),
        height=np.full(FRAMES, PIXELS),
    )
    (stretch,) = unsure_track(track, Shots.between((), FRAMES), reach=10)
    assert (stretch.first, stretch.last, stretch.frame, stretch.half) == (20, 40, 30, "both")
    assert "px" not in stretch.text
    (stretch,) = unsure_track(track, Shots.between((28,), FRAMES), reach=10)
    assert (stretch.first, stretch.last, stretch.frame) == (28, 40, 34)


def swinging(fps):
    """Four seconds of a body that swings to and fro once a second."""
    count = round(4 * fps)
    still = make_motion()
    values = {
        name: np.repeat(getattr(still, name)[:1], count, axis=0)
        for name in ("points3d", "points2d", "points2d_propagated", "confidence", "source", "scale")
    }
    time = np.arange(count) / fps
    way = 0.3 * PIXELS * np.sin(2 * np.pi * time)[:, None, None]
    values["points2d"] = values["points2d"] + way
    values["points2d_propagated"] = values["points2d_propagated"] + way
    return replace(still, **values, fps=fps, time=time, expected_error=None)


def test_the_same_motion_is_as_sure_at_any_frame_rate():
    expected = [expected_error(swinging(fps)).mean() for fps in (25.0, 50.0, 200.0)]
    assert expected == pytest.approx([expected[0]] * 3, rel=0.03)


def with_unseen_arms():
    """Arms at rest that nobody saw, marked on the first frame and the last: nothing to correct."""
    confidence, source = np.full((FRAMES, 14), 0.9), np.ones((FRAMES, 14), int)
    confidence[1:-1, ARMS], source[[0, -1]] = 0.0, SOURCES.index("annotated")
    motion = replace(make_motion(confidence), source=source)
    return replace(motion, expected_error=expected_error(motion))


def test_arms_of_which_nothing_was_seen_are_the_less_sure_the_farther_a_mark_is():
    error = with_unseen_arms().expected_error[:, ARMS] / PIXELS
    assert (error[[0, -1]] < 0.02).all()
    assert (error[5:-5] > 0.15).all()
    assert (np.diff(error[1 : FRAMES // 2], axis=0) >= 0).all()


def test_arms_that_rest_unseen_are_told_and_legs_that_are_seen_are_not():
    motion = with_unseen_arms()
    assert uncertain_share(motion) > 0.9
    assert {stretch.what for stretch in uncertain_stretches(motion)} == {"arms"}
