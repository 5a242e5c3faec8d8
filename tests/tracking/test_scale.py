"""How large the player is, where the picture shows less than all of him."""

import numpy as np
import pytest

from keyrecon.records import Track
from keyrecon.tracking.scale import SizeEvidence, measured

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


def evidence(told, feet_marked=None):
    """A still camera, and what marked bodies tell."""
    marked = np.zeros(COUNT, bool) if feet_marked is None else feet_marked
    return SizeEvidence(np.ones(COUNT), told, marked, ROWS)


def test_a_player_whose_feet_the_picture_cuts_off_is_as_tall_as_marked_bones_tell():
    height, track = approaching()
    # proportions are not quite the table's: what is told is a tenth too much everywhere
    found = measured(track, evidence(1.1 * height), 30, np.ones(COUNT, bool))
    assert found.height == pytest.approx(height, rel=0.12)
    assert found.mid_feet[-1] == pytest.approx([200.0, 150.0 + found.height[-1]])


def test_without_marked_bones_head_and_feet_tell():
    _, track = approaching()
    unknown = np.full(COUNT, np.nan)
    found = measured(track, evidence(unknown), 30, np.ones(COUNT, bool))
    assert found.height.max() < 210
    assert (found.feet == track.feet).all()


def test_marked_feet_are_in_the_picture_however_tall_the_bones_are():
    height, track = approaching()
    everywhere = np.ones(COUNT, bool)
    found = measured(track, evidence(height, everywhere), 30, everywhere)
    assert (found.feet == track.feet).all()
