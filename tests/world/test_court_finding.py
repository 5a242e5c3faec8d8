"""A court is found where there is one, and nowhere else."""

import cv2
import numpy as np
import pytest
from painted_court import badminton_court, camera_at, court_error, paint

from keyrecon.world.court import tennis_court
from keyrecon.world.court_finding import find_in_picture

VIEWS = {
    "broadcast": camera_at((0.4, -32, 9), (0, -2, 0), 1.5),
    "phone behind the baseline": camera_at((-0.8, -19, 1.6), (0.3, 0, 0.6), 1.2),
    "from a corner": camera_at((8, -19, 3), (-1.5, -7, 0), 1.4),
}


@pytest.mark.parametrize("name", VIEWS)
def test_a_painted_court_is_found_to_a_pixel(name):
    truth = VIEWS[name]
    view = find_in_picture(paint(truth), tennis_court())
    assert view.doubt == ""
    assert np.median(court_error(view.camera, truth)) < 1.5
    away = np.linalg.norm(truth.centre - [0, -6, 0])
    assert np.linalg.norm(view.camera.centre - truth.centre) < 0.05 * away


def test_noise_is_no_court():
    rng = np.random.default_rng(3)
    noise = rng.integers(0, 256, (360, 640)).astype(np.uint8)
    for picture in (noise, cv2.GaussianBlur(noise, (0, 0), 3), np.full_like(noise, 100)):
        assert "No tennis court" in find_in_picture(picture, tennis_court()).doubt


def test_straight_lines_in_all_directions_are_no_court():
    rng = np.random.default_rng(8)
    picture = np.full((360, 640), 80, np.uint8)
    for _ in range(14):
        a, b = (tuple(int(v) for v in rng.uniform((0, 0), (640, 360))) for _ in range(2))
        cv2.line(picture, a, b, 210, 3, cv2.LINE_AA)
    assert find_in_picture(picture, tennis_court()).doubt


def test_lines_of_another_sport_are_no_tennis_court():
    size = (960, 540)
    corner = camera_at((4.7, -10.7, 3.5), (-0.5, -2, 0), 1.4, size)
    broadcast = camera_at((0.3, -22.7, 8), (0, -1, 0), 1.5, size)
    painted = [paint(camera, size, court=badminton_court()) for camera in (corner, broadcast)]
    doubts = [find_in_picture(picture, tennis_court()).doubt for picture in painted]
    assert "no net is where its net would be" in doubts[0]
    assert "No tennis court" in doubts[1]


def test_one_line_is_no_court():
    low = camera_at((0, -13.5, 1.5), (0, -11.9, 0), 2.0)
    assert find_in_picture(paint(low), tennis_court()).doubt
