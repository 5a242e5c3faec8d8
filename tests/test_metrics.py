from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from keyrecon import metrics
from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.records import Motion

ROOT = (LSP14.index("right_hip"), LSP14.index("left_hip"))


@pytest.fixture
def figure():
    figure = np.random.default_rng(0).normal(0, 0.3, (30, 14, 3))
    figure.setflags(write=False)
    return figure


def motion_from(points, units="m"):
    frames = len(points)
    return Motion(
        skeleton=LSP14,
        points3d=points,
        points2d=100 * points[..., :2],
        points2d_propagated=100 * points[..., :2],
        confidence=np.ones(points.shape[:2]),
        source=np.zeros(points.shape[:2], dtype=np.int64),
        scale=np.full(frames, 100.0),
        fps=50.0,
        time=np.arange(frames) / 50,
        units=units,
        keyframes=np.array([0]),
    )


def truth_from(points, order=slice(None)):
    return {
        "points3d": points[:, order],
        "points2d": 100 * points[:, order, :2],
        "joint_names": np.array(LSP14.names)[order],
        "fps": np.array(50.0),
    }


def random_similarity(points, rng, mirror=False):
    """Each frame of `points` turned, scaled and shifted by its own similarity."""
    turns = Rotation.random(len(points), rng=rng).as_matrix()
    scale = rng.uniform(0.5, 2, (len(points), 1, 1))
    moved = scale * points @ np.swapaxes(turns, 1, 2) + rng.normal(0, 1, (len(points), 1, 3))
    return moved * [-1, 1, 1] if mirror else moved


def test_a_shifted_figure_has_no_error_after_root_alignment(figure):
    assert metrics.mpjpe(figure + np.array([1, 2, 3]), figure, ROOT) == pytest.approx(0, abs=1e-12)


def test_moving_one_of_fourteen_joints_by_14_mm_makes_an_error_of_1_mm(figure):
    moved = figure.copy()
    moved[:, LSP14.index("left_wrist"), 1] += 14
    assert metrics.mpjpe(moved, figure, ROOT) == pytest.approx(1)


def test_the_scaled_error_forgives_a_size_of_its_own_in_every_frame(figure):
    sizes = np.linspace(0.5, 2, len(figure))[:, None, None]
    assert metrics.n_mpjpe(sizes * figure, figure, ROOT) == pytest.approx(0, abs=1e-12)
    assert metrics.mpjpe(sizes * figure, figure, ROOT) > 0.05


def test_the_aligned_error_forgives_a_similarity_of_its_own_in_every_frame(figure):
    moved = random_similarity(figure, np.random.default_rng(1))
    assert metrics.pa_mpjpe(moved, figure) == pytest.approx(0, abs=1e-9)


def test_the_aligned_error_does_not_forgive_a_mirrored_figure(figure):
    moved = random_similarity(figure, np.random.default_rng(1), mirror=True)
    assert metrics.pa_mpjpe(moved, figure) > 0.05


def test_the_alignment_agrees_with_scipy_frame_by_frame(figure):
    noisy = figure + np.random.default_rng(2).normal(0, 0.05, figure.shape)
    ours = metrics.align_similarity(noisy, figure)
    for frame in range(3):
        a = noisy[frame] - noisy[frame].mean(axis=0)
        b = figure[frame] - figure[frame].mean(axis=0)
        turned = Rotation.align_vectors(b, a)[0].apply(a)
        scale = (turned * b).sum() / (turned**2).sum()
        assert np.allclose(ours[frame], scale * turned + figure[frame].mean(axis=0))


def test_unknown_truth_is_left_out_of_every_measure(figure):
    known = figure.copy()
    known[3:9, 7] = np.nan
    wrong = figure.copy()
    wrong[3:9, 7] += 100
    assert metrics.mpjpe(wrong, known, ROOT) == pytest.approx(0, abs=1e-12)
    assert metrics.n_mpjpe(figure, known, ROOT) == pytest.approx(0, abs=1e-12)
    assert metrics.pa_mpjpe(wrong, known) == pytest.approx(0, abs=1e-9)
    assert metrics.pck(wrong[..., :2], known[..., :2], (2, 9)) == 1


def test_an_estimate_with_gaps_has_no_mean_error(figure):
    gaps = figure.copy()
    gaps[3, 7] = np.nan
    assert np.isnan(metrics.mpjpe(gaps, figure, ROOT))
    assert np.isnan(metrics.pa_mpjpe(gaps, figure))


def test_constant_velocity_is_no_acceleration_error(figure):
    drift = np.arange(len(figure))[:, None, None] * np.array([0.1, 0.2, 0.3])
    assert metrics.acceleration_error(figure + drift, figure, ROOT) == pytest.approx(0, abs=1e-12)


def test_a_joint_that_jitters_by_1_every_other_frame_accelerates_by_4(figure):
    shaken = figure.copy()
    shaken[:, 7, 0] += np.where(np.arange(len(figure)) % 2, 1, -1)
    assert metrics.acceleration_error(shaken, figure, ROOT) == pytest.approx(4 / 14)


def test_an_error_that_is_constant_within_every_shot_is_no_acceleration_error(figure):
    wrong = figure.copy()
    wrong[12:, LSP14.index("left_wrist")] += 0.1  # the second shot has its own
    motion = replace(motion_from(wrong), cuts=np.array([12]))
    assert metrics.evaluate_motion(motion, truth_from(figure)).acceleration == pytest.approx(0)
    wrong[10:12] = np.nan  # nobody is seen at the end of the first
    motion = replace(motion, points3d=wrong, cuts=np.array([10, 12]))
    assert metrics.evaluate_motion(motion, truth_from(figure)).acceleration == pytest.approx(0)


@pytest.mark.parametrize("frames", [1, 2])
def test_two_frames_tell_nothing_of_acceleration(figure, frames):
    assert np.isnan(metrics.acceleration_error(figure[:frames], figure[:frames], ROOT))


def test_joints_count_as_correct_within_a_fifth_of_the_torso():
    truth = np.zeros((1, 4, 2))
    truth[0, 1] = [100, 0]
    points = truth + np.array([[0, 0], [0, 0], [19.9, 0], [20.1, 0]])
    assert metrics.pck(points, truth, (0, 1)) == 0.75


def test_a_joint_without_estimate_counts_as_missed():
    truth = np.array([[[0.0, 0], [100, 0]]])
    points = np.array([[[np.nan, 0], [100, 0]]])
    assert metrics.pck(points, truth, (0, 1)) == 0.5


def test_a_rigid_figure_has_limbs_of_constant_length(figure):
    turns = Rotation.random(30, rng=np.random.default_rng(4)).as_matrix()
    rigid = figure[:1] @ turns
    assert metrics.limb_variation(rigid, LSP14.bones).max() < 1e-12


def test_joints_are_matched_by_name_whatever_their_order(figure):
    order = np.random.default_rng(5).permutation(14)
    scores = metrics.evaluate_motion(motion_from(figure), truth_from(figure, order))
    assert scores.mpjpe == pytest.approx(0, abs=1e-9)
    assert scores.pck == 1
    assert scores.by_joint["left_wrist"] == pytest.approx(0, abs=1e-9)


def test_joints_that_only_the_truth_has_are_left_out(figure):
    truth = truth_from(figure)
    truth["joint_names"] = np.array([*LSP14.names[:-1], "nose"])
    scores = metrics.evaluate_motion(motion_from(figure), truth)
    assert "head_top" not in scores.by_joint
    assert scores.mpjpe == pytest.approx(0, abs=1e-9)


def test_a_motion_in_body_heights_is_scaled_to_the_truth_as_a_whole(figure):
    scores = metrics.evaluate_motion(motion_from(figure / 1.8, "body heights"), truth_from(figure))
    assert scores.scaled
    assert scores.mpjpe == pytest.approx(0, abs=1e-9)


def test_errors_of_a_motion_are_in_millimetres(figure):
    moved = figure.copy()
    moved[:, LSP14.index("left_wrist"), 1] += 0.014
    scores = metrics.evaluate_motion(motion_from(moved), truth_from(figure))
    assert scores.mpjpe == pytest.approx(1)
    assert scores.by_joint["left_wrist"] == pytest.approx(14)


def test_where_the_true_hip_is_unknown_no_joint_has_an_error_and_all_others_keep_theirs(figure):
    moved, true = figure.copy(), figure.copy()
    moved[:, LSP14.index("left_wrist"), 1] += 0.014
    true[3, LSP14.index("right_hip")] = np.nan
    scores = metrics.evaluate_motion(motion_from(moved), truth_from(true))
    assert scores.mpjpe == pytest.approx(1)
    assert scores.by_joint["left_wrist"] == pytest.approx(14)
    assert scores.by_joint["neck"] == pytest.approx(0, abs=1e-9)


def test_a_truth_of_another_length_is_refused(figure):
    with pytest.raises(KeyreconError, match="30 frames and the truth 20"):
        metrics.evaluate_motion(motion_from(figure), truth_from(figure[:20]))


def test_a_truth_without_hips_is_refused(figure):
    truth = truth_from(figure)
    truth["joint_names"] = np.array([f"p{i}" for i in range(14)])
    with pytest.raises(KeyreconError, match="left_hip, left_shoulder, right_hip"):
        metrics.evaluate_motion(motion_from(figure), truth)


def test_truth_comes_back_from_its_file(tmp_path, figure):
    np.savez(tmp_path / "truth.npz", height_m=1.8, **truth_from(figure))
    truth = metrics.read_truth(tmp_path / "truth.npz")
    assert np.array_equal(truth["points3d"], figure)
    assert truth["height_m"] == 1.8


def test_files_that_are_no_truth_are_refused(tmp_path, figure):
    path = tmp_path / "truth.npz"
    with pytest.raises(KeyreconError, match="not a truth"):
        metrics.read_truth(path)
    path.write_text("hello")
    with pytest.raises(KeyreconError, match="not a truth"):
        metrics.read_truth(path)
    np.savez(path, points3d=figure)
    with pytest.raises(KeyreconError, match="no fps, joint_names, points2d"):
        metrics.read_truth(path)
    np.savez(path, **{**truth_from(figure), "points2d": figure})
    with pytest.raises(KeyreconError, match="do not fit"):
        metrics.read_truth(path)
