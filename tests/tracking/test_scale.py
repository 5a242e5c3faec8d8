"""How large the player is, where the picture shows less than all of him."""

import numpy as np
import pytest

from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.records import CameraPath, Track, TrackAnchors
from keyrecon.tracking.scale import SizeEvidence, with_standing_height

COUNT, ROWS = 120, 360


def approaching():
    """A player who comes near: he grows from 150 to 300 px, his head stays where it is, and from
    the frame on in which the picture ends above his feet the lowest that is seen passes for them.
    """
    height = np.linspace(150.0, 300.0, COUNT)
    head = np.tile([200.0, 150.0], (COUNT, 1))
    lowest = np.minimum(head[:, 1] + height, ROWS - 5.0)
    feet = np.stack([np.full((COUNT, 2), 190.0), np.tile(lowest[:, None], 2)], axis=2)
    feet[:, 1, 0] = 210.0
    unmeasured = np.full(COUNT, np.nan), np.full((COUNT, 4), np.nan)
    return height, Track(head, feet, *unmeasured, np.ones(COUNT))


def evidence(told, footless=True):
    """A still camera, and what marked bodies tell."""
    return SizeEvidence(np.ones(COUNT), told, np.full(COUNT, footless), ROWS)


def test_a_player_whose_feet_the_picture_cuts_off_is_as_tall_as_marked_bones_tell():
    height, track = approaching()
    # proportions are not quite the table's: what is told is a tenth too much everywhere
    found = with_standing_height(track, evidence(1.1 * height), 30, np.ones(COUNT, bool))
    assert found.height == pytest.approx(height, rel=0.12)
    assert found.mid_feet[-1] == pytest.approx([200.0, 150.0 + found.height[-1]])


def test_without_marked_bones_head_and_feet_tell():
    _, track = approaching()
    unknown = np.full(COUNT, np.nan)
    found = with_standing_height(track, evidence(unknown), 30, np.ones(COUNT, bool))
    assert found.height.max() < 210
    assert (found.feet == track.feet).all()


def test_no_feet_are_cut_off_where_every_marked_body_has_them():
    height, track = approaching()
    found = with_standing_height(track, evidence(height, footless=False), 30, np.ones(COUNT, bool))
    assert (found.feet == track.feet).all()


def test_a_marked_body_without_feet_speaks_for_the_frames_up_to_those_that_have_them(tmp_path):
    height, track = approaching()
    marked = np.array([10, 60, 100])
    feet = track.feet[marked].copy()
    feet[1] = np.nan
    without = np.array([False, True, False])
    given = marked, track.head[marked], feet, np.ones(3, bool), height[marked], without
    nowhere, unknown = np.full((len(given[0]), 2), np.nan), np.full(len(given[0]), np.nan)
    bodies = TrackAnchors(*given, nowhere, unknown)
    camera = CameraPath(np.tile(np.eye(3), (COUNT, 1, 1)), np.ones(COUNT))
    write_video(tmp_path / "dark.mp4", np.zeros((COUNT, ROWS, 400, 3), np.uint8), 25.0)
    told = SizeEvidence.of(camera, open_video(tmp_path / "dark.mp4"), bodies)
    np.testing.assert_array_equal(np.flatnonzero(told.footless), np.arange(11, 100))
    np.testing.assert_allclose(told.marked_height[marked], height[marked])
