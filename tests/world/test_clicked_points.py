"""Four clicks tell a camera; one that contradicts the others is named."""

import numpy as np
import pytest
from painted_court import camera_at, court_error

from keyrecon.errors import KeyreconError
from keyrecon.world.clicked_points import camera_from_points, check_click
from keyrecon.world.court import POINTS
from keyrecon.world.records import CourtClick

SHAPE = (360, 640)
TRUTH = camera_at((3, -25, 6), (0, -3, 0), 1.4)
NAMES = ("near-left", "near-right", "far-right-service", "near-service", "net-middle", "far-left")


def clicked(names, camera=TRUTH):
    return camera.project(np.array([POINTS[name] for name in names]))


def test_four_points_are_enough():
    names = NAMES[:3] + NAMES[4:5]
    found = camera_from_points(names, clicked(names) + [[0.3, -0.4]] * 4, SHAPE)
    assert np.median(court_error(found, TRUTH)) < 1.5


def test_the_click_that_contradicts_the_others_is_named():
    pixels = clicked(NAMES)
    pixels[2] += (45, -8)
    with pytest.raises(KeyreconError, match="far-right-service contradicts the others"):
        camera_from_points(NAMES, pixels, SHAPE)


def test_left_and_right_exchanged_are_told_of():
    mirrored = [name.replace("left", "L").replace("right", "left").replace("L", "right")
                for name in NAMES]  # fmt: skip
    with pytest.raises(KeyreconError, match="left and right are exchanged"):
        camera_from_points(mirrored, clicked(NAMES), SHAPE)


def test_near_and_far_exchanged_are_told_of():
    turned = [name.replace("near", "N").replace("far", "near").replace("N", "far")
              for name in NAMES]  # fmt: skip
    with pytest.raises(KeyreconError, match="near and far are exchanged"):
        camera_from_points(turned, clicked(NAMES), SHAPE)


def test_points_on_one_line_leave_the_camera_open():
    names = ("near-left", "near-left-singles", "near-mark", "near-right")
    for more in ((), ("near-service",)):
        with pytest.raises(KeyreconError, match="click two that lie away from it"):
            camera_from_points(names + more, clicked(names + more), SHAPE)
    enough = (*names, "near-service", "near-right-service")
    assert np.median(court_error(camera_from_points(enough, clicked(enough), SHAPE), TRUTH)) < 1.5


def test_four_that_contradict_one_another_ask_for_a_fifth():
    names = ("near-left", "near-right", "far-right", "far-left")
    pixels = clicked(names)
    pixels[2] += (200, 90)
    with pytest.raises(KeyreconError, match="contradict"):
        camera_from_points(names, pixels, SHAPE)


def test_a_misspelt_point_is_told_of_with_the_one_meant():
    with pytest.raises(KeyreconError, match="did you mean near-left"):
        check_click(CourtClick("near-lft", 0, 3.0, 4.0), 10, (640, 360))
