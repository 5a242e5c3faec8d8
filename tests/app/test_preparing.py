"""What the automatic part tells of a video and of what a person told."""

import numpy as np

from keyrecon.app.preparing import describe_cuts
from keyrecon.records import CameraPath


def path(frames, cuts):
    return CameraPath(np.tile(np.eye(3), (frames, 1, 1)), np.ones(frames), cuts)


def test_a_video_of_several_shots_is_told_with_its_cuts_and_its_longest_shot():
    (line,) = describe_cuts(path(100, (20, 70)))
    assert "at frame 20, 70" in line
    assert "frames 20 to 69" in line


def test_a_video_of_one_shot_tells_nothing():
    assert describe_cuts(path(100, ())) == []
