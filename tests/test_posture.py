"""Facts about the measures that a coach would read off a motion (benchmarks/posture.py)."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.records import Motion

FPS = 50.0


@pytest.fixture(scope="module")
def posture():
    sys.path.insert(0, str(Path(__file__).parent.parent / "benchmarks"))
    import posture

    yield posture
    sys.path.pop(0)


def motion_of(points):
    frames = len(points)
    flat = points[..., :2]
    return Motion(
        skeleton=LSP14,
        points3d=points,
        points2d=flat,
        points2d_propagated=flat,
        confidence=np.ones(flat.shape[:2]),
        source=np.zeros(flat.shape[:2], dtype=np.int64),
        scale=np.ones(frames),
        fps=FPS,
        time=np.arange(frames) / FPS,
        units="m",
        keyframes=np.zeros(0, dtype=np.int64),
    )


@pytest.fixture
def stroke():
    """Straight limbs; the right wrist swings once."""
    rng = np.random.default_rng(0)
    bones = unit_vectors(rng.normal(size=(13, 3)))
    ends = [LSP14.names[end] for _, end in LSP14.bones]
    for side in ("right", "left"):
        for upper, lower in (("knee", "ankle"), ("elbow", "wrist")):
            bones[ends.index(f"{side}_{lower}")] = bones[ends.index(f"{side}_{upper}")]
    pose = LSP14.ancestry @ (LSP14.lengths[:, None] * bones)
    points = np.repeat(pose[None], 100, axis=0)
    points[:, LSP14.index("right_wrist"), 0] += np.tanh((np.arange(100) - 50) / 5)
    return points


def truth_of(points):
    return {"points3d": points, "joint_names": np.array(LSP14.names)}


def test_the_truth_scores_no_error(posture, stroke):
    scores = posture.judge_posture(motion_of(stroke), truth_of(stroke))
    assert scores.peak == pytest.approx(1) and scores.peak_low == pytest.approx(1)
    assert scores.knee == scores.elbow == scores.separation == scores.straight_knee == 0


def test_a_swing_of_half_the_way_has_half_the_peak_speed(posture, stroke):
    wrist = LSP14.index("right_wrist")
    slow = stroke.copy()
    slow[:, wrist] = 0.5 * (stroke[:, wrist] + stroke[:1, wrist])
    scores = posture.judge_posture(motion_of(slow), truth_of(stroke))
    assert scores.peak_low == pytest.approx(0.5, abs=0.01)


def test_knees_that_stay_bent_are_told_with_their_sign(posture, stroke):
    bent = stroke.copy()
    for side in ("right", "left"):
        knee, ankle = (LSP14.index(f"{side}_{j}") for j in ("knee", "ankle"))
        shank = stroke[:, ankle] - stroke[:, knee]
        aside = unit_vectors(np.cross(shank, [0.3, 0.5, 0.8]))
        length = np.linalg.norm(shank, axis=-1, keepdims=True)
        angle = np.radians(20)
        bent[:, ankle] = stroke[:, knee] + np.cos(angle) * shank + np.sin(angle) * length * aside
    scores = posture.judge_posture(motion_of(bent), truth_of(stroke))
    assert scores.straight_knee == pytest.approx(-20, abs=1e-6)
    assert scores.knee == pytest.approx(20, abs=1e-6)


def test_shoulders_turned_about_the_trunk_change_the_separation_by_as_much(posture, stroke):
    at = {name: stroke[:, LSP14.index(name)] for name in LSP14.names}
    up = unit_vectors(at["neck"] - 0.5 * (at["right_hip"] + at["left_hip"]))
    turned, angle = stroke.copy(), np.radians(30)
    for name in ("right_shoulder", "left_shoulder"):
        arm = at[name] - at["neck"]
        along = (arm * up).sum(axis=-1, keepdims=True) * up
        across = arm - along
        spun = np.cos(angle) * across + np.sin(angle) * np.cross(up, across)
        turned[:, LSP14.index(name)] = at["neck"] + along + spun
    scores = posture.judge_posture(motion_of(turned), truth_of(stroke))
    assert scores.separation == pytest.approx(30, abs=1e-6)
    still = replace(motion_of(stroke), points3d=stroke + 1.0)
    assert posture.judge_posture(still, truth_of(stroke)).separation == pytest.approx(0, abs=1e-6)
