"""Facts about which cameras a motion is put into the world of."""

from dataclasses import replace

import numpy as np
import pytest
from court_walker import court_camera
from ground_walker import CAMERA

from keyrecon.app.placing import MAX_TILT_ERROR, most_tilt_error


def looking_down(degrees):
    """A camera over level ground."""
    sine, cosine = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    turn = np.array([[1, 0, 0], [0, -sine, -cosine], [0, cosine, -sine]])
    camera = court_camera(CAMERA, 3)
    return replace(camera, R=np.repeat(turn[None], 3, axis=0))


def test_a_level_camera_must_be_known_well():
    assert most_tilt_error(looking_down(5)) == MAX_TILT_ERROR


def test_a_steep_camera_helps_though_it_is_known_less_well():
    """A lift guesses a tilt of 23 degrees wrong by 5 and more."""
    steep = most_tilt_error(looking_down(23))
    assert np.degrees(steep) == pytest.approx(5.5, abs=0.3)
    assert most_tilt_error(looking_down(32)) > steep


def test_a_camera_that_was_never_found_has_the_usual_limit():
    camera = looking_down(30)
    nowhere = replace(camera, found=np.zeros(3, dtype=bool))
    assert most_tilt_error(nowhere) == MAX_TILT_ERROR
