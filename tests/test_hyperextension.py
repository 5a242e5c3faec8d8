"""Knees that bend forwards in space are told; nobody who moves as people do is accused."""

from dataclasses import replace

import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.hyperextension import (
    MAX_HYPEREXTENSION,
    hyperextended_stretches,
    knee_hyperextension,
)
from keyrecon.records import Motion
from keyrecon.synthetic.motion import MotionOptions, play_tennis

KNEE, ANKLE = LSP14.index("left_knee"), LSP14.index("left_ankle")


@pytest.fixture(scope="module")
def tennis():
    """Camera axes from metres with Y up."""
    points = play_tennis(MotionOptions(4.0, seed=3)) * np.array([1.0, -1.0, -1.0])
    frames, joints = points.shape[:2]
    return Motion(
        skeleton=LSP14,
        points3d=points,
        points2d=points[..., :2],
        points2d_propagated=points[..., :2],
        confidence=np.ones((frames, joints)),
        source=np.ones((frames, joints), int),
        scale=np.full(frames, 200.0),
        fps=50.0,
        time=np.arange(frames) / 50.0,
        units="m",
        keyframes=np.array([0, 60]),
    )


def with_knee_forward(motion, first, last, degrees=50.0):
    """The left shank turned forwards about the hips from the line of the thigh."""
    points = motion.points3d.copy()
    hips = points[:, LSP14.index("right_hip")] - points[:, LSP14.index("left_hip")]
    hips /= np.linalg.norm(hips, axis=1, keepdims=True)
    thigh = points[:, KNEE] - points[:, LSP14.index("left_hip")]
    across = thigh - (thigh * hips).sum(axis=1, keepdims=True) * hips
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    turn = np.radians(degrees)
    shank = np.cos(turn) * across + np.sin(turn) * np.cross(hips, across)
    length = np.linalg.norm(points[:, ANKLE] - points[:, KNEE], axis=1, keepdims=True)
    forward = points[:, KNEE] + length * shank
    points[first : last + 1, ANKLE] = forward[first : last + 1]
    return replace(motion, points3d=points)


def test_a_player_who_moves_as_people_do_is_not_accused(tennis):
    assert knee_hyperextension(tennis.points3d, LSP14).max() < MAX_HYPEREXTENSION
    assert hyperextended_stretches(tennis) == []


def test_a_mirrored_body_bends_its_knees_alike(tennis):
    mirrored = tennis.points3d[:, LSP14.mirror] * np.array([-1.0, 1.0, 1.0])
    here, there = (knee_hyperextension(p, LSP14) for p in (tennis.points3d, mirrored))
    np.testing.assert_allclose(here, there[:, ::-1], atol=1e-9)


def test_a_knee_that_bends_forwards_is_told_with_its_side_and_the_frame_to_mark(tennis):
    (stretch,) = hyperextended_stretches(with_knee_forward(tennis, 30, 49))
    assert (stretch.first, stretch.last, stretch.side) == (30, 49, "left")
    assert 30 <= stretch.frame <= 49
    assert stretch.angle == pytest.approx(50, abs=12)  # the thigh is not quite across the hips
    assert stretch.text.startswith("Frames 30-49: the left knee bends forwards in space, by up to")
    assert f"frame {stretch.frame}" in stretch.text


def test_a_moment_is_not_told_and_neither_is_what_was_marked_since(tennis):
    assert hyperextended_stretches(with_knee_forward(tennis, 30, 32)) == []
    wrong = with_knee_forward(tennis, 50, 69)
    assert len(hyperextended_stretches(wrong, np.array([60]))) == 1  # of which it was made
    assert hyperextended_stretches(wrong, np.array([60, 64])) == []


def test_a_stretch_ends_with_its_shot_and_is_not_seen_where_nobody_is(tennis):
    wrong = with_knee_forward(tennis, 50, 89)
    apart = replace(wrong, cuts=np.array([70]))
    assert [(s.first, s.last) for s in hyperextended_stretches(apart)] == [(50, 69), (70, 89)]
    points = wrong.points3d.copy()
    points[50:90] = np.nan
    assert hyperextended_stretches(replace(wrong, points3d=points)) == []
