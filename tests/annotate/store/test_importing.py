"""Marks from a file against those of the project."""

from keyrecon.annotate.store.cells import apply_in_place
from keyrecon.annotate.store.importing import compare_marks, name_conflicts

NECK, KNEE = ("mark", 3, "neck"), ("mark", 3, "left_knee")
DEPTH = ("nearer", 3, "left_knee")


def conflicts(current, imported):
    return name_conflicts(compare_marks(current, imported))


def test_marks_where_there_were_none_are_new():
    comparison = compare_marks({NECK: [1, 2, 2]}, {KNEE: [3, 4, 2], DEPTH: 1})
    assert {change.key for change in comparison.new} == {KNEE, DEPTH}
    assert comparison.conflicts == ()


def test_only_marks_that_differ_are_conflicts():
    assert conflicts({NECK: [1, 2, 2]}, {NECK: [1.2, 2, 2]}) == []
    assert conflicts({NECK: [1, 2, 2]}, {NECK: [9, 2, 2]}) == ["frame 3 neck"]
    assert conflicts({NECK: [1, 2, 2]}, {("mark", 4, "neck"): [9, 2, 2]}) == []
    assert conflicts({DEPTH: 1}, {DEPTH: -1}) == ["frame 3 depth of left_knee"]


def test_an_absent_joint_that_is_placed_elsewhere_is_a_conflict_either_way():
    placed, absent = {NECK: [1, 2, 2]}, {NECK: [0, 0, 0]}
    assert conflicts(placed, absent) == conflicts(absent, placed) == ["frame 3 neck"]
    assert conflicts(absent, {NECK: [5, 6, 0]}) == []


def test_a_format_that_knows_no_hidden_joints_contradicts_none():
    hidden, visible = {NECK: [1, 2, 1]}, {NECK: [1, 2, 2]}
    assert conflicts(hidden, visible) == []
    assert conflicts(visible, hidden) == ["frame 3 neck"]


def test_what_contradicts_is_taken_only_to_replace():
    current, imported = {NECK: [1, 2, 2]}, {NECK: [9, 2, 2], KNEE: [3, 4, 2]}
    for replace, neck in ((False, [1, 2, 2]), (True, [9, 2, 2])):
        cells = dict(current)
        apply_in_place(cells, compare_marks(current, imported).changes(replace))
        assert cells == {NECK: neck, KNEE: [3, 4, 2]}
