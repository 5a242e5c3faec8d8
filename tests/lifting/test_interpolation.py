"""Which frames prove a key pose: those whose joints lie as its joints do."""

import numpy as np

from keyrecon.lifting.interpolation import reprojection_residual


def tracked_pose(frames=5, joints=8):
    """A pose, and its joints in frames in which it has moved, grown and been tracked roughly."""
    rng = np.random.default_rng(0)
    poses = np.tile(rng.normal(size=(1, joints, 2)), (frames, 1, 1))
    size, place = rng.uniform(0.5, 2, (frames, 1, 1)), rng.normal(size=(frames, 1, 2))
    return poses, size * poses + place + 0.02 * rng.normal(size=poses.shape)


def test_a_pose_that_moves_and_grows_stays_itself():
    poses, _ = tracked_pose()
    np.testing.assert_allclose(reprojection_residual(poses, 1.7 * poses + [3, -2]), 0, atol=1e-12)


def test_a_frame_that_shows_less_than_half_of_a_pose_proves_it_least():
    poses, joints = tracked_pose()
    for frame, located in enumerate((8, 4, 3, 1, 0)):
        joints[frame, located:] = np.nan
    residual = reprojection_residual(poses, joints)
    assert np.isfinite(residual[:2]).all() and (residual[:2] > 0).all()
    assert np.isinf(residual[2:]).all()


def test_a_pose_turned_upside_down_is_another_pose():
    poses, joints = tracked_pose()
    apart = np.linalg.norm(poses - poses.mean(axis=1, keepdims=True), axis=-1)
    turned = reprojection_residual(poses, -poses)
    np.testing.assert_allclose(turned, np.median(apart, axis=1))
    assert (turned > 10 * reprojection_residual(poses, joints)).all()
