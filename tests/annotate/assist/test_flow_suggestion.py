"""Joints followed by optical flow from the marks nearest in time to a frame."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from keyrecon.annotate.assist.flow_suggestion import nearest_marks, surer_by_flow
from keyrecon.annotate.assist.pose_suggestion import PoseSuggestion
from keyrecon.body import LSP14
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.records import Annotations, Shots

FPS, COUNT, STEP = 25.0, 40, (2.0, 1.0)
SIZE = (240, 320)
ONE_SHOT = Shots.between((), COUNT)
START = np.column_stack([60 + 8 * (np.arange(14) % 5), 30 + 10.0 * np.arange(14)])


def places(frame):
    """All joints drift with a patterned cloth, a few px a frame."""
    return START + np.array(STEP) * frame


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    cloth = gaussian_filter(np.random.default_rng(4).uniform(0, 255, (400, 500)), 2)
    cloth = np.clip((cloth - cloth.mean()) * 6 + 128, 0, 255).astype(np.uint8)

    def pictures():
        for t in range(COUNT):
            x, y = (round(STEP[axis] * t) for axis in (0, 1))
            cut = cloth[100 - y : 100 - y + SIZE[0], 120 - x : 120 - x + SIZE[1]]
            yield np.repeat(cut[..., None], 3, axis=2)

    path = tmp_path_factory.mktemp("flow") / "cloth.mp4"
    write_video(path, pictures(), FPS)
    return open_video(path)


def marks(*frames):
    joints = np.stack([places(t) for t in frames])
    none = np.zeros((len(frames), len(LSP14.bones)), dtype=np.int64)
    return Annotations(LSP14, np.array(frames), joints, np.isfinite(joints[..., 0]), none)


def suggested(confidence):
    """A suggestion that is 10 px off, from frame 5."""
    return PoseSuggestion(places(12) + 10, np.full(14, confidence), np.full(14, 5))


def test_flow_brings_a_doubtful_suggestion_to_where_the_joints_are(video):
    better = surer_by_flow(suggested(0.2), video, marks(5, 20), 12)
    assert np.abs(better.joints - places(12)).max() < 1.0
    assert (better.confidence > 0.5).all()
    assert (better.source == 5).all()


def test_what_is_surer_than_flow_stays_and_so_does_all_without_near_marks(video):
    sure, far = suggested(1.0), suggested(0.2)
    assert (surer_by_flow(sure, video, marks(5, 20), 12).joints == sure.joints).all()
    near = nearest_marks(marks(0, 39), 12, FPS / 4, ONE_SHOT)
    assert len(near.frames) == 0
    assert surer_by_flow(far, video, near, 12) is far


def test_a_frame_in_the_middle_of_being_marked_is_not_followed(video):
    begun, far = marks(5), suggested(0.2)
    begun.joints[0, 1:] = np.nan
    assert surer_by_flow(far, video, begun, 12) is far


def test_of_each_joint_the_marks_before_and_after_are_taken():
    given = marks(2, 6, 10, 12, 18, 30)
    given.joints[2, 5] = np.nan  # of this joint frame 6 is the last before
    assert nearest_marks(given, 12, FPS, ONE_SHOT).frames.tolist() == [6, 10, 18]


def test_nothing_is_followed_from_one_shot_into_another():
    given, shots = marks(2, 6, 10, 12, 18, 30), Shots.between((8, 15), COUNT)
    assert nearest_marks(given, 9, FPS, shots).frames.tolist() == [10]
    assert nearest_marks(given, 12, FPS, shots).frames.tolist() == [10]
    assert nearest_marks(given, 20, FPS, shots).frames.tolist() == [18, 30]
