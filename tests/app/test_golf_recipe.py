"""In what order a golf fit is made, and what ends it early."""

from dataclasses import replace

import numpy as np
import pytest

from keyrecon.app import golf_recipe
from keyrecon.app.golf_recipe import find_swing
from keyrecon.errors import KeyreconError
from keyrecon.golf.click_checks import HandCosts
from keyrecon.golf.clicks import clicked_pose
from keyrecon.golf.plausibility import SwingDoubt
from keyrecon.golf.records import NO_MARKS
from keyrecon.golf.swing_fit import FoundSwing
from keyrecon.io.formats.clicks import GolfClicks
from keyrecon.io.formats.model_file import read_motion_model
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.records import CameraPath
from tests.support.golf_truth import FRAMES, observed, swing_at

JOINTS = {
    "head_top": (160.0, 40.0), "root": (160.0, 142.0), "right_knee": (142.0, 192.0),
    "left_knee": (178.0, 192.0), "right_ankle": (138.0, 240.0), "left_ankle": (182.0, 240.0),
}  # fmt: skip


class SearchBegan(Exception):
    """The film was held against the clicks, and these were believed."""


def keep(name, stage, *inputs, **named):
    """A film whose swing goes round the other way."""
    if name.startswith("search"):
        raise SearchBegan
    return HandCosts(given=0.6, other=0.1) if name == "hands" else None


def film_of_a_swing(tmp_path, monkeypatch):
    write_video(tmp_path / "v.mp4", (np.zeros((270, 320, 3), np.uint8) for _ in range(4)), 30.0)
    video = open_video(tmp_path / "v.mp4")
    camera = CameraPath(np.tile(np.eye(3), (4, 1, 1)), np.ones(4))
    monkeypatch.setattr(golf_recipe, "place_in_film", lambda pose, film: pose)
    return video, camera, clicked_pose(GolfClicks(0, (320, 270), JOINTS)), read_motion_model()


def test_who_marks_is_believed_whichever_way_the_swing_seems_to_go(tmp_path, monkeypatch):
    swing = film_of_a_swing(tmp_path, monkeypatch)
    with pytest.raises(KeyreconError, match="mark the top of the swing"):
        find_swing(*swing, keep=keep)
    top = replace(NO_MARKS, keys=np.array([np.nan, 12.0, np.nan, np.nan]))
    with pytest.raises(SearchBegan):
        find_swing(*swing, keep=keep, marks=top)


def found_swing(*doubts):
    numbers = np.arange(0, FRAMES, 8)
    shown = True, True, True, True
    return FoundSwing(swing_at(numbers), observed(numbers), doubts, (), shown)


def test_the_club_of_an_earlier_fit_is_believed_where_nothing_speaks_against_that():
    doubtful = found_swing(SwingDoubt("the player is beside the figure", 3))
    assert golf_recipe._earlier_shafts(lambda: doubtful, NO_MARKS) is NO_MARKS
    found = found_swing()
    earlier = golf_recipe._earlier_shafts(lambda: found, NO_MARKS)
    np.testing.assert_array_equal(earlier.shafts, found.observations.club)


def test_marks_are_held_to_where_the_clicks_alone_show_no_swing():
    def find():
        raise KeyreconError("No swing was found.")

    assert golf_recipe._earlier_shafts(find, NO_MARKS) is NO_MARKS


def test_marks_push_no_stage_of_the_fit_without_them_out_of_the_cache(tmp_path, monkeypatch):
    """A store keeps a few results of each name; the fit without marks is wanted with every mark."""
    names = {}
    for marked in (False, True):
        swing = film_of_a_swing(tmp_path, monkeypatch)
        top = np.array([np.nan, 12.0, np.nan, np.nan])
        marks = replace(NO_MARKS, keys=top) if marked else NO_MARKS
        names[marked] = set()

        def note(name, stage, *inputs, names=names[marked], **named):
            names.add(name)
            if name.startswith("search"):
                raise SearchBegan
            return HandCosts(given=0.1, other=0.6) if name == "hands" else None

        with pytest.raises(SearchBegan):
            find_swing(*swing, keep=note, marks=marks)
    assert names[False] & names[True] == {"film", "scene"}
