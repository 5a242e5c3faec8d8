"""Facts about arms that the trunk hides."""

import numpy as np

from keyrecon.lifting.priors.occlusion import hidden_cost, within_trunk

CORNERS = np.array([[-0.1, 0.3, 0.0], [0.1, 0.3, 0.0], [-0.12, 0.05, 0.0], [0.12, 0.05, 0.0]])
"""Right hip, left hip, right shoulder, left shoulder of a trunk seen from behind."""


def arm(depth):
    """Upper arm and forearm from the left shoulder to before the belly, at a depth."""
    return np.array([[0.02, 0.12, depth / 2], [-0.16, 0.02, depth / 2]])


def cost_of(depths, hidden):
    bones = np.stack([arm(depth) for depth in depths])[None]
    return hidden_cost(CORNERS[None, None], CORNERS[None, None, 3], bones, np.array([hidden]))[0, 0]


def test_a_hidden_wrist_behind_the_trunk_costs_less_than_one_before_it():
    behind, before = cost_of((0.15, -0.15), (False, True))
    assert behind < 0.1
    assert before > 3.0


def test_a_joint_that_is_seen_costs_nothing_wherever_it_is():
    np.testing.assert_array_equal(cost_of((0.15, -0.15), (False, False)), 0.0)


def test_what_hides_a_joint_beside_the_trunk_is_not_known():
    beside = np.array([[[[0.3, 0.0, -0.1], [0.2, 0.0, -0.1]]]])
    cost = hidden_cost(
        CORNERS[None, None], CORNERS[None, None, 3], beside, np.array([[True, True]])
    )
    np.testing.assert_array_equal(cost, 0.0)


def test_the_outline_of_the_trunk_is_told_from_its_surroundings():
    places = np.array([[0.0, 0.15], [0.1, 0.28], [0.0, 0.5], [0.3, 0.1], [-0.14, 0.1]])
    inside = within_trunk(CORNERS[None, :, :2], places[None])[0]
    np.testing.assert_array_equal(inside, [True, True, False, False, True])


def test_a_trunk_seen_from_the_side_keeps_its_width_of_flesh():
    narrow = CORNERS[None, :, :2] * [0.01, 1.0]
    np.testing.assert_array_equal(
        within_trunk(narrow, np.array([[[0.02, 0.2], [0.1, 0.2]]]))[0], [True, False]
    )
