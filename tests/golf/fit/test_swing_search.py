"""The swing is found wherever it is in a film."""

from dataclasses import replace

import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.golf.fit.initial_pose import LEVEL, Placement, repeat_pose
from keyrecon.golf.fit.residuals import project
from keyrecon.golf.fit.swing_path import SearchLimits, best_paths
from keyrecon.golf.fit.swing_search import SwingEvidence, draw_swing, search_swing, silhouette
from keyrecon.golf.observe.shaft_hypotheses import ShaftHypotheses
from keyrecon.golf.prior.kinematics import find_joints, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import NO_MARKS, Camera, InitialJoints, SwingMarks
from keyrecon.io.formats.model_file import BUILT_IN_SWING_PRIOR, read_motion_model

MODEL = read_motion_model(BUILT_IN_SWING_PRIOR)
BODY = size_body(1.8)
CAMERA = Camera(500.0, np.array([99.5, 74.5]))
PLACE = Placement(LEVEL @ np.diag([-1.0, 1.0, -1.0]), np.array([0.0, 0.9, 7.0]))
SIZE = (200, 150)
CLICKED = ("head_top", "right_knee", "left_knee", "right_ankle", "left_ankle")


def film(keys, frames, fps=30.0, waggle=()):
    """Masks and clubs of the mean swing, with other phases played before it."""
    phase = np.interp(np.arange(frames), keys, MODEL.keys)
    phase[: len(waggle)] = waggle
    drawn = draw_swing(MODEL, BODY, np.zeros(2), phase, PLACE, CAMERA)
    masks = [
        silhouette(e, r, np.ones(2), SIZE) > 0
        for e, r in zip(drawn.capsules, drawn.radii, strict=True)
    ]
    shafts = tuple(ShaftHypotheses(c[None], np.array([0.4]), np.array([True])) for c in drawn.club)
    height = 500 * 1.8 / 7.0
    return SwingEvidence(np.array(masks), 1.0, height, shafts, fps)


def clicks():
    state = repeat_pose(PLACE, np.zeros(1))
    joints = find_joints(
        BODY, place_body(BODY, posture_at(MODEL, state.phase, np.zeros(0)), state)
    )[0]
    pixels = project(joints, CAMERA)[0]
    places = [pixels[LSP14.index(n)] for n in CLICKED]
    hips = pixels[[LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=0)
    return InitialJoints(0, (*CLICKED, "root"), np.array([*places, hips]))


def test_the_swing_is_found_after_a_long_wait():
    keys = np.array([60.0, 84.0, 92.0, 106.0])
    found = search_swing(film(keys, 130), clicks(), CAMERA, MODEL, BODY)[0]
    assert found.keys == pytest.approx(keys, abs=3)
    assert np.abs(found.keys[1:3] - keys[1:3]).max() <= 1


def test_half_an_upswing_before_is_no_swing():
    keys = np.array([40.0, 63.0, 71.0, 84.0])
    waggle = 0.3 * np.abs(np.sin(np.arange(30) / 5))
    found = search_swing(film(keys, 100, waggle=waggle), clicks(), CAMERA, MODEL, BODY)[0]
    assert np.abs(found.keys[1:3] - keys[1:3]).max() <= 1


def test_slow_motion_that_nobody_told_of_is_found():
    keys = np.array([10.0, 70.0, 90.0, 125.0])
    found = search_swing(film(keys, 140), clicks(), CAMERA, MODEL, BODY)[0]
    assert np.abs(found.keys[1:3] - keys[1:3]).max() <= 3


def test_no_path_is_faster_or_slower_than_golfers_are():
    costs = np.random.default_rng(0).random((90, 93))
    phases = np.linspace(0, 1, 93)
    for path in best_paths(costs, MODEL.keys, phases, 30.0, SearchLimits(fastest_camera=0.0)):
        up, down = np.diff(path.keys)[:2] / 30
        assert 0.14 < down < 0.52
        assert 1.2 < up / down < 7


def test_a_film_that_is_too_short_has_no_swing():
    costs = np.zeros((6, 93))
    assert best_paths(costs, MODEL.keys, np.linspace(0, 1, 93), 30.0) == []


def test_a_marked_key_posture_tells_the_swing_from_a_practice_swing():
    practice = np.interp(np.arange(60), [5, 29, 37, 51], MODEL.keys)
    shown = film(np.array([70.0, 94.0, 102.0, 116.0]), 130, waggle=practice)
    nothing = np.full(4, np.nan)
    for k, frame in ((1, 29.0), (2, 37.0), (1, 94.0), (2, 102.0)):
        keys = nothing.copy()
        keys[k] = frame
        marks = replace(NO_MARKS, keys=keys)
        for found in search_swing(shown, clicks(), CAMERA, MODEL, BODY, marks=marks):
            assert found.keys[k] == frame


def test_marked_joints_tell_the_swing_from_a_practice_swing():
    practice = np.interp(np.arange(60), [5, 29, 37, 51], MODEL.keys)
    shown = film(np.array([70.0, 94.0, 102.0, 116.0]), 130, waggle=practice)
    # In frame 29 the body is marked as at address: whatever it shows was no top.
    drawn = draw_swing(MODEL, BODY, np.zeros(2), np.zeros(1), PLACE, CAMERA)
    marks = SwingMarks.of_joints(np.array([29]), drawn.joints)
    found = search_swing(shown, clicks(), CAMERA, MODEL, BODY, marks=marks)[0]
    assert found.keys[1] == pytest.approx(94, abs=3)
