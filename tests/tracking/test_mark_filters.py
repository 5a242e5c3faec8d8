"""A track is held against filters that only marks have taught."""

import numpy as np
import pytest

from keyrecon.records import Track
from keyrecon.segmentation.player_crops import Cropping
from keyrecon.tracking.correlation_filters import Examples, spectrum
from keyrecon.tracking.mark_filters import MarkFilters, doubted, responses_at

SIZE, TALL = (96, 80), 56.0
ROWS = 80
HEAD, FEET = (40.0, 16.0), ((34.0, 72.0), (48.0, 72.0))
"""Of the body that is marked, in the crop."""
SLEEVE, KNEE = (52.0, 24.0), (34.0, 58.0)
"""What a tracker took for a head and for a foot."""


def picture(generator):
    """Three noisy channels: a round head, a trunk, two shoes."""
    channels = generator.normal(0, 0.1, (3, *SIZE))
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    channels[0][np.hypot(x - HEAD[0], y - HEAD[1]) < 5] += 1
    channels[1][22:50, 32:54] += 1
    for column, row in FEET:
        channels[2][int(row) - 2 : int(row) + 2, int(column) - 4 : int(column) + 5] += 1
    return channels


@pytest.fixture(scope="module")
def looks():
    """Responses in a picture like those that were marked."""
    generator = np.random.default_rng(0)
    spectra = np.stack([spectrum(picture(generator)) for _ in range(6)])
    places = np.tile(np.array([HEAD, *FEET]), (6, 1, 1))
    return MarkFilters.learn(Examples(spectra, places), SIZE, TALL).responses(
        spectrum(picture(generator))
    )


def test_what_was_marked_responds_and_other_parts_do_not(looks):
    assert min(responses_at(looks, np.array([HEAD, *FEET]))) > 0.6
    head, foot = responses_at(looks, np.array([SLEEVE, KNEE, FEET[1]]))
    assert head < 0.15
    assert foot < 0.15  # the worse of both


def test_beyond_the_crop_nothing_looks_like_a_part(looks):
    assert responses_at(looks, np.array([(-9.0, 10.0), FEET[0], (40.0, 300.0)])) == (0.0, 0.0)


def test_a_track_that_looks_unlike_the_marks_is_unsure_and_no_track_becomes_surer(looks):
    places = np.array([[HEAD, *FEET], [SLEEVE, *FEET], [HEAD, KNEE, FEET[1]], [HEAD, *FEET]])
    sure = np.array([0.9, 0.9, 0.9, 0.2])
    track = Track(places[:, 0], places[:, 1:], np.full(4, TALL), np.zeros((4, 4)), sure)
    cropping = Cropping(np.zeros((4, 2)), np.ones(4), SIZE)
    found = doubted(track, [looks] * 4, cropping, ROWS).confidence
    np.testing.assert_allclose(found[[0, 3]], [0.9, 0.2])
    assert (found[[1, 2]] < 0.6).all()
    np.testing.assert_array_equal(doubted(track, [None] * 4, cropping, ROWS).confidence, sure)


def test_feet_beneath_the_picture_are_not_asked_what_they_look_like(looks):
    places = np.array([[HEAD, KNEE, FEET[1]]] * 2)
    track = Track(places[:, 0], places[:, 1:], np.full(2, TALL), np.zeros((2, 4)), np.full(2, 0.9))
    cropping = Cropping(np.zeros((2, 2)), np.ones(2), SIZE)
    shown, cut = (doubted(track, [looks] * 2, cropping, rows).confidence for rows in (ROWS, 40))
    assert (shown < 0.6).all()
    np.testing.assert_allclose(cut, 0.9)
