"""A long motion is fitted in windows."""

import numpy as np
import pytest

from keyrecon.lifting.motion_fitting import _windows

SHOWN = 0.4
"""Seconds on both sides of a frame that the depth model is shown."""


@pytest.mark.parametrize("fps", [25.0, 50.0, 240.0, 3000.0])
def test_windows_add_up_and_their_ends_count_little(fps):
    shot, total, last = slice(30, 9030), np.zeros(9030), 30
    for window in _windows(shot, fps):
        assert window.first <= last
        total[window.first : window.last] += window.weight
        last = window.last
        if fps <= 240 and last < shot.stop:
            assert window.weight[-round(SHOWN * fps) :].max() <= 0.21
    assert last == shot.stop
    assert np.allclose(total[30:], 1)
