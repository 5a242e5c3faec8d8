"""Outlines that ride on bones, their correspondence, and least squares over them."""

import numpy as np
from capsule_player import scene, standing, turned

from keyrecon.body import LSP14
from keyrecon.propagation.body_frame import stabilise_player
from keyrecon.propagation.correspondence import index_elements, match_elements
from keyrecon.propagation.edge_template import (
    AnnotatedPoses,
    assign_to_bones,
    make_edge_templates,
    pose_templates,
)
from keyrecon.propagation.foot_evidence import foot_equations, learn_foot_offsets
from keyrecon.propagation.half_body import split_body
from keyrecon.propagation.normal_equations import add_joint_observations, add_observations
from keyrecon.propagation.registration import FittedFigures, register_templates
from keyrecon.propagation.scoring import find_unexplained_edges, score_templates
from keyrecon.propagation.selection import LimbStates, choose_two
from keyrecon.propagation.trajectory_smoothing import couple_frames, solve_banded_chain

LOWER, UPPER = split_body(LSP14)


def puppets_of(preparation, truth, frames, half):
    """Puppets of the truth on some frames, and the index of all elements."""
    window = stabilise_player(preparation.track, preparation.camera)
    rows = np.array(frames)
    joints = window.from_pixels(truth[rows][:, half.joints], rows[:, None])
    poses = AnnotatedPoses(half, rows, joints, np.ones(joints.shape, bool))
    edges = preparation.contours.edges
    return make_edge_templates(edges, window, poses, 400), index_elements(edges, window), window


def test_the_halves_share_out_all_joints_and_mirror_each_other():
    own = [half.joints[half.own] for half in (LOWER, UPPER)]
    assert sorted(np.concatenate(own)) == list(range(14))
    for half in (LOWER, UPPER):
        one, other = (half.joints[list(side)] for side in half.sides)
        np.testing.assert_array_equal(LSP14.mirror[one], other)
        assert (half.bone_mirror[half.bone_mirror] == np.arange(len(half.bones))).all()


def test_elements_ride_on_the_bone_they_outline():
    preparation, truth = scene([standing()], (0,))
    window = stabilise_player(preparation.track, preparation.camera)
    pose = window.from_pixels(truth[0][UPPER.joints], 0)
    riders = assign_to_bones(preparation.contours.edges[0], window, 0, pose, UPPER)
    wrists = [LSP14.index("right_wrist"), LSP14.index("left_wrist")]
    forearm = np.isin(UPPER.joints[UPPER.bones[riders.bone, 1]], wrists)
    assert forearm[riders.color == 2].mean() > 0.9
    widths = np.abs(riders.offset[forearm & (riders.color == 2)])
    np.testing.assert_allclose(np.median(widths), 0.025 / 0.98, rtol=0.05)


def test_a_puppet_in_its_own_pose_lies_on_its_own_elements():
    preparation, truth = scene([standing()], (0,))
    puppets, index, _ = puppets_of(preparation, truth, (0,), UPPER)
    every = np.zeros(1, int)
    figures = FittedFigures(every, every, puppets.poses.joints)
    posed = pose_templates(puppets, every, puppets.poses.joints)
    row, found = match_elements(index, every, posed, 0.05)
    own = posed.color >= 0
    assert found[own].mean() > 0.9
    assert np.abs(index.points[row] - posed.points)[found].max() < 0.02
    assert score_templates(puppets, index, figures).max() < 0.35


def test_matches_have_the_same_colour_and_direction():
    preparation, truth = scene([standing()], (0,))
    puppets, index, _ = puppets_of(preparation, truth, (0,), LOWER)
    every = np.zeros(1, int)
    posed = pose_templates(puppets, every, puppets.poses.joints + 0.03j)
    row, found = match_elements(index, every, posed, 0.06)
    assert (index.color[row] == posed.color)[found].all()
    turn = np.abs(np.angle(index.tangent[row] / posed.tangent))[found]
    assert turn.max() < np.pi / 2


def test_a_fit_turns_a_limb_back_onto_its_edges():
    bent = turned(standing(), "left_elbow", ("left_wrist",), -0.35)
    preparation, truth = scene([standing(), bent], (0,))
    puppets, index, window = puppets_of(preparation, truth, (0,), UPPER)
    one = np.ones(1, int)
    found = register_templates(
        puppets, index, FittedFigures(one, one - 1, puppets.poses.joints)
    ).joints
    away = np.abs(found[0] - window.from_pixels(truth[1][UPPER.joints], 1))
    assert away[UPPER.own].max() < 0.02


def test_an_arm_elsewhere_leaves_edges_unexplained():
    bent = turned(standing(), "left_shoulder", ("left_elbow", "left_wrist"), -1.2)
    preparation, truth = scene([standing(), bent], (0,))
    puppets, index, _ = puppets_of(preparation, truth, (0, 1), UPPER)
    first = np.zeros(2, int)
    far = find_unexplained_edges(puppets, index, FittedFigures(first, first, puppets.poses.joints))
    left = far.min(axis=1).sum(axis=1)
    assert left[0] < 0.5 * left[1]


def test_sides_are_chosen_for_continuity():
    # two limbs cross; each proposal names them the wrong way round half of the time
    path = np.linspace(-1, 1, 21)
    one, other = path + 0.3j, -path - 0.3j
    swapped = np.arange(21) % 2 == 1
    first, second = np.where(swapped, other, one), np.where(swapped, one, other)
    joints = np.stack([first, second], axis=1)[:, :, None]
    cost = np.zeros((21, 2))
    cost[0] = [0, 5]
    spread = np.array([0.2])
    clash = 9 * np.tile(np.eye(2), (21, 1, 1))
    a, b = choose_two(
        LimbStates(joints, cost, spread), LimbStates(joints, cost[:, ::-1].copy(), spread), clash
    )
    np.testing.assert_array_equal(a, swapped)
    np.testing.assert_array_equal(b, ~swapped)


def test_weighted_rows_are_least_squares():
    rng = np.random.default_rng(1)
    mixture = rng.normal(size=(1, 9, 3))
    target = rng.normal(size=(1, 9)) + 1j * rng.normal(size=(1, 9))
    axis = np.exp(1j * rng.uniform(0, 6, (1, 9)))
    along, across = rng.uniform(0.1, 2, (2, 1, 9))
    found = add_observations(mixture, target, axis, along, across).solve()[0]
    rows, right = [], []
    for m, q, n, strong, weak in zip(
        mixture[0], target[0], axis[0], along[0], across[0], strict=True
    ):
        for direction, weight in ((n, strong), (1j * n, weak)):
            rows.append(np.sqrt(weight) * np.concatenate([direction.real * m, direction.imag * m]))
            right.append(np.sqrt(weight) * (q * np.conj(direction)).real)
    slow = np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0]
    np.testing.assert_allclose(found, slow[:3] + 1j * slow[3:], atol=1e-6)


def test_the_chain_equals_dense_least_squares():
    rng = np.random.default_rng(2)
    target = rng.normal(size=(7, 2)) + 1j * rng.normal(size=(7, 2))
    weight, calm = rng.uniform(0.5, 2, (7, 2)), np.array([0.5, 2.0])
    found = solve_banded_chain(couple_frames(add_joint_observations(target, weight), calm))
    second = np.diff(np.eye(7), 2, axis=0)
    for joint in range(2):
        matrix = np.diag(weight[:, joint]) + second.T @ second / calm[joint] ** 2
        slow = np.linalg.solve(matrix, weight[:, joint] * target[:, joint])
        np.testing.assert_allclose(found[:, joint], slow, atol=1e-6)


def test_the_window_follows_a_panning_camera():
    preparation, truth = scene([standing()] * 9, (0,), origin=(600 + 30.0 * np.arange(9))[:, None])
    window = stabilise_player(preparation.track, preparation.camera)
    back = window.to_pixels(window.from_pixels(truth, np.arange(9)[:, None]), np.arange(9)[:, None])
    np.testing.assert_allclose(back, truth)


def test_each_foot_speaks_to_the_leg_it_fits():
    ankles = np.array([[-0.2 + 1j, 0.2 + 1j], [0.1 + 1j, -0.1 + 1j]])
    joints = np.zeros((2, 6), complex)
    ends = np.array([max(side, key=lambda j: LOWER.depth[j]) for side in LOWER.sides])
    joints[:, ends] = ankles
    tracked = np.array([[0.23 + 1.02j, -0.17 + 1.02j], [0.13 + 1.02j, -0.07 + 1.02j]])
    feet = learn_foot_offsets(LOWER, np.arange(2), joints, tracked)
    seen = foot_equations(feet, np.arange(2), joints + 0.02).solve()[:, ends]
    np.testing.assert_allclose(seen, ankles, atol=1e-6)
    far = foot_equations(feet, np.arange(2), joints + 0.5j).matrix
    assert far.max() < 0.01 * foot_equations(feet, np.arange(2), joints).matrix.max()
