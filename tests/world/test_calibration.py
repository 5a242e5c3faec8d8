"""The camera of every frame of small films of a painted court."""

from dataclasses import replace

import numpy as np
import pytest
from painted_court import camera_at, court_error, paint

import keyrecon
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.camera_file import read_camera, write_calibration, write_camera
from keyrecon.io.video_writer import write_video
from keyrecon.records import CameraPath
from keyrecon.world.court_tracking import carry_camera, homography_between
from keyrecon.world.pinhole import Pinhole

SIZE = (640, 360)
FRAMES = 16


def film(folder, cameras):
    """A video of painted courts, and the camera's motion as it truly is."""
    pictures = [np.repeat(paint(c, SIZE, t)[..., None], 3, axis=2) for t, c in enumerate(cameras)]
    write_video(folder / "v.mp4", pictures, 25.0)
    inner = [
        np.array([[c.focal, 0, c.principal[0]], [0, c.focal, c.principal[1]], [0, 0, 1]])
        @ c.rotation
        for c in cameras
    ]
    path = np.array([inner[FRAMES // 2] @ np.linalg.inv(m) for m in inner])
    still = all(c is cameras[0] for c in cameras)
    path = np.tile(np.eye(3), (FRAMES, 1, 1)) if still else path / path[:, 2:, 2:]
    return keyrecon.open_video(folder / "v.mp4"), CameraPath(path, np.ones(FRAMES))


def pinhole(camera, t):
    return Pinhole(camera.focal[t], camera.K[t, :2, 2], camera.R[t], camera.centre[t])


@pytest.fixture(scope="module")
def panned(tmp_path_factory):
    """A camera that turns and zooms over the near half."""
    cameras = [
        camera_at((-4, -24, 4), (-2 + 0.12 * t, -5, 0), 1.25 + 0.01 * t) for t in range(FRAMES)
    ]
    video, path = film(tmp_path_factory.mktemp("pan"), cameras)
    return cameras, path, keyrecon.calibrate_court(video, path)


def test_every_frame_of_a_pan_is_found(panned):
    cameras, _, found = panned
    assert found.found.all()
    off = [np.median(court_error(pinhole(found, t), c, SIZE)) for t, c in enumerate(cameras)]
    assert np.median(off) < 0.5
    assert max(off) < 1.5


def test_a_camera_that_pans_stands_in_one_place(panned):
    cameras, _, found = panned
    assert np.ptp(found.centre, axis=0).max() < 1e-9
    assert np.linalg.norm(found.centre[0] - cameras[0].centre) < 0.02 * 20
    assert (np.abs(found.centre[0] - cameras[0].centre) < 5 * found.sd_centre[0] + 0.05).all()


def test_a_camera_carried_along_the_motion_between_two_frames_is_the_other_camera(panned):
    cameras, path, _ = panned
    moved = carry_camera(cameras[2], homography_between(path, 2, 9))
    assert court_error(moved, cameras[9], SIZE).max() < 1e-6


def test_world_axes_are_those_of_the_convention(panned):
    found = panned[2]
    assert found.centre[0, 1] < 0 < found.centre[0, 2]  # on the near half, above the ground
    right = found.project(0, np.array([[1.0, -3, 0]])) - found.project(0, np.array([[0, -3, 0.0]]))
    away = found.project(0, np.array([[0, -3.0, 0]])) - found.project(0, np.array([[0, -4.0, 0]]))
    up = found.project(0, np.array([[0, -3.0, 1]])) - found.project(0, np.array([[0, -3.0, 0]]))
    assert right[0, 0] > 0 > away[0, 1]
    assert up[0, 1] < 0


def test_each_shot_of_a_cut_video_is_looked_at_by_itself(tmp_path):
    here, there = camera_at((-4, -24, 4), (-2, -5, 0), 1.25), camera_at((5, -20, 8), (0, 0, 0), 1.1)
    court = [paint(here, SIZE, t) for t in range(8)]
    plain = [
        np.random.default_rng(t).integers(90, 110, SIZE[::-1]).astype(np.uint8) for t in range(12)
    ]
    other = [paint(there, SIZE, t) for t in range(6)]
    pictures = [*plain, *court, *other, *court]
    write_video(tmp_path / "v.mp4", [np.repeat(p[..., None], 3, axis=2) for p in pictures], 25.0)
    count = len(pictures)
    path = CameraPath(np.tile(np.eye(3), (count, 1, 1)), np.ones(count), (12, 20, 26))
    found = keyrecon.calibrate_court(keyrecon.open_video(tmp_path / "v.mp4"), path)
    np.testing.assert_array_equal(np.flatnonzero(found.found), [*range(12, 20), *range(26, 34)])
    assert np.median(court_error(pinhole(found, 30), here, SIZE)) < 0.5
    assert np.isnan(found.K[:12]).all() and np.isnan(found.sd_centre[20:26]).all()
    assert found.elsewhere == (20,)


def test_a_cut_is_not_followed(tmp_path):
    court, elsewhere = camera_at((0, -26, 7), (0, -2, 0), 1.4), camera_at((0, 60, 7), (0, 90, 0))
    video, path = film(tmp_path, [court] * 10 + [elsewhere] * 6)
    path = CameraPath(np.tile(np.eye(3), (FRAMES, 1, 1)), np.r_[np.ones(10), np.zeros(6)])
    found = keyrecon.calibrate_court(video, path)
    assert found.found[:10].all()
    assert not found.found[10:].any()
    assert np.isnan(found.K[10:]).all()


def test_a_film_without_a_court_is_told_as_such(tmp_path):
    video, path = film(tmp_path, [camera_at((0, 60, 7), (0, 90, 0))] * FRAMES)
    with pytest.raises(KeyreconError, match="No tennis court was found"):
        keyrecon.calibrate_court(video, path)


def test_a_camera_file_is_read_as_it_was_written(panned, tmp_path):
    found = panned[2]
    write_camera(tmp_path / "camera.npz", found)
    again = read_camera(tmp_path / "camera.npz")
    for name in ("K", "R", "t", "found", "sd_centre", "sd_focal"):
        assert np.array_equal(getattr(again, name), getattr(found, name))
    (tmp_path / "broken.npz").write_bytes(b"PK\x03\x04 no")
    with pytest.raises(KeyreconError, match="is not a camera"):
        read_camera(tmp_path / "broken.npz")


def test_a_camera_over_the_ground_without_the_spread_of_its_tilt_is_refused(panned, tmp_path):
    for origin, tilt, word in (("ground", np.nan, "sd_tilt"), ("court", np.inf, "sd_tilt")):
        told = replace(panned[2], origin=origin, sd_tilt=np.full(len(panned[2].found), tilt))
        write_camera(tmp_path / "camera.npz", told)
        with pytest.raises(KeyreconError, match=word):
            read_camera(tmp_path / "camera.npz")


def test_pose2sim_reads_the_same_camera(panned, tmp_path):
    import tomllib

    import cv2

    found = panned[2]
    said = write_calibration(tmp_path / "calib.toml", found, SIZE, "cam")
    assert "the camera moves" in said
    told = tomllib.loads((tmp_path / "calib.toml").read_text())["cam_01"]
    point, middle = np.array([[1.0, -5, 0.5]]), FRAMES // 2
    arguments = (np.array(told[n]) for n in ("rotation", "translation", "matrix", "distortions"))
    pixel = cv2.projectPoints(point, *arguments)[0].reshape(1, 2)
    assert np.allclose(pixel, found.project(middle, point), atol=1e-4)
    assert told["size"] == [640.0, 360.0]
