"""A court is found where there is one, and nowhere else."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from other_courts import OTHER_COURTS
from painted_court import camera_at, court_error, paint

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


OTHERS = [
    ("pickleball", (-2, -7.7, 1.0), 0.8),
    ("pickleball", (0, -7.7, 1.3), 0.8),
    ("pickleball", (0.4, -9.2, 1.0), 1.3),
    ("pickleball", (0.4, -7.7, 5.0), 1.3),
    ("pickleball", (0.3, -16.8, 6.0), 1.5),
    ("badminton", (-2, -7.7, 1.6), 0.8),
    ("volleyball", (0, -10.0, 2.0), 0.8),
    ("volleyball", (0.4, -16.0, 2.0), 1.3),
    ("volleyball", (0.4, -11.5, 5.0), 1.3),
    ("padel", (0, -17.0, 1.0), 0.8),
    ("padel", (0, -11.0, 1.6), 0.8),
    ("padel", (0, -12.5, 1.6), 0.8),
    ("padel", (0, -14.0, 5.0), 0.8),
    ("basketball", (0.4, -16.5, 1.3), 1.3),
    ("basketball", (0.3, -35.0, 9.0), 1.5),
]
"""Courts from low behind the baseline to a broadcast: the camera's place, m, and focal length."""


@pytest.mark.parametrize(("sport", "place", "focal"), OTHERS)
def test_the_court_of_another_sport_is_no_tennis_court(sport, place, focal):
    court, half_length = OTHER_COURTS[sport]
    camera = camera_at(place, (0, -0.1 * half_length, 0.3), focal, (960, 540))
    doubt = find_in_picture(paint(camera, (960, 540), court=court), tennis_court()).doubt
    assert "tennis court" in doubt


def test_a_tennis_court_without_a_net_is_told_apart_by_it():
    whole = tennis_court()
    ground = (whole.ends[..., 2] == 0).all(axis=1)
    names = tuple(n for n, kept in zip(whole.names, ground, strict=True) if kept)
    bare = replace(whole, names=names, ends=whole.ends[ground], width=whole.width[ground])
    doubt = find_in_picture(paint(VIEWS["broadcast"], court=bare), whole).doubt
    assert "no net is where its net would be" in doubt


def test_a_line_that_is_not_painted_is_named():
    whole = tennis_court()
    kept = [k for k, name in enumerate(whole.names) if name != "left singles sideline"]
    names = tuple(whole.names[k] for k in kept)
    bare = replace(whole, names=names, ends=whole.ends[kept], width=whole.width[kept])
    doubt = find_in_picture(paint(VIEWS["broadcast"], court=bare), whole).doubt
    assert "singles sideline is not to be seen" in doubt


HALVES = {
    "far half": camera_at((0.4, -32, 9), (0, 8.5, 0), 3.2),
    "near half": camera_at((0.4, -32, 9), (0, -9, 0), 2.3),
}


@pytest.mark.parametrize("name", HALVES)
def test_half_a_court_is_found_without_its_net(name):
    truth = HALVES[name]
    view = find_in_picture(paint(truth), tennis_court())
    assert view.doubt == ""
    assert np.median(court_error(view.camera, truth)) < 1.5


def test_one_line_is_no_court():
    low = camera_at((0, -13.5, 1.5), (0, -11.9, 0), 2.0)
    assert find_in_picture(paint(low), tennis_court()).doubt
