"""Facts about lifting: from joints in the picture to a motion in space."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.optimize import OptimizeResult, minimize
from swinging_figure import BREADTHS, standing_directions, swinging_motion, turned

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.lifting import limb_lengths
from keyrecon.lifting.depth_evidence import (
    DepthSignOptions,
    ForeshortenedBones,
    at_rate,
    sign_states,
)
from keyrecon.lifting.depth_signs import choose_depth_signs, second_order_path
from keyrecon.lifting.lifting import LiftOptions, lift_motion
from keyrecon.lifting.limb_lengths import estimate_lengths
from keyrecon.lifting.priors import anatomy
from keyrecon.lifting.taylor import foreshorten_bones, lift_foreshortened
from keyrecon.numerics.bone_directions import bone_vectors, pose_from_directions
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.records import Annotations, HalfKeyframes, JointTracks, Keyframes

SCALE = 400.0


def scene(frames=240, every=12, noise=0.0, signs=True, seed=0):
    """Truth, tracks, annotations and keyframes of a swinging figure."""
    directions = swinging_motion(frames, seed)
    truth = pose_from_directions(directions, LSP14.lengths, LSP14)
    rng = np.random.default_rng(seed)
    picture = SCALE * truth[..., :2] + [600.0, 200.0]
    joints = picture + rng.normal(0, noise * SCALE, picture.shape)
    at = np.arange(every // 2, frames, every)
    joints[at] = picture[at]
    nearer = -np.sign(directions[at, :, 2]).astype(np.int64) * signs
    marks = Annotations(LSP14, at, picture[at], np.ones((len(at), 14), bool), nearer)
    nearest = at[np.abs(np.arange(frames)[:, None] - at).argmin(axis=1)]
    apart = np.abs(np.arange(frames) - nearest).astype(float)
    half = HalfKeyframes(
        frames=at,
        nearest=nearest,
        distance=apart,
        represented=apart < every / 3,
        coverage=1.0,
        beta=every / 3,
        printed_count=len(at),
    )
    tracks = JointTracks(joints, np.ones((frames, 14)))
    for array in (joints, marks.joints, nearer, tracks.confidence):
        array.setflags(write=False)
    return truth, tracks, marks, Keyframes(half, half, 10, 0.95)


def aligned_error(points, truth):
    """Mean distance after removing the mean position, body heights."""
    a, b = points - points.mean(1, keepdims=True), truth - truth.mean(1, keepdims=True)
    return np.linalg.norm(a - b, axis=-1).mean()


def test_a_projected_pose_with_known_signs_comes_back():
    directions = unit_vectors(np.random.default_rng(1).normal(size=(40, 13, 3)))
    truth = pose_from_directions(directions, LSP14.lengths, LSP14)
    bones = foreshorten_bones(truth[..., :2], np.full((40, 14), 1e-4), LSP14.lengths, LSP14)
    sign = np.where(directions[..., 2] > 0, 1, -1)
    lifted = pose_from_directions(lift_foreshortened(bones, sign), LSP14.lengths, LSP14)
    assert np.linalg.norm(lifted - truth, axis=-1).max() < 0.02


def test_a_bone_longer_in_the_picture_than_in_life_lies_nearly_in_the_image_plane():
    joints = np.zeros((1, 14, 2))
    joints[0, LSP14.index("right_wrist")] = [0.16, 0.0]
    bones = foreshorten_bones(joints, np.full((1, 14), 0.003), LSP14.lengths, LSP14)
    bone = [c for _, c in LSP14.bones].index(LSP14.index("right_wrist"))
    assert bones.depth[0, bone] < 0.25 * LSP14.lengths[bone]


def test_a_bone_with_a_missing_end_keeps_a_finite_depth():
    joints = np.zeros((1, 14, 2))
    joints[0, LSP14.index("left_ankle")] = np.nan
    bones = foreshorten_bones(joints, np.full((1, 14), 0.01), LSP14.lengths, LSP14)
    assert np.isfinite(bones.in_plane).all() and np.isfinite(bones.depth).all()


def price_of_body(vectors):
    """All joint limits of whole poses, added up without any regard to the tree."""
    bone = {LSP14.names[c]: b for b, (_, c) in enumerate(LSP14.bones)}
    corners = [f"{side}_{name}" for name in ("hip", "shoulder") for side in ("right", "left")]
    trunk = vectors[:, [bone[name] for name in corners]]
    hips, shoulders, up = anatomy.trunk_axes(trunk)
    directions = unit_vectors(vectors)
    cost = anatomy.trunk_cost(trunk, BREADTHS)
    cost += anatomy.head_cost(shoulders, up, directions[:, bone["head_top"]])
    for side, sign in (("right", 1), ("left", -1)):
        thigh, shank, upper, forearm = (
            directions[:, bone[f"{side}_{name}"]] for name in ("knee", "ankle", "elbow", "wrist")
        )
        cost += anatomy.leg_cost(hips, up, thigh, shank, sign)
        cost += anatomy.arm_cost(shoulders, up, upper, forearm, sign)
    return cost


def test_a_hanging_arm_bends_its_forearm_forward_rather_than_back():
    right, up, forward = (sign * np.eye(3)[[axis]] for axis, sign in ((0, 1), (1, -1), (2, 1)))
    forwards, backwards = unit_vectors(-up + forward), unit_vectors(-up - forward)
    usual = anatomy.arm_cost(right, up, -up, forwards, 1)
    assert (usual < anatomy.arm_cost(right, up, -up, backwards, 1) - 1).all()


def test_left_and_right_limbs_cost_the_same_in_the_mirror():
    rng = np.random.default_rng(5)
    upper, lower = unit_vectors(rng.normal(size=(2, 20, 3)))
    right, up, flip = np.eye(3)[0], -np.eye(3)[1], np.array([-1.0, 1.0, 1.0])
    for price in (anatomy.arm_cost, anatomy.leg_cost):
        here = price(right, up, upper, lower, 1)
        there = price(right, up, upper * flip, lower * flip, -1)
        assert np.allclose(here, there)


def test_a_trunk_that_leans_forward_is_likelier_than_its_mirror_image():
    right, down = np.eye(3)[[0]], np.eye(3)[[1]]
    toward_camera = np.array([[0.0, 0.0, -1.0]])
    ahead = unit_vectors(-down + 0.3 * toward_camera)
    back = unit_vectors(-down - 0.3 * toward_camera)
    assert (anatomy.lean_cost(-right, ahead) < anatomy.lean_cost(-right, back)).all()


def test_keyframes_take_their_signs_from_the_frames_around_them():
    truth, tracks, marks, keyframes = scene(signs=False)
    lifted = lift_motion(tracks, marks, keyframes, np.full(len(truth), SCALE), 50.0)
    depth = bone_vectors(truth, LSP14)[marks.frames][..., 2]
    deep = np.abs(depth) > 0.4 * LSP14.lengths
    assert (lifted.signs == -np.sign(depth))[deep].mean() > 0.85


def test_half_the_frame_rate_gives_a_frame_twice_the_say_and_four_times_the_jump():
    once, slow = DepthSignOptions(), at_rate(DepthSignOptions(), 25.0)
    assert at_rate(once, 50.0) == once
    assert slow.joint_limits == 2 * once.joint_limits
    assert slow.acceleration == 4 * once.acceleration


def bare(flat, depth):
    """Bones of which only the picture is known."""
    return ForeshortenedBones(flat, depth, np.full(depth.shape, 0.01), np.full(depth.shape, np.nan))


def test_signs_are_the_cheapest_of_all_sign_vectors():
    rng = np.random.default_rng(3)
    directions = unit_vectors(standing_directions() + 0.4 * rng.normal(size=(3, 13, 3)))
    flat = LSP14.lengths[:, None] * directions[..., :2]
    depth = np.abs(LSP14.lengths * directions[..., 2])
    bones = bare(flat, depth)
    nearer = np.zeros((3, 13), dtype=np.int64)
    chosen = choose_depth_signs(bones, nearer, BREADTHS, LSP14).sign
    every = np.array(list(product((1, -1), repeat=13)))
    for pose in range(3):
        vectors = np.concatenate(
            [
                np.broadcast_to(bones.in_plane[pose], (len(every), 13, 2)),
                (every * depth[pose])[..., None],
            ],
            axis=-1,
        )
        cost = price_of_body(vectors)
        found = np.flatnonzero((every == chosen[pose]).all(axis=1))[0]
        assert cost[found] == pytest.approx(cost.min())


def test_the_sign_path_is_the_cheapest_of_all_paths():
    rng = np.random.default_rng(5)
    cost = rng.uniform(0, 1, (6, 2))
    depth = sign_states(1)[None] * rng.uniform(0.02, 0.2, (6, 1, 1))
    depth_spread = rng.uniform(0.01, 0.05, (6, 1))
    options = DepthSignOptions()

    def price(path):
        z = depth[np.arange(6), list(path), 0]
        jumps = np.diff(z, 2) ** 2 / (2 * (options.acceleration**2 + depth_spread[1:-1, 0] ** 2))
        return cost[np.arange(6), list(path)].sum() + np.minimum(jumps, options.max_jump_cost).sum()

    found = second_order_path(cost, depth[:, 0], depth_spread, options)
    assert price(found) == pytest.approx(min(price(p) for p in product((0, 1), repeat=6)))


def test_knees_bend_backwards_whichever_way_the_figure_faces():
    lifted = standing_directions()
    names = [LSP14.names[c] for _, c in LSP14.bones]
    shanks = [names.index(f"{side}_ankle") for side in ("right", "left")]
    lifted[shanks] = unit_vectors(np.array([0.0, 0.8, 0.6]))
    for yaw in (0.4, -0.5, 2.6):
        directions = turned(lifted, yaw)[None]
        flat = LSP14.lengths[:, None] * directions[..., :2]
        bones = bare(flat, np.abs(LSP14.lengths * directions[..., 2]))
        chosen = choose_depth_signs(bones, np.zeros((1, 13), np.int64), BREADTHS, LSP14)
        np.testing.assert_array_equal(chosen.sign[0, shanks], np.sign(directions[0, shanks, 2]))


def test_the_expected_depth_tells_apart_what_looks_the_same():
    names = [LSP14.names[c] for _, c in LSP14.bones]
    arms = [
        names.index(f"{side}_{end}") for side in ("right", "left") for end in ("elbow", "wrist")
    ]
    nobody = np.zeros((1, 13), np.int64)
    alone, expected = [], []
    for side in (1, -1):
        directions = standing_directions()[None]
        directions[:, arms] = unit_vectors(np.array([0.1, 0.6, 0.8 * side]))
        flat, dz = LSP14.lengths[:, None] * directions[..., :2], LSP14.lengths * directions[..., 2]
        bones = bare(flat, np.abs(dz))
        alone.append(choose_depth_signs(bones, nobody, BREADTHS, LSP14).sign[0, arms])
        known = choose_depth_signs(replace(bones, expected_depth=dz), nobody, BREADTHS, LSP14)
        expected.append(known.sign[0, arms])
    np.testing.assert_array_equal(alone[0], alone[1])
    np.testing.assert_array_equal(expected[0], 1)
    np.testing.assert_array_equal(expected[1], -1)


def test_annotated_signs_are_kept():
    rng = np.random.default_rng(7)
    directions = unit_vectors(standing_directions() + 0.3 * rng.normal(size=(5, 13, 3)))
    flat = LSP14.lengths[:, None] * directions[..., :2]
    bones = bare(flat, np.abs(LSP14.lengths * directions[..., 2]))
    nearer = rng.choice([-1, 1], (5, 13))
    chosen = choose_depth_signs(bones, nearer, BREADTHS, LSP14, DepthSignOptions(annotated=1e3))
    np.testing.assert_array_equal(chosen.sign, -nearer)


def test_lengths_and_scale_come_from_the_picture():
    truth, tracks, marks, _ = scene(noise=0.01)
    size = estimate_lengths(tracks, marks, np.full(240, 0.88 * SCALE), 50.0)
    true = np.linalg.norm(bone_vectors(truth, LSP14), axis=-1).mean(axis=0)
    apparent = size.lengths * np.median(size.scale)
    across = [c in (8, 9) for _, c in LSP14.bones]  # shoulders: seen from the front only
    off = np.abs(apparent / (true * SCALE) - 1)
    assert off[np.logical_not(across)].max() < 0.12
    assert np.abs(size.scale / np.median(size.scale) - 1).max() < 0.05
    np.testing.assert_array_equal(size.lengths, size.lengths[LSP14.bone_mirror])


def test_a_search_for_lengths_that_fails_leaves_the_table_and_says_so(monkeypatch, caplog):
    _, tracks, marks, _ = scene(frames=60)

    def fail(cost, start, **_):
        lost = np.full(len(start), np.nan)
        return OptimizeResult(x=lost, fun=np.nan, success=False, message="ABNORMAL")

    monkeypatch.setattr(limb_lengths, "minimize", fail)
    size = estimate_lengths(tracks, marks, np.full(60, 0.88 * SCALE), 50.0)
    np.testing.assert_allclose(size.lengths, LSP14.lengths)
    assert np.isfinite(size.scale).all()
    assert "did not converge (ABNORMAL); the table's proportions are used" in caplog.text


def test_a_search_that_stops_early_keeps_what_it_gained(monkeypatch, caplog):
    _, tracks, marks, _ = scene(frames=60, noise=0.01)
    height = np.full(60, 0.88 * SCALE)
    found = estimate_lengths(tracks, marks, height, 50.0)

    def stop(cost, start, **settings):
        return OptimizeResult(minimize(cost, start, **settings), success=False, message="LIMIT")

    monkeypatch.setattr(limb_lengths, "minimize", stop)
    np.testing.assert_array_equal(
        estimate_lengths(tracks, marks, height, 50.0).lengths, found.lengths
    )
    assert "did not converge (LIMIT); its last step is used" in caplog.text


def test_lengths_of_nothing_are_refused():
    _, tracks, marks, _ = scene(frames=60)
    nothing = replace(tracks, joints=np.full_like(tracks.joints, np.nan))
    unmarked = replace(marks, joints=np.full_like(marks.joints, np.nan))
    with pytest.raises(KeyreconError, match="No bone has both ends"):
        estimate_lengths(nothing, unmarked, np.full(60, 350.0), 50.0)


def test_a_motion_is_lifted_from_keyframes_and_tracks():
    truth, tracks, marks, keys = scene(frames=150, noise=0.005)
    found = lift_motion(tracks, marks, keys, np.full(150, 0.88 * SCALE), 50.0)
    assert aligned_error(found.points3d, truth) < 0.035
    back = found.scale[:, None, None] * found.points3d[..., :2]
    np.testing.assert_allclose(back, found.points2d, atol=1e-6)


def test_bone_lengths_are_constant_and_alike_left_and_right():
    _, tracks, marks, keys = scene(frames=120, noise=0.01)
    for method in ("trajectory", "paper"):
        options = LiftOptions(height=1.8, method=method)
        found = lift_motion(tracks, marks, keys, np.full(120, 0.88 * SCALE), 50.0, options=options)
        lengths = np.linalg.norm(bone_vectors(found.points3d, LSP14), axis=-1)
        assert (lengths.std(axis=0) / lengths.mean(axis=0)).max() < 1e-6
        np.testing.assert_allclose(lengths[0], lengths[0][LSP14.bone_mirror], rtol=1e-6)


def test_a_height_in_metres_scales_the_motion_and_nothing_else():
    _, tracks, marks, keys = scene(frames=100, noise=0.005)
    height = np.full(100, 0.88 * SCALE)
    plain = lift_motion(tracks, marks, keys, height, 50.0)
    metres = lift_motion(tracks, marks, keys, height, 50.0, options=LiftOptions(height=1.9))
    np.testing.assert_allclose(metres.points3d, 1.9 * plain.points3d, rtol=1e-9)
    np.testing.assert_allclose(metres.points2d, plain.points2d, rtol=1e-9)


def test_gross_outliers_change_little():
    truth, tracks, marks, keys = scene(frames=150, noise=0.005)
    rng = np.random.default_rng(2)
    joints = tracks.joints.copy()
    outlier = rng.random(joints.shape[:2]) < 0.05
    outlier[marks.frames] = False
    joints[outlier] += rng.normal(0, 0.15 * SCALE, (outlier.sum(), 2))
    height = np.full(150, 0.88 * SCALE)
    clean = lift_motion(tracks, marks, keys, height, 50.0)
    disturbed = lift_motion(JointTracks(joints, tracks.confidence), marks, keys, height, 50.0)
    assert aligned_error(disturbed.points3d, truth) < aligned_error(clean.points3d, truth) + 0.008
    assert disturbed.rejected[outlier].mean() > 0.6


def test_the_inputs_are_left_as_they_were():
    _, tracks, marks, keys = scene(frames=60)
    before = tracks.joints.copy()
    lift_motion(tracks, marks, keys, np.full(60, 0.88 * SCALE), 50.0)
    np.testing.assert_array_equal(before, tracks.joints)


def test_missing_annotations_are_reported():
    _, tracks, marks, keys = scene(frames=60)
    nothing = Annotations(
        LSP14, marks.frames[:0], marks.joints[:0], marks.visible[:0], marks.nearer[:0]
    )
    with pytest.raises(KeyreconError, match="No keyframe is marked"):
        lift_motion(tracks, nothing, keys, np.full(60, 350.0), 50.0)
