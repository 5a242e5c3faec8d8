"""Colours along bones, learnt from marks."""

import numpy as np
import pytest
from drawn_legs import (
    BODY,
    FRAMES,
    JOINTS,
    LEGS,
    ONE,
    OTHER,
    draw,
    marked_poses,
)

from keyrecon.propagation.appearance import describe_player
from keyrecon.propagation.bone_color import learn_bone_colors

THIGH = LEGS.bones.tolist().index(ONE[:2])
APART = np.abs(JOINTS[:, ONE[0]] - JOINTS[:, OTHER[0]]) > 0.15


def learn(**drawn):
    features = describe_player(draw(JOINTS, **drawn), BODY, np.arange(FRAMES))
    return learn_bone_colors(features, marked_poses(), JOINTS)


@pytest.fixture(scope="module")
def colors():
    return learn()


def test_a_bone_is_where_its_colour_is(colors):
    both = np.stack([JOINTS, JOINTS + 0.1, JOINTS - 0.1], axis=1)
    cost = colors.unlikeness(both)[APART][:, :, 0, THIGH]
    assert (cost[:, 0] < 0.1).all()
    assert (cost[:, 1:] > 0.5).all()


def test_a_colour_of_the_marks_speaks_for_nothing(colors):
    assert colors.tables.min() == 0
    assert not colors.unlikeness(JOINTS[:, None])[APART][:, 0, 0, THIGH].any()


def test_a_colour_that_no_mark_has_costs_no_more_than_marks_are_many(colors):
    assert np.exp(colors.tables[THIGH]).max() <= len(marked_poses().frames) + 2 + 1e-3


def test_where_all_has_one_colour_it_tells_nothing():
    grey = (110, 110, 110)
    cost = learn(colors=(grey, grey)).unlikeness(JOINTS[:, None])
    assert cost.max() < 0.5


def test_many_places_of_a_bone_cost_about_what_its_pixels_do(colors):
    start, stop = JOINTS[3, ONE[0]], JOINTS[3, ONE[1]]
    shifts = np.array([0.0, 0.3])
    few = colors.along(colors.numbers(3), THIGH, start + shifts, stop + shifts)
    whole = colors.unlikeness(np.stack([JOINTS, JOINTS + 0.3], axis=1))[3, :, 0, THIGH]
    np.testing.assert_allclose(few, whole, atol=0.4)
