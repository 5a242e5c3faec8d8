"""Facts about what a project knows of its lens, and what it says where it knows nothing."""

import re
from dataclasses import replace

import numpy as np
import pytest
from court_walker import court_camera
from ground_walker import CAMERA, SIZE, seen, standing

from keyrecon import lens
from keyrecon.annotate.server.descriptions import describe_settings
from keyrecon.annotate.server.page_words import in_page_words
from keyrecon.app.project import start
from keyrecon.io.formats.camera_file import write_camera
from keyrecon.io.video_writer import write_video
from keyrecon.io.workspace import Workspace
from keyrecon.world.records import GroundMarks


@pytest.fixture
def workspace(tmp_path):
    write_video(tmp_path / "v.mp4", [np.zeros((SIZE[1], SIZE[0], 3), np.uint8)] * 3, 50.0)
    start(tmp_path / "v.mp4", tmp_path / "p")
    return Workspace(tmp_path / "p")


def degrees_of(focal):
    return np.degrees(2 * np.arctan(SIZE[0] / 2 / focal))


def degrees_known(workspace):
    """Across the picture by what the project knows."""
    video = workspace.video()
    known = lens.known_lens(workspace, video)
    return None if known is None else lens.degrees_across(known, video)


def test_nothing_is_known_of_a_lens_that_nobody_told(workspace):
    assert degrees_known(workspace) is None


def test_a_lens_is_known_by_the_camera_of_a_court_unless_its_focal_length_is_open(workspace):
    camera = court_camera(CAMERA, 3)
    write_camera(workspace.camera_file, camera)
    known = degrees_known(workspace)
    assert known == pytest.approx(degrees_of(CAMERA.focal))
    write_camera(workspace.camera_file, replace(camera, sd_focal=0.4 * camera.focal))
    assert degrees_known(workspace) is None


def test_what_a_person_told_of_the_lens_counts_before_what_the_file_tells(workspace, monkeypatch):
    monkeypatch.setattr(lens, "lens_focal", lambda path, size: 1100.0)
    by_file = degrees_known(workspace)
    assert by_file == pytest.approx(degrees_of(1100.0))
    workspace.change_ground_marks(GroundMarks(field_of_view=48.0))
    assert degrees_known(workspace) == pytest.approx(48.0)


def test_the_page_is_told_of_a_lens_that_nobody_has_to_type(workspace, monkeypatch):
    video = workspace.video()
    assert describe_settings(workspace, video)["lens"] is None
    write_camera(workspace.camera_file, court_camera(CAMERA, 3))
    told = describe_settings(workspace, video)["lens"]
    assert told == {
        "degrees": pytest.approx(degrees_of(CAMERA.focal)),
        "told_by": "the camera that the court told",
    }
    monkeypatch.setattr(lens, "lens_focal", lambda path, size: 1100.0)
    told = describe_settings(workspace, video)["lens"]
    assert told["told_by"] == "the lens that the file names"
    workspace.change_ground_marks(GroundMarks(field_of_view=48.0))
    told = describe_settings(workspace, video)["lens"]
    assert told == {"degrees": pytest.approx(48.0), "told_by": "step 6 Ground"}


def test_a_damaged_camera_file_does_not_keep_the_page_from_opening(workspace):
    workspace.camera_file.write_bytes(b"PK no camera")
    assert describe_settings(workspace, workspace.video())["lens"] is None


def test_a_player_who_fills_the_picture_is_asked_for_the_lens(workspace):
    motion = seen(standing(steps=2))
    assert lens.describe_nearness(motion, workspace.video()) is None
    near = replace(motion, scale=0.5 * max(SIZE) / 1.75 * np.ones(len(motion.time)))
    nearness = lens.describe_nearness(near, workspace.video())
    line = lens.lens_advice(workspace.folder, nearness)
    assert "53% of the picture" in line and "--fov DEGREES" in line


def test_on_the_page_and_in_the_report_a_lens_is_asked_for_without_a_command(workspace):
    line = in_page_words(lens.lens_advice(workspace.folder, "The player is near."))
    assert "type it in degrees as field of view, beside the height (phones" in line
    for text in (line, lens.lens_caveat("The player is near.")):
        assert text.startswith("The player is near. Depths come out better")
        assert not re.search("keyrecon|--|DEGREES|option", text)
