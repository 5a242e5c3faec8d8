"""What limbs explain of a silhouette, and limbs that it proposes."""

from dataclasses import replace

import numpy as np
import pytest
from capsule_player import scene, standing, turned
from hypothesis_choice import choice

from keyrecon.body import LSP14
from keyrecon.propagation.body_frame import BodyFrame
from keyrecon.propagation.edge_template import AnnotatedPoses
from keyrecon.propagation.half_body import split_body
from keyrecon.propagation.selection import choose_limbs
from keyrecon.propagation.silhouette import (
    Silhouettes,
    find_holding_hand,
    gather_silhouettes,
    limb_places,
    search_by_silhouette,
    unexplained_silhouette,
)
from keyrecon.records import Shots

LEGS, ARMS = split_body(LSP14)
HEIGHT = 180.0


def seen(pose, half):
    """Silhouette and joints of one frame, player heights from the head."""
    preparation, _ = scene([pose], (0,), HEIGHT)
    here = BodyFrame(np.array([600 + 200j]), np.array([HEIGHT]))
    places = pose[half.joints] @ [1, 1j]
    return gather_silhouettes(preparation.edges, here), places[None]


def limbs(half, joints):
    return tuple(joints[:, None, list(side)] for side in half.sides)


def kicking():
    """The left leg is kicked out to the side."""
    return turned(standing(), "left_hip", ("left_knee", "left_ankle"), -1.1)


def raising():
    """The left arm is raised."""
    return turned(standing(), "left_shoulder", ("left_elbow", "left_wrist"), -1.6)


def on_one_limb(half, joints):
    """Both limbs where the right one is."""
    one, other = (list(side) for side in half.sides)
    together = joints.copy()
    together[:, one[1:]] = joints[:, other[1:]]
    return together


@pytest.mark.parametrize("half", [LEGS, ARMS], ids=["legs", "arms"])
def test_both_limbs_on_one_leave_the_other_unexplained(half):
    silhouette, joints = seen({"lower": kicking, "upper": raising}[half.name](), half)
    places = limb_places(silhouette, half, joints)
    left, right = limbs(half, joints)
    assert unexplained_silhouette(places, half, joints, (left, right)) < 0.05
    assert unexplained_silhouette(places, half, joints, (right, right)) > 0.15
    # which of them is the left one it does not tell
    assert unexplained_silhouette(places, half, joints, (right, left)) == pytest.approx(
        unexplained_silhouette(places, half, joints, (left, right)), abs=0.02
    )


@pytest.mark.parametrize("half", [LEGS, ARMS], ids=["legs", "arms"])
def test_a_limb_is_found_where_the_silhouette_has_one_that_no_pose_has(half):
    silhouette, joints = seen({"lower": kicking, "upper": raising}[half.name](), half)
    found = search_by_silhouette(
        silhouette, marked_nowhere(half, joints), on_one_limb(half, joints)
    )
    side = list(half.sides[0])
    away = np.abs(found[0, :, side] - joints[0, side][:, None])
    assert away.max(axis=0).min() < 0.1


def marked_nowhere(half, joints):
    longest, none = np.full(len(half.bones), 0.28), np.zeros(0, int)
    known = np.zeros((0, len(half.joints)), bool)
    return AnnotatedPoses(half, none, joints[:0], known, longest)


def test_the_pair_of_limbs_that_explains_the_silhouette_is_chosen():
    silhouette, joints = seen(kicking(), LEGS)
    one_frame = Shots.between((), 1)
    hypotheses = np.stack([on_one_limb(LEGS, joints), joints], axis=1)
    states = choice(LEGS, hypotheses, np.zeros((1, 2)), np.full(len(LEGS.bones), np.inf))
    chosen = choose_limbs(*states, one_frame, 50.0, None, silhouette).joints[0]
    left, right = (list(side) for side in LEGS.sides)
    knees_and_ankles = {complex(z) for z in chosen[left[1:] + right[1:]]}
    assert knees_and_ankles == {complex(z) for z in joints[0, left[1:] + right[1:]]}


def test_without_a_silhouette_no_pair_is_better_than_another():
    _, joints = seen(standing(), LEGS)
    nothing = Silhouettes(np.zeros((1, 1), complex), np.zeros((1, 1), bool))
    places = limb_places(nothing, LEGS, joints)
    left, right = limbs(LEGS, joints)
    assert unexplained_silhouette(places, LEGS, joints, (left, right)) == 0
    assert unexplained_silhouette(places, LEGS, joints, (right, right)) == 0


def test_legs_without_knees_are_not_looked_for():
    silhouette, joints = seen(standing(), LEGS)
    half = replace(LEGS, sides=((3, 4), (2, 1)))
    assert search_by_silhouette(silhouette, marked_nowhere(half, joints), joints).shape[1] == 0


RIGHT = 1
"""The right side's place in `sides`."""


def with_racket(silhouette, wrist):
    """A racket's head above the wrist, as far as its handle is long."""
    grid = 0.03 * np.arange(-3, 4)
    head = (grid + 1j * grid[:, None]).ravel()
    head = wrist - 0.3j + head[np.abs(head) < 0.1]
    points = np.concatenate([silhouette.points, head[None]], axis=1)
    return Silhouettes(points, np.ones(points.shape, bool))


def marked(half, joints):
    known = np.ones((1, len(half.joints)), bool)
    return AnnotatedPoses(half, np.zeros(1, int), joints, known, np.full(len(half.bones), 0.28))


def test_a_racket_speaks_for_no_arm_where_marks_show_that_a_hand_holds_it():
    silhouette, joints = seen(raising(), ARMS)
    right_arm = list(ARMS.sides[RIGHT])
    armed = with_racket(silhouette, joints[0, right_arm[-1]])
    assert find_holding_hand(armed, marked(ARMS, joints)) == RIGHT
    places = limb_places(armed, ARMS, joints)
    left, right = limbs(ARMS, joints)
    assert unexplained_silhouette(places, ARMS, joints, (left, right), None) > 0.1
    assert unexplained_silhouette(places, ARMS, joints, (left, right), RIGHT) < 0.05
    along_it = right + np.array([0, -0.1j, -0.3j])
    assert unexplained_silhouette(places, ARMS, joints, (left, along_it), RIGHT) > 0.05


def test_a_hand_holds_nothing_where_marked_limbs_leave_nothing():
    silhouette, joints = seen(raising(), ARMS)
    assert find_holding_hand(silhouette, marked(ARMS, joints)) is None
    assert find_holding_hand(silhouette, marked_nowhere(ARMS, joints)) is None


def test_a_foot_holds_nothing():
    silhouette, joints = seen(standing(), LEGS)
    armed = with_racket(silhouette, joints[0, LEGS.sides[RIGHT][-1]])
    assert find_holding_hand(armed, marked(LEGS, joints)) is None
