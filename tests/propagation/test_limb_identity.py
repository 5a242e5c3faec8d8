"""Left and right of two limbs over a whole clip."""

import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.propagation.correspondence import side_confidence
from keyrecon.propagation.half_body import split_body
from keyrecon.propagation.limb_identity import (
    IdentityEvidence,
    identify_limbs,
    template_log_odds,
)

LEGS = split_body(LSP14)[0]
ONE, OTHER = map(list, LEGS.sides)
FPS = 25.0
LEG = np.array([0.0, 0.2j, 0.45j])
"""Hip, knee and ankle of a leg that hangs straight down."""
SWING = np.array([0.1, 0.6, 1.0])
"""How far each joint takes part when a leg swings."""


def legs(one, other):
    """Joints of both legs in every frame, from how far aside they swing."""
    joints = np.zeros((len(one), len(LEGS.joints)), complex)
    joints[:, ONE] = LEG + np.outer(one, SWING)
    joints[:, OTHER] = LEG + np.outer(other, SWING)
    return joints


def exchange(joints, frames):
    """The same with left and right exchanged in some frames."""
    result = joints.copy()
    result[np.ix_(frames, ONE)], result[np.ix_(frames, OTHER)] = (
        joints[np.ix_(frames, OTHER)],
        joints[np.ix_(frames, ONE)],
    )
    return result


def identify(joints, marked, log_odds=None):
    evidence = IdentityEvidence(np.zeros(len(joints)) if log_odds is None else log_odds)
    return identify_limbs(LEGS, joints, evidence, np.array(marked), FPS)


TIME = np.linspace(-1, 1, 41)
CROSSING = legs(0.25 * TIME, -0.25 * TIME)
"""Two legs that pass one another in frame 20, each at its own constant speed."""
PARTING = legs(0.02 + 0.25 * TIME**2, -0.02 - 0.25 * TIME**2)
"""Two legs that come together until frame 20 and part again."""
STANDING = legs(0.08 * np.sin(3 * TIME) ** 2, 0.25 * TIME)
"""One leg goes past another that hardly moves."""


@pytest.mark.parametrize("motion", [CROSSING, PARTING, STANDING], ids=["cross", "part", "pass"])
@pytest.mark.parametrize("wrong", [range(21, 41), range(20), range(22, 33), range(0)])
def test_limbs_keep_their_sides_where_they_meet(motion, wrong):
    found = identify(exchange(motion, list(wrong)), [0] if 0 not in wrong else [40])
    # where both legs are in one place, either is right
    apart = np.abs(motion[:, ONE[-1]] - motion[:, OTHER[-1]]) > 0.05
    np.testing.assert_array_equal(
        found.exchanged[apart], np.isin(np.arange(41), list(wrong))[apart]
    )


def test_an_exchange_in_mid_air_is_moved_to_where_the_limbs_met():
    # taken for one another when they met in frame 20, and set right by a jump in frame 32
    found = identify(exchange(CROSSING, list(range(20, 32))), [0, 40])
    assert found.exchanged[21:32].all()
    assert not found.exchanged[:20].any()
    assert not found.exchanged[32:].any()


def test_the_next_mark_decides_a_meeting_that_motion_leaves_open():
    apart = np.abs(TIME[:, None]) > 0.4
    still = np.where(apart, CROSSING, legs(0 * TIME, 0 * TIME))
    for wrong in (list(range(20, 41)), []):
        found = identify(exchange(still, wrong), [0, 40])
        assert not found.exchanged[:12].any()
        assert not found.exchanged[29:].any()
        assert found.probability[[2, 38]].min() > 0.95


def test_sides_are_uncertain_where_nothing_decides():
    together = legs(0 * TIME, 0 * TIME)
    together[:10] = CROSSING[0]
    together[30:] = CROSSING[0]
    found = identify(together, [0])
    assert found.probability[:9].min() > 0.95
    assert found.probability[31:].max() < 0.7
    away = side_confidence(LEGS, together, found.probability)
    assert away[35, ONE[-1]] < 0.8
    assert away[20, ONE[-1]] == pytest.approx(1.0)


def test_similar_poses_tell_sides_after_limbs_were_in_one_place():
    together = legs(0 * TIME, 0 * TIME)
    together[:10] = CROSSING[0]
    together[30:] = CROSSING[0]
    wrong = exchange(together, list(range(30, 41)))
    log_odds = template_log_odds(
        LEGS, wrong, np.repeat(CROSSING[:1, None], len(together), axis=0), FPS
    )
    found = identify(wrong, [0], log_odds)
    assert found.exchanged[31:].all()
    assert not found.exchanged[:10].any()


def test_a_likeness_that_misleads_for_a_while_does_not_outweigh_two_jumps():
    wrong = list(range(30, 36))
    log_odds = np.where(np.isin(np.arange(41), wrong), 6.0, -0.0)
    found = identify(exchange(CROSSING, wrong), [0, 40], log_odds)
    assert np.flatnonzero(found.exchanged).tolist() == wrong


def test_a_likeness_that_lasts_tells_what_motion_leaves_open():
    together = legs(0 * TIME, 0 * TIME)
    together[:10] = together[30:] = CROSSING[0]
    found = identify(together, [0], np.where(np.arange(41) < 25, 0.0, -2.0))
    assert found.exchanged[31:].all()
    assert found.probability[35] > 0.95


def test_what_belongs_to_joints_follows_them_to_the_other_side():
    wrong = list(range(22, 33))
    found = identify(exchange(CROSSING, wrong), [0, 40])
    np.testing.assert_allclose(found.apply(LEGS, exchange(CROSSING, wrong)), CROSSING)


def test_a_mark_with_left_and_right_exchanged_is_in_doubt():
    apart = legs(0.25 + 0.1 * np.sin(6 * TIME), -0.25 - 0.1 * np.cos(5 * TIME))
    marked = [0, 10, 20, 30, 40]
    assert identify(apart, marked).exchange_evidence[marked].max() < -3
    # joints near the mark come from its own pose, so they are exchanged too
    wrong = identify(exchange(apart, list(range(17, 24))), marked)
    assert np.flatnonzero(wrong.exchange_evidence > 3).tolist() == [20]


def test_marks_on_either_side_of_a_meeting_are_not_in_doubt():
    found = identify(exchange(CROSSING, list(range(21, 41))), [0, 40])
    assert found.exchange_evidence.max() < 1
