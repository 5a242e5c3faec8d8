"""What keyrecon court and keyrecon run do to a project's motion."""

from dataclasses import replace

import numpy as np
import pytest
from court_walker import court_camera, lifted, walk
from painted_court import camera_at

from keyrecon.app.court import court_click, describe_camera, write_placed_motion
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.camera_file import write_camera
from keyrecon.io.workspace import Workspace

PINHOLE = camera_at((2, -20, 3), (0, -9, 0.8), 1.6)


@pytest.fixture(scope="module")
def motion():
    return lifted(walk()[0], PINHOLE)


def stored(workspace):
    with np.load(workspace.motion_file) as file:
        return {name: file[name] for name in file.files}


def test_without_a_camera_the_motion_is_as_it_was(bare, motion):
    workspace = Workspace(bare)
    assert write_placed_motion(workspace, motion) == []
    assert "points3d_world" not in stored(workspace)


def test_with_a_camera_the_motion_is_on_the_court_too(bare, motion):
    workspace = Workspace(bare)
    write_placed_motion(workspace, motion)
    before = stored(workspace)
    write_camera(workspace.camera_file, court_camera(PINHOLE, len(motion.time)))
    (line,) = write_placed_motion(workspace, motion)
    assert "m run, top speed" in line
    after = stored(workspace)
    assert all(np.array_equal(before[name], after[name]) for name in before)
    assert after["root_world"].shape == (len(motion.time), 3)


def test_a_camera_that_makes_a_giant_of_the_player_puts_nothing_on_the_court(bare, motion):
    workspace = Workspace(bare)
    far = replace(PINHOLE, centre=PINHOLE.centre * [1, 1, 2.0])
    write_camera(workspace.camera_file, court_camera(far, len(motion.time)))
    (line,) = write_placed_motion(workspace, motion)
    assert "times the height given" in line
    assert "points3d_world" not in stored(workspace)


def test_a_camera_of_another_trim_is_told_of(bare, motion):
    workspace = Workspace(bare)
    write_camera(workspace.camera_file, court_camera(PINHOLE, 7))
    (line,) = write_placed_motion(workspace, motion)
    assert "made for 7 frames" in line
    assert "points3d_world" not in stored(workspace)


def test_frames_without_the_court_are_listed():
    camera = court_camera(PINHOLE, 20)
    found = camera.found.copy()
    found[5:8] = False
    lines = describe_camera(replace(camera, found=found))
    assert "20.0 m from the net, 2.0 m to the right" in lines[0]
    assert lines[1] == "No court seen in frames 5-7."


def test_a_point_is_named_framed_and_placed():
    click = court_click("near-left:12:40.5,300")
    assert (click.name, click.frame, click.x, click.y) == ("near-left", 12, 40.5, 300.0)
    with pytest.raises(KeyreconError, match="NAME:FRAME:X,Y"):
        court_click("near-left:40,300")
