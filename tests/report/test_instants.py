"""Key instants: where a hand is fastest relative to the body, whatever the sport."""

from dataclasses import replace

import numpy as np
import pytest
from small_motion import FPS, make_motion

from keyrecon.body import LSP14
from keyrecon.report import instants
from keyrecon.report.instants import hand_speed, instant_angles, key_instants, separation

WRIST = LSP14.index("right_wrist")


def swinging(strokes, frames=500, speed=6.0):
    """A still body whose right hand goes there and back, fastest at the given frames."""
    motion = make_motion(frames, wildness=0.0)
    way = np.zeros(frames)
    for stroke in strokes:
        way += np.tanh((np.arange(frames) - stroke) / 5)
    points = motion.points3d.copy()
    points[:, WRIST, 0] += speed * 5 / FPS * way
    return replace(motion, points3d=points)


def test_strokes_are_found_where_the_hand_is_fastest():
    found = key_instants(swinging([100, 220, 400]))
    assert [instant.frame for instant in found] == pytest.approx([100, 220, 400], abs=1)
    assert {instant.hand for instant in found} == {"right"}
    assert all(instant.speed == pytest.approx(6, rel=0.1) for instant in found)


def timed(motion, steps):
    """The same frames, so many seconds apart."""
    return replace(motion, time=np.concatenate([[0.0], np.cumsum(steps)]))


def test_a_hand_is_slower_where_frames_are_farther_apart_in_time():
    strokes = swinging([100, 300])
    usual, slower = key_instants(timed(strokes, np.where(np.arange(499) < 200, 1, 1.5) / FPS))
    assert (usual.frame, slower.frame) == pytest.approx((100, 300), abs=1)
    assert usual.speed == pytest.approx(6, rel=0.1)
    assert slower.speed == pytest.approx(4, rel=0.1)


def test_a_hand_that_moves_evenly_is_evenly_fast_at_uneven_times():
    motion = make_motion(100, wildness=0.0)
    uneven = timed(motion, np.resize([0.01, 0.03, 0.02], 99))
    points = motion.points3d.copy()
    points[:, WRIST, 0] += 3.0 * uneven.time
    assert hand_speed(replace(uneven, points3d=points), "right_wrist") == pytest.approx(3.0)


def test_a_backswing_is_no_stroke_however_many_frames_show_it():
    motion = swinging([100, 160])
    assert len(key_instants(motion)) == 2
    filmed_faster = timed(motion, np.full(499, 0.25 / FPS))
    assert len(key_instants(filmed_faster)) == 1  # 60 frames are .3 s there


def test_times_that_a_file_rounds_to_milliseconds_leave_a_speed_as_it_is():
    motion = make_motion(100, wildness=0.0)
    points = motion.points3d.copy()
    points[:, WRIST, 0] += 3.0 * np.arange(100) / 240
    rounded = replace(motion, points3d=points, fps=240.0, time=np.round(np.arange(100) / 240, 3))
    assert hand_speed(rounded, "right_wrist") == pytest.approx(3.0, rel=0.01)


def test_strokes_on_both_sides_of_a_cut_are_two():
    motion = swinging([185, 215])  # in one shot nearer than a backswing and its hit
    assert len(key_instants(motion)) == 1
    found = key_instants(replace(motion, cuts=np.array([200])))
    assert [instant.frame for instant in found] == pytest.approx([185, 215], abs=1)


def test_a_player_is_measured_once_for_however_many_shots(monkeypatch):
    """A match of an hour has hundreds, and measuring takes all of its frames."""
    measured, measure = [], instants.stature
    monkeypatch.setattr(instants, "stature", lambda motion: measured.append(1) or measure(motion))
    assert key_instants(replace(swinging([185, 215]), cuts=np.array([100, 200, 300])))
    assert len(measured) == 1


def test_a_runner_whose_hands_are_still_has_none():
    motion = make_motion(200, wildness=0.0)
    run = np.arange(200)[:, None, None] / FPS * np.array([7.0, 0, 0])
    assert key_instants(replace(motion, points3d=motion.points3d + run)) == []


def test_slow_hands_are_no_strokes():
    assert key_instants(swinging([100, 300], speed=1.0)) == []


def test_the_fastest_are_kept_and_told_in_the_order_of_time():
    found = key_instants(swinging(range(60, 1560, 100), frames=1600))
    frames = [instant.frame for instant in found]
    assert len(frames) == 8
    assert frames == sorted(frames)


@pytest.mark.parametrize("frames", [1, 4, 6])
def test_the_shortest_motions_have_none(frames):
    assert key_instants(make_motion(frames, wildness=0.0)) == []


def test_shoulders_that_turn_against_the_hips_are_told_in_degrees():
    motion = make_motion(3, wildness=0.0)
    points = motion.points3d.copy()
    for side, sign in (("left", 1), ("right", -1)):
        turned = sign * 0.25 * np.array([np.cos(np.radians(30)), 0, np.sin(np.radians(30))])
        points[:, LSP14.index(f"{side}_shoulder")] = points[:, LSP14.root] + turned
    assert separation(replace(motion, points3d=points)) == pytest.approx(30, abs=1)


def test_angles_of_all_hinges_are_named():
    assert list(instant_angles(make_motion(5))) == [
        "left knee",
        "right knee",
        "left elbow",
        "right elbow",
        "shoulders to hips",
    ]


def test_a_skeleton_without_hands_has_no_instants():
    motion = make_motion(60)
    names = tuple(name.replace("wrist", "palm") for name in LSP14.names)
    assert key_instants(replace(motion, skeleton=replace(LSP14, names=names))) == []
