"""Numbers of the report on a video of two shots, which show the player at two sizes and places."""

from dataclasses import replace

import numpy as np
import pytest
from small_motion import FPS, make_motion

from keyrecon.records import Track
from keyrecon.report import summary

FRAMES, CUT = 60, 30
SIZES = np.where(np.arange(FRAMES) < CUT, 100.0, 300.0)
"""Height of the player in the picture, px."""


def two_shots(points2d):
    """A motion whose joints go so in the picture, and another shot from `CUT` on."""
    motion = make_motion(FRAMES)
    return replace(motion, points2d=points2d, points2d_propagated=points2d, cuts=np.array([CUT]))


def seen_at(place):
    """(T, 2) in player heights, as pixels of every joint."""
    middle = np.array([500.0, 300.0])
    return np.tile((middle + SIZES[:, None] * place)[:, None], (1, 14, 1))


def track():
    nowhere = np.zeros((FRAMES, 2))
    feet, box = np.zeros((FRAMES, 2, 2)), np.zeros((FRAMES, 4))
    return Track(nowhere, feet, SIZES, box, np.ones(FRAMES))


def test_joints_that_rest_in_each_of_two_shots_do_not_accelerate():
    motion = two_shots(seen_at(np.full((FRAMES, 2), 0.4)))
    found = summary.joint_acceleration(motion.points2d, motion, track())
    np.testing.assert_allclose(found, 0, atol=1e-9)


def test_an_acceleration_is_told_in_heights_of_the_shot_that_shows_it():
    fall = 0.5 * 2.0 * (np.arange(FRAMES) / FPS) ** 2
    motion = two_shots(seen_at(np.column_stack([np.zeros(FRAMES), fall])))
    found = summary.joint_acceleration(motion.points2d, motion, track())
    np.testing.assert_allclose(found, 2.0)


def test_a_speed_of_the_feet_is_told_in_heights_of_the_shot_that_shows_it():
    along = np.column_stack([0.5 * np.arange(FRAMES) / FPS, np.zeros(FRAMES)])
    found = summary.foot_speed(two_shots(seen_at(along)), track())
    assert found == pytest.approx(0.5)


def at_uneven_times(along):
    """A motion in one shot whose joints are at `along` of their time, in heights."""
    time = np.cumsum(np.resize([0.01, 0.03, 0.02], FRAMES))
    pixels = np.tile((100 * along(time))[:, None, None], (1, 14, 2))
    return replace(make_motion(FRAMES, time=time), points2d=pixels)


def test_feet_that_go_evenly_have_one_speed_at_uneven_times():
    motion = at_uneven_times(lambda time: 0.5 * time)
    even_track = replace(track(), height=np.full(FRAMES, 100.0))
    assert summary.foot_speed(motion, even_track) == pytest.approx(0.5 * np.sqrt(2))


def test_a_fall_has_one_acceleration_at_uneven_times():
    motion = at_uneven_times(lambda time: 0.5 * 2.0 * time**2)
    even_track = replace(track(), height=np.full(FRAMES, 100.0))
    found = summary.joint_acceleration(motion.points2d, motion, even_track)
    np.testing.assert_allclose(found, 2.0 * np.sqrt(2))


def test_steady_motion_has_no_acceleration():
    steady = np.arange(float(FRAMES))[:, None, None] * np.ones((14, 2))
    found = summary.joint_acceleration(steady, two_shots(steady), track())
    np.testing.assert_allclose(found, 0, atol=1e-9)


def test_a_joint_never_found_in_three_frames_running_has_no_acceleration():
    points = seen_at(np.zeros((FRAMES, 2)))
    points[::3, 4] = np.nan
    points[2::3, 4] = np.nan
    found = summary.joint_acceleration(points, two_shots(points), track())
    assert np.isnan(found[4]) and not np.isnan(np.delete(found, 4)).any()
