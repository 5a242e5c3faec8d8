"""Edge templates, their correspondence, and least squares over joints."""

from dataclasses import replace

import numpy as np
from capsule_player import scene, standing, turned

from keyrecon.body import LSP14
from keyrecon.propagation.body_frame import stabilise_player
from keyrecon.propagation.correspondence import (
    TemplateFits,
    index_elements,
    match_elements,
    pose_templates,
    score_bones,
    score_fits,
)
from keyrecon.propagation.edge_template import (
    AnnotatedPoses,
    assign_to_bones,
    feet_in_sight,
    learn_foot_offsets,
    make_edge_templates,
)
from keyrecon.propagation.half_body import split_body
from keyrecon.propagation.registration import (
    foot_equations,
    joint_equations,
    point_equations,
    register_templates,
)
from keyrecon.propagation.selection import LimbStates, choose_limb_pair
from keyrecon.propagation.trajectory_smoothing import solve_smooth

LOWER, UPPER = split_body(LSP14)


def templates_of(preparation, truth, frames, half):
    """Templates of the truth on some frames, the index of all elements, player coordinates."""
    body_frame = stabilise_player(preparation.track, preparation.camera, preparation.video.fps)
    rows = np.array(frames)
    joints = body_frame.from_pixels(truth[rows][:, half.joints], rows[:, None])
    poses = AnnotatedPoses(
        half, rows, joints, np.ones(joints.shape, bool), np.full(len(half.bones), np.inf)
    )
    edges = preparation.edges
    return (
        make_edge_templates(edges, body_frame, poses, 400),
        index_elements(edges, body_frame),
        body_frame,
    )


def test_the_halves_share_out_all_joints_and_mirror_each_other():
    free = [half.joints[half.free] for half in (LOWER, UPPER)]
    assert sorted(np.concatenate(free)) == list(range(14))
    for half in (LOWER, UPPER):
        one, other = (half.joints[list(side)] for side in half.sides)
        np.testing.assert_array_equal(LSP14.mirror[one], other)
        assert (half.bone_mirror[half.bone_mirror] == np.arange(len(half.bones))).all()


def test_elements_belong_to_the_bone_they_outline():
    preparation, truth = scene([standing()], (0,))
    body_frame = stabilise_player(preparation.track, preparation.camera, preparation.video.fps)
    pose = body_frame.from_pixels(truth[0][UPPER.joints], 0)
    elements = assign_to_bones(preparation.edges[0], body_frame, 0, pose, UPPER)
    wrists = [LSP14.index("right_wrist"), LSP14.index("left_wrist")]
    forearm = np.isin(UPPER.joints[UPPER.bones[elements.bone, 1]], wrists)
    assert forearm[elements.color == 2].mean() > 0.9
    widths = np.abs(elements.offset[forearm & (elements.color == 2)])
    np.testing.assert_allclose(np.median(widths), 0.025 / 0.98, rtol=0.05)


def test_a_template_in_its_own_pose_lies_on_its_own_elements():
    preparation, truth = scene([standing()], (0,))
    templates, index, _ = templates_of(preparation, truth, (0,), UPPER)
    every = np.zeros(1, int)
    fits = TemplateFits(every, every, templates.poses.joints)
    posed = pose_templates(templates, every, templates.poses.joints)
    row, found = match_elements(index, every, posed, 0.05)
    own = posed.color >= 0
    assert found[own].mean() > 0.9
    assert np.abs(index.points[row] - posed.points)[found].max() < 0.02
    assert score_bones(templates, index, fits).max() < 0.35


def test_matches_have_the_same_colour_and_direction():
    preparation, truth = scene([standing()], (0,))
    templates, index, _ = templates_of(preparation, truth, (0,), LOWER)
    every = np.zeros(1, int)
    posed = pose_templates(templates, every, templates.poses.joints + 0.03j)
    row, found = match_elements(index, every, posed, 0.06)
    assert (index.color[row] == posed.color)[found].all()
    turn = np.abs(np.angle(index.tangent[row] / posed.tangent))[found]
    assert turn.max() < np.pi / 2


def test_a_fit_turns_a_limb_back_onto_its_edges():
    bent = turned(standing(), "left_elbow", ("left_wrist",), -0.35)
    preparation, truth = scene([standing(), bent], (0,))
    templates, index, body_frame = templates_of(preparation, truth, (0,), UPPER)
    one = np.ones(1, int)
    found = register_templates(
        templates, index, TemplateFits(one, one - 1, templates.poses.joints)
    ).joints
    away = np.abs(found[0] - body_frame.from_pixels(truth[1][UPPER.joints], 1))
    assert away[UPPER.free].max() < 0.02


def test_an_arm_elsewhere_leaves_edges_unexplained():
    bent = turned(standing(), "left_shoulder", ("left_elbow", "left_wrist"), -1.2)
    preparation, truth = scene([standing(), bent], (0,))
    templates, index, _ = templates_of(preparation, truth, (0, 1), UPPER)
    first = np.zeros(2, int)
    far = score_fits(
        templates, index, TemplateFits(first, first, templates.poses.joints)
    ).unexplained
    left = far.min(axis=1).sum(axis=1)
    assert left[0] < 0.5 * left[1]


def test_sides_are_chosen_for_continuity():
    # two limbs cross; each hypothesis names them the wrong way round half of the time
    path = np.linspace(-1, 1, 21)
    one, other = path + 0.3j, -path - 0.3j
    swapped = np.arange(21) % 2 == 1
    first, second = np.where(swapped, other, one), np.where(swapped, one, other)
    joints = np.stack([first, second], axis=1)[:, :, None]
    cost = np.zeros((21, 2))
    cost[0] = [0, 5]
    spread = np.array([0.2])
    unlikeness = np.zeros((21, 2, 2, 1))
    clash = 9 * np.tile(np.eye(2), (21, 1, 1))
    a, b = choose_limb_pair(
        LimbStates(joints, cost, unlikeness, spread),
        LimbStates(joints, cost[:, ::-1].copy(), unlikeness, spread),
        clash,
    )
    np.testing.assert_array_equal(a, swapped)
    np.testing.assert_array_equal(b, ~swapped)


def test_weighted_rows_are_least_squares():
    rng = np.random.default_rng(1)
    mixture = rng.normal(size=(1, 9, 3))
    target = rng.normal(size=(1, 9)) + 1j * rng.normal(size=(1, 9))
    axis = np.exp(1j * rng.uniform(0, 6, (1, 9)))
    along, across = rng.uniform(0.1, 2, (2, 1, 9))
    found = point_equations(mixture, target, axis, along, across).solve()[0]
    rows, right = [], []
    for m, q, n, strong, weak in zip(
        mixture[0], target[0], axis[0], along[0], across[0], strict=True
    ):
        for direction, weight in ((n, strong), (1j * n, weak)):
            rows.append(np.sqrt(weight) * np.concatenate([direction.real * m, direction.imag * m]))
            right.append(np.sqrt(weight) * (q * np.conj(direction)).real)
    slow = np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0]
    np.testing.assert_allclose(found, slow[:3] + 1j * slow[3:], atol=1e-6)


def test_smoothing_equals_dense_least_squares():
    rng = np.random.default_rng(2)
    target = rng.normal(size=(7, 2)) + 1j * rng.normal(size=(7, 2))
    weight, spread = rng.uniform(0.5, 2, (7, 2)), np.array([0.5, 2.0])
    found = solve_smooth(joint_equations(target, weight), spread)
    second = np.diff(np.eye(7), 2, axis=0)
    for joint in range(2):
        matrix = np.diag(weight[:, joint]) + second.T @ second / spread[joint] ** 2
        slow = np.linalg.solve(matrix, weight[:, joint] * target[:, joint])
        np.testing.assert_allclose(found[:, joint], slow, atol=1e-6)


def test_player_coordinates_follow_a_panning_camera():
    preparation, truth = scene([standing()] * 9, (0,), origin=(600 + 30.0 * np.arange(9))[:, None])
    body_frame = stabilise_player(preparation.track, preparation.camera, preparation.video.fps)
    back = body_frame.to_pixels(
        body_frame.from_pixels(truth, np.arange(9)[:, None]), np.arange(9)[:, None]
    )
    np.testing.assert_allclose(back, truth)


def test_each_foot_counts_for_the_leg_it_fits():
    ankles = np.array([[-0.2 + 1j, 0.2 + 1j], [0.1 + 1j, -0.1 + 1j]])
    joints = np.zeros((2, 6), complex)
    ends = np.array([max(side, key=lambda j: LOWER.depth[j]) for side in LOWER.sides])
    joints[:, ends] = ankles
    tracked = np.array([[0.23 + 1.02j, -0.17 + 1.02j], [0.13 + 1.02j, -0.07 + 1.02j]])
    poses = AnnotatedPoses(LOWER, np.arange(2), joints, np.ones((2, 6), bool), np.ones(5))
    feet = learn_foot_offsets(poses, tracked, np.ones(2, bool))
    seen = foot_equations(feet, np.arange(2), joints + 0.02).solve()[:, ends]
    np.testing.assert_allclose(seen, ankles, atol=1e-6)
    far = foot_equations(feet, np.arange(2), joints + 0.5j).matrix
    assert far.max() < 0.01 * foot_equations(feet, np.arange(2), joints).matrix.max()


def test_a_foot_that_nobody_marked_tells_nothing_of_where_ankles_are():
    ends = np.array([max(side, key=lambda j: LOWER.depth[j]) for side in LOWER.sides])
    joints, known = np.zeros((3, 6), complex), np.ones((3, 6), bool)
    joints[:, ends] = [-0.2 + 1j, 0.2 + 1j]
    tracked = joints[:, ends] + 0.03j
    joints[1:, ends[0]] -= 0.3j  # where it stands on the median
    known[1:, ends[0]] = False
    poses = AnnotatedPoses(LOWER, np.arange(3), joints, known, np.ones(5))
    feet = learn_foot_offsets(poses, tracked, np.ones(3, bool))
    np.testing.assert_allclose(feet.points, tracked - 0.03j)


def test_feet_beneath_the_picture_are_not_in_sight():
    preparation, _ = scene([standing()] * 4, (0,), origin=[(600, y) for y in (200, 700, 200, 200)])
    away = replace(preparation.track, confidence=np.array([1.0, 1.0, 0.0, 1.0]))
    seen = feet_in_sight(replace(preparation, track=away))
    assert seen.tolist() == [True, False, False, True]
