"""A swing that was fitted to a film, before the camera as it moved."""

from dataclasses import replace

import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.golf.fit.handedness import MIRROR_X
from keyrecon.golf.fit.in_file import swing_in_file
from keyrecon.golf.fit.result import describe_fit
from keyrecon.golf.mirroring import _mirror_fitted
from keyrecon.golf.observation import ObservedSwing
from keyrecon.golf.observe.film import Film
from keyrecon.golf.prior.kinematics import find_club, find_joints, fitted_pose
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import NO_MARKS, Camera, SwingFit, SwingState
from keyrecon.golf.swing_fit import swing_found
from keyrecon.io.formats.model_file import BUILT_IN_SWING_PRIOR, read_motion_model
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.numerics.geometry import warp_points
from keyrecon.paper.sliding_windows import WindowOptions, fit_sliding_windows
from keyrecon.report.golf_measures import record_swing
from tests.support.golf_truth import camera_before, even_times, observe

FRAMES = 12
CAMERA = Camera(900.0, np.array([359.5, 249.5]))
CORNER = np.array([40.0, 10.0])


TIME = np.arange(FRAMES) / 30.0


@pytest.fixture(scope="module")
def fitted():
    model, body = read_motion_model(BUILT_IN_SWING_PRIOR), size_body(1.8)
    rotation, position = camera_before(180.0)
    state = SwingState(
        np.zeros(2), even_times(FRAMES), np.tile(rotation, (FRAMES, 1, 1)),
        np.tile(position, (FRAMES, 1)),
    )  # fmt: skip
    fit = SwingFit(model, body, state)
    pose = fitted_pose(fit)
    observations = observe(find_joints(body, pose), find_club(body, pose), CAMERA, 0.0)
    return describe_fit(fit, observations, TIME), observations, model


def film_as_it_is(time):
    """A film of all frames of a file, whose camera stood still."""
    place, whole = np.arange(FRAMES, dtype=float), (0, FRAMES - 1)
    warps = np.tile(np.eye(3), (FRAMES, 1, 1))
    return Film(
        np.arange(FRAMES), time, place, warps, (720, 500), np.zeros(2), True, whole, 0.0, whole
    )


@pytest.mark.parametrize("still", [True, False])
def test_times_are_those_of_the_world_in_slow_motion_that_nobody_told_of(fitted, still, tmp_path):
    swing, observations, model = fitted
    write_video(tmp_path / "v.mp4", [np.zeros((96, 128, 3), np.uint8)] * FRAMES, 30.0)
    video = open_video(tmp_path / "v.mp4")
    film = film_as_it_is(TIME / 4)
    if not still:
        film = replace(film, still=False, corner=CORNER)
    motion = replace(swing.motion, time=TIME / 4, fps=120.0)
    found = swing_found(
        replace(swing, motion=motion), observations, (), ObservedSwing(film, 4.0, observations),
        NO_MARKS, video, model,
    )  # fmt: skip
    assert found.fitted.motion.time == pytest.approx(video.time / 4, abs=1e-6)
    assert found.fitted.motion.fps == pytest.approx(120.0)
    assert "slowed down 4.0 times" in found.notes[0]


@pytest.mark.parametrize(
    ("marked", "shown"), [(np.nan, (False, True, True, False)), (0.0, (True, True, True, False))]
)
def test_a_posture_at_the_films_end_is_not_shown_unless_a_person_marked_it(
    fitted, marked, shown, tmp_path
):
    swing, observations, model = fitted
    write_video(tmp_path / "v.mp4", [np.zeros((96, 128, 3), np.uint8)] * FRAMES, 30.0)
    film = film_as_it_is(TIME)
    swing = replace(swing, keys=np.array([0.0, 5.0, 7.0, FRAMES - 1.0]))
    marks = replace(NO_MARKS, keys=np.array([marked, np.nan, np.nan, np.nan]))
    found = swing_found(
        swing, observations, (), ObservedSwing(film, 1.0, observations), marks,
        open_video(tmp_path / "v.mp4"), model,
    )  # fmt: skip
    assert found.shown == shown
    told = "; ".join(found.notes)
    assert "the finish is not shown" in told
    assert ("the start is not shown" in told) == (not shown[0])


def test_no_key_posture_lies_outside_of_the_film(fitted, tmp_path):
    """Where the hit was marked in the last frame, the finish would come after it."""
    swing, observations, model = fitted
    write_video(tmp_path / "v.mp4", [np.zeros((96, 128, 3), np.uint8)] * FRAMES, 30.0)
    film, last = film_as_it_is(TIME), FRAMES - 1.0
    swing = replace(swing, keys=np.array([-1.0, 5.0, 7.0, FRAMES]))
    marks = replace(NO_MARKS, keys=np.array([np.nan, np.nan, last, np.nan]))
    found = swing_found(
        swing, observations, (), ObservedSwing(film, 1.0, observations), marks,
        open_video(tmp_path / "v.mp4"), model,
    )  # fmt: skip
    assert found.fitted.keys.tolist() == [0.0, 5.0, last, last]


def film_seen_by(back):
    """A film whose frames were warped from a file by the inverses of `back`."""
    place = np.arange(FRAMES, dtype=float)
    whole = (0, FRAMES - 1)
    return Film(
        np.arange(FRAMES), TIME, place, np.linalg.inv(back), (720, 500), CORNER, False,
        whole, 0.0, whole,
    )  # fmt: skip


def pan_and_roll(t):
    """Where a camera that was shifted, rolled and zoomed a little shows what the film shows."""
    c, s = 1.02 * np.cos(0.01 * t), 1.02 * np.sin(0.01 * t)
    x, y = -CORNER + (6.0 * t, -3.0 * t)
    return np.array([[c, -s, x], [s, c, y], [0, 0, 1.0]])


def test_joints_lie_where_the_camera_that_was_shifted_shows_them(fitted):
    swing, observations, model = fitted
    back = np.stack([pan_and_roll(t) for t in range(FRAMES)])
    inside = swing_in_file(swing, observations, film_seen_by(back), TIME, model)
    expected = warp_points(back[:, None], swing.motion.points2d)
    off = np.linalg.norm(inside.motion.points2d - expected, axis=2)
    assert off.max() < 2.5 and off.mean() < 0.7
    club = warp_points(back[:, None], swing.club2d)
    assert np.linalg.norm(inside.club2d - club, axis=2).max() < 4


def test_a_camera_that_moved_adds_nothing_to_what_is_measured(fitted):
    swing, observations, model = fitted
    back = np.stack([pan_and_roll(t) for t in range(FRAMES)])
    inside = swing_in_file(swing, observations, film_seen_by(back), TIME, model)
    for found in (inside, _mirror_fitted(inside, 720)):
        recorded = record_swing(found, observations)
        mirrored = found is not inside
        expected = swing.motion.points3d
        expected = expected[:, LSP14.mirror] * MIRROR_X if mirrored else expected
        assert np.abs(found.motion.points3d - expected).max() > 0.05
        np.testing.assert_allclose(recorded.standing_points, expected, atol=1e-9)
        expected = swing.club * MIRROR_X if mirrored else swing.club
        np.testing.assert_allclose(recorded.standing_club, expected, atol=1e-9)


def test_joints_lie_where_the_camera_that_turned_shows_them(fitted):
    swing, observations, model = fitted
    a = 0.08
    turn = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    standing, moving = np.diag([900.0, 900, 1]), np.diag([900.0, 900, 1])
    standing[:2, 2], moving[:2, 2] = CAMERA.principal, CAMERA.principal - CORNER
    back = np.tile(moving @ turn @ np.linalg.inv(standing), (FRAMES, 1, 1))
    inside = swing_in_file(swing, observations, film_seen_by(back), TIME, model)
    expected = warp_points(back[:, None], swing.motion.points2d)
    assert np.linalg.norm(inside.motion.points2d - expected, axis=2).max() < 2.5


def test_the_papers_windows_have_the_same_swing_in_the_file_as_in_the_film(fitted):
    swing, observations, model = fitted
    state = replace(swing.state, coefficients=np.zeros(0))
    initial = SwingFit(model, swing.body, state)
    fit = fit_sliding_windows(observations, initial, WindowOptions(steps=2))
    in_film = describe_fit(fit, observations, TIME)
    film = replace(film_as_it_is(TIME), still=False)
    inside = swing_in_file(in_film, observations, film, TIME, model)
    np.testing.assert_allclose(inside.motion.points2d, in_film.motion.points2d, atol=1e-6)
    np.testing.assert_allclose(inside.motion.points3d, in_film.motion.points3d, atol=1e-6)
