"""How long a bone can be, and that no longer one is chosen."""

import numpy as np
from capsule_player import marks, scene, standing
from hypothesis_choice import choice

from keyrecon.body import LSP14
from keyrecon.propagation.body_frame import stabilise_player
from keyrecon.propagation.bone_bounds import bone_lengths, bound_bones
from keyrecon.propagation.flow_agreement import with_flow
from keyrecon.propagation.half_body import split_body
from keyrecon.propagation.selection import choose_limbs
from keyrecon.records import FlowTracks, JointTracks, Shots

KNEE, ANKLE = LSP14.index("left_knee"), LSP14.index("left_ankle")
ELBOW, WRIST = LSP14.index("right_elbow"), LSP14.index("right_wrist")


def bounds_of(preparation, annotations):
    body_frame = stabilise_player(preparation.track, preparation.camera, preparation.video.fps)
    return bound_bones(body_frame.of_marks(annotations))


def foreshortened(share):
    """A pose whose right forearm points towards the camera."""
    pose = standing()
    pose[WRIST] = pose[ELBOW] + share * (pose[WRIST] - pose[ELBOW])
    return pose


def test_a_bone_can_be_as_long_as_it_was_marked_and_hardly_longer():
    preparation, truth = scene([standing(), standing(), standing()], (0, 2), 180.0)
    bounds = bounds_of(preparation, marks(truth, (0, 2)))
    shank = np.linalg.norm(standing()[KNEE] - standing()[ANKLE])
    assert shank <= bounds[KNEE, ANKLE] < 1.1 * shank
    assert bounds[KNEE, ANKLE] == bounds[ANKLE, KNEE]
    assert np.isinf(bounds[KNEE, WRIST])


def test_the_size_of_the_player_in_a_frame_does_not_matter():
    preparation, truth = scene([standing()] * 3, (0, 2), [180.0, 240.0, 360.0])
    bounds = bounds_of(preparation, marks(truth, (0, 2)))
    assert bounds[KNEE, ANKLE] < 1.1 * np.linalg.norm(standing()[KNEE] - standing()[ANKLE])


def test_marks_that_spread_leave_more_room():
    preparation, truth = scene([standing()] * 3, (0, 2))
    annotations = marks(truth, (0, 2))
    before = bounds_of(preparation, annotations)[KNEE, ANKLE]
    elbow, wrist = LSP14.index("left_elbow"), LSP14.index("left_wrist")
    annotations.joints[0, wrist] += 0.1 * (annotations.joints[0, wrist] - truth[0, elbow])
    assert bounds_of(preparation, annotations)[KNEE, ANKLE] > 1.05 * before


def test_a_forearm_seen_at_length_in_one_frame_of_many_gives_no_room_to_the_legs():
    shank = np.linalg.norm(standing()[KNEE] - standing()[ANKLE])
    poses = [standing(), *[foreshortened(0.2)] * 6]
    for pose in poses[1:]:
        left = LSP14.index("left_elbow"), LSP14.index("left_wrist")
        pose[left[1]] = pose[left[0]] + 0.2 * (pose[left[1]] - pose[left[0]])
    preparation, truth = scene(poses, tuple(range(7)))
    assert bounds_of(preparation, marks(truth, tuple(range(7))))[KNEE, ANKLE] < 1.1 * shank


def test_a_forearm_that_was_marked_foreshortened_only_may_be_as_long_as_bodies_have_it():
    preparation, truth = scene([foreshortened(0.4)] * 3, (0, 2))
    annotations = marks(truth, (0, 2))
    annotations.joints[:, LSP14.index("left_wrist")] = np.nan
    pose = standing()
    others = np.linalg.norm(pose[LSP14.index("left_elbow")] - pose[LSP14.index("left_shoulder")])
    assert bounds_of(preparation, annotations)[ELBOW, WRIST] > 0.6 * others


def test_one_marked_body_bounds_nothing():
    preparation, truth = scene([standing()] * 3, (0,))
    assert np.isinf(bounds_of(preparation, marks(truth, (0,)))).all()


def test_a_limb_that_cannot_be_that_long_is_refused_whatever_speaks_for_it():
    legs, _ = split_body(LSP14)
    pose = (standing() @ [1, 1j])[legs.joints]
    knee, ankle = (list(legs.joints).index(j) for j in (KNEE, ANKLE))
    stretched = pose.copy()
    stretched[ankle] = pose[knee] + 1.4 * (pose[ankle] - pose[knee])
    joints = np.tile(np.stack([stretched, pose]), (5, 1, 1))
    cost, longest = np.tile([0.0, 0.5], (5, 1)), 1.1 * bone_lengths(pose, legs.bones)
    one_shot = Shots.between((), 5)
    found = {
        limit: choose_limbs(*choice(legs, joints, cost, scale * longest), one_shot, 50.0).joints[2]
        for limit, scale in (("bounded", 1.0), ("not", np.inf))
    }
    np.testing.assert_array_equal(found["bounded"], pose)
    np.testing.assert_array_equal(found["not"], stretched)


def test_flow_has_no_joint_where_a_bone_would_be_too_long():
    joints = np.array([[[0.0, 0.0], [0.0, 20.0]]])
    tracks = JointTracks(joints, np.full((1, 2), 0.3))
    bounds = np.array([[np.inf, 0.25], [0.25, np.inf]])
    for away, expected in ((24.0, 24.0), (30.0, 20.0)):
        places = np.array([[[0.0, 0.0], [away, 0.0]]])
        exact, both = np.zeros((1, 2)), np.ones((1, 2), bool)
        flow = FlowTracks(places, 0.95 + exact, both, drift=exact, likeness=1 - exact)
        found = with_flow(tracks, flow, np.full(1, 100.0), bounds)
        assert np.linalg.norm(found.joints[0, 1]) == expected
