"""Facts about keyframes that a person annotated, asked for or not."""

from dataclasses import replace

import numpy as np
import pytest
from capsule_player import marks, scene, standing
from sporting_poses import comparison_of, sporting_poses

from keyrecon.keyframes.adoption import adopt_keyframes, keep_marked
from keyrecon.keyframes.selection import KeyframeOptions, choose_keyframes
from keyrecon.pipeline import with_marked_keyframes
from keyrecon.propagation.marked_poses import distances_to
from keyrecon.records import PLAYER, Shots


@pytest.fixture(scope="module")
def comparison():
    return comparison_of(sporting_poses(seed=1), sporting_poses(seed=2))


@pytest.fixture(scope="module")
def chosen(comparison):
    return choose_keyframes(comparison, 50.0, KeyframeOptions(budget=0.015))


def every_second_frame_is_an_exemplar(poses):
    """A comparison in which each frame stands for itself and the next, and the distance between."""
    comparison = comparison_of(poses[::2], row=np.repeat(np.arange(len(poses) // 2), 2))
    step = np.linalg.norm(poses[1::2] - poses[::2], axis=1)
    exemplar_distance = np.zeros((2, len(poses)), dtype=np.float32)
    exemplar_distance[:, 1::2] = step
    return replace(comparison, exemplar_distance=exemplar_distance)


def test_adopting_the_choice_gives_the_choice_back(comparison, chosen):
    frames = chosen.upper.frames, chosen.lower.frames
    adopted = adopt_keyframes(comparison, chosen, frames)
    for ours, theirs in ((adopted.upper, chosen.upper), (adopted.lower, chosen.lower)):
        assert np.array_equal(ours.nearest, theirs.nearest)
        assert np.array_equal(ours.represented, theirs.represented)
        assert ours.coverage == theirs.coverage


def one_pose_around_a_turn(cut=None):
    """40 frames of one pose, of which the 9 from frame 16 on show nine others; a cut in them."""
    poses = np.zeros((40, 2))
    poses[16:25] = 1 + np.arange(18).reshape(9, 2)
    comparison = comparison_of(poses)
    steps = comparison.consecutive_distance.copy()
    if cut is not None:
        steps[:, cut - 1] = np.nan
    return replace(comparison, consecutive_distance=steps)


def test_frames_before_a_cut_are_no_neighbours_of_those_after_it(chosen):
    first = np.array([0])
    whole, cut = (
        adopt_keyframes(one_pose_around_a_turn(at), chosen, (first, first)).upper
        for at in (None, 20)
    )
    assert whole.coverage == 1
    assert cut.coverage == pytest.approx(1 - 9 / 40)
    assert cut.gains.coverage == pytest.approx([1 - 9 / 40])


def test_of_a_shot_without_the_player_nothing_is_covered_however_short_it_is(chosen):
    comparison = one_pose_around_a_turn()
    steps, visible = comparison.consecutive_distance.copy(), np.ones(40)
    steps[:, [15, 24]], visible[16:25] = np.nan, 0
    left_out = replace(comparison, consecutive_distance=steps, visibility_score=visible)
    half = adopt_keyframes(left_out, chosen, (np.array([0]), np.array([0]))).upper
    assert half.coverage == 1  # of the frames that show the player
    assert not np.isfinite(half.distance[16:25]).any()
    assert np.isfinite(np.delete(half.distance, slice(16, 25))).all()


@pytest.mark.parametrize("method", ["coverage", "paper"])
def test_keyframes_that_were_annotated_tell_how_those_asked_for_were_chosen(comparison, method):
    asked = choose_keyframes(comparison, 50.0, KeyframeOptions(budget=0.015, method=method))
    assert (
        adopt_keyframes(comparison, asked, (asked.upper.frames[1:], asked.lower.frames)).method
        == method
    )


def test_one_more_keyframe_stands_for_what_it_is_nearest_to(comparison, chosen):
    worst = int(chosen.upper.distance.argmax())
    frames = np.union1d(chosen.upper.frames, [worst]), chosen.lower.frames
    adopted = adopt_keyframes(comparison, chosen, frames).upper
    assert adopted.nearest[worst] == worst
    assert adopted.distance.sum() < chosen.upper.distance.sum()
    assert (adopted.distance <= chosen.upper.distance).all()
    assert adopted.coverage >= chosen.upper.coverage


def test_a_person_may_annotate_a_frame_that_is_no_exemplar():
    poses = sporting_poses(400, seed=4)
    comparison = every_second_frame_is_an_exemplar(poses)
    asked = choose_keyframes(comparison, 50.0, KeyframeOptions(budget=0.015))
    own = 101
    adopted = adopt_keyframes(comparison, asked, (np.array([own]), asked.lower.frames)).upper
    assert adopted.frames.tolist() == [own]
    assert (adopted.nearest == own).all()
    assert adopted.distance[own] == 0
    assert adopted.represented[own]


def test_a_frame_goes_to_the_keyframe_next_to_it_when_one_exemplar_stands_for_both():
    still = comparison_of(np.zeros((1, 2)), row=np.zeros(60, dtype=np.int64))
    asked = choose_keyframes(still, 50.0, KeyframeOptions(budget=0.02))
    own = np.array([10, 40])
    adopted = adopt_keyframes(still, asked, (own, own)).upper
    assert adopted.nearest[[0, 10, 20, 30, 40, 59]].tolist() == [10, 10, 10, 40, 40, 40]


def test_a_keyframe_is_no_distance_from_itself_even_where_an_exemplar_stands_for_it():
    comparison = every_second_frame_is_an_exemplar(sporting_poses(100, seed=5))
    apart = distances_to(comparison, "upper", np.array([31, 60]))
    assert apart[31, 0] == apart[60, 1] == 0
    assert (np.delete(apart[:, 0], 31) >= comparison.exemplar_distance[0, 31]).all()


def test_a_mark_takes_no_place_of_a_keyframe_that_it_does_not_represent():
    """One exemplar stands for both, and neither shows the pose of the other."""
    comparison = every_second_frame_is_an_exemplar(sporting_poses(400, seed=6))
    asked = choose_keyframes(comparison, 50.0, KeyframeOptions(budget=0.015))
    keyframe = next(int(f) for f in asked.upper.frames if f % 2 == 0)
    apart = comparison.exemplar_distance.copy()
    for far, kept in ((2 * asked.upper.beta, True), (asked.upper.beta / 2, False)):
        apart[:, keyframe + 1] = far
        own = np.array([keyframe + 1]), np.array([], int)
        with_mark = keep_marked(replace(comparison, exemplar_distance=apart), asked, own)
        assert keyframe + 1 in with_mark.upper.frames
        assert (keyframe in with_mark.upper.frames) == kept


def test_a_mark_in_a_shot_that_is_left_out_takes_no_keyframe_of_a_used_one():
    made, truth = scene([standing()] * 12, [4])
    for shows, kept in (("somebody else", [4]), (PLAYER, [10])):
        shown = replace(made, shots=Shots((0, 8), 12, (PLAYER, shows)))
        with_mark = with_marked_keyframes(shown, marks(truth, [10]))
        assert with_mark.keyframes.upper.frames.tolist() == kept
