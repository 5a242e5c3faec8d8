"""Where there is no court: the player's height, upright things, lengths and the horizon."""

from dataclasses import replace

import numpy as np
import pytest
from court_walker import STATURE
from ground_walker import (
    CAMERA,
    HORIZON,
    PRINCIPAL,
    SIZE,
    TRUE,
    mark,
    posts,
    seen,
    seen_by,
    standing,
    still,
    turned,
    walks,
)

from keyrecon.errors import KeyreconError
from keyrecon.world.ground_calibration import (
    ContradictoryMarks,
    FieldOfView,
    calibrate_ground,
)
from keyrecon.world.ground_evidence import GroundState, on_plane, size_residuals, upward
from keyrecon.world.records import GROUND

FOV = FieldOfView(1100.0, 0.03, "told")


def calibrated(points, marks=(), known=None, **seeing):
    return calibrate_ground(seen(points, **seeing), still(points), SIZE, marks, known)


@pytest.fixture(scope="module")
def about():
    return walks()


def assert_true(found, focal, tilt, height):
    """Off by no more than shares of focal length and height, and degrees of the tilt."""
    assert abs(found.state.log_focal - TRUE.log_focal) < focal
    assert abs(np.degrees(found.state.tilt - TRUE.tilt)) < tilt
    assert abs(found.state.log_height - TRUE.log_height) < height


def test_a_camera_that_looks_down_has_the_horizon_above_its_middle():
    far = CAMERA.project(np.array([[0.0, 1e6, 2.5]]))[0]
    assert far[1] == pytest.approx(PRINCIPAL[1] - 1100 * np.tan(np.radians(8.0)), abs=1.0)
    foot, top = CAMERA.project(np.array([[1.0, 9.0, 0.0], [1.0, 9.0, 0.01]]))
    assert np.allclose(upward(CAMERA, foot[None])[0], (top - foot) / np.linalg.norm(top - foot))
    assert np.allclose(on_plane(CAMERA, foot[None])[0], [1, 9, 0])


@pytest.fixture(scope="module")
def by_walking(about):
    return calibrated(about)


def test_a_player_who_walks_about_tells_the_camera(by_walking):
    assert_true(by_walking, 0.15, 1.5, 0.04)
    assert by_walking.sd.log_focal < 0.3
    near, far = by_walking.distances
    assert near < 8 and far > 15


def test_upright_things_tell_the_rest(about, by_walking):
    found = calibrated(about, posts())
    assert_true(found, 0.05, 0.5, 0.04)
    assert found.sd.log_focal < 0.7 * by_walking.sd.log_focal


def test_one_spot_leaves_the_focal_length_open():
    found = calibrated(standing())
    assert found.sd.log_focal > 0.4
    assert found.distances[1] < 1.1 * found.distances[0]
    assert np.nanmax(found.camera.sd_tilt) > np.radians(4)


def test_two_upright_things_and_a_field_of_view_tell_the_tilt_from_one_spot():
    found = calibrated(standing(), posts(), FOV)
    assert_true(found, 0.05, 1.0, 0.15)
    assert np.nanmax(found.camera.sd_tilt) < np.radians(2.5)


def test_the_horizon_and_a_field_of_view_tell_tilt_and_height_from_one_spot():
    found = calibrated(standing(), (HORIZON,), FOV)
    assert_true(found, 0.05, 0.5, 0.05)


def test_a_known_length_gives_metres_to_a_motion_in_body_heights(about):
    with pytest.raises(KeyreconError, match="Nothing is in metres yet"):
        calibrated(about, units="body heights")
    length = mark("length", [(-2.0, 8.0, 0), (2.0, 8.5, 0)], float(np.hypot(4, 0.5)))
    found = calibrated(about, (*posts(), length), units="body heights")
    assert np.exp(found.state.log_size) == pytest.approx(STATURE, rel=0.03)
    assert_true(found, 0.06, 0.6, 0.03)


def test_an_upright_thing_of_known_length_gives_metres_too(about):
    tall = mark("vertical", [(2.0, 9.0, 0), (2.0, 9.0, 2.0)], 2.0)
    found = calibrated(about, (*posts(), tall), units="body heights")
    assert np.exp(found.state.log_size) == pytest.approx(STATURE, rel=0.03)


def test_the_truth_is_within_what_is_told_of_the_spread():
    off = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        noisy = [
            replace(
                m,
                start=tuple(m.start + rng.normal(0, 3, 2)),
                end=tuple(m.end + rng.normal(0, 3, 2)),
            )
            for m in posts()
        ]
        starts = [(rng.uniform(-2, 2), rng.uniform(6, 14), rng.uniform(0, 360)) for _ in range(4)]
        found = calibrated(walks(starts), noisy, noise=0.015, seed=seed)
        numbers = [
            (getattr(found.state, n) - getattr(TRUE, n)) / getattr(found.sd, n)
            for n in ("log_focal", "tilt", "roll", "log_height")
        ]
        off.append(numbers)
    assert np.abs(off).max() < 3
    assert np.sqrt(np.mean(np.square(off))) < 1.3


def test_the_origin_is_under_the_first_stance_and_the_camera_looks_along_y(about):
    found = calibrated(about, posts(), FOV)
    camera, first = found.camera, found.reference
    assert camera.origin == GROUND
    feet = about[first, [0, 5]].mean(axis=0) * [1, 1, 0]
    assert np.allclose(camera.centre[0], CAMERA.centre - feet, atol=[0.3, 0.6, 0.1])
    assert np.allclose(camera.R[first, 2] * [1, 0, 0], 0, atol=1e-9)
    assert camera.R[first, 2, 1] > 0.9


def test_a_camera_that_pans_is_followed(about):
    views, path = turned(np.radians(6) * np.sin(np.arange(len(about)) / 60))
    found = calibrate_ground(seen_by(views, about), path, SIZE, posts(), FOV)
    assert_true(found, 0.05, 0.7, 0.05)
    t = len(about) // 2
    between = found.camera.R[t] @ found.camera.R[0].T
    assert np.allclose(between, views[t].rotation @ views[0].rotation.T, atol=0.01)


@pytest.fixture(scope="module")
def followed():
    """From 20 degrees left of the first picture's axis to 20 right of it, and the azimuths."""
    points = walks([(0.0, 9, 90), (3.0, 9, -45), (-4.0, 10, 0), (-3.0, 8, 30), (0.5, 14, 0)])
    x, y = points[..., 0].mean(axis=1), points[..., 1].mean(axis=1)
    azimuths = np.arctan2(x, y)
    assert np.degrees(azimuths.min()) < -20 and np.degrees(azimuths.max()) > 20
    return points, azimuths


@pytest.mark.parametrize("longest", [1.0, 2.5])
def test_a_size_is_that_of_the_picture_it_was_measured_in(followed, longest):
    """Also where the camera zooms as it turns, and is no usual one."""
    points, azimuths = followed
    for camera in (CAMERA, replace(CAMERA, focal=2600.0)):
        zoom = np.linspace(1, longest, len(points))
        views, path = turned(azimuths - azimuths[0], zoom, camera)
        known = FieldOfView(camera.focal, 0.001, "told")
        found = calibrate_ground(seen_by(views, points), path, SIZE, (), known)
        true = replace(TRUE, log_focal=np.log(views[found.reference].focal))
        off = size_residuals(true.pinhole(PRINCIPAL), found.stances, 0.0)
        assert np.abs(off).max() < 0.005


def test_a_camera_that_follows_the_player_far_round_is_found(followed):
    points, azimuths = followed
    views, path = turned(azimuths - azimuths[0])
    found = calibrate_ground(seen_by(views, points), path, SIZE, (), FOV)
    assert_true(found, 0.05, 1.0, 0.05)


def test_after_a_cut_only_the_shot_with_most_of_the_motion_has_a_camera(about):
    path = replace(still(about), cuts=(150,))
    found = calibrate_ground(seen(about), path, SIZE)
    assert not found.camera.found[:150].any() and found.camera.found[150:].all()
    with pytest.raises(KeyreconError, match="vertical marked in frame 0 is in no frame"):
        calibrate_ground(seen(about), path, SIZE, posts())


def test_an_upright_thing_that_leans_is_named(about):
    good = mark("vertical", [(0.5, 12, 0), (0.5, 12, 3.0)])
    leaning = posts(leaning=0.8)
    with pytest.raises(ContradictoryMarks, match="contradicts the rest") as fault:
        calibrated(about, (*leaning, good))
    assert f"{leaning[1].start[0]:g}" in str(fault.value)
    assert f"{leaning[0].start[0]:g}" not in str(fault.value)


def test_an_upright_thing_that_would_turn_the_camera_far_about_its_axis_is_named():
    leaning = posts(leaning=1.5)
    with pytest.raises(ContradictoryMarks, match=f"vertical at {leaning[1].start[0]:g}"):
        calibrated(standing(), leaning)


def test_a_camera_that_is_turned_about_its_axis_by_all_accounts_is():
    turned = replace(TRUE, roll=np.radians(14)).pinhole(PRINCIPAL)
    found = calibrated(standing(), posts(turned), FOV, camera=turned)
    assert abs(np.degrees(found.state.roll) - 14) < 1


def test_a_player_who_never_stands_tells_nothing(about):
    motion = seen(about)
    sliding = motion.points2d + np.arange(len(about))[:, None, None] * 9.0
    with pytest.raises(KeyreconError, match="never seen to stand"):
        calibrate_ground(replace(motion, points2d=sliding), still(about), SIZE)


def test_a_state_goes_to_a_camera_of_that_height():
    state = GroundState(7.0, 0.1, 0.05, 0.5, 0.0, 0.0)
    camera = state.pinhole(PRINCIPAL)
    assert camera.centre[2] == pytest.approx(np.exp(0.5))
    assert np.allclose(camera.rotation @ camera.rotation.T, np.eye(3))
    assert np.linalg.det(camera.rotation) == pytest.approx(1)


def test_a_camera_high_above_that_looks_far_down_is_found_too():
    steep = GroundState(np.log(1900.0), np.radians(32), 0.0, np.log(7.0), 0.0, 0.0)
    camera = steep.pinhole(PRINCIPAL)
    points = standing(y=9.0, steps=24)
    length = mark("length", [(-1.0, 8.5, 0), (1.8, 11.3, 0)], float(np.hypot(2.8, 2.8)), camera)
    ends = ([(x, 10, 0), (x, 10, 2.5)] for x in (-2.2, 2.2))
    marks = (*(mark("vertical", pair, camera=camera) for pair in ends), length)
    found = calibrated(points, marks, camera=camera)
    assert abs(found.state.log_focal - steep.log_focal) < 0.2
    assert abs(np.degrees(found.state.tilt - steep.tilt)) < 4
