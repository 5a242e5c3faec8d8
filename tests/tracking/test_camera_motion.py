"""The camera's path from pictures of a scene that is known."""

import cv2
import numpy as np
import pytest

from keyrecon.tracking.camera_motion import (
    MIN_CONFIDENCE,
    CameraMotionOptions,
    _FeatureTracker,
    _register_all,
)

SIZE = 320, 180
REST, PAN = 24, 60


@pytest.fixture(scope="module", params=[1, 2, 3])
def scene(request):
    rng = np.random.default_rng(request.param)
    noise = cv2.GaussianBlur(rng.integers(0, 255, (400, 900)).astype(np.float32), (0, 0), 2)
    return cv2.normalize(noise, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)


def shifts():
    """The camera rests, pans to the right and rests again."""
    return np.concatenate([np.zeros(REST), np.linspace(0, 90, PAN), np.full(REST, 90)])


def view(scene, shift, logo=False):
    matrix = np.array([[1, 0, 200 + shift], [0, 1, 100]], float)
    picture = cv2.warpAffine(scene, matrix, SIZE, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
    if logo:
        cv2.putText(picture, "15:40", (8, 40), cv2.FONT_HERSHEY_SIMPLEX, 1.2, 255, 3)
    return picture


def test_the_path_is_right_in_frames_that_were_not_registered_themselves(scene):
    pictures = [view(scene, shift) for shift in shifts()]
    path, _ = _register_all(pictures, _FeatureTracker(CameraMotionOptions()))
    assert np.abs(path[:, 0, 2] - shifts()).max() < 0.3
    assert np.abs(path[:, 1, 2]).max() < 0.3


def follow_pan(scene, logo=False):
    tracker = _FeatureTracker(CameraMotionOptions())
    path, _ = _register_all(
        [view(scene, s, logo) for s in np.linspace(0, 90, PAN)], tracker, watch=2
    )
    return path, tracker.overlay.share(tracker.keys[0].corners)


def test_letters_laid_over_a_moving_scene_are_told_from_it(scene):
    path, share = follow_pan(scene, logo=True)
    assert share > 0.05
    assert np.abs(path[:, 0, 2] - np.linspace(0, 90, PAN)).max() < 0.2
    assert follow_pan(scene)[1] == 0


def test_corners_on_lines_along_the_pan_are_no_overlay_if_they_move_with_the_scene(scene):
    lined = scene.copy()
    for row in range(120, 270, 50):
        cv2.line(lined, (0, row), (899, row), 255, 3)
    assert follow_pan(lined)[1] < 0.05


def test_a_pan_is_followed_from_a_picture_that_comes_up_out_of_black(scene):
    shifts = np.linspace(0, 90, PAN)
    light = np.minimum(np.arange(PAN) / 12, 1)
    pictures = [
        (view(scene, shift) * gain).astype(np.uint8)
        for shift, gain in zip(shifts, light, strict=True)
    ]
    path, confidence = _register_all(pictures, _FeatureTracker(CameraMotionOptions()))
    assert np.ptp((path[:, 0, 2] - shifts)[15:]) < 2  # px, of 67
    assert confidence[15:].min() > MIN_CONFIDENCE


@pytest.mark.parametrize("deviation", [0, 40])
def test_what_shows_nothing_has_one_key_picture_however_long_it_lasts(scene, deviation):
    rng = np.random.default_rng(0)
    empty = [
        np.clip(rng.normal(128, deviation, SIZE[::-1]), 0, 255).astype(np.uint8) for _ in range(40)
    ]
    tracker = _FeatureTracker(CameraMotionOptions())
    _, confidence = _register_all([view(scene, 0), *empty], tracker)
    assert len(tracker.keys) <= 3
    assert confidence[5:].max() < 0.35
