"""A downswing before a still scene, and fits that have it at other times."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from golf_truth import camera_before, observe

from keyrecon.body import LSP14
from keyrecon.golf.fit.result import describe_fit
from keyrecon.golf.observe.motion_timing import measure_time_shift
from keyrecon.golf.observe.swing_timing import interpolate_times
from keyrecon.golf.prior.kinematics import find_club, find_joints, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import Camera, SwingFit, SwingState
from keyrecon.io.formats.model_file import read_motion_model
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video

CAMERA = Camera(320.0, np.array([160.0, 120.0]))
FRAMES, FPS, HEIGHT = 60, 60.0, 115.0
KEYS = np.array([2.0, 22.0, 38.0, 55.0])
DOWN = KEYS[2] - KEYS[1]


def swing_at(ahead):
    """A fit whose top and hit are so many frames before those of the film."""
    model, body = read_motion_model(), size_body(1.8)
    rotation, position = camera_before(180.0)
    phase = interpolate_times(KEYS - [0, ahead, ahead, 0], model.keys, FRAMES)
    state = SwingState(
        np.zeros(len(model.components)), phase, np.tile(rotation, (FRAMES, 1, 1)),
        np.tile(position, (FRAMES, 1)),
    )  # fmt: skip
    pose = place_body(body, posture_at(model, phase, state.coefficients), state)
    observations = observe(find_joints(body, pose), find_club(body, pose), CAMERA, noise=0.0)
    fitted = describe_fit(SwingFit(model, body, state), observations, np.arange(FRAMES) / FPS)
    return replace(fitted, keys=KEYS - [0, ahead, ahead, 0])


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    """Bones and club of the swing before a scene with noise."""
    rng, fitted = np.random.default_rng(0), swing_at(0)
    ground = cv2.GaussianBlur(rng.normal(100, 60, (240, 320)), (0, 0), 3)

    def pictures():
        for joints, club in zip(fitted.motion.points2d, fitted.club2d, strict=True):
            picture = ground + rng.normal(0, 2, ground.shape)
            for a, b in LSP14.bones:
                ends = np.rint(joints[[a, b]]).astype(int).tolist()
                cv2.line(picture, tuple(ends[0]), tuple(ends[1]), 200.0, 6)
            ends = np.rint(club).astype(int).tolist()
            cv2.line(picture, tuple(ends[0]), tuple(ends[1]), 20.0, 1)
            yield np.repeat(picture.clip(0, 255).astype(np.uint8)[..., None], 3, axis=2)

    file = tmp_path_factory.mktemp("swing") / "swing.mp4"
    write_video(file, pictures(), FPS, 12)
    return open_video(file)


def test_a_downswing_at_its_time_agrees_with_what_moves(video):
    shift = measure_time_shift(video, swing_at(0), HEIGHT)
    assert abs(shift.frames) <= 0.5
    assert shift.agreement > 0.4


@pytest.mark.parametrize("ahead", [-6, -4, 4, 6])
def test_the_frames_by_which_a_downswing_comes_too_early_or_late_are_told(video, ahead):
    shift = measure_time_shift(video, swing_at(ahead), HEIGHT)
    assert abs(shift.frames - ahead) <= 1.5
    assert shift.downswings == pytest.approx(shift.frames / DOWN)
    assert shift.best > shift.agreement + 0.1


def test_pictures_in_which_nobody_swings_agree_with_no_time(video):
    fitted = swing_at(0)
    beside = replace(fitted, motion=replace(fitted.motion, points2d=fitted.motion.points2d + 90.0),
                     club2d=fitted.club2d + 90.0)  # fmt: skip
    assert measure_time_shift(video, beside, HEIGHT).best < 0.1


def test_few_frames_of_a_downswing_tell_nothing(video):
    fitted = swing_at(0)
    short = replace(fitted, keys=np.array([20.0, 30.0, 32.0, 40.0]))
    late = replace(fitted, keys=np.array([20.0, 57.5, 62.0, 70.0]))
    for few in (short, late):
        shift = measure_time_shift(video, few, HEIGHT)
        assert shift.frames == 0
        assert np.isnan(shift.best)
