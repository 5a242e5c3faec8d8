"""A motion is put on the court by its standing feet."""

from dataclasses import replace

import numpy as np
import pytest
from court_walker import STATURE, court_camera, lifted, walk
from painted_court import camera_at

from keyrecon.body import LSP14
from keyrecon.io.formats.motion_file import read_motion, write_motion
from keyrecon.records import SOURCES
from keyrecon.world.placement import place_motion
from keyrecon.world.run_measures import measure_run
from keyrecon.world.stances import find_stances

PINHOLE = camera_at((2, -20, 3), (0, -9, 0.8), 1.6)
FEET = [LSP14.index("right_ankle"), LSP14.index("left_ankle")]


@pytest.fixture(scope="module")
def walked():
    points, contact = walk()
    motion = lifted(points, PINHOLE)
    return points, contact, motion, place_motion(motion, court_camera(PINHOLE, len(points)))


def test_a_walk_is_where_it_was(walked):
    points, _, _, world = walked
    hips = points[:, [LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=1)
    assert np.median(np.linalg.norm(world.root - hips, axis=1)) < 0.05
    assert np.median(np.linalg.norm(world.points - points, axis=2)) < 0.06


def test_the_foot_that_stands_is_found(walked):
    _, contact, _, world = walked
    assert (world.contact & ~contact).mean() < 0.12  # around the change of feet both are at rest
    assert (world.contact & contact).sum() > 0.85 * contact.sum()


def test_a_standing_foot_stays_on_the_ground(walked):
    _, contact, _, world = walked
    feet = world.points[:, FEET]
    inner = contact & np.roll(contact, 5, axis=0) & np.roll(contact, -5, axis=0)
    moved = np.linalg.norm(np.diff(feet, axis=0), axis=2)[inner[1:] & inner[:-1]]
    assert np.median(moved) < 0.002
    assert np.abs(feet[inner][:, 2] - 0.0486 * STATURE).max() < 0.06


def test_the_court_tells_the_height_of_a_player_without_one():
    points, _ = walk()
    world = place_motion(
        lifted(points, PINHOLE, "body heights"), court_camera(PINHOLE, len(points))
    )
    assert abs(world.height_ratio - STATURE) < 0.06


def test_who_jumps_beside_the_cameras_axis_is_as_far_away_as_his_size_tells():
    """Off the axis a picture is larger, by 1 / cosine of an angle of 30 degrees here."""
    pinhole = camera_at((2, -20, 3), (-9.4, -9, 0.8), 0.8)
    points, _ = walk()
    points[50:100, :, 2] += 0.3 * np.sin(np.linspace(0, np.pi, 50))[:, None]
    world = place_motion(lifted(points, pinhole), court_camera(pinhole, len(points)))
    hips = points[:, [LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=1)
    off = np.linalg.norm(world.root - hips, axis=1)
    assert off[50:100].mean() < 0.04


def test_the_way_is_as_long_as_it_was(walked):
    points, _, motion, world = walked
    ground = points.mean(axis=1)[:, :2]
    true = np.linalg.norm(ground[-1] - ground[0])
    way = measure_run(world, motion)
    length, speed = way.length.value, way.top_speed.value
    assert true * 0.9 < length < true * 1.2
    assert speed < 2.5


def test_frames_without_the_court_have_no_place(walked):
    _, _, motion, _ = walked
    gap = slice(40, 60)
    world = place_motion(motion, without_camera(len(motion.time), gap))
    assert np.isnan(world.points[gap]).all()
    assert np.isfinite(np.delete(world.points, np.r_[gap], axis=0)).all()
    assert not world.contact[40:60].any()


def without_camera(frames, gap):
    """The camera, which was not found in the gap."""
    camera = court_camera(PINHOLE, frames)
    values = {n: getattr(camera, n).copy() for n in ("K", "R", "t", "found")}
    for name in ("K", "R", "t"):
        values[name][gap] = np.nan
    values["found"][gap] = False
    return replace(camera, **values)


def test_a_player_does_not_fall_while_the_court_is_lost(walked):
    points, _, motion, _ = walked
    world = place_motion(motion, without_camera(len(points), slice(50, 100)))
    hips = points[:, [LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=1)
    off = np.linalg.norm(world.root - hips, axis=1)
    assert off[np.r_[42:50, 100:108]].max() < 0.03


def test_feet_that_nothing_told_of_do_not_stand(walked):
    points, contact, motion, _ = walked
    unseen = slice(50, 100)
    flat, space, confidence, source = (
        getattr(motion, name).copy() for name in ("points2d", "points3d", "confidence", "source")
    )
    flat[unseen, FEET] = flat[50, FEET]  # held where they were last
    space[unseen, FEET, 2] = np.linspace(space[49, FEET, 2], space[100, FEET, 2], 50)
    confidence[unseen, FEET], source[unseen, FEET] = 0, SOURCES.index("interpolated")
    motion = replace(motion, points2d=flat, points3d=space, confidence=confidence, source=source)
    world = place_motion(motion, court_camera(PINHOLE, len(points)))
    assert not world.contact[unseen].any()
    assert (world.contact & contact)[100:].sum() > 0.85 * contact[100:].sum()
    hips = points[:, [LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=1)
    off = np.linalg.norm(world.root - hips, axis=1)
    assert np.delete(off, np.r_[unseen]).mean() < 0.02


def test_feet_that_nothing_told_of_say_nothing_of_the_ground(walked):
    points, _, motion, _ = walked
    confidence, source = motion.confidence.copy(), motion.source.copy()
    confidence[50:, FEET], source[50:, FEET] = 0, SOURCES.index("interpolated")
    count = len(points)
    everywhere = np.ones(count, dtype=bool), np.tile(np.eye(3), (count, 1, 1)), np.ones(count)
    assert find_stances(motion, *everywhere).frame.max() > 100
    motion = replace(motion, confidence=confidence, source=source)
    assert find_stances(motion, *everywhere).frame.max() < 50


def test_a_motion_on_the_court_is_the_same_without_it(walked, tmp_path):
    _, _, motion, world = walked
    write_motion(tmp_path / "plain.npz", motion)
    camera = court_camera(PINHOLE, len(motion.time))
    write_motion(tmp_path / "court.npz", motion, (world, camera))
    with np.load(tmp_path / "plain.npz") as plain, np.load(tmp_path / "court.npz") as placed:
        for name in plain.files:
            assert np.array_equal(plain[name], placed[name]), name
        assert placed["points3d_world"].shape == motion.points3d.shape
        assert placed["contact"].shape == (len(motion.time), 2)
    assert read_motion(tmp_path / "court.npz").units == "m"


def test_nothing_goes_on_from_one_shot_to_the_next():
    """Who stands in one place, and after a cut in another, is in both and ran nowhere."""
    standing = np.repeat(walk()[0][:1], 60, axis=0)
    for step in ((1.0, 0.0), (0.0, 1.0), (0.0, 6.0)):
        points = np.concatenate([standing, standing + np.array([*step, 0.0])])
        motion = replace(lifted(points, PINHOLE), cuts=np.array([60]))
        world = place_motion(motion, court_camera(PINHOLE, len(points)))
        hips = points[:, [LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=1)
        assert np.linalg.norm(world.root - hips, axis=1).max() < 0.12, step
        assert abs(world.height_ratio - 1) < 0.03, step


def test_a_shot_without_a_motion_is_left_out(walked):
    points, _, motion, whole = walked
    gap = np.zeros(len(points), dtype=bool)
    gap[60:80] = True
    pose, places = motion.points3d.copy(), motion.points2d.copy()
    pose[gap], places[gap] = np.nan, np.nan
    cut = replace(motion, points3d=pose, points2d=places, cuts=np.array([60, 80]))
    world = place_motion(cut, court_camera(PINHOLE, len(points)))
    assert np.isnan(world.points[gap]).all()
    assert np.median(np.linalg.norm(world.points - whole.points, axis=2)[~gap]) < 0.05
