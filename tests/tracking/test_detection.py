"""What is told where the player's head was found too seldom."""

import numpy as np

from keyrecon.tracking.detection import missed_head

CHOSEN, NUMBERS = np.array([0, -1, -1, 2]), np.array([0, 5, 10, 15])


def test_who_picked_colours_is_told_to_pick_again():
    text = str(missed_head(CHOSEN, NUMBERS, np.zeros(0, int)))
    assert "found in only 2 of 4 frames; pick its colour again on a frame where it was" in text
    assert "for instance frame 10." in text


def test_who_marked_bodies_is_told_which():
    text = str(missed_head(CHOSEN, NUMBERS, np.array([3, 22])))
    assert "whether the marks on frame 3, 22 are the player's, and mark another body on a" in text
    assert "colour" not in text
    many = str(missed_head(CHOSEN, NUMBERS, np.arange(10)))
    assert "frame 0, 1, 2, 3, 4, 5, 6, 7 ... are" in many
