"""In what order a golf fit is made, and what ends it early."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

from keyrecon.app import golf_recipe
from keyrecon.app.golf_recipe import find_swing
from keyrecon.errors import KeyreconError
from keyrecon.golf.click_checks import HandCosts
from keyrecon.golf.clicks import clicked_pose
from keyrecon.golf.fit.swing_search import SwingHypothesis
from keyrecon.golf.plausibility import SwingDoubt
from keyrecon.golf.records import NO_MARKS, SwingMarks
from keyrecon.golf.scene import SwingScene
from keyrecon.golf.swing_fit import FoundSwing, GolfOptions
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


@dataclass
class Stages:
    """Stages that make nothing; what a fit without marks comes to, or why there is none."""

    found: FoundSwing | KeyreconError
    hands: HandCosts = HandCosts(given=0.1, other=0.6)
    names: list[str] = field(default_factory=list)

    def keep(self, name, stage, *inputs, **named):
        self.names.append(name)
        if name == "found" and isinstance(self.found, KeyreconError):
            raise self.found
        scene = object.__new__(SwingScene)
        vars(scene)["film"] = None
        candidate = SwingHypothesis(np.arange(4.0), 1.0, np.zeros((FRAMES, 2, 2)))
        made = {"scene": scene, "hands": self.hands, "found": self.found}
        made |= {
            "search": (candidate,),
            "search_marked": (candidate,),
            "found_marked": found_swing(),
        }
        return made.get(name)


def found_swing(*doubts):
    numbers = np.arange(0, FRAMES, 8)
    shown = True, True, True, True
    return FoundSwing(swing_at(numbers), observed(numbers), doubts, (), shown)


@pytest.fixture
def find(tmp_path, monkeypatch):
    """Finds a swing by such stages; returns the club that each candidate was tried with."""
    write_video(tmp_path / "v.mp4", (np.zeros((270, 320, 3), np.uint8) for _ in range(4)), 30.0)
    video = open_video(tmp_path / "v.mp4")
    camera = CameraPath(np.tile(np.eye(3), (4, 1, 1)), np.ones(4))
    monkeypatch.setattr(golf_recipe, "place_in_film", lambda pose, film: pose)
    pose, model = clicked_pose(GolfClicks(0, (320, 270), JOINTS)), read_motion_model()

    def find(stages, marks=NO_MARKS):
        tried, observed_swing = [], SimpleNamespace(slow_motion=1)
        made = SimpleNamespace(doubts=(), fitted=None, observations=None, observed=observed_swing)

        def attempt(search, candidate, marks, suffix):
            stages.keep(f"observe{suffix}", None)
            tried.append(candidate.earlier)
            return made

        monkeypatch.setattr(golf_recipe._Search, "_try", attempt)
        options = GolfOptions(method="windows")
        find_swing(video, camera, pose, model, options, stages.keep, marks=marks)
        return tried

    return find


TOP = replace(NO_MARKS, keys=np.array([np.nan, 12.0, np.nan, np.nan]))
SHAFT = SwingMarks(
    np.array([20]),
    np.full((1, 14, 2), np.nan),
    swing_at(np.array([160])).club2d,
    np.full(4, np.nan),
)


def test_who_marks_is_believed_whichever_way_the_swing_seems_to_go(find):
    other_way = Stages(found_swing(), HandCosts(given=0.6, other=0.1))
    with pytest.raises(KeyreconError, match="mark the top of the swing"):
        find(other_way)
    assert len(find(other_way, TOP)) == len(find(other_way, SHAFT)) == 1


def test_beside_a_marked_shaft_the_club_of_the_fit_without_it_is_believed(find):
    found = found_swing()
    alone, beside = find(Stages(found), SHAFT)
    assert alone is NO_MARKS
    np.testing.assert_array_equal(beside.shafts, found.observations.club[beside.frames])
    assert len(beside.frames)
    assert find(Stages(found)) == [NO_MARKS] == find(Stages(found), TOP)


@pytest.mark.parametrize(
    "found",
    [found_swing(SwingDoubt("the player is beside the figure", 3)), KeyreconError("No swing.")],
    ids=["doubtful", "none"],
)
def test_a_fit_that_something_speaks_against_tells_nothing_of_the_club(find, found):
    assert find(Stages(found), SHAFT)[-1] is NO_MARKS


def test_what_a_film_shows_is_looked_at_once_for_the_fits_without_and_with_marks(find):
    stages = Stages(found_swing())
    find(stages, SHAFT)
    assert stages.names.count("film") == stages.names.count("scene") == 1


def test_marks_push_no_stage_of_the_fit_without_them_out_of_the_cache(find):
    """A store keeps a few results of each name; the fit without marks is wanted with every mark."""
    alone, marked = Stages(found_swing()), Stages(found_swing())
    find(alone), find(marked, TOP)
    assert set(alone.names) & set(marked.names) == {"film", "scene"}
