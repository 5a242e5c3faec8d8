"""The swing prior in the keyframe pipeline."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from golf_truth import camera_before, even_times

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.prior.kinematics import find_joints, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import SwingState
from keyrecon.golf.swing_prior import fit_swing_prior
from keyrecon.io.formats.model_file import read_motion_model, write_motion_model
from keyrecon.io.video import Video
from keyrecon.metrics import pa_mpjpe
from keyrecon.records import Annotations, JointTracks

FRAMES, FPS = 50, 30.0
HEIGHTS = np.full(FRAMES, 380.0)
VIDEO = Video(
    Path("swing.mp4"), 1280, 720, np.arange(FRAMES), np.arange(FRAMES) / FPS, FPS, 0, False, None
)


@pytest.fixture(scope="module")
def filmed():
    """Joints of a swing of the prior in camera axes, and in the picture."""
    model = read_motion_model()
    rotation, position = camera_before(170.0)
    coefficients = np.random.default_rng(5).normal(0, 0.6, len(model.components))
    state = SwingState(
        coefficients, even_times(FRAMES, 6), np.tile(rotation, (FRAMES, 1, 1)),
        np.tile(position, (FRAMES, 1)),
    )  # fmt: skip
    joints = find_joints(
        size_body(1.75),
        place_body(size_body(1.75), posture_at(model, state.phase, coefficients), state),
    )
    pixels = 1100.0 * joints[..., :2] / joints[..., 2:] + np.array([639.5, 359.5])
    return joints, pixels


def propagated(pixels):
    confidence = np.full(pixels.shape[:2], 0.8)
    return JointTracks(pixels, confidence)


def marked(pixels, frames):
    nothing = np.zeros((len(frames), len(LSP14.bones)), np.int64)
    return Annotations(
        LSP14, np.array(frames), pixels[frames], np.ones((len(frames), 14), bool), nothing
    )


def test_a_swing_is_found_behind_propagated_joints(filmed):
    joints, pixels = filmed
    noisy = pixels + np.random.default_rng(0).normal(0, 3.0, pixels.shape)
    fitted = fit_swing_prior(
        propagated(noisy), marked(pixels, [6, 22, 34]), read_motion_model(), HEIGHTS, VIDEO
    )
    assert 1000 * pa_mpjpe(fitted, joints) < 40


def test_a_swing_is_found_though_no_wrist_is_known_in_some_frames(filmed):
    joints, pixels = filmed
    hands = [LSP14.index(f"{side}_wrist") for side in ("left", "right")]
    gaps = pixels.copy()
    gaps[20:23, hands] = np.nan
    fitted = fit_swing_prior(
        propagated(gaps), marked(pixels, [6, 34]), read_motion_model(), HEIGHTS, VIDEO
    )
    assert 1000 * pa_mpjpe(fitted, joints) < 40


def test_a_swing_is_found_though_nothing_is_known_where_it_begins(filmed):
    joints, pixels = filmed
    gaps = pixels.copy()
    gaps[3:12] = np.nan
    fitted = fit_swing_prior(
        propagated(gaps), marked(pixels, [16, 34]), read_motion_model(), HEIGHTS, VIDEO
    )
    assert 1000 * pa_mpjpe(fitted, joints) < 40


@pytest.mark.parametrize(
    ("missing", "message"),
    [
        (("left_wrist", "right_wrist"), "No frame has a wrist and an elbow"),
        (("left_knee",), "No frame has both hips, knees and ankles"),
    ],
)
def test_joints_without_which_no_swing_can_be_fitted_are_told(filmed, missing, message):
    gaps = filmed[1].copy()
    gaps[:, [LSP14.index(name) for name in missing]] = np.nan
    with pytest.raises(KeyreconError, match=message):
        fit_swing_prior(propagated(gaps), marked(gaps, [6]), read_motion_model(), HEIGHTS, VIDEO)


def test_a_player_who_stands_still_does_not_swing(filmed):
    still = np.repeat(filmed[1][:1], FRAMES, axis=0)
    with pytest.raises(KeyreconError, match="no swing"):
        fit_swing_prior(propagated(still), marked(still, [6]), read_motion_model(), HEIGHTS, VIDEO)


def test_a_prior_of_another_version_is_refused(tmp_path):
    file = tmp_path / "old.npz"
    write_motion_model(file, replace(read_motion_model(), version=99))
    with pytest.raises(KeyreconError, match="version 99"):
        read_motion_model(file)


def test_a_file_that_is_no_prior_is_refused(tmp_path):
    file = tmp_path / "other.npz"
    np.savez(file, something=np.zeros(3))
    with pytest.raises(KeyreconError, match="not a swing prior"):
        read_motion_model(file)


def test_a_prior_on_disk_is_the_one_that_was_written(tmp_path):
    model = read_motion_model()
    write_motion_model(tmp_path / "copy.npz", model)
    again = read_motion_model(tmp_path / "copy.npz")
    assert again.provenance == model.provenance
    assert np.array_equal(again.components, model.components)
