"""Marks of several makers."""

import numpy as np

from keyrecon.golf.marks import join_marks
from keyrecon.golf.records import SwingMarks


def test_marks_of_two_makers_are_joined_and_the_first_counts():
    first = SwingMarks(
        np.array([3]), np.full((1, 14, 2), np.nan), np.ones((1, 2, 2)),
        np.array([1, np.nan, np.nan, np.nan]),
    )  # fmt: skip
    first.joints[0, 2] = 5, 6
    second = SwingMarks.of_joints(np.array([3, 7]), np.full((2, 14, 2), 9.0))
    both = join_marks(first, second)
    assert both.frames.tolist() == [3, 7]
    assert both.joints[0, 2].tolist() == [5, 6]
    assert (both.joints[0, 3:] == 9).all() and (both.joints[1] == 9).all()
    assert np.isfinite(both.shafts).all(axis=(1, 2)).tolist() == [True, False]
    np.testing.assert_array_equal(both.keys, first.keys)
