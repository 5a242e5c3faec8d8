"""The pose of one keyframe, how sure it is, and what else it could be."""

import numpy as np
import pytest
from swinging_figure import BREADTHS, swinging_motion

from keyrecon.annotate.assist.body_estimate import estimate_body
from keyrecon.annotate.assist.pose_estimate import MIN_DEPTH_CHANGE, FrameObservation, estimate_pose
from keyrecon.body import LSP14
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.numerics.bone_directions import pose_from_directions
from keyrecon.records import Annotations

SIZE = BodySize(LSP14, LSP14.lengths, BREADTHS, np.full(240, 400.0))
DIRECTIONS = swinging_motion()
TRUTH = pose_from_directions(DIRECTIONS, LSP14.lengths, LSP14)
NEARER = -np.sign(DIRECTIONS[..., 2]).astype(np.int64)
DEEP = np.abs(DIRECTIONS[..., 2]) > 0.2


def observe(frame, nearer=None, hidden=()):
    joints = TRUTH[frame, :, :2].copy()
    joints[[LSP14.index(name) for name in hidden]] = np.nan
    nearer = np.zeros(13, dtype=np.int64) if nearer is None else nearer
    return FrameObservation(joints, np.full(14, 0.002), nearer)


@pytest.mark.parametrize("frame", [10, 90, 170])
def test_with_all_signs_given_the_pose_is_the_true_one(frame):
    pose = estimate_pose(observe(frame, NEARER[frame]), SIZE, LSP14)
    truth = TRUTH[frame] - TRUTH[frame, :, :].mean(axis=0) * [1, 1, 0]
    assert np.linalg.norm(pose.points3d - truth, axis=1).max() < 0.05
    assert (pose.certainty == 1).all()
    assert pose.alternatives == ()


def test_a_sign_that_a_person_gave_holds_in_every_pose():
    bone = int(np.abs(DIRECTIONS[30, :, 2]).argmax())
    for sign in (1, -1):
        nearer = np.zeros(13, dtype=np.int64)
        nearer[bone] = sign
        pose = estimate_pose(observe(30, nearer), SIZE, LSP14)
        poses = [pose, *pose.alternatives]
        assert {int(pose.nearer[bone]) for pose in poses} == {sign}


def test_alternatives_cost_more_and_differ_from_the_pose_and_each_other():
    pose = estimate_pose(observe(60), SIZE, LSP14)
    depths = [p.points3d[:, 2] for p in (pose, *pose.alternatives)]
    for n, depth in enumerate(depths[1:], 1):
        assert min(np.abs(depth - other).max() for other in depths[:n]) > MIN_DEPTH_CHANGE
    costs = [alternative.cost for alternative in pose.alternatives]
    assert 0 < len(costs) <= 3
    assert costs == sorted(costs)
    assert costs[0] >= 0


def test_signs_that_are_called_sure_are_mostly_right():
    poses = [estimate_pose(observe(t), SIZE, LSP14) for t in range(0, 240, 12)]
    right = np.concatenate(
        [(r.nearer == NEARER[t])[DEEP[t]] for r, t in zip(poses, range(0, 240, 12), strict=True)]
    )
    sure = np.concatenate(
        [r.certainty[DEEP[t]] for r, t in zip(poses, range(0, 240, 12), strict=True)]
    )
    assert right[sure > 0.8].mean() > 0.9
    assert right[sure > 0.8].mean() > right[sure < 0.4].mean()


def annotated(frames):
    frames = np.array(frames)
    joints = 400.0 * TRUTH[frames][..., :2] + [600.0, 200.0]
    return Annotations(LSP14, frames, joints, np.ones((len(frames), 14), bool), NEARER[frames])


def test_keyframes_whose_signs_are_known_settle_those_of_their_likes():
    others = estimate_body(annotated(range(0, 240, 4)), {}, np.full(240, 360.0), 50.0)
    alone, advised = [], []
    for t in range(2, 240, 16):
        for found, votes in ((alone, None), (advised, others.exemplars(t))):
            pose = estimate_pose(observe(t), SIZE, LSP14, votes)
            found.append((pose.nearer == NEARER[t])[DEEP[t]].mean())
    assert np.mean(advised) > np.mean(alone)


def test_a_frame_gives_no_advice_about_itself():
    body = estimate_body(annotated([20, 60]), {}, np.full(240, 360.0), 50.0)
    assert len(body.exemplars(20).vectors) == 1
    assert estimate_body(annotated([20]), {}, np.full(240, 360.0), 50.0).exemplars(20) is None


def test_without_a_whole_trunk_only_given_signs_are_sure():
    nearer = np.zeros(13, dtype=np.int64)
    nearer[6] = NEARER[10, 6]
    pose = estimate_pose(observe(10, nearer, hidden=("left_hip",)), SIZE, LSP14)
    assert pose.nearer[6] == nearer[6]
    assert pose.certainty[6] == 1
    assert np.delete(pose.certainty, 6).max() < 1e-6


def test_joints_that_are_unknown_stay_unknown():
    pose = estimate_pose(observe(10, hidden=("left_wrist",)), SIZE, LSP14)
    wrist = LSP14.index("left_wrist")
    bone = [c for _, c in LSP14.bones].index(wrist)
    assert np.isnan(pose.points3d[wrist]).all()
    assert np.isfinite(np.delete(pose.points3d, wrist, axis=0)).all()
    assert pose.certainty[bone] == 0
    assert np.isnan(pose.stretch[bone])


def test_nothing_marked_gives_nothing():
    pose = estimate_pose(observe(0, hidden=LSP14.names), SIZE, LSP14)
    assert np.isnan(pose.points3d).all()
    assert pose.alternatives == ()


def test_a_limb_drawn_too_long_shows_by_how_much():
    seen = observe(10)
    elbow, wrist = LSP14.index("left_elbow"), LSP14.index("left_wrist")
    seen.joints[wrist] = seen.joints[elbow] + [0.146 * 1.5, 0]
    pose = estimate_pose(seen, SIZE, LSP14)
    assert pose.stretch[[c for _, c in LSP14.bones].index(wrist)] == pytest.approx(1.5)


def test_depths_add_up_from_the_root():
    pose = estimate_pose(observe(100), SIZE, LSP14)
    steps = np.diff(pose.points3d[LSP14.bones][:, :, 2], axis=1)[:, 0]
    np.testing.assert_allclose(LSP14.ancestry @ steps, pose.points3d[:, 2], atol=1e-9)
    assert (np.sign(steps) == -pose.nearer).all()
