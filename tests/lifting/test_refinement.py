"""Facts about interpolation between key poses and about the fit to observed joints."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from keyrecon.body import LSP14
from keyrecon.lifting import terms
from keyrecon.lifting.foreshortening import INCLINATIONS, depth_share, log_densities
from keyrecon.lifting.interpolation import choose_control_frames, slerp, slerp_between
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.lifting.preprocessing import HUBER_DELTA, PreparedTracks, bridge_gaps, reject_spikes
from keyrecon.lifting.priors.anatomy import sideways_spread
from keyrecon.lifting.refinement import refine_motion, tilted_as
from keyrecon.lifting.solver import MotionState, Smoothness, solve
from keyrecon.lifting.terms import unseen_bend
from keyrecon.numerics.bone_directions import bone_vectors, pose_from_directions
from keyrecon.numerics.geometry import tangents, unit_vectors
from keyrecon.paper.gradient_descent import descend, keep_lengths, low_pass
from keyrecon.records import HalfKeyframes

LENGTHS = LSP14.lengths
LSP14_LEG = tuple(
    [LSP14.names[end] for _, end in LSP14.bones].index(name) for name in ("left_knee", "left_ankle")
)


def smooth_state(frames=60, seed=0):
    """A root and bone directions that move smoothly."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0, 1, frames)[:, None, None]
    ends = rng.normal(size=(3, 13, 3))
    directions = unit_vectors(ends[0] + 0.5 * time * ends[1] + 0.3 * np.sin(5 * time) * ends[2])
    return MotionState(0.2 * time[:, 0] * rng.normal(size=2), directions)


def positions(state):
    points = pose_from_directions(state.directions, LENGTHS, LSP14)
    points[..., :2] += state.root[:, None]
    return points


def half_keyframes(nearest, represented):
    nearest = np.asarray(nearest)
    return HalfKeyframes(
        frames=np.unique(nearest),
        nearest=nearest,
        distance=np.zeros(len(nearest)),
        represented=np.asarray(represented, dtype=bool),
        coverage=1.0,
        beta=1.0,
        printed_count=len(np.unique(nearest)),
    )


def test_slerp_keeps_unit_length_and_returns_its_ends():
    rng = np.random.default_rng(1)
    a, b = unit_vectors(rng.normal(size=(50, 3))), unit_vectors(rng.normal(size=(50, 3)))
    for share in (0.0, 0.3, 1.0):
        between = slerp(a, b, np.full(50, share))
        np.testing.assert_allclose(np.linalg.norm(between, axis=-1), 1.0)
    np.testing.assert_allclose(slerp(a, b, np.zeros(50)), a, atol=1e-9)
    np.testing.assert_allclose(slerp(a, b, np.ones(50)), b, atol=1e-9)


def test_slerp_moves_at_constant_speed():
    a, b = np.array([[1.0, 0, 0]]), unit_vectors(np.array([[0.2, 1.0, 0.5]]))
    whole = np.arccos((a * b).sum())
    third = slerp(a, b, np.array([1 / 3]))
    assert np.arccos((a * third).sum()) == pytest.approx(whole / 3)


def test_opposite_directions_turn_through_the_image_plane():
    toward, away = np.array([[0.0, 0, -1.0]]), np.array([[0.0, 0, 1.0]])
    middle = slerp(toward, away, np.array([0.5]))
    assert abs(middle[0, 2]) < 1e-9 and np.linalg.norm(middle) == pytest.approx(1.0)


def test_directions_are_held_outside_the_control_frames():
    poses = unit_vectors(np.random.default_rng(0).normal(size=(2, 1, 3)))
    between = slerp_between(poses, np.array([3, 6]), 10)
    np.testing.assert_allclose(between[:4], np.repeat(poses[:1], 4, axis=0))
    np.testing.assert_allclose(between[6:], np.repeat(poses[1:], 4, axis=0))


def test_control_points_never_part_further_than_their_reach():
    rng = np.random.default_rng(4)
    nearest = np.repeat(rng.permutation(20), 6)
    kept = choose_control_frames(half_keyframes(nearest, np.ones(120)), rng.random(120), 5)
    assert np.diff(kept).max() <= 5
    assert set(nearest[kept]) == set(nearest), "every run keeps a frame"


def test_the_best_frame_of_a_run_stays_and_the_worst_go_first():
    residual = np.array([0.0, 5, 4, 1, 4, 5, 0.0])
    kept = choose_control_frames(half_keyframes([0, 1, 1, 1, 1, 1, 2], np.ones(7)), residual, 10)
    np.testing.assert_array_equal(kept, [0, 3, 6])


def test_a_second_projection_leaves_lengths_alone():
    points = np.random.default_rng(2).normal(size=(20, 14, 3))
    project = keep_lengths(LENGTHS, LSP14)
    once = project(points)
    np.testing.assert_allclose(np.linalg.norm(bone_vectors(once, LSP14), axis=-1), [LENGTHS] * 20)
    np.testing.assert_allclose(project(once), once, atol=1e-12)


def test_the_truth_is_a_fixed_point_of_the_descent_up_to_the_filter():
    truth = positions(smooth_state(200))
    found = descend(truth, truth[..., :2], (keep_lengths(LENGTHS, LSP14), low_pass(0.5)), 0.2, 30)
    assert np.abs(found - truth)[10:-10].max() < 1e-3


def test_descent_filters_as_one_pass_whose_gain_follows_the_923_rule():
    frames, step = 2000, 0.2
    frequency = np.fft.rfftfreq(frames)
    impulse = np.zeros((frames, 1, 3))
    impulse[frames // 2] = 1.0
    gain = np.abs(np.fft.rfft(low_pass(0.5)(impulse)[:, 0, 0]))
    cut = frequency[np.argmin(np.abs(gain - 0.707 / (step + 0.707 * (1 - step))))]
    wave = np.sin(2 * np.pi * cut * np.arange(frames))
    observed = np.repeat(wave[:, None, None], 2, axis=2)
    start = np.zeros((frames, 1, 3))
    found = descend(start, observed, (low_pass(0.5),), step, 200)
    middle = slice(200, -200)
    loss = found[middle, 0, 0].std() / observed[middle, 0, 0].std()
    assert loss == pytest.approx(0.707, abs=0.01)


def known(joints, spread, delta=HUBER_DELTA):
    """Joints of which all are known equally well."""
    return PreparedTracks(
        joints, np.full(joints.shape[:2], spread), np.full(joints.shape[:2], delta)
    )


@pytest.mark.parametrize("name", ["reprojection", "breadth", "alignment"])
def test_slopes_agree_with_finite_differences(name):
    state = smooth_state(4)
    rng = np.random.default_rng(3)
    observed = positions(state)[..., :2] + rng.normal(0, 0.01, (4, 14, 2))
    term = {
        "reprojection": terms.reprojection(known(observed, 0.02, np.inf), LENGTHS, LSP14),
        "alignment": terms.alignment(np.linspace(0, 1, 13), 0.3),
        "breadth": terms.breadth(2, 3, 0.2, 0.01, LENGTHS, LSP14),
    }[name]
    line, step = term(state), 1e-6
    basis = tangents(state.directions)
    for bone in range(13):
        turn = np.zeros_like(state.directions)
        turn[:, bone] = step * basis[:, bone, :, 0]
        moved = term(MotionState(state.root, state.directions + turn)).residual
        slope = np.einsum("tmi,ti->tm", line.by_direction[:, :, bone], turn[:, bone] / step)
        np.testing.assert_allclose((moved - line.residual) / step, slope, atol=1e-3)
    if line.by_root is not None:
        moved = term(MotionState(state.root + np.array([step, 0.0]), state.directions)).residual
        np.testing.assert_allclose((moved - line.residual) / step, line.by_root[..., 0], atol=1e-3)


def test_the_pull_to_key_poses_is_the_slope_of_its_cost():
    state, wanted = smooth_state(3), smooth_state(3, seed=8).directions
    term, step = terms.key_pose_prior(wanted, 0.4, 0.7), 1e-6
    line = term(state)
    slope = np.einsum("tm,tmbi->tbi", line.residual, line.by_direction)
    for bone in (0, 7):
        nudged = state.directions.copy()
        nudged[1, bone, 2] += step
        change = (term(MotionState(state.root, nudged)).cost - line.cost) / step
        assert change == pytest.approx(slope[1, bone, 2], abs=1e-3)


def test_the_solver_returns_to_the_truth_from_a_disturbed_start():
    truth = smooth_state(80)
    observed = positions(truth)[..., :2]
    deep = np.sign(truth.directions[..., 2:]) * 0.2
    start = MotionState(
        truth.root + 0.02, unit_vectors(truth.directions + [0.05, -0.05, 0] + deep * [0, 0, 1])
    )
    term = terms.reprojection(known(observed, 0.005), LENGTHS, LSP14)
    smoothness = Smoothness.even(80, 1e2, 1e2 * LENGTHS**2)
    found = solve(start, [term], smoothness, 40, 1e-8)
    error = np.linalg.norm(positions(found) - positions(truth), axis=-1)
    assert np.median(error) < 0.005


def test_a_solver_step_never_raises_the_cost():
    truth = smooth_state(40)
    rng = np.random.default_rng(5)
    observed = positions(truth)[..., :2] + rng.normal(0, 0.05, (40, 14, 2))
    term = terms.reprojection(known(observed, 0.01), LENGTHS, LSP14)
    smoothness = Smoothness.even(40, 1e3, 1e3 * LENGTHS**2)
    costs = [term(solve(truth, [term], smoothness, rounds, 0.0)).cost for rounds in (0, 1, 3, 8)]
    assert costs[-1] < costs[0]


def test_what_a_person_marked_holds_against_outlying_neighbours():
    truth, wrist, marked = smooth_state(60), LSP14.index("right_wrist"), 30
    joints = positions(truth)[..., :2]
    displaced = joints.copy()
    displaced[20:41, wrist, 0] += 0.1
    displaced[marked] = joints[marked]
    off = {}
    for delta in (HUBER_DELTA, np.inf):
        observed = known(displaced, 0.02)
        observed.spread[marked], observed.huber_delta[marked] = 0.007, delta
        term = terms.reprojection(observed, LENGTHS, LSP14)
        found = solve(truth, [term], Smoothness.even(60, 1e4, 1e4 * LENGTHS**2), 20, 1e-6)
        off[delta] = np.linalg.norm(positions(found)[marked, wrist, :2] - joints[marked, wrist])
    assert off[np.inf] < 0.5 * off[HUBER_DELTA]


def test_gaps_are_bridged_by_straight_lines():
    values = np.array([0.0, np.nan, np.nan, 3.0, np.nan])[:, None, None]
    np.testing.assert_allclose(bridge_gaps(values)[:, 0, 0], [0, 1, 2, 3, 3])


def test_spikes_are_rejected_and_steady_offsets_are_not():
    residual = np.random.default_rng(6).normal(0, 0.01, (100, 2, 2))
    residual[:, 1] += 0.5
    residual[40, 0] += 0.3
    rejected = reject_spikes(residual, 9, 5.0)
    assert rejected[40, 0] and rejected.sum() <= 3


def test_expected_depth_is_taylors_without_noise():
    foreshortening = np.array([0.1, 0.5, 0.8, 0.95])
    found, _ = depth_share(foreshortening, np.full(4, 0.005))
    np.testing.assert_allclose(found, np.sqrt(1 - foreshortening**2), atol=0.01)


def test_long_lengths_in_the_picture_are_likelier_than_short_ones_up_to_the_full_length():
    foreshortening = np.array([0.3, 0.7, 0.97, 1.3])
    value = log_densities(foreshortening, np.full(4, 0.03))[0][INCLINATIONS.index(0.0)]
    assert value[0] < value[1] < value[2] and value[3] < value[0]


def test_what_a_length_in_the_picture_loses_when_the_bone_grows_is_its_slope():
    length = np.array([0.1, 0.3, 0.7, 0.97, 1.3, 2.5])
    for noise in (0.001, 0.011, 0.03, 0.2, 1.5):  # over the full length, in the table and beyond
        (low, _), (_, slope), (high, _) = (
            log_densities(length / full, np.full(6, noise / full))
            for full in np.exp([-1e-5, 0.0, 1e-5])
        )
        np.testing.assert_allclose((low - high) / 2e-5, slope, rtol=1e-3, atol=1e-3)


def test_balance_turns_a_leaning_body_upright_and_leaves_an_upright_one_alone():
    share = LENGTHS / LENGTHS.sum()
    leaning = np.tile(unit_vectors(np.array([0.0, -1.0, 0.3])), (5, 13, 1))
    upright = np.tile(unit_vectors(np.array([0.0, -1.0, -0.1])), (5, 13, 1))
    term = terms.balance(share, 0.1, 0.05)
    assert np.abs(term(MotionState(np.zeros((5, 2)), upright)).residual).max() < 1e-9
    solved = solve(
        MotionState(np.zeros((5, 2)), leaning), [term], Smoothness.even(5, 1.0, LENGTHS), 20, 1e-9
    )
    assert np.abs(term(solved).residual).max() < 0.01


def test_a_step_of_a_foot_that_rests_is_no_outlier():
    residual = np.random.default_rng(0).normal(0, 1e-4, (200, 1, 2))
    residual[90:96, 0, 1] -= 0.03 * np.sin(np.linspace(0, np.pi, 6))
    residual[150, 0] += 0.3
    assert np.flatnonzero(reject_spikes(residual, 9, 4.0, 0.0125)[:, 0]).tolist() == [150]


@pytest.mark.parametrize("angle", [0.0, 0.5])
def test_a_limb_that_looks_straight_is_straightened_and_a_bend_in_the_picture_stays(angle):
    thigh, shank = np.array([0.0, 0.95, 0.31]), np.array([np.sin(angle), 0.9, -0.3])
    directions = np.tile([thigh, shank], (6, 1, 1))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    term = unseen_bend((0, 1), directions, noise=0.12, weight=1.0)
    state = MotionState(np.zeros((6, 2)), directions)
    pull = np.abs(term(state).residual).max()
    assert pull > 1 if angle == 0 else pull < 1.3


def test_the_slope_of_an_unseen_bend_is_that_of_its_cost():
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(1, 3, 3))
    term = unseen_bend((0, 2), directions, noise=0.2, weight=0.7)
    at = MotionState(np.zeros((1, 2)), directions)
    line = term(at)
    gradient = np.einsum("tm,tmbi->tbi", line.residual, line.by_direction)
    for bone, axis in ((0, 2), (2, 2), (1, 2), (0, 0)):
        moved = directions.copy()
        moved[0, bone, axis] += 1e-6
        slope = (term(MotionState(np.zeros((1, 2)), moved)).cost - line.cost) / 1e-6
        assert slope == pytest.approx(gradient[0, bone, axis], abs=1e-4)


def swinging_arm(frames=120, fps=50.0):
    """A body that rests, but for one arm that swings by 170 degrees within 0.3 s."""
    state = MotionState(np.zeros((frames, 2)), np.tile(unit_vectors(np.ones(3)), (frames, 13, 1)))
    bones = [b for b, (_, end) in enumerate(LSP14.bones) if LSP14.names[end].startswith("right_")]
    arm = [b for b in bones if LSP14.names[LSP14.bones[b, 1]][6:] in ("elbow", "wrist")]
    angle = np.radians(170) / (1 + np.exp(-(np.arange(frames) - frames / 2) / (0.05 * fps)))
    swing = np.stack([np.cos(angle), np.sin(angle) * 0.8, np.sin(angle) * 0.6], axis=-1)
    state.directions[:, arm] = swing[:, None]
    return state


def test_a_stroke_keeps_its_speed_and_rest_stays_still():
    truth, wrist = swinging_arm(), LSP14.index("right_wrist")
    rng = np.random.default_rng(2)
    drift = gaussian_filter1d(rng.normal(0, 0.03, (120, 14, 2)), 4, axis=0)
    observed = known(positions(truth)[..., :2] + drift, 0.03)
    size = BodySize(LSP14, LENGTHS, np.array([0.145, 0.258]), np.full(120, 400.0))
    flat = np.linspace(truth.directions[0], truth.directions[-1], 120)
    found = refine_motion(truth, observed, unit_vectors(flat + 1e-6), size, 50.0)
    speed, wanted = (
        np.linalg.norm(np.diff(positions(state)[:, wrist], axis=0), axis=-1).max()
        for state in (found, truth)
    )
    assert 0.9 < speed / wanted < 1.1
    rest = np.diff(positions(found)[:40, LSP14.index("left_knee")], 2, axis=0)
    assert np.abs(rest).max() < 0.002


def test_a_stroke_that_the_key_poses_miss_is_as_right_at_high_frame_rates():
    """The same stroke, tracked as surely per second, from a pose that is held throughout."""
    off, wrist = [], LSP14.index("right_wrist")
    for fps in (50.0, 100.0, 240.0):
        frames = round(2.4 * fps)
        truth = swinging_arm(frames, fps)
        observed = known(positions(truth)[..., :2], 0.009 * np.sqrt(0.15 * fps))
        held = np.repeat(truth.directions[:1], frames, axis=0)
        size = BodySize(LSP14, LENGTHS, np.array([0.145, 0.258]), np.full(frames, 400.0))
        found = refine_motion(truth, observed, held, size, fps)
        away = np.linalg.norm(positions(found) - positions(truth), axis=2)[frames // 2 :, wrist]
        off.append(away.mean())
    assert max(off) < 1.35 * min(off)


def test_a_depth_prior_turns_a_bone_to_where_it_is_expected_and_nothing_else():
    state = smooth_state(5)
    shares = np.full((5, 13), np.nan)
    shares[:, 4] = 0.8 * state.directions[:, 4, 2]
    term = terms.depth_prior(shares, np.full(13, 0.1), 1.0)
    found = solve(state, [term], Smoothness.even(5, 1.0, 0 * LENGTHS), 30, 1e-12)
    np.testing.assert_allclose(found.directions[:, 4, 2], shares[:, 4], atol=1e-3)
    others = np.arange(13) != 4
    np.testing.assert_allclose(found.directions[:, others], state.directions[:, others], atol=1e-6)


def test_expected_depths_aretilted_as_the_motion_is():
    rng = np.random.default_rng(3)
    expected = unit_vectors(rng.normal(size=(50, 13, 3)))
    angle = np.radians(15)
    turn = np.array(
        [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
    )
    found = tilted_as(expected[..., 2], expected @ turn.T)
    before = np.abs(expected[..., 2] - (expected @ turn.T)[..., 2]).mean()
    assert np.abs(found - (expected @ turn.T)[..., 2]).mean() < 0.4 * before


def test_a_knee_seen_from_the_side_is_not_bent_in_depth():
    state = smooth_state(3)
    upright, hips = unit_vectors(np.array([0.1, 1.0, 0.0])), np.array([0.0, 0.0, 1.0])
    thigh, shank = LSP14_LEG
    state.directions[:, thigh] = unit_vectors(upright + 0.4 * hips)
    state.directions[:, shank] = unit_vectors(upright - 0.4 * hips)
    axis = np.tile(hips, (3, 1))
    legs = state.directions[:, thigh], state.directions[:, shank]
    spread = sideways_spread(*legs, axis)
    assert spread.max() < 0.1
    term = terms.hinge((thigh, shank), axis, spread, 1.0)
    found = solve(state, [term], Smoothness.even(3, 1.0, 1e-6 + 0 * LENGTHS), 30, 1e-12).directions
    np.testing.assert_allclose(found[:, thigh, 2], found[:, shank, 2], atol=1e-3)


def test_a_track_that_jumps_to_and_fro_is_not_followed():
    truth, wrist = swinging_arm(), LSP14.index("right_wrist")
    truth = MotionState(truth.root[:40], truth.directions[:40])
    joints = positions(truth)[..., :2].copy()
    joints[::4, wrist] += [0.15, 0.1]
    size = BodySize(LSP14, LENGTHS, np.array([0.145, 0.258]), np.full(40, 400.0))
    found = refine_motion(truth, known(joints, 0.03), truth.directions, size, 50.0)
    trembling = np.linalg.norm(np.diff(joints[:, wrist], 2, axis=0), axis=-1).mean()
    left = np.linalg.norm(np.diff(positions(found)[:, wrist], 2, axis=0), axis=-1).mean()
    assert left < 0.02 * trembling
