from dataclasses import replace

import numpy as np

from keyrecon.body import LSP14
from keyrecon.io.formats.annotations import (
    marks_asked_for,
    merge_annotations,
    missing_marks,
)
from keyrecon.records import Annotations


def marks(frames, value, joints=range(14)):
    points = np.full((len(frames), 14, 2), np.nan)
    points[:, list(joints)] = value
    return Annotations(
        LSP14,
        np.array(frames),
        points,
        np.isfinite(points).all(axis=2),
        np.zeros((len(frames), 13), dtype=np.int64),
    )


def test_marks_of_other_frames_are_added():
    merged = merge_annotations(marks([3, 9], 1.0), marks([5], 2.0))
    assert merged.frames.tolist() == [3, 5, 9]
    assert merged.joints[:, 0, 0].tolist() == [1, 2, 1]


def test_unmarked_joints_erase_nothing():
    merged = merge_annotations(marks([3], 1.0), marks([3], 2.0, joints=[4]))
    assert merged.joints[0, 4, 0] == 2
    assert merged.joints[0, 5, 0] == 1


def test_an_absent_joint_stays_absent_until_it_is_placed():
    old = replace(marks([3], 1.0, joints=[4]), absent=((3, "neck"), (5, "neck")))
    added = merge_annotations(old, marks([3], 2.0, joints=[6]))
    assert added.absent == old.absent
    placed = marks([3], 2.0, joints=[LSP14.index("neck")])
    assert merge_annotations(old, placed).absent == ((5, "neck"),)
    taken_back = merge_annotations(placed, old)
    assert taken_back.absent == old.absent
    assert np.isnan(taken_back.joints[0, LSP14.index("neck")]).all()


def test_a_half_of_which_nothing_is_to_be_seen_lacks_nothing():
    lower = tuple((5, LSP14.names[j]) for j in sorted(LSP14.lower))
    gone = replace(marks([3], 1.0), absent=lower)
    assert missing_marks(gone, np.array([3, 5]), np.array([3, 5])) == {5: ["upper body"]}
    gone = replace(gone, absent=lower[1:])
    assert missing_marks(gone, np.array([3]), np.array([5])) == {5: ["lower body"]}


def test_a_keyframe_needs_marks_for_its_half_only():
    upper = [j for j in range(14) if j not in LSP14.lower]
    done = marks([3, 5], 1.0, joints=upper)
    assert missing_marks(done, np.array([3]), np.array([5])) == {5: ["lower body"]}
    assert missing_marks(None, np.array([3]), np.array([3])) == {3: ["upper body", "lower body"]}


def test_of_all_marks_those_of_the_halves_asked_for_are_kept():
    kept = marks_asked_for(marks([3, 5, 9], 1.0), np.array([3]), np.array([3, 5]))
    assert kept.frames.tolist() == [3, 5]
    assert np.isfinite(kept.joints[0]).all()
    assert np.flatnonzero(kept.visible[1]).tolist() == np.flatnonzero(LSP14.is_lower).tolist()
