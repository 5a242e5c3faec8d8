"""What a golf fit does with a downswing that is off from what moves in the pictures."""

from dataclasses import replace

import numpy as np
import pytest
from golf_truth import camera_before, even_times, observe

from keyrecon.app import golf_recipe
from keyrecon.golf.fit.result import describe_fit
from keyrecon.golf.observation import ObservedSwing
from keyrecon.golf.observe.film import Film
from keyrecon.golf.observe.motion_timing import TimeShift
from keyrecon.golf.prior.kinematics import find_club, find_joints, place_body
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import NO_MARKS, Camera, SwingFit, SwingState
from keyrecon.golf.swing_fit import GolfOptions, retime
from keyrecon.io.formats.model_file import read_motion_model
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.keeping import call_stage
from keyrecon.progress import silent

CAMERA = Camera(1000.0, np.array([640.0, 360.0]))
FRAMES, FPS = 50, 30.0


@pytest.fixture(scope="module")
def played():
    """A fit and what it was fitted to."""
    model, body = read_motion_model(), size_body(1.8)
    rotation, position = camera_before(180.0)
    state = SwingState(
        np.zeros(len(model.components)), even_times(FRAMES, 5),
        np.tile(rotation, (FRAMES, 1, 1)), np.tile(position, (FRAMES, 1)),
    )  # fmt: skip
    pose = place_body(body, posture_at(model, state.phase, state.coefficients), state)
    observations = observe(find_joints(body, pose), find_club(body, pose), CAMERA, noise=0.1)
    fitted = describe_fit(SwingFit(model, body, state), observations, np.arange(FRAMES) / FPS)
    return fitted, replace(observations, keys=fitted.keys)


def off(downswings):
    return TimeShift(10 * downswings, downswings, 0.3, 0.5)


def test_top_and_hit_move_to_their_time_in_the_pictures_unless_they_were_marked(played):
    fitted, observations = played
    model = read_motion_model()
    later = retime(observations, fitted, off(0.3), model).keys
    np.testing.assert_allclose(later - fitted.keys, [0, 3, 3, 0])
    top = np.array([np.nan, round(fitted.keys[1]), np.nan, np.nan])
    marked = replace(observations, marks=replace(NO_MARKS, keys=top))
    held = retime(marked, fitted, off(0.3), model).keys
    assert held[1] == top[1]
    assert held[2] == pytest.approx(fitted.keys[2] + 3)


@pytest.mark.parametrize(
    ("shifts", "expected"),
    [((0.1,), 0.1), ((0.4, 0.05), 0.05), ((0.4, -0.3, 0.1), 0.1), ((0.4, 0.5), 0.4)],
)
def test_a_fit_is_made_anew_while_its_downswing_is_off_and_that_helps(
    played, monkeypatch, tmp_path, shifts, expected
):
    fitted, observations = played
    measured = iter(shifts)
    monkeypatch.setattr(golf_recipe, "fit_candidate", lambda first, *_: (fitted, first))
    monkeypatch.setattr(golf_recipe, "measure_time_shift", lambda *_: off(next(measured)))
    black = np.zeros((32, 32, 3), np.uint8)
    write_video(tmp_path / "black.mp4", (black for _ in range(FRAMES)), FPS)
    video = open_video(tmp_path / "black.mp4")
    film = Film(
        np.arange(FRAMES), video.time, np.arange(FRAMES, dtype=float),
        np.tile(np.eye(3), (FRAMES, 1, 1)), (32, 32), np.zeros(2), True, (0, FRAMES - 1), 0.0,
        (0, FRAMES - 1),
    )  # fmt: skip
    observed = ObservedSwing(film, 1.0, observations)
    tried = golf_recipe._try(
        observed, video, read_motion_model(), GolfOptions(), call_stage, silent, "_1"
    )
    assert tried.shift.downswings == expected
    assert list(measured) == []
    assert bool(tried.doubts) == (abs(expected) > 0.15)
