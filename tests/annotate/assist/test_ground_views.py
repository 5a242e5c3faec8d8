"""Marks on the ground as the page makes them and takes them away."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from keyrecon.annotate.assist.answers import make_assistant
from keyrecon.app.project import start
from keyrecon.io.video_writer import write_video
from keyrecon.io.workspace import Workspace

UPRIGHT = [("vertical", 0, ((float(x), 10.0), (float(x), 80.0)), None) for x in range(10, 90, 5)]


@pytest.fixture
def workspace(tmp_path):
    write_video(tmp_path / "v.mp4", [np.zeros((96, 128, 3), np.uint8)] * 4, 25.0)
    start(tmp_path / "v.mp4", tmp_path / "p")
    return Workspace(tmp_path / "p")


def test_marks_made_at_the_same_time_are_all_kept(workspace):
    assistant = make_assistant(workspace)
    with ThreadPoolExecutor(len(UPRIGHT)) as pool:
        list(pool.map(lambda mark: assistant.ground_mark(*mark), UPRIGHT))
    assert len(workspace.ground_marks().marks) == len(UPRIGHT)


def test_a_mark_that_is_removed_twice_takes_no_other_with_it(workspace):
    assistant = make_assistant(workspace)
    for mark in UPRIGHT[:3]:
        assistant.ground_mark(*mark)
    assistant.ground_removal(*UPRIGHT[0])
    left = assistant.ground_removal(*UPRIGHT[0])["marks"]
    assert [tuple(mark["ends"]) for mark in left] == [ends for _, _, ends, _ in UPRIGHT[1:3]]


def test_a_field_of_view_is_kept_and_taken_back(workspace):
    assistant = make_assistant(workspace)
    assert assistant.field_of_view(60.0)["field_of_view"] == 60.0
    assistant.ground_mark(*UPRIGHT[0])
    assert assistant.field_of_view(None)["field_of_view"] is None
    assert len(workspace.ground_marks().marks) == 1
