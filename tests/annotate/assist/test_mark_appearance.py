"""Marks that look unlike the marks of other frames."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from capsule_player import LIMBS, hide, marks, scene, standing, turned

from keyrecon.annotate.assist.body_estimate import estimate_body
from keyrecon.annotate.assist.checks import find_checks
from keyrecon.annotate.assist.mark_appearance import (
    SeenFrames,
    compare_appearance,
    describe_frames,
)
from keyrecon.annotate.assist.pose_suggestion import scene_of
from keyrecon.body import LSP14
from keyrecon.io.held_video import with_exposure
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video

ROW = 5
COLORS = ((200, 60, 60), (40, 60, 160), (210, 170, 140), (60, 40, 20))
LEFT_SHOE, RIGHT_SHOE = (240, 240, 240), (30, 160, 60)


def swinging():
    """Poses whose left arm goes up while they step."""
    poses = []
    for t in range(12):
        pose = turned(standing(), "left_shoulder", ("left_elbow", "left_wrist"), -0.1 * t)
        poses.append(turned(pose, "right_hip", ("right_knee", "right_ankle"), 0.05 * t))
    return poses


def draw(joints, scale):
    """A picture of a pose with two different shoes before a court."""
    rng = np.random.default_rng(3)
    coarse = rng.integers(90, 130, (20, 30, 3)).astype(np.uint8)
    picture = cv2.resize(coarse, (1200, 800), interpolation=cv2.INTER_LINEAR)
    for a, b, radius, color in LIMBS:
        ends = [tuple(np.rint(joints[LSP14.index(n)]).astype(int).tolist()) for n in (a, b)]
        cv2.line(picture, *ends, COLORS[color], round(2 * radius * scale))
    for name, color in (("left_ankle", LEFT_SHOE), ("right_ankle", RIGHT_SHOE)):
        place = tuple(np.rint(joints[LSP14.index(name)]).astype(int).tolist())
        cv2.circle(picture, place, round(0.05 * scale), color, -1)
    return picture


@pytest.fixture(scope="module")
def filmed(tmp_path_factory):
    """The preparation of a film that has pictures, and true marks on all its frames."""
    preparation, truth = scene(swinging(), (0, 6))
    path = tmp_path_factory.mktemp("film") / "film.mp4"
    write_video(path, (draw(joints, 180.0) for joints in truth), 50.0, crf=12)
    return replace(preparation, video=open_video(path)), marks(truth, range(len(truth)))


def compared(preparation, annotations):
    """The looks of all marks, held against each other."""
    body_frame = scene_of(preparation, annotations).body_frame
    features = describe_frames(preparation, body_frame, annotations.frames)
    return compare_appearance(preparation, body_frame, annotations, features)


def moved(annotations, joint, step):
    """One joint elsewhere on one frame."""
    joints = annotations.joints.copy()
    joints[ROW, LSP14.index(joint)] += step
    return replace(annotations, joints=joints)


def test_a_joint_beside_the_body_has_a_better_place_near_it(filmed):
    preparation, annotations = filmed
    wrist = LSP14.index("left_wrist")
    wrong = compared(preparation, moved(annotations, "left_wrist", (22, 22))).excess
    assert wrong[ROW, wrist] > 2 * np.delete(wrong, wrist, axis=1).max()
    assert wrong[ROW, wrist] > 2 * compared(preparation, annotations).excess[ROW, wrist]


def test_hidden_joints_say_nothing(filmed):
    preparation, annotations = filmed
    looks = compared(preparation, hide(moved(annotations, "left_wrist", (22, 22)), "left_wrist"))
    assert (looks.excess[:, LSP14.index("left_wrist")] == 0).all()


def test_exchanged_feet_look_exchanged_without_any_poses(filmed):
    """Shoes of two colours tell sides where edges do not."""
    preparation, annotations = filmed
    joints = annotations.joints.copy()
    legs = [LSP14.index(f"{s}_{p}") for s in ("left", "right") for p in ("hip", "knee", "ankle")]
    joints[ROW, legs] = annotations.joints[ROW, LSP14.mirror[legs]]
    exchanged = replace(annotations, joints=joints)
    size = estimate_body(annotations, {}, preparation.track.height, 50.0).size
    looks = compared(preparation, exchanged)
    checks = find_checks(exchanged, size, (), None, looks)
    assert (checks[0].kind, checks[0].frame) == ("crossed", ROW)
    assert set(checks[0].joints) >= {"left_ankle", "right_ankle"}
    careful = find_checks(annotations, size, (), None, compared(preparation, annotations))
    assert "crossed" not in {check.kind for check in careful}


def test_marks_of_another_frame_are_told(filmed):
    preparation, annotations = filmed
    joints = annotations.joints.copy()
    joints[ROW] = annotations.joints[ROW] + (35, 0)
    size = estimate_body(annotations, {}, preparation.track.height, 50.0).size
    other = replace(annotations, joints=joints)
    found = find_checks(other, size, (), None, compared(preparation, other))
    assert {check.frame for check in found} == {ROW}


def test_frames_are_described_once(filmed):
    """What was read before is as if all had been read at once."""
    preparation, annotations = filmed
    body_frame = scene_of(preparation, annotations).body_frame
    first = describe_frames(preparation, body_frame, annotations.frames[[2, 8]])
    more = describe_frames(preparation, body_frame, annotations.frames, first)
    whole = describe_frames(preparation, body_frame, annotations.frames)
    np.testing.assert_array_equal(more.frames, whole.frames)
    np.testing.assert_array_equal(more.cells, whole.cells)


@pytest.mark.parametrize("light", [1.0, 0.8])
def test_pictures_that_were_seen_need_not_be_read_again(filmed, light):
    """Whoever reads the video sees it as filmed; frames are compared in one light."""
    preparation, annotations = filmed
    body_frame = scene_of(preparation, annotations).body_frame
    film = preparation.video
    exposure = np.linspace(light, 1.0, len(film))
    preparation = replace(preparation, video=with_exposure(film, exposure))
    seen = SeenFrames(preparation, body_frame, annotations.frames[[2, 8, 5]])
    assert seen.features is None
    for frame, picture in enumerate(film.frames()):
        seen.see(frame, picture)
    read = describe_frames(preparation, body_frame, annotations.frames[[2, 5, 8]])
    np.testing.assert_array_equal(seen.features.frames, read.frames)
    np.testing.assert_array_equal(seen.features.cells, read.cells)


def test_a_single_marked_frame_has_nothing_to_be_compared_with(filmed):
    preparation, annotations = filmed
    one = marks(annotations.joints, [ROW])
    assert compared(preparation, one) is None
