"""Camera and ground mend what a lifting guesses of depth."""

from dataclasses import replace

import numpy as np
import pytest
from court_walker import FPS, court_camera, lifted, walk
from painted_court import camera_at
from scipy.ndimage import gaussian_filter1d

from keyrecon.body import LSP14
from keyrecon.metrics import n_mpjpe
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.world import refinement
from keyrecon.world.placement import place_motion
from keyrecon.world.sight import sight_axes

PINHOLE = camera_at((2, -20, 3), (0, -9, 0.8), 1.6)
HIGH = camera_at((2, -18, 8), (0, -9, 0.8), 1.6)
FEET = [LSP14.index("right_ankle"), LSP14.index("left_ankle")]
HIPS = [LSP14.index("right_hip"), LSP14.index("left_hip")]
NECK = LSP14.index("neck")


def guessed(points, seed=0, depth=0.08, pixels=2.0, lean=0.0, pinhole=PINHOLE):
    """A lifting with slow errors, of depth above all; `lean` along the line of sight."""
    rng, motion = np.random.default_rng(seed), lifted(points, pinhole)

    def slow(spread, axes):
        made = gaussian_filter1d(rng.standard_normal((*points.shape[:2], axes)), 8.0, axis=0)
        return spread * made / made.std()

    places = motion.points2d + slow(pixels, 2)
    parents, children = LSP14.bones.T
    bones = motion.points3d[:, children] - motion.points3d[:, parents]
    lengths = np.linalg.norm(bones, axis=2, keepdims=True)
    bones = bones + np.concatenate([slow(0.02, 2), slow(depth, 1)], axis=2)[:, children]
    bones[..., 2] += lean * bones[..., 1]
    pose = LSP14.ancestry @ (lengths * unit_vectors(bones))
    return replace(motion, points3d=pose, points2d=places)


def placed(motion, points, pinhole=PINHOLE):
    return place_motion(motion, court_camera(pinhole, len(points)))


@pytest.fixture(scope="module")
def walked():
    points, contact = walk()
    return points, contact, placed(guessed(points), points)


def test_standing_feet_do_not_slip(walked):
    _, contact, world = walked
    steps = np.linalg.norm(np.diff(world.points[:, FEET, :2], axis=0), axis=2) * FPS
    both = world.contact[1:] & world.contact[:-1]
    assert np.median(steps[both]) < 0.01
    assert np.quantile(steps[both], 0.9) < 0.05
    hit = (world.contact & contact).sum()
    assert 2 * hit / (world.contact.sum() + contact.sum()) > 0.85


def test_the_pose_is_nearer_the_truth_than_that_of_the_lifting(walked):
    points, _, world = walked
    motion = guessed(points)
    axes = sight_axes(court_camera(PINHOLE, len(points)), motion.points2d[:, HIPS].mean(axis=1))
    turned = np.einsum("tik,tnk->tni", axes, motion.points3d)
    assert n_mpjpe(world.points, points, HIPS) < 0.9 * n_mpjpe(turned, points, HIPS)


def test_limbs_keep_their_lengths(walked):
    _, _, world = walked
    bones = LSP14.bones
    lengths = np.linalg.norm(world.points[:, bones[:, 1]] - world.points[:, bones[:, 0]], axis=2)
    assert (lengths.std(axis=0) < 1e-9).all()


def trunk_slope(points):
    trunk = points[:, NECK] - points[:, HIPS].mean(axis=1)
    return np.median(trunk[:, 1] / trunk[:, 2])


def test_a_lean_that_a_high_camera_gave_to_all_frames_is_taken_out():
    points, _ = walk()
    lean = {}
    for pinhole in (HIGH, PINHOLE):
        for slope in (-0.2, 0.2):
            world = placed(guessed(points, lean=slope, pinhole=pinhole), points, pinhole)
            lean[pinhole is HIGH, slope] = trunk_slope(world.points)
    assert abs(lean[True, 0.2] - lean[True, -0.2]) < 0.2
    assert 0 < (lean[True, 0.2] + lean[True, -0.2]) / 2 < 0.11  # players lean forward, this one not
    # a level camera tells no tilt: a trunk that leans, leans
    assert abs(lean[False, 0.2] - lean[False, -0.2]) > 0.25


def test_a_foot_on_its_toes_stands_with_its_heel_up():
    points, _ = walk(steps=2, stride=0.0)
    points = np.repeat(points[:1], 120, axis=0)
    up = slice(50, 90)
    for foot, knee in ((FEET[0], LSP14.index("right_knee")), (FEET[1], LSP14.index("left_knee"))):
        points[up, foot, 2] += 0.08
        points[up, knee, 2] += 0.04
    world = placed(guessed(points, pixels=0.5), points)
    assert world.contact[:45].mean() > 0.8
    assert world.contact[55:85].mean() > 0.8
    feet = world.points[:, FEET, 2]
    assert np.abs(feet[55:85].mean(axis=0) - feet[:45].mean(axis=0) - 0.08).max() < 0.02


def test_a_jump_is_as_high_as_it_was():
    points, _ = walk(steps=2, stride=0.0)
    points = np.repeat(points[:1], 120, axis=0)
    t = np.arange(120) / FPS
    rise = np.maximum(0.3 - 0.5 * 9.81 * (t - 1.2) ** 2, 0.0)
    points = points + rise[:, None, None] * np.array([0, 0, 1.0])
    world = placed(guessed(points), points)
    height = world.root[:, 2] - np.median(world.root[rise == 0, 2])
    assert abs(height.max() - 0.3) < 0.04
    assert not world.contact[rise > 0.1].any()


def test_windows_of_a_long_motion_fit_together(monkeypatch):
    points, _ = walk(steps=8)
    motion = guessed(points)
    whole = placed(motion, points)
    monkeypatch.setattr(refinement, "WINDOW_FRAMES", 120)
    monkeypatch.setattr(refinement, "OVERLAP_FRAMES", 40)
    pieces = placed(motion, points)
    off = np.median(np.linalg.norm(whole.points - pieces.points, axis=2))
    assert off < 0.05  # two seconds tell the player's size less surely than four
    jumps = np.linalg.norm(np.diff(pieces.root, 2, axis=0), axis=1)
    assert jumps.max() < 0.01
    ends = pieces.points[:, LSP14.bones]
    lengths = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    assert (lengths.max(axis=0) / lengths.min(axis=0)).max() < 1.01


def test_a_player_of_another_size_than_said_is_as_large_as_the_court_says():
    points, _ = walk()
    motion = guessed(points)
    wrong = replace(motion, points3d=motion.points3d * 1.05, scale=motion.scale / 1.05)
    world = placed(wrong, points)
    true = np.linalg.norm(points[:, NECK] - points[:, HIPS].mean(axis=1), axis=1).mean()
    ours = np.linalg.norm(world.points[:, NECK] - world.points[:, HIPS].mean(axis=1), axis=1)
    assert abs(ours.mean() / true - 1) < 0.04
    assert abs(world.height_ratio - 1 / 1.05) < 0.04


def test_standing_feet_tell_how_long_legs_are():
    points, _ = walk()
    motion = guessed(points, depth=0.02, pixels=0.5)
    shanks = np.isin(LSP14.bones[:, 1], FEET)
    bones = motion.points3d[:, LSP14.bones[:, 1]] - motion.points3d[:, LSP14.bones[:, 0]]
    bones[:, shanks] *= 0.94
    world = placed(replace(motion, points3d=LSP14.ancestry @ bones), points)

    def shank(joints):
        return np.linalg.norm(joints[:, FEET[0]] - joints[:, LSP14.index("right_knee")], axis=1)

    assert np.median(shank(world.points)) > 0.97 * np.median(shank(points))
