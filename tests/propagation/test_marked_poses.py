"""What marks tell of the poses of one half of the body."""

import numpy as np

from keyrecon.body import LSP14
from keyrecon.propagation.body_frame import PlayerMarks
from keyrecon.propagation.half_body import split_body
from keyrecon.propagation.marked_poses import gather_poses


def test_a_joint_that_is_not_marked_stands_at_the_median_place_beside_its_parent():
    half = next(half for half in split_body(LSP14) if half.name == "upper")
    wrist, elbow = LSP14.index("left_wrist"), LSP14.index("left_elbow")
    joints = np.tile(0.1 * np.arange(14) * (1 + 0.5j), (4, 1))
    joints[:, wrist] = joints[:, elbow] + np.array([-0.1 + 0.1j, -0.1j, 0.1 + 0.1j, np.nan])
    fixed = np.tile(joints[0, half.joints[half.fixed]], (4, 1))
    poses = gather_poses(PlayerMarks(LSP14, np.arange(4), joints), np.ones((14, 14)), half, fixed)
    (place,), (parent,) = (np.flatnonzero(half.joints == j) for j in (wrist, elbow))
    assert np.isclose(poses.joints[3, place] - poses.joints[3, parent], 0.1j)
    assert not poses.known[3, place]
