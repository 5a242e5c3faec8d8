"""Marked joints followed by optical flow between marks."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.records import Annotations
from keyrecon.tracking.mark_flow import FlowOptions, track_marked_joints

COUNT, SIZE = 24, (200, 320)
BODY = np.array([[60.0 + 9 * (j % 3), 30.0 + 11 * j] for j in range(14)])
OPTIONS = FlowOptions(player=143.0)


def places(t):
    """Where the joints are in frame t: the whole body moves to the right."""
    return BODY + np.array([4.0 * t, 0.0])


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    """A textured body that moves over a smooth scene and is gone from frame 18 on."""
    noise = np.random.default_rng(0).integers(0, 255, (180, 60, 3)).astype(np.uint8)
    texture = cv2.GaussianBlur(noise, (5, 5), 0)

    def frames():
        for t in range(COUNT):
            picture = np.full((*SIZE, 3), 90, np.uint8)
            if t < 18:
                x = 45 + 4 * t
                picture[15:195, x : x + 60] = texture
            yield picture

    path = tmp_path_factory.mktemp("flow") / "moving.mp4"
    write_video(path, frames(), 25.0)
    return open_video(path)


def marked(*frames):
    """The truth marked on some frames."""
    joints = np.stack([places(t) for t in frames])
    seen = np.ones(joints.shape[:2], dtype=bool)
    signs = np.zeros((len(frames), len(LSP14.bones)), dtype=np.int64)
    return Annotations(LSP14, np.array(frames), joints, seen, signs)


def test_between_two_marks_joints_are_where_both_ways_meet(video):
    flow = track_marked_joints(video, marked(2, 14), OPTIONS)
    for t in range(3, 14):
        assert np.linalg.norm(flow.joints[t] - places(t), axis=1).max() < 1.5
        assert np.median(flow.confidence[t]) > 0.8


def test_a_single_mark_is_followed_both_ways_while_the_place_looks_like_it(video):
    flow = track_marked_joints(video, marked(9), OPTIONS)
    for t in (2, 16):
        assert np.linalg.norm(flow.joints[t] - places(t), axis=1).max() < 2
        assert np.median(flow.confidence[t]) > 0.7
    assert flow.confidence[20:].max() < 0.3


def test_drift_and_likeness_tell_a_place_that_was_followed_from_one_that_was_lost(video):
    flow = track_marked_joints(video, marked(9), OPTIONS)
    assert flow.drift[16].max() < 0.02
    assert flow.likeness[16].min() > 0.8
    assert np.median(flow.likeness[21]) < 0.3  # the body is gone
    assert np.isnan(flow.drift[9]).all()  # marked, not followed


def test_marks_too_far_apart_say_nothing_of_the_middle(video):
    flow = track_marked_joints(video, marked(0, 17), FlowOptions(player=143.0, longest=0.2))
    assert np.isnan(flow.joints[8]).all()
    assert (flow.confidence[8] == 0).all()


def test_one_joint_marked_says_nothing_of_the_player_and_is_not_followed(video):
    marks = marked(9)
    marks.joints[:, 1:] = np.nan
    flow = track_marked_joints(video, marks)
    assert np.isnan(flow.joints).all()
    assert (flow.confidence == 0).all()


def test_a_head_that_grows_has_lost_an_end_and_stays_doubtful_when_it_is_short_again(tmp_path):
    noise = np.random.default_rng(1).integers(0, 255, (2, 180, 80, 3)).astype(np.uint8)
    body, top = (cv2.GaussianBlur(each, (5, 5), 0) for each in noise)
    away = [*range(0, 40, 4), *range(40, -1, -4)]  # the top of the head goes off, and comes back

    def frames():
        for x in away:
            picture = np.full((240, 320, 3), 90, np.uint8)
            picture[15:175, 40:120] = body[:160]
            picture[180:230, 40 + x : 120 + x] = top[:50]
            yield picture

    path = tmp_path / "head.mp4"
    write_video(path, frames(), 25.0)
    joints = BODY[None].copy()
    ends = [LSP14.index("neck"), LSP14.index("head_top")]
    joints[0, ends] = (80.0, 160.0), (80.0, 200.0)
    marks = replace(marked(0), joints=joints)
    flow = track_marked_joints(open_video(path), marks, FlowOptions(player=170.0))
    back = len(away) - 1
    assert np.linalg.norm(flow.joints[back, ends] - joints[0, ends], axis=1).max() < 3
    assert flow.drift[1, ends].max() < 0.01
    assert flow.drift[10, ends].min() > 0.04  # 57 px long instead of 40, of a player of 170
    assert flow.drift[back, ends].min() > 0.04
    assert np.delete(flow.drift[back], ends).max() < 0.02
    assert flow.confidence[back, ends].max() < 0.5
