"""Exports stand on the floor, over the origin, upright, and at even times."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_motion import FPS, make_motion

from keyrecon.body import ANKLE_HEIGHT, LSP14, Skeleton
from keyrecon.io.formats.conventions import (
    WorldJoints,
    camera_pitch,
    stand_on_floor,
    stature,
    y_up,
)
from keyrecon.world.records import COURT

ANKLES = [LSP14.index("right_ankle"), LSP14.index("left_ankle")]
HIPS = [LSP14.index("right_hip"), LSP14.index("left_hip")]


def uneven_time(frames):
    return np.cumsum(np.random.default_rng(3).uniform(0.5, 1.5, frames)) / FPS


def moved(motion, shift):
    """A motion with (T, 3) added to every joint, camera axes."""
    return replace(motion, points3d=motion.points3d + shift[:, None])


def lower_ankle(motion):
    return stand_on_floor(motion).points[:, ANKLES, 1].min(axis=1)


@pytest.mark.parametrize("place", [(0, 0, 0), (3, 2.4, 5), (-1, -2, 0)])
def test_feet_stand_on_the_floor_wherever_the_player_was_in_the_picture(place):
    motion = make_motion(wildness=0.1)
    away = moved(motion, np.tile(np.array(place, dtype=float), (60, 1)))
    assert np.median(lower_ankle(away)) == pytest.approx(ANKLE_HEIGHT * 1.8, abs=0.02)
    assert np.allclose(stand_on_floor(away).points, stand_on_floor(motion).points)


def test_the_first_frame_is_over_the_origin():
    points = stand_on_floor(make_motion(wildness=0.5)).points
    assert np.allclose(points[0, HIPS][:, [0, 2]].mean(axis=0), 0)


def test_a_jump_keeps_its_height():
    still, frames = make_motion(200, wildness=0.0), np.arange(200)
    height = np.maximum(0, 0.3 * (1 - ((frames - 100) / 12) ** 2))  # half a second in the air
    rise = lower_ankle(moved(still, height[:, None] * [0, -1, 0])) - ANKLE_HEIGHT * 1.8
    assert rise.max() == pytest.approx(0.3, abs=0.02)
    assert np.abs(rise[height == 0]).max() < 0.02


def test_a_player_who_walks_away_from_a_camera_above_does_not_rise():
    still = make_motion(300, wildness=0.0)
    walked = lower_ankle(moved(still, np.linspace(0, 0.6, 300)[:, None] * [0, -1, 0]))
    assert np.ptp(walked[25:-25]) < 0.01
    assert np.ptp(walked) < 0.08


def legs_lean(joints):
    """Mean angle of the legs towards the camera, degrees; joints with Y up."""
    legs = joints[:, HIPS].mean(axis=1) - joints[:, ANKLES].mean(axis=1)
    return np.degrees(np.arctan2(legs[:, 2], legs[:, 1]).mean())


@pytest.mark.parametrize("degrees", [-35, 20, 35])
def test_a_camera_that_looks_down_is_levelled(degrees):
    level = make_motion(wildness=0.0)
    own = legs_lean(y_up(level.points3d))
    assert camera_pitch(level) == 0
    tilt = Rotation.from_euler("x", degrees, degrees=True).as_matrix()
    tilted = replace(level, points3d=y_up(y_up(level.points3d) @ tilt.T))
    assert np.degrees(camera_pitch(tilted)) == pytest.approx(own + degrees, abs=0.1)
    standing = stand_on_floor(tilted)
    assert abs(legs_lean(standing.points)) < 0.1
    assert f"the camera looked {'down' if degrees > 0 else 'up'} by" in standing.placing


def test_an_even_motion_keeps_its_frames():
    motion = make_motion(wildness=0.0)
    standing = stand_on_floor(motion)
    assert np.allclose(standing.time, motion.time)
    assert (standing.fps, len(standing.points)) == (FPS, 60)
    joints = y_up(motion.points3d)
    assert np.allclose(standing.points - standing.points[:, :1], joints - joints[:, :1])


def test_uneven_frames_become_as_many_even_ones():
    motion = make_motion(time=uneven_time(60))
    standing = stand_on_floor(motion)
    assert len(standing.points) == 60
    assert np.allclose(np.diff(standing.time), 1 / standing.fps)
    assert standing.time[-1] == pytest.approx(motion.time[-1] - motion.time[0])
    assert "as many as in the video" in standing.timing
    kept = stand_on_floor(motion, even_times=False)
    assert np.allclose(kept.time, motion.time - motion.time[0])


def test_resampling_keeps_bone_lengths():
    points = stand_on_floor(make_motion(time=uneven_time(60))).points
    lengths = np.linalg.norm(points[:, LSP14.bones[:, 1]] - points[:, LSP14.bones[:, 0]], axis=2)
    assert np.allclose(lengths, 1.8 * LSP14.lengths)


def test_resampling_takes_joints_to_where_they_are_at_even_times():
    time = uneven_time(60)
    still = make_motion(time=time, wildness=0.0)
    shift = (time - time[0])[:, None] * np.array([1.0, 0, 0])
    standing = stand_on_floor(moved(still, shift))
    expected = standing.points[:1] + standing.time[:, None, None] * np.array([1.0, 0, 0])
    assert np.allclose(standing.points, expected)


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_the_shortest_motions_stand_too(frames):
    assert lower_ankle(make_motion(frames, wildness=0.0)) == pytest.approx(ANKLE_HEIGHT * 1.8)


def test_a_skeleton_without_ankles_stands_on_its_lowest_joint():
    stick = Skeleton(("a", "b"), (-1, 0), (), (0.0, 1.0), ())
    motion = make_motion()
    names = ("points3d", "points2d", "points2d_propagated", "confidence", "source")
    parts = {name: getattr(motion, name)[:, :2] for name in names}
    standing = stand_on_floor(replace(motion, skeleton=stick, **parts))
    assert np.median(standing.points[:, 1, 1]) == pytest.approx(0, abs=0.05)


def test_stature_is_told_by_the_bones():
    assert stature(make_motion()) == pytest.approx(1.8)


def in_two_shots(motion, cut=30):
    """The same motion, which another shot begins in."""
    return replace(motion, cuts=np.array([cut]))


def on_the_court(motion):
    """The same joints 20 m from the net: x right, y away from the camera, z up."""
    x, y, z = motion.points3d.transpose(2, 0, 1)
    return WorldJoints(np.stack([x + 3, z - 20, 1.2 - y], axis=2), COURT)


def test_two_shots_on_the_court_stand_where_the_court_is():
    motion = in_two_shots(make_motion())
    world = on_the_court(motion)
    standing = stand_on_floor(motion, world=world)
    assert np.allclose(standing.points, world.points[..., [0, 2, 1]] * [1, 1, -1])
    assert "on the court" in standing.placing and "by itself" not in standing.placing


@pytest.mark.parametrize("shots", [1, 2])
def test_all_frames_have_one_origin_where_the_camera_was_lost_for_long(shots):
    motion = make_motion()
    motion = motion if shots == 1 else in_two_shots(motion)
    world = on_the_court(motion)
    world.points[4:24] = np.nan
    standing = stand_on_floor(motion, world=world)
    assert np.array_equal(standing.points, stand_on_floor(motion).points)
    assert standing.placing.startswith("feet on the floor at 0")
    assert "not on the court, since the place there is unknown in 20 of 60" in standing.placing


def test_a_moment_without_a_place_on_the_court_is_bridged_and_said():
    motion = make_motion()
    whole, world = on_the_court(motion), on_the_court(motion)
    world.points[7:9] = np.nan  # the camera was lost for two frames
    standing = stand_on_floor(motion, world=world)
    off = np.linalg.norm(standing.points - stand_on_floor(motion, world=whole).points, axis=2)
    assert off[[*range(7), *range(9, 60)]].max() < 1e-9
    assert off[7:9].max() < 0.05
    assert standing.placing.startswith("on the court")
    assert "unknown in 2 of 60 frames, which are bridged" in standing.placing


def test_a_moment_without_a_place_on_the_court_stays_a_gap_where_a_format_can_have_one():
    motion = make_motion()
    world = on_the_court(motion)
    world.points[7:9] = np.nan
    standing = stand_on_floor(motion, world=world, gaps=True)
    assert np.array_equal(np.flatnonzero(~standing.known), [7, 8])
    assert "left out are 2 of 60 frames" in standing.placing


def test_what_is_unknown_up_to_a_cut_is_not_bridged():
    motion = in_two_shots(make_motion())
    world = on_the_court(motion)
    world.points[28:32] = np.nan
    assert "not on the court" in stand_on_floor(motion, world=world).placing


def test_frames_without_a_figure_need_no_place_on_the_court():
    motion = make_motion()
    points = motion.points3d.copy()
    points[20:25] = np.nan
    motion = replace(motion, points3d=points)
    standing = stand_on_floor(motion, world=on_the_court(motion))
    assert standing.placing.startswith("on the court")
    assert np.array_equal(standing.known, motion.known)
