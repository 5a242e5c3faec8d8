"""The window that the report's pictures show of each frame."""

from dataclasses import replace

import numpy as np
from small_motion import make_motion

from keyrecon.records import Track
from keyrecon.report.pictures import ROOM, follow_player

FRAMES, CUT = 60, 30
SECOND = (np.arange(FRAMES) >= CUT)[:, None]


def track():
    """A player at (100, 200) 80 px tall, from `CUT` on at (500, 150) 240 px tall."""
    height = np.where(SECOND[:, 0], 240.0, 80.0)
    middle = np.where(SECOND, [500.0, 150.0], [100.0, 200.0])
    head, feet = (middle + np.outer(height, [0, side]) for side in (-0.5, 0.5))
    box = np.concatenate([middle - height[:, None], middle + height[:, None]], axis=1)
    return Track(head, np.repeat(feet[:, None], 2, axis=1), height, box, np.ones(FRAMES))


def test_beside_a_cut_the_window_is_around_the_player_of_its_own_shot():
    windows = follow_player(track(), replace(make_motion(FRAMES), cuts=np.array([CUT])))
    np.testing.assert_allclose(windows.center, np.where(SECOND, [500, 150], [100, 200]))
    np.testing.assert_allclose(windows.side, ROOM * np.where(SECOND[:, 0], 240, 80))


def test_within_a_shot_the_window_moves_calmly():
    windows = follow_player(track(), make_motion(FRAMES))
    assert 0 < np.diff(windows.center[:, 0]).max() < 50
