"""How far, how fast and where a player ran."""

from dataclasses import replace

import numpy as np
import pytest
from small_motion import make_motion

from keyrecon.world.records import WorldMotion
from keyrecon.world.run_measures import measure_run

FPS, FRAMES = 50.0, 400


def along(root):
    """A motion whose root goes so."""
    motion = replace(make_motion(len(root)), time=np.arange(len(root)) / FPS, fps=FPS)
    contact = np.zeros((len(root), 2), dtype=bool)
    return WorldMotion(motion.points3d, root, contact, 1.0), motion


def straight(speed):
    """From behind the near baseline straight to the net."""
    way = -15.0 + speed * np.arange(FRAMES) / FPS
    return np.column_stack([np.zeros(FRAMES), way, np.ones(FRAMES)])


def test_a_straight_run_is_as_long_and_as_fast_as_it_is():
    way = measure_run(*along(straight(1.5)))
    assert way.length.value == pytest.approx(12.0, rel=1e-6)
    assert way.top_speed.value == pytest.approx(1.5)
    assert way.top_acceleration.value == pytest.approx(0, abs=1e-6)


def test_time_is_spent_behind_on_and_inside_the_baseline():
    behind, on, inside = measure_run(*along(straight(1.5))).seconds
    assert behind == pytest.approx((15 - 12.385) / 1.5, abs=0.03)
    assert on == pytest.approx(1.0 / 1.5, abs=0.03)
    assert behind + on + inside == pytest.approx(FRAMES / FPS, abs=0.03)


def test_swaying_about_one_place_is_not_running():
    root = straight(0.0)
    root[:, 0] = 0.02 * np.sin(2 * np.pi * 2 * np.arange(FRAMES) / FPS)
    assert measure_run(*along(root)).length.value < 0.1


def test_frames_without_a_place_count_for_nothing():
    root = straight(1.5)
    root[100:200] = np.nan
    way = measure_run(*along(root))
    assert way.known_seconds == pytest.approx(6.0, abs=0.1)
    assert way.length.value == pytest.approx(9.0, abs=0.2)
    assert np.isnan(way.speed[100:200]).all()
    root[:] = np.nan
    assert measure_run(*along(root)) is None


def cut_between(root, cut):
    """A way of which another shot begins with frame `cut`."""
    world, motion = along(root)
    return world, replace(motion, cuts=np.array([cut]))


def test_who_stands_in_two_shots_at_two_places_has_not_run():
    root = straight(0.0)
    root[200:, :2] += [3.0, 9.0]
    way = measure_run(*cut_between(root, 200))
    assert way.length.value < 0.2
    assert way.top_speed.value == pytest.approx(0, abs=1e-9)
    assert way.top_acceleration.value == pytest.approx(0, abs=1e-9)
    assert np.isfinite(way.speed).all() and way.known_seconds == pytest.approx(FRAMES / FPS)


def test_each_of_two_shots_keeps_the_speed_of_its_own_way():
    root = straight(1.5)
    root[200:] = straight(3.0)[:200]
    speed = measure_run(*cut_between(root, 200)).speed
    assert speed[:200] == pytest.approx(1.5)
    assert speed[200:] == pytest.approx(3.0)


def test_a_shot_of_one_frame_tells_no_speed():
    world, motion = along(straight(1.5))
    way = measure_run(world, replace(motion, cuts=np.array([200, 201])))
    assert np.isnan(way.speed[200]) and np.isfinite(np.delete(way.speed, 200)).all()
    assert way.length.value == pytest.approx(12.0, rel=0.01)


def test_time_between_shots_is_spent_nowhere():
    """Black that is stored as one long frame belongs to nobody's way."""
    world, motion = along(straight(1.5))
    later = motion.time + np.where(np.arange(FRAMES) < 200, 0, 60.0)
    way = measure_run(world, replace(motion, time=later, cuts=np.array([200])))
    assert way.known_seconds == pytest.approx(FRAMES / FPS)
    assert way.length.value == pytest.approx(12.0)
