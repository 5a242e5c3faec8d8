"""In what order a golf fit is made, and what ends it early."""

from dataclasses import replace

import numpy as np
import pytest

from keyrecon.app import golf_recipe
from keyrecon.app.golf_recipe import find_swing
from keyrecon.errors import KeyreconError
from keyrecon.golf.click_checks import HandCosts
from keyrecon.golf.clicks import clicked_pose
from keyrecon.golf.records import NO_MARKS
from keyrecon.io.formats.clicks import GolfClicks
from keyrecon.io.formats.model_file import read_motion_model
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.records import CameraPath

JOINTS = {
    "head_top": (160.0, 40.0), "root": (160.0, 142.0), "right_knee": (142.0, 192.0),
    "left_knee": (178.0, 192.0), "right_ankle": (138.0, 240.0), "left_ankle": (182.0, 240.0),
}  # fmt: skip


class SearchBegan(Exception):
    """The film was held against the clicks, and these were believed."""


def keep(name, stage, *inputs, **named):
    """A film whose swing goes round the other way."""
    if name == "search":
        raise SearchBegan
    return HandCosts(given=0.6, other=0.1) if name == "hands" else None


def test_who_marks_is_believed_whichever_way_the_swing_seems_to_go(tmp_path, monkeypatch):
    write_video(tmp_path / "v.mp4", (np.zeros((270, 320, 3), np.uint8) for _ in range(4)), 30.0)
    video = open_video(tmp_path / "v.mp4")
    camera = CameraPath(np.tile(np.eye(3), (4, 1, 1)), np.ones(4))
    monkeypatch.setattr(golf_recipe, "place_in_film", lambda pose, film: pose)
    swing = video, camera, clicked_pose(GolfClicks(0, (320, 270), JOINTS)), read_motion_model()
    with pytest.raises(KeyreconError, match="mark the top of the swing"):
        find_swing(*swing, keep=keep)
    top = replace(NO_MARKS, keys=np.array([np.nan, 12.0, np.nan, np.nan]))
    with pytest.raises(SearchBegan):
        find_swing(*swing, keep=keep, marks=top)
