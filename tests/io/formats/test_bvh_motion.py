"""BVH: the same motion in another program, by rotations alone."""

from dataclasses import replace

import numpy as np
import pytest
from small_motion import FPS, make_motion

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.bvh import read_bvh
from keyrecon.io.formats.bvh_motion import write_bvh
from keyrecon.io.formats.conventions import stand_on_floor
from keyrecon.io.formats.mocap import read_capture
from keyrecon.io.formats.rigs import find_joints


def varied_hips(motion, centimetres):
    """The same with a breadth of the hips that varies while both keep their way to the neck."""
    neck, hips = (
        motion.points3d[:, LSP14.root],
        [LSP14.index(f"{s}_hip") for s in ("right", "left")],
    )
    right, left = (motion.points3d[:, hip] - neck for hip in hips)
    across = (left - right) / np.linalg.norm(left - right, axis=1, keepdims=True)
    middle = (left + right) / 2
    down = middle / np.linalg.norm(middle, axis=1, keepdims=True)
    down -= across * (down * across).sum(axis=1, keepdims=True)
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    swing = np.sin(np.arange(len(neck)) / 7)
    angle = np.arcsin((0.145 * 1.8 + 0.01 * centimetres * swing) / 2 / (0.315 * 1.8))[:, None]
    points = motion.points3d.copy()
    for side, sign in (("right", -1), ("left", 1)):
        hip = LSP14.index(f"{side}_hip")
        new = neck + 0.315 * 1.8 * (np.cos(angle) * down + sign * np.sin(angle) * across)
        shift = new - points[:, hip]
        for name in ("hip", "knee", "ankle"):
            points[:, LSP14.index(f"{side}_{name}")] += shift
    return replace(motion, points3d=points)


def channels(path):
    """Channels of every joint, and the offsets."""
    lines = [line.split() for line in path.read_text().splitlines()]
    return (
        [line[2:] for line in lines if line[:1] == ["CHANNELS"]],
        np.array([line[1:] for line in lines if line[:1] == ["OFFSET"]], dtype=float),
    )


@pytest.mark.parametrize(
    ("wildness", "breadth"), [(0.0, 0), (0.3, 0), (1.0, 0), (0.3, 2), (0.3, 4)]
)
def test_joints_come_back_from_bvh(tmp_path, wildness, breadth):
    motion = varied_hips(make_motion(wildness=wildness), breadth)
    write_bvh(tmp_path / "a.bvh", motion)
    figure = read_bvh(tmp_path / "a.bvh")
    joints, _ = find_joints(figure)
    error = np.linalg.norm(joints - stand_on_floor(motion).points, axis=2)
    assert error.max() < 0.001
    assert figure.fps == FPS


def test_a_text_beside_a_bvh_tells_its_axes_and_unit(tmp_path):
    done = write_bvh(tmp_path / "a.bvh", make_motion())
    assert (tmp_path / "a.bvh.txt").read_text() == f"a.bvh, written by keyrecon, in m: {done}\n"
    assert done.startswith("Y up, x to the right of the picture, z towards the camera; feet on")


def test_our_bvh_is_a_person_to_the_motion_capture_reader(tmp_path):
    motion = make_motion(wildness=0.2)
    write_bvh(tmp_path / "a.bvh", motion)
    capture = read_capture(tmp_path / "a.bvh")
    assert np.abs(capture.joints - stand_on_floor(motion).points).max() < 0.001


def test_where_nobody_is_every_joint_stands_still(tmp_path):
    motion = make_motion(wildness=0.3)
    arm = [LSP14.index(f"right_{joint}") for joint in ("shoulder", "elbow", "wrist")]
    points, gap = motion.points3d.copy(), slice(len(motion.time) // 3, len(motion.time) // 2)
    # The arm is straight before and after the gap: how it is rolled is told by other frames.
    near = slice(gap.start - 4, gap.stop + 4)
    points[near, arm[2]] = 2 * points[near, arm[1]] - points[near, arm[0]]
    points[gap] = np.nan
    write_bvh(tmp_path / "a.bvh", replace(motion, points3d=points))
    held = (tmp_path / "a.bvh").read_text().splitlines()[-len(points) :]
    assert len({*held[gap.start - 1 : gap.stop]}) == 1
    assert len({*held}) == len(points) - (gap.stop - gap.start)


def test_no_zero_is_negative(tmp_path):
    write_bvh(tmp_path / "a.bvh", make_motion(wildness=0.2))
    assert "-0.000000" not in (tmp_path / "a.bvh").read_text().partition("MOTION")[2].split()


def test_only_the_root_has_a_place_and_no_bone_is_without_length(tmp_path):
    write_bvh(tmp_path / "a.bvh", varied_hips(make_motion(), 3))
    words, offsets = channels(tmp_path / "a.bvh")
    assert words[0][:3] == ["Xposition", "Yposition", "Zposition"]
    assert len(words[0]) == 6
    assert all(len(w) == 3 and all(c.endswith("rotation") for c in w) for w in words[1:])
    assert np.allclose(offsets[0], 0)
    assert np.linalg.norm(offsets[1:], axis=1).min() > 0.02


def test_the_rest_pose_of_bvh_is_a_t_pose_that_faces_plus_z(tmp_path):
    write_bvh(tmp_path / "a.bvh", make_motion())
    lines = (tmp_path / "a.bvh").read_text().splitlines()
    words, _ = channels(tmp_path / "a.bvh")
    zeros = " ".join(["0"] * sum(map(len, words)))
    rest = [*lines[: lines.index("MOTION")], "MOTION", "Frames: 1", "Frame Time: 0.02", zeros]
    (tmp_path / "rest.bvh").write_text("\n".join(rest))
    joints, toes = find_joints(read_bvh(tmp_path / "rest.bvh"))
    at = {name: joints[0, j] for j, name in enumerate(LSP14.names)}
    assert np.allclose(at["right_wrist"][1:], at["right_shoulder"][1:], atol=1e-5)
    assert at["right_wrist"][0] < at["right_shoulder"][0] < 0 < at["left_wrist"][0]
    assert np.allclose(at["left_ankle"][[0, 2]], at["left_hip"][[0, 2]], atol=1e-5)
    assert at["head_top"][1] > at["neck"][1] > at["left_hip"][1] > at["left_ankle"][1]
    assert (toes[0, :, 2] > 0).all()


def test_angles_in_bvh_do_not_jump_by_full_turns(tmp_path):
    frames = 120
    motion = make_motion(frames, wildness=0.05)
    turn = np.linspace(0, 4 * np.pi, frames)
    spun = motion.points3d - [0.2, -0.5, 12]
    spun = np.stack(
        [
            spun[..., 0] * np.cos(turn)[:, None] + spun[..., 2] * np.sin(turn)[:, None],
            spun[..., 1],
            spun[..., 2] * np.cos(turn)[:, None] - spun[..., 0] * np.sin(turn)[:, None],
        ],
        axis=2,
    )
    write_bvh(tmp_path / "a.bvh", replace(motion, points3d=spun))
    text = (tmp_path / "a.bvh").read_text()
    values = np.array([line.split() for line in text.splitlines() if line[:1] in "-0123456789"])
    angles = values[:, 3:].astype(float)
    assert np.abs(np.diff(angles, axis=0)).max() < 90
    assert np.ptp(angles[:, 2]) > 600


def test_an_arm_that_is_raised_past_the_lock_of_one_order_turns_smoothly(tmp_path):
    motion = make_motion(100, wildness=0.0)
    points = motion.points3d.copy()
    shoulder, elbow, wrist = (LSP14.index(f"left_{j}") for j in ("shoulder", "elbow", "wrist"))
    swing = np.linspace(0, np.pi, 100)  # from hanging, past straight ahead, to straight up
    way = np.stack([0.02 * np.ones(100), np.cos(swing), -np.sin(swing)], axis=1)
    points[:, elbow] = points[:, shoulder] + 1.8 * 0.186 * way
    points[:, wrist] = points[:, elbow] + 1.8 * 0.146 * way
    write_bvh(tmp_path / "a.bvh", replace(motion, points3d=points))
    text = (tmp_path / "a.bvh").read_text()
    values = np.array([line.split() for line in text.splitlines() if line[:1] in "-0123456789"])
    assert np.abs(np.diff(values[:, 3:].astype(float), axis=0)).max() < 25


def test_feet_are_level_while_one_stands(tmp_path):
    write_bvh(tmp_path / "a.bvh", make_motion(wildness=0.0))
    _, toes = find_joints(read_bvh(tmp_path / "a.bvh"))
    assert np.allclose(toes[..., 1], 0, atol=0.005)


def test_bvh_needs_a_person(tmp_path):
    motion = make_motion()
    few = replace(LSP14, names=("hand", *LSP14.names[1:]))
    with pytest.raises(KeyreconError, match="has no right_ankle"):
        write_bvh(tmp_path / "a.bvh", replace(motion, skeleton=few))
