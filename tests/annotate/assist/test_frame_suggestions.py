"""Why a keyframe is one, and where one more would help most."""

from dataclasses import replace

import numpy as np
import pytest
from sporting_poses import comparison_of, sporting_poses

from keyrecon.annotate.assist.frame_suggestions import explain_keyframes, suggest_frames
from keyrecon.annotate.server.descriptions import describe_keyframes
from keyrecon.body import LSP14
from keyrecon.keyframes.selection import KeyframeOptions, choose_keyframes
from keyrecon.records import Annotations, Motion
from keyrecon.timeline import cut_motion

COUNT = 200


@pytest.fixture(scope="module")
def comparison():
    return comparison_of(sporting_poses(COUNT, seed=1), sporting_poses(COUNT, seed=2))


@pytest.fixture(scope="module")
def keyframes(comparison):
    return choose_keyframes(comparison, 50.0, KeyframeOptions(budget=0.015))


def annotated(frames):
    """All joints marked on some frames."""
    frames = np.array(frames, dtype=np.int64)
    joints = np.zeros((len(frames), 14, 2))
    signs = np.zeros((len(frames), 13), dtype=np.int64)
    return Annotations(LSP14, frames, joints, np.ones((len(frames), 14), bool), signs)


def result(confidence):
    """A motion of which only the confidence matters."""
    nowhere = np.zeros((COUNT, 14, 2))
    return Motion(
        LSP14, np.zeros((COUNT, 14, 3)), nowhere, nowhere, confidence,
        np.zeros((COUNT, 14), dtype=np.int64), np.ones(COUNT), 50.0, np.arange(COUNT) / 50, "m",
        np.arange(3),
    )  # fmt: skip


def test_every_frame_is_best_served_by_some_keyframe(comparison, keyframes):
    reasons = explain_keyframes(comparison, keyframes, {})
    assert reasons.keys() == set(keyframes.frames.tolist())
    assert sum(reason.stands_for for reason in reasons.values()) >= COUNT
    assert all(reason.why for reason in reasons.values())


def test_the_motion_of_a_video_that_was_shorter_suggests_nothing(comparison):
    motion = result(np.full((COUNT, 14), 0.5))
    assert suggest_frames(comparison, motion, annotated([3]))
    first = cut_motion(motion, slice(0, 120))
    assert suggest_frames(comparison, first, annotated([3, 150])) == []


def test_frames_without_the_player_are_no_reason_for_a_keyframe():
    visible = np.ones(COUNT)
    visible[60:120] = 0
    comparison = comparison_of(sporting_poses(COUNT, seed=1), visibility_score=visible)
    chosen = choose_keyframes(comparison, 50.0, KeyframeOptions(budget=0.015))
    only = replace(chosen, lower=chosen.upper)
    reasons = explain_keyframes(comparison, only, {})
    assert sum(reason.stands_for for reason in reasons.values()) == COUNT - 60
    described = describe_keyframes(only, {}, LSP14, {})
    assert sum(keyframe["stands_for"] for keyframe in described) == COUNT - 60


def test_what_a_keyframe_is_for_is_told_for_the_halves_it_was_chosen_for(comparison, keyframes):
    reasons = explain_keyframes(comparison, keyframes, {})
    for frame, reason in reasons.items():
        assert ("upper body" in reason.why) == (frame in keyframes.upper.frames)
        assert ("lower body" in reason.why) == (frame in keyframes.lower.frames)


def test_a_frame_that_the_person_added_takes_frames_from_the_others(comparison, keyframes):
    own = int(keyframes.upper.distance.argmax())
    before = explain_keyframes(comparison, keyframes, {})
    after = explain_keyframes(comparison, keyframes, {own: "upper"})
    assert after[own].why.startswith("You added it. Shows the upper body")
    assert after[own].stands_for >= 1
    assert sum(before[f].stands_for for f in before) > sum(after[f].stands_for for f in before)


def test_frames_that_are_unsure_and_unlike_all_annotated_ones_are_suggested_first():
    poses = np.repeat([[0.0, 0], [0.05, 0], [0, 0.05], [0.05, 0.05]], COUNT // 4, axis=0)
    comparison = comparison_of(poses + 1e-4 * np.random.default_rng(0).normal(size=poses.shape))
    confidence = np.full((COUNT, 14), 0.9)
    confidence[100:150] = 0.1
    found = suggest_frames(comparison, result(confidence), annotated([10]))
    assert 100 <= found[0].frame < 150
    assert [s.gain for s in found] == sorted((s.gain for s in found), reverse=True)
    # each of the poses that nobody annotated once
    assert sorted(s.frame // 50 for s in found[:3]) == [1, 2, 3]
    assert all(s.half == "both" for s in found[:3])


def test_only_the_half_that_needs_it_is_asked_for(comparison):
    confidence = np.ones((COUNT, 14))
    confidence[:, LSP14.is_lower] = 0.3
    found = suggest_frames(comparison, result(confidence), annotated([3, 90]))
    assert {s.half for s in found} == {"lower"}
    assert all("hip" in s.why or "knee" in s.why or "ankle" in s.why for s in found)


def test_taken_frames_are_never_suggested_and_none_twice(comparison):
    motion = result(np.full((COUNT, 14), 0.5))
    first = suggest_frames(comparison, motion, annotated([3]))
    taken = frozenset(s.frame for s in first)
    again = suggest_frames(comparison, motion, annotated([3]), taken)
    assert len(taken) == len(first) == 5
    assert not taken & {s.frame for s in again}


def test_unclear_frames_are_not_suggested_while_clear_ones_do_as_well(comparison):
    visibility_score = np.ones(COUNT)
    visibility_score[::2] = 0.3
    blurred = replace(comparison, visibility_score=visibility_score)
    found = suggest_frames(blurred, result(np.full((COUNT, 14), 0.5)), annotated([3]))
    assert all(s.frame % 2 for s in found)


def test_a_motion_that_is_sure_of_everything_needs_nothing(comparison):
    assert suggest_frames(comparison, result(np.ones((COUNT, 14))), annotated([3])) == []
