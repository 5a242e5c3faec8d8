"""Which of two tracks is kept, and what is told where the player's head was found too seldom."""

import numpy as np
import pytest

from keyrecon.errors import KeyreconError
from keyrecon.records import Track
from keyrecon.segmentation.foreground_model import ForegroundModel
from keyrecon.tracking.detection import missed_head, surest_track

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


def choose(of_first, of_second, doubtful=0.75):
    """(number of the track that is kept, tracks made); `of_` are confidences of feet and places."""
    backgrounds = [object.__new__(ForegroundModel) for _ in range(2)]  # nobody looks at them
    made: list[Track | None] = []

    def detect(background):
        number = backgrounds.index(background)
        confidence = (of_first, of_second)[number]
        made.append(None)
        if confidence is None:
            raise KeyreconError(f"nobody before background {number}")
        even = np.ones(len(confidence) - 1)
        places = np.full((len(even), 2), float(number)), np.zeros((len(even), 2, 2))
        track = Track(*places, even, np.zeros((len(even), 4)), np.array(confidence[1:]))
        return track, confidence[0]

    return int(surest_track(backgrounds, detect, doubtful).head[0, 0]), len(made)


def test_a_player_who_was_found_surely_is_not_looked_for_again():
    assert choose((0.75, 0.5, 0.5), (1.0, 0.9, 0.9)) == (0, 1)


def test_of_two_tracks_the_surer_one_is_kept():
    assert choose((0.7, 0.6, 0.6), (0.9, 0.8, 0.8)) == (1, 2)
    assert choose((0.7, 0.6, 0.6), (0.9, 0.5, 0.5)) == (0, 2)


def test_a_few_places_that_were_missed_speak_less_against_a_track_than_many():
    assert choose((0.7, 0.6, 0.6, 0.6, 0.6), (0.9, 0.8, 0.8, 0.8, 0.0)) == (1, 2)
    assert choose((0.7, 0.6, 0.6, 0.6, 0.6), (0.9, 0.8, 0.8, 0.0, 0.0)) == (0, 2)


def test_a_player_who_is_found_before_one_background_alone_is_found_there():
    assert choose(None, (0.2, 0.1)) == (1, 2)
    assert choose((0.2, 0.1), None) == (0, 2)
    with pytest.raises(KeyreconError, match="before background 0"):
        choose(None, None)


def test_the_printed_form_looks_once():
    assert choose((0.1, 0.1), (0.9, 0.9), doubtful=0.0) == (0, 1)
    with pytest.raises(KeyreconError, match="before background 0"):
        choose(None, (0.9, 0.9), doubtful=0.0)
