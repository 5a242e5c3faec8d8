import numpy as np

from keyrecon.keyframes.smoothing import smooth_distances


def noisy_poses(count=120, kinds=3, noise=0.002, seed=0):
    """(clean distances, noisy ones): few poses that come back, seen with noise."""
    rng = np.random.default_rng(seed)
    pose = rng.integers(kinds, size=count)
    clean = 0.03 * np.abs(pose[:, None] - pose[None]).astype(float)
    error = noise * np.abs(rng.normal(size=clean.shape))
    noisy = clean + (error + error.T) / 2
    np.fill_diagonal(noisy, 0)
    return clean, noisy


def test_averaging_over_frames_of_the_same_pose_lessens_noise():
    clean, noisy = noisy_poses()
    same = clean == 0.03
    spread = {
        "noisy": noisy[same].std(),
        **{form: smooth_distances(noisy, 0.01, form)[same].std() for form in ("both", "mean")},
    }
    assert spread["both"] < spread["mean"] / 2 < spread["noisy"] / 2


def test_both_forms_are_the_products_they_stand_for():
    _, noisy = noisy_poses(30)
    near = noisy < 0.01
    averaging = near / near.sum(axis=1, keepdims=True)
    both = averaging @ noisy @ averaging.T
    mean = (averaging @ noisy + noisy @ averaging.T) / 2
    for product, form in ((both, "both"), (mean, "mean")):
        np.fill_diagonal(product, 0)
        assert np.allclose(smooth_distances(noisy, 0.01, form), product)


def test_few_and_many_neighbours_are_averaged_alike():
    _, noisy = noisy_poses(200, kinds=40)  # one frame in forty is near: the sparse product
    near = noisy < 0.01
    averaging = near / near.sum(axis=1, keepdims=True)
    product = averaging @ noisy @ averaging.T
    np.fill_diagonal(product, 0)
    assert near.mean() < 0.1
    assert np.allclose(smooth_distances(noisy, 0.01), product)


def test_nothing_changes_when_no_two_frames_are_near():
    _, noisy = noisy_poses(20)
    before = noisy.copy()
    assert np.allclose(smooth_distances(noisy, 0.0), noisy)
    assert np.array_equal(noisy, before)


def test_smoothing_both_factors_of_a_product_smooths_the_product():
    rng = np.random.default_rng(1)
    members, offered = rng.random((20, 50)), rng.random((50, 20))
    averaging = rng.random((20, 20))
    product = averaging @ (members @ offered) @ averaging.T
    assert np.allclose((averaging @ members) @ (offered @ averaging.T), product)
