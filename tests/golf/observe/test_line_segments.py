"""Shafts out of line segments."""

import numpy as np

from keyrecon.golf.observe.foreground import FrameForeground
from keyrecon.golf.observe.line_segments import DETECTED_HEIGHT, LineSegmentOptions, _join


def joined(scale):
    """Two pieces of one shaft, a little beside one another, in a picture of some scale."""
    side = round(400 * scale)
    everywhere = np.ones((side, side), bool)
    player = FrameForeground(
        0,
        np.full((side, side), 255, np.uint8),
        everywhere,
        1.0,
        DETECTED_HEIGHT * scale,
        np.zeros((side, side), np.uint8),
    )
    pieces = np.array([[[100, 100], [140, 100]], [[150, 101.2], [190, 101.2]]])
    return _join(scale * pieces, player, LineSegmentOptions()).ends / scale


def test_pieces_of_a_shaft_are_joined_at_any_size_of_the_picture():
    small, large, larger = (joined(scale) for scale in (1, 2, 4))
    assert np.ptp(small[..., 0], axis=1).max() > 89
    np.testing.assert_allclose(large, small, atol=1e-6)
    np.testing.assert_allclose(larger, small, atol=1e-6)
