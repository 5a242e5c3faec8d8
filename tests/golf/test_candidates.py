"""How a film is timed by the swing that is in it."""

import numpy as np
import pytest

from keyrecon.golf.candidates import find_slowed_keys
from keyrecon.golf.observe.film import Film

KEYS = np.array([10.0, 50.0, 68.0, 90.0])


def film(fps, step=1):
    """120 frames of a file, each `step`-th of them, taken with `fps`."""
    numbers = np.arange(0, 120, step)
    place = np.interp(np.arange(120), numbers, np.arange(len(numbers)))
    return Film(
        numbers, numbers / fps, place, np.tile(np.eye(3), (120, 1, 1)), (64, 48), np.zeros(2),
        True, (0, 119), 0.0, (0, 119),
    )  # fmt: skip


@pytest.mark.parametrize(("fps", "slowed"), [(60.0, False), (15.0, True)])
def test_a_downswing_that_no_golfer_is_so_slow_in_shows_slow_motion(fps, slowed):
    found = find_slowed_keys(KEYS, film(fps), film(fps))
    assert (found is not None) == slowed  # 18 frames down: .3 s, or 1.2
    if found is not None:
        np.testing.assert_array_equal(found, KEYS)


def test_its_keys_are_told_by_the_frames_that_were_searched():
    found = find_slowed_keys(KEYS / 2, film(15.0, step=2), film(15.0))
    np.testing.assert_allclose(found, KEYS)
