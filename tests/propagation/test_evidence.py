"""What speaks for a limb, and which limb is chosen for it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis_choice import choice

from keyrecon.body import LSP14
from keyrecon.propagation.evidence import (
    SCALE,
    WEIGHTS,
    LimbCosts,
    find_evidence,
    limb_state_probabilities,
)
from keyrecon.propagation.half_body import split_body
from keyrecon.propagation.hypotheses import MarkPredictions
from keyrecon.propagation.selection import ELSEWHERE, choose_limbs
from keyrecon.propagation.silhouette import Silhouettes
from keyrecon.records import Shots

LEGS, ARMS = split_body(LSP14)
FRAMES = 5
ONE_SHOT = Shots.between((), FRAMES)


def poses(half):
    """Two poses of a half, one with its left side elsewhere, and what is chosen between."""
    random = np.random.default_rng(3)
    here = random.normal(size=(len(half.joints), 2)) @ [1, 1j]
    there = here.copy()
    there[list(half.sides[0])] += 0.3
    joints = np.tile(np.stack([here, there]), (FRAMES, 1, 1))
    return (
        here,
        there,
        choice(half, joints, np.zeros((FRAMES, 2)), np.full(len(half.bones), np.inf)),
    )


def predictions(joints, confidence=0.0, seconds=10.0):
    """Flow and lines that lead to the same joints in all frames."""
    places = np.tile(joints, (FRAMES, 1))
    return MarkPredictions(
        places, np.full(places.shape, confidence), places, np.full(places.shape, seconds)
    )


@pytest.mark.parametrize("half", [LEGS, ARMS], ids=["legs", "arms"])
@pytest.mark.parametrize("sure", [{"confidence": 0.9}, {"seconds": 0.02}], ids=["flow", "lines"])
def test_a_limb_is_where_flow_and_near_marks_lead(half, sure):
    here, there, scene = poses(half)
    for pose in (here, there):
        found = choose_limbs(*scene, ONE_SHOT, 50.0, predictions(pose, **sure)).joints
        side = list(half.sides[0])
        np.testing.assert_array_equal(found[2, side], pose[side])


LOOKS = "unlikeness", "bone_unlikeness", "residual"


@pytest.mark.parametrize(
    ("half", "what"),
    [*((LEGS, w) for w in LOOKS), *((ARMS, w) for w in (*LOOKS, "color_unlikeness"))],
)
def test_a_limb_that_looks_like_marked_ones_on_its_outline_is_chosen(half, what):
    here, there, (templates, hypotheses) = poses(half)
    side = list(half.sides[0])
    for right, pose in enumerate((here, there)):
        against = getattr(hypotheses, what).copy()
        against[:, 1 - right] = 0.5
        found = choose_limbs(
            templates, replace(hypotheses, **{what: against}), ONE_SHOT, 50.0
        ).joints
        np.testing.assert_array_equal(found[2, side], pose[side])


def test_every_weight_is_of_some_evidence_and_none_is_negative():
    for half in (LEGS, ARMS):
        _, _, (templates, hypotheses) = poses(half)
        here = hypotheses.joints[0, 0]
        nothing = Silhouettes(np.zeros((FRAMES, 1), complex), np.zeros((FRAMES, 1), bool))
        trunk = np.zeros(FRAMES, int)
        found = find_evidence(templates, hypotheses, trunk, predictions(here), nothing)
        names = {*found.of_sides[0], *(name for name, _ in found.of_pairs)}
        assert {*WEIGHTS[half.name]} <= names
        assert min(WEIGHTS[half.name].values()) >= 0


def test_probabilities_of_states_are_those_of_the_pairs_that_they_are_in():
    random = np.random.default_rng(4)
    one, other, pairs = (random.uniform(0, 9, (2, *n)) for n in ((3,), (3,), (3, 3)))
    one[1, 2] = np.inf
    chances = limb_state_probabilities(LimbCosts((one, other), pairs))
    for t in range(2):
        every = {
            (a, b): np.exp(-(one[t, a] + other[t, b] + pairs[t, a, b]) / SCALE)
            for a in range(3)
            for b in range(3)
        }
        for state in range(3):
            own = [sum(v for pair, v in every.items() if pair[n] == state) for n in (0, 1)]
            expected = np.array(own) / sum(every.values())
            np.testing.assert_allclose([c[t, state] for c in chances], expected)
    assert chances[0][1, 2] == 0


@pytest.mark.parametrize("half", [LEGS, ARMS], ids=["legs", "arms"])
def test_a_joint_is_elsewhere_by_as_much_as_speaks_for_limbs_that_have_it_there(half):
    here, there, scene = poses(half)
    chosen = choose_limbs(*scene, ONE_SHOT, 50.0, predictions(here, confidence=0.9))
    side, other = (list(members) for members in half.sides)
    elsewhere = chosen.elsewhere(np.tile(here, (FRAMES, 1)))
    assert (elsewhere[2, side] < 0.5).all() and (elsewhere[2, side] > 0).all()
    away = chosen.elsewhere(np.tile(there, (FRAMES, 1)))
    assert (away[2, side] > 0.5).all()
    np.testing.assert_array_equal(elsewhere[2, list(half.middle)], 0)
    near = np.tile(here + 0.9 * ELSEWHERE, (FRAMES, 1))
    np.testing.assert_allclose(chosen.elsewhere(near)[2, other], elsewhere[2, other])
