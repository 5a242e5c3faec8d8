"""The paper's transfer: local translation, and patches on a tree."""

import numpy as np

from keyrecon.paper.joint_transfer import JointSearch, crop_patches, geometric_median, refine_joints

BONES = np.array([[0, 1], [1, 2]])
LIMB = np.array([[0.0, 0.0], [0.2, 0.05], [0.35, 0.2]])


def textured(shift=(0, 0)):
    """A picture with smooth random texture, moved by whole px."""
    rng = np.random.default_rng(3)
    coarse = rng.uniform(0, 255, (90, 120, 3))
    picture = np.kron(coarse, np.ones((4, 4, 1))).astype(np.uint8)
    return np.roll(picture, shift, axis=(1, 0))


def search(estimate, spread=0.05):
    return JointSearch(LIMB, estimate, np.full(3, spread), True)


def test_the_geometric_median_ignores_a_minority():
    points = np.concatenate([np.tile([[1.0, 2.0]], (7, 1)), np.tile([[9.0, -5.0]], (3, 1))])
    found = geometric_median(points + 1e-6 * np.arange(10)[:, None], np.ones(10))
    np.testing.assert_allclose(found, [1, 2], atol=0.05)


def test_a_keyframe_refines_to_itself():
    picture = crop_patches(textured(), 480, 125.0)
    origin = np.array([150.0, 120.0])
    found = refine_joints(picture.around(origin), picture, search(LIMB), BONES, origin)
    np.testing.assert_allclose(found, origin + LIMB * 125, atol=1e-9)


def test_appearance_pulls_estimates_to_where_the_picture_moved():
    keyframe = crop_patches(textured(), 480, 125.0)
    frame = crop_patches(textured((5, 3)), 480, 125.0)
    origin = np.array([150.0, 120.0])
    found = refine_joints(keyframe.around(origin), frame, search(LIMB), BONES, origin)
    np.testing.assert_allclose(found - (origin + LIMB * 125), np.tile([5, 3], (3, 1)), atol=1.01)


def test_limb_lengths_pull_back_a_displaced_joint():
    blank = crop_patches(np.full((360, 480, 3), 90, np.uint8), 480, 125.0)
    origin = np.array([150.0, 120.0])
    displaced = LIMB + np.array([[0, 0], [0, 0], [0.04, 0.04]])
    found = refine_joints(blank.around(origin), blank, search(displaced), BONES, origin)
    before, after = (np.linalg.norm(p[2] - p[1]) for p in (displaced * 125, found))
    assert abs(after - 125 * np.hypot(0.15, 0.15)) < abs(before - 125 * np.hypot(0.15, 0.15))


def test_missing_estimates_stay_missing():
    picture = crop_patches(textured(), 480, 125.0)
    estimate = LIMB.copy()
    estimate[1] = np.nan
    found = refine_joints(picture, picture, search(estimate), BONES, np.array([150.0, 120.0]))
    assert np.isnan(found[1]).all()
    assert np.isfinite(found[[0, 2]]).all()
