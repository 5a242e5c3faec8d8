"""Marks that look wrong, in the order of suspicion."""

from dataclasses import replace

import numpy as np
import pytest
from capsule_player import marks, scene, standing, turned

from keyrecon.annotate.assist.body_estimate import estimate_body
from keyrecon.annotate.assist.checks import find_checks
from keyrecon.annotate.assist.neighbours import find_neighbours
from keyrecon.annotate.assist.side_checks import BY_CHANCE, evidence_of_motion
from keyrecon.body import LSP14
from keyrecon.records import Motion
from keyrecon.timeline import part_of_marks

ROW = 5
LEGS = ("hip", "knee", "ankle")


def stretching():
    """Poses whose right arm is raised and whose legs are apart, so that the sides differ."""
    poses = []
    for t in range(12):
        pose = turned(standing(), "right_shoulder", ("right_elbow", "right_wrist"), 0.8 + 0.04 * t)
        poses.append(turned(pose, "left_hip", ("left_knee", "left_ankle"), -0.5 - 0.02 * t))
    return poses


@pytest.fixture(scope="module")
def careful():
    preparation, truth = scene(stretching(), (0, 6))
    return preparation, marks(truth, range(12))


def checked(preparation, annotations):
    body = estimate_body(annotations, {}, preparation.track.height, 50.0)
    return find_checks(annotations, body.size, find_neighbours(preparation, annotations))


def changed(annotations, **places):
    """The same marks with joints of one frame elsewhere."""
    joints = annotations.joints.copy()
    for name, place in places.items():
        joints[ROW, LSP14.index(name)] = place
    return replace(annotations, joints=joints)


def place(annotations, name):
    return annotations.joints[ROW, LSP14.index(name)]


def test_true_marks_raise_no_suspicion(careful):
    preparation, annotations = careful
    assert [c for c in checked(preparation, annotations) if c.suspicion > 0.5] == []


def test_where_nothing_is_marked_nothing_looks_wrong(careful):
    preparation, annotations = careful
    body = estimate_body(annotations, {}, preparation.track.height, 50.0)
    nothing = part_of_marks(annotations, np.arange(0))
    assert len(nothing.frames) == 0
    neighbours = find_neighbours(preparation, nothing)
    assert find_checks(nothing, body.size, neighbours, preparation.track) == []


def test_swapped_legs_come_first_and_only_once(careful):
    preparation, annotations = careful
    sides = [(f"left_{part}", f"right_{part}") for part in LEGS]
    swapped = {a: place(annotations, b) for pair in sides for a, b in (pair, pair[::-1])}
    first, *rest = checked(preparation, changed(annotations, **swapped))
    assert (first.kind, first.frame) == ("crossed", ROW)
    assert "legs" in first.text
    assert not [c for c in rest if c.frame == ROW and c.suspicion > 0.5]


def test_a_joint_that_is_elsewhere_is_told_by_the_other_frames(careful):
    preparation, annotations = careful
    knee, ankle = place(annotations, "left_knee"), place(annotations, "left_ankle")
    first = checked(preparation, changed(annotations, left_ankle=knee + 0.2 * (ankle - knee)))[0]
    assert (first.kind, first.frame, first.joint) == ("far", ROW, "left_ankle")
    assert "left ankle" in first.text


def test_a_limb_that_one_frame_alone_has_elsewhere_is_no_mistake():
    poses = stretching()
    poses[ROW] = turned(poses[ROW], "left_shoulder", ("left_elbow", "left_wrist"), -2.6)
    preparation, truth = scene(poses, (0, 6))
    assert [c for c in checked(preparation, marks(truth, range(12))) if c.suspicion > 0.5] == []


def test_a_forearm_twice_as_long_as_it_can_be_is_told(careful):
    preparation, annotations = careful
    elbow, wrist = place(annotations, "right_elbow"), place(annotations, "right_wrist")
    moved = changed(annotations, right_wrist=elbow + 2.2 * (wrist - elbow))
    body = estimate_body(moved, {}, preparation.track.height, 50.0)
    first = find_checks(moved, body.size, ())[0]
    assert (first.kind, first.frame, first.joint) == ("long", ROW, "right_wrist")


def test_joints_left_out_are_told_together_unless_the_person_said_so(careful):
    preparation, annotations = careful
    gone = changed(annotations, left_wrist=np.nan, left_elbow=np.nan)
    first = checked(preparation, gone)[0]
    assert (first.kind, first.frame) == ("missing", ROW)
    assert {"left_wrist", "left_elbow"} == set(first.joints)
    absent = ((ROW, "left_elbow"), (ROW, "left_wrist"))
    assert "missing" not in {c.kind for c in checked(preparation, replace(gone, absent=absent))}


def test_a_half_that_nobody_began_lacks_nothing(careful):
    preparation, annotations = careful
    joints = annotations.joints.copy()
    joints[ROW, LSP14.is_lower] = np.nan
    found = checked(preparation, replace(annotations, joints=joints))
    assert "missing" not in {c.kind for c in found}


def test_a_player_whose_shanks_are_long_in_every_frame_is_not_told_of_them(careful):
    """The table knows the usual player, the other frames this one."""
    preparation, annotations = careful
    joints = annotations.joints.copy()
    for side in ("left", "right"):
        knee, ankle = (LSP14.index(f"{side}_{part}") for part in ("knee", "ankle"))
        joints[:, ankle] = joints[:, knee] + 1.3 * (joints[:, ankle] - joints[:, knee])
    body = estimate_body(annotations, {}, preparation.track.height, 50.0)
    found = find_checks(replace(annotations, joints=joints), body.size, ())
    assert [c for c in found if c.kind == "long"] == []


def test_shoulders_and_hips_that_face_opposite_ways_are_told(careful):
    preparation, annotations = careful
    sides = [(f"left_{part}", f"right_{part}") for part in ("shoulder", "elbow", "wrist")]
    swapped = {a: place(annotations, b) for pair in sides for a, b in (pair, pair[::-1])}
    body = estimate_body(annotations, {}, preparation.track.height, 50.0)
    found = find_checks(changed(annotations, **swapped), body.size, ())
    assert [(c.kind, c.frame) for c in found if c.kind == "crossed"] == [("crossed", ROW)]


def test_marks_of_another_frame_are_where_the_player_is_not(careful):
    preparation, annotations = careful
    joints = annotations.joints.copy()
    joints[ROW] += 0.5 * preparation.track.height[ROW]
    body = estimate_body(annotations, {}, preparation.track.height, 50.0)
    elsewhere = replace(annotations, joints=joints)
    found = find_checks(elsewhere, body.size, (), preparation.track)
    assert [(c.kind, c.frame) for c in found if c.kind == "off"] == [("off", ROW)]
    assert "another frame" in found[0].text


def test_a_motion_confirms_an_exchange_or_refutes_it(careful):
    preparation, annotations = careful
    sides = [(f"left_{part}", f"right_{part}") for part in LEGS]
    swapped = {a: place(annotations, b) for pair in sides for a, b in (pair, pair[::-1])}
    wrong = changed(annotations, **swapped)
    body = estimate_body(wrong, {}, preparation.track.height, 50.0)

    def suspicion(marked, legs):
        said = np.zeros((12, 2))
        said[ROW, 0] = legs
        found = find_checks(
            marked, body.size, find_neighbours(preparation, marked), preparation.track, None, said
        )
        return max([c.suspicion for c in found if (c.kind, c.frame) == ("crossed", ROW)], default=0)

    assert suspicion(wrong, 6.0) > suspicion(wrong, 0.0) > 0.5
    assert suspicion(wrong, -30.0) == 0
    assert suspicion(annotations, 12.0) > 0.9  # though nothing else speaks for it


def test_a_motion_speaks_of_the_marks_that_it_was_made_from_alone(careful):
    _, annotations = careful
    carried = np.zeros((14, 14, 2))
    carried[annotations.frames] = annotations.joints
    said = np.full((14, 2), 8.0)
    motion = Motion(
        LSP14, np.zeros((14, 14, 3)), carried, carried, np.ones((14, 14)),
        np.ones((14, 14), int), np.ones(14), 25.0, np.arange(14) / 25, "body heights",
        annotations.frames, exchange_evidence=said,
    )  # fmt: skip
    assert (evidence_of_motion(annotations, motion) == 8.0 - BY_CHANCE).all()
    moved = changed(annotations, left_knee=place(annotations, "left_knee") + 5)
    expected = np.full((12, 2), 8.0 - BY_CHANCE)
    expected[ROW, 0] = 0
    np.testing.assert_array_equal(evidence_of_motion(moved, motion), expected)
    assert evidence_of_motion(annotations, None) is None


def test_a_motion_says_nothing_of_sides_where_one_arm_alone_is_marked(careful):
    _, annotations = careful
    carried = np.zeros((14, 14, 2))
    carried[annotations.frames] = annotations.joints
    motion = Motion(
        LSP14, np.zeros((14, 14, 3)), carried, carried, np.ones((14, 14)),
        np.ones((14, 14), int), np.ones(14), 25.0, np.arange(14) / 25, "body heights",
        annotations.frames, exchange_evidence=np.full((14, 2), 8.0),
    )  # fmt: skip
    one_arm = changed(annotations, left_elbow=np.nan, left_wrist=np.nan)
    assert evidence_of_motion(one_arm, motion)[ROW].tolist() == [8.0 - BY_CHANCE, 0.0]
    one_wrist = changed(annotations, left_wrist=np.nan)
    assert evidence_of_motion(one_wrist, motion)[ROW].tolist() == [8.0 - BY_CHANCE] * 2
