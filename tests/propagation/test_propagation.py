"""Joints carried from annotated frames to all others."""

from dataclasses import replace

import numpy as np
import pytest
from capsule_player import hide, marks, scene, standing, turned

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.propagation.flow_agreement import with_flow
from keyrecon.propagation.propagation import PropagateOptions, propagate_joints
from keyrecon.records import FlowTracks, JointTracks

PAPER = PropagateOptions(method="paper")
RIGHT_ARM = ("right_wrist",)
BEND = np.linspace(0, 0.6, 13)


def bending(angles=BEND):
    """Poses whose right forearm turns."""
    return [turned(standing(), "right_elbow", RIGHT_ARM, angle) for angle in angles]


def carry(preparation, annotations, options=PropagateOptions()):
    return propagate_joints(preparation, annotations, options=options)


def test_annotated_frames_keep_their_marks_exactly():
    preparation, truth = scene(bending(), (2, 9))
    found = carry(preparation, marks(truth, (2, 9)))
    np.testing.assert_array_equal(found.joints[[2, 9]], truth[[2, 9]])
    assert (found.confidence[[2, 9]] == 1).all()


@pytest.mark.parametrize("options", [PropagateOptions(), PAPER], ids=["fused", "paper"])
def test_joints_move_and_grow_with_the_figure(options):
    steps = np.arange(12)
    preparation, truth = scene(
        [standing()] * 12, (4,), 180 + 5 * steps, np.stack([500 + 8 * steps, 200 + steps], axis=1)
    )
    found = carry(preparation, marks(truth, (4,)), options)
    away = np.linalg.norm(found.joints - truth, axis=-1) / preparation.track.height[:, None]
    assert np.median(away) < 0.01
    assert away.max() < (0.03 if options.method == "fused" else 0.08)


def test_a_limb_that_turns_is_followed():
    preparation, truth = scene(bending(), (0,))
    found = carry(preparation, marks(truth, (0,)))
    wrist = LSP14.index("right_wrist")
    away = np.linalg.norm(found.joints - truth, axis=-1)[:, wrist] / preparation.track.height
    # 0.6 rad move the wrist by a tenth of the player's height
    assert away.max() < 0.025


def test_a_crossing_limb_keeps_its_side():
    swing = np.linspace(-0.45, 0.45, 31)
    poses = [
        turned(
            turned(standing(), "right_hip", ("right_knee", "right_ankle"), -0.25 + angle),
            "left_hip",
            ("left_knee", "left_ankle"),
            0.25 - angle,
        )
        for angle in swing
    ]
    preparation, truth = scene(poses, (0, 30))
    found = carry(preparation, marks(truth, (0, 30)))
    legs = [LSP14.index(n) for n in ("right_knee", "left_knee", "right_ankle", "left_ankle")]
    away = (
        np.linalg.norm(found.joints - truth, axis=-1)[:, legs] / preparation.track.height[:, None]
    )
    assert (away < 0.06).mean() > 0.95


@pytest.mark.parametrize(("half", "limbs"), [(LSP14.is_lower, 0), (~LSP14.is_lower, 1)])
def test_a_mark_with_left_and_right_exchanged_is_told_and_kept(half, limbs):
    marked = (2, 8, 14, 20, 26)
    preparation, truth = scene(bending(0.3 * np.sin(np.linspace(0, 6, 29))), marked)
    right = marks(truth, marked)
    assert carry(preparation, right).exchange_evidence.max() <= 0
    joints = right.joints.copy()
    joints[2, half] = right.joints[2, LSP14.mirror][half]
    found = carry(preparation, replace(right, joints=joints))
    assert np.argwhere(found.exchange_evidence > 3).tolist() == [[14, limbs]]
    np.testing.assert_array_equal(found.joints[14], joints[2])


def test_a_hidden_joint_is_missing_the_papers_way_only():
    preparation, truth = scene(bending(), (2, 9))
    annotations = hide(marks(truth, (2, 9)), "left_wrist")
    wrist = LSP14.index("left_wrist")
    as_printed = carry(preparation, annotations, PAPER)
    assert np.isnan(as_printed.joints[:, wrist]).all()
    assert (as_printed.confidence[:, wrist] == 0).all()
    assert np.isfinite(carry(preparation, annotations).joints).all()


@pytest.mark.parametrize("options", [PropagateOptions(), PAPER], ids=["fused", "paper"])
def test_a_joint_that_cannot_be_seen_in_a_frame_is_not_carried_there(options):
    preparation, truth = scene(bending(), (2, 9))
    annotations = marks(truth, (2, 9))
    wrist, elbow = (LSP14.index(f"left_{name}") for name in ("wrist", "elbow"))
    annotations.joints[1, wrist], annotations.visible[1, wrist] = np.nan, False
    absent = ((2, "left_elbow"), (5, "left_wrist"), (9, "left_wrist"))
    found = carry(preparation, replace(annotations, absent=absent), options)
    assert np.isnan(found.joints[[5, 9], wrist]).all()
    assert (found.confidence[[5, 9], wrist] == 0).all()
    # what is placed is there, whatever is said
    assert (found.joints[2, elbow] == truth[2, elbow]).all()
    assert np.isfinite(found.joints[4, wrist]).all()


def test_feet_that_were_not_seen_do_not_pull_the_ankles():
    legs = "right_hip", ("right_knee", "right_ankle")
    poses = [turned(standing(), *legs, angle) for angle in np.linspace(-0.3, 0.3, 21)]
    preparation, truth = scene(poses, (0, 20))
    track, unseen = preparation.track, slice(6, 15)
    track.feet[unseen, :, 0] += 0.12 * track.height[unseen, None]
    track.confidence[unseen] = 0
    found = carry(preparation, marks(truth, (0, 20)))
    ankles = [LSP14.index(f"{side}_ankle") for side in ("right", "left")]
    away = np.linalg.norm(found.joints - truth, axis=-1)[:, ankles] / track.height[:, None]
    assert away.max() < 0.003


@pytest.mark.parametrize("options", [PropagateOptions(), PAPER], ids=["fused", "paper"])
def test_confidence_falls_with_pose_distance(options):
    preparation, truth = scene(bending(np.linspace(0, 1.2, 13)), (0,))
    confidence = carry(preparation, marks(truth, (0,)), options).confidence.mean(axis=1)
    assert confidence[1:4].mean() > confidence[-3:].mean()


def test_a_joint_that_is_marked_nowhere_is_named():
    preparation, truth = scene(bending(), (2, 9))
    annotations = marks(truth, (2, 9))
    annotations.joints[:, LSP14.index("left_knee")] = np.nan
    with pytest.raises(KeyreconError, match="left_knee"):
        carry(preparation, annotations)


def test_a_joint_left_out_on_one_frame_comes_from_another():
    preparation, truth = scene(bending(), (2, 9))
    annotations = marks(truth, (2, 9))
    annotations.joints[1, LSP14.index("left_wrist")] = np.nan
    found = carry(preparation, annotations)
    away = np.linalg.norm(found.joints - truth, axis=-1) / preparation.track.height[:, None]
    assert away.max() < 0.03


def test_a_frame_on_which_half_of_the_joints_are_marked_serves_as_a_figure():
    preparation, truth = scene(bending(), (2, 9))
    annotations = marks(truth, (2, 9))
    hidden = [LSP14.index(n) for n in ("neck", "head_top", "left_elbow", "left_wrist")]
    annotations.joints[1, hidden] = np.nan
    found = carry(preparation, annotations)
    away = np.linalg.norm(found.joints - truth, axis=-1) / preparation.track.height[:, None]
    assert away.max() < 0.03


def fused(edges, followed, joined=True, shift=40.0):
    """One joint at 0 by edges and elsewhere by flow, each with a confidence."""
    joints = np.zeros((1, 1, 2))
    tracks = JointTracks(joints, np.full((1, 1), edges))
    sure, ways, exact = np.full((1, 1), followed), np.full((1, 1), joined), np.zeros((1, 1))
    flow = FlowTracks(joints + shift, sure, ways, drift=exact, likeness=1 - exact)
    result = with_flow(tracks, flow, np.full(1, 100.0), np.full((1, 1), np.inf))
    return float(result.joints[0, 0, 0]), float(result.confidence[0, 0])


def test_flow_that_joins_two_marks_has_a_joint_where_it_is_surer_than_edges():
    assert fused(edges=0.7, followed=0.95) == (40, 0.95)
    assert fused(edges=0.02, followed=0.3) == (40, 0.3)
    assert fused(edges=0.4, followed=0.6) == (0, 0.4)
    assert fused(edges=0.02, followed=0.0) == (0, 0.02)


def test_flow_from_one_mark_alone_overrules_nothing():
    assert fused(edges=0.05, followed=0.99, joined=False) == (0, 0.05)


def test_flow_and_edges_near_one_another_agree_and_edges_are_more_exact():
    assert fused(edges=0.3, followed=0.99, shift=1.0) == (0, 0.3)
