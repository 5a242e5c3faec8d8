"""Choose among hypotheses: the cheapest path through time (Viterbi), both sides jointly.

A side (arm or leg) may take a hypothesis's joints of the same side or of the other, since
silhouettes do not tell left from right. What counts most is how much of the frame's edges both
sides and the trunk leave unexplained, so that the sides do not both take the same limb. Besides, a
step costs its length, and a hypothesis its residual, its prior cost, and how unlike marks its
joints look. Annotated frames admit the
annotation alone.

The weights were tried at half and twice their values on rendered strokes and serves; none of
them moves the share of joints that are right by more than half a percent.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.numerics.viterbi import find_cheapest_path
from keyrecon.propagation.bone_bounds import too_long
from keyrecon.propagation.edge_template import FOOT_MATCH_DISTANCE, EdgeTemplates, FootEvidence
from keyrecon.propagation.half_body import BodyHalf
from keyrecon.propagation.hypotheses import PoseHypotheses
from keyrecon.records import Shots

STEP_SPEED = 1.5
"""Speed of a joint next to the root in a step that costs 1, player heights per second; it doubles
outwards. Halved or doubled, others with it: at most 0.7 points, 0.4 mm on one clip."""
MAX_STEP_COST = 20.0
"""Largest cost of a joint's step: a jump happens, and it should not outweigh everything else.
Halved or doubled, others with it: at most 0.3 points, 0.4 mm on one clip."""
RESIDUAL_WEIGHT = 3.0
"""Cost of a limb whose elements match nothing. Halved or doubled, others with it: at most 0.3
points, 0.4 mm on one clip."""
FOOT_WEIGHT = 2.0
"""Cost of a leg that ends where no foot was tracked. Halved or doubled, others with it: at most 0.4
points, 0.3 mm on one clip."""
SIDE_SWAP_COST = 1.0
"""Cost of taking left for right. Halved or doubled, others with it: at most 0.4 points, 0.3 mm on
one clip."""
UNEXPLAINED_WEIGHT = 48.0
"""Cost of leaving all of the frame's elements unexplained. Halved or doubled, others with it: at
most 0.4 points, 0.3 mm on one clip."""
TOO_LONG_COST = 1e3
"""Cost of a bone that is longer than it can be: no such limb while there is another."""
APPEARANCE_WEIGHT = 4.0
"""Cost of a joint that looks like no mark of it at all. On five real clips with three choices of
marks each .6 points of PCK more than without, .5 more where looks tell left and right as well;
twice this has .2 points fewer."""


@dataclass(frozen=True, eq=False)
class LimbStates:
    """What a few joints may be in every frame: S states."""

    joints: Complex[np.ndarray, "T S J"]
    cost: Float[np.ndarray, "T S"]
    unlikeness: Float[np.ndarray, "T S 2 J"]
    """How unlike marks each joint looks: those of its own side, then of the other."""
    spread: Float[np.ndarray, "J"]
    """Of a joint's step from one frame to the next, player heights."""
    first: frozenset[int] = frozenset()
    """Frames that shots begin with: any state follows on any other there."""

    def steps(self, t: int) -> Float[np.ndarray, "S S"]:
        """Cost of going from each state of frame t - 1 to each of frame t."""
        if t in self.first:
            return np.zeros((self.joints.shape[1], self.joints.shape[1]))
        step = np.abs(self.joints[t][None] - self.joints[t - 1][:, None]) / self.spread
        return np.minimum(step**2, MAX_STEP_COST).mean(axis=2)


@dataclass(frozen=True, eq=False)
class ChosenLimbs:
    """The chosen hypotheses, limb by limb."""

    joints: Complex[np.ndarray, "T J"]
    template: Int[np.ndarray, "T J"]
    """Row of the annotated frame that each joint comes from."""
    unlikeness: Float[np.ndarray, "T 2 J"]
    """How unlike marks each joint looks: those of its own side, then of the other."""


def choose_limbs(
    templates: EdgeTemplates, hypotheses: PoseHypotheses, shots: Shots, fps: float
) -> ChosenLimbs:
    """The cheapest limbs of every frame."""
    half, frames = templates.half, np.arange(len(hypotheses.template))
    joints = hypotheses.joints[:, 0].copy()
    template = np.broadcast_to(hypotheses.template[:, :1], joints.shape).copy()
    unlikeness = hypotheses.unlikeness[:, 0].copy()
    groups = [half.middle, *half.sides]
    states = [_limb_states(templates, hypotheses, group, shots, fps) for group in groups]
    trunk = choose_one(states[0]) if half.middle else _best_trunk(hypotheses, half)
    joints[:, half.middle] = states[0].joints[frames, trunk]
    one, other = (
        replace(state, cost=state.cost + _joining_costs(templates, joints, state, group))
        for state, group in zip(states[1:], groups[1:], strict=True)
    )
    clash = _unexplained_costs(templates, hypotheses, trunk) + _breadth_costs(templates, one, other)
    paths = [trunk, *choose_two(one, other, clash)]
    for group, state, path in zip(groups, states, paths, strict=True):
        joints[:, group] = state.joints[frames, path]
        unlikeness[..., group] = state.unlikeness[frames, path]
        row = hypotheses.template[frames, path % hypotheses.prior_cost.shape[1]]
        template[:, group] = row[:, None]
    return ChosenLimbs(joints, template, unlikeness)


def _best_trunk(hypotheses: PoseHypotheses, half: BodyHalf) -> Int[np.ndarray, "T"]:
    """Hypotheses by the residual of what lies between the sides."""
    residual = hypotheses.residual[:, :, half.limb == 0].mean(axis=2)
    return np.where(np.isinf(hypotheses.prior_cost), np.inf, residual).argmin(axis=1)


def _limb_states(
    templates: EdgeTemplates,
    hypotheses: PoseHypotheses,
    group: tuple[int, ...],
    shots: Shots,
    fps: float,
) -> LimbStates:
    """The same side of every hypothesis, then the other side."""
    half, poses, members = templates.half, templates.poses, np.array(group, int)
    mirrored = half.mirror[members]
    sides = [members] if np.array_equal(members, mirrored) else [members, mirrored]
    unlikeness = np.concatenate(
        [
            hypotheses.unlikeness[:, :, ::order, side]
            for order, side in zip((1, -1), sides, strict=False)
        ],
        axis=1,
    )
    costs: list[Float[np.ndarray, "T P"]] = []
    foot_cost = None if templates.feet is None else _foot_costs(templates.feet, hypotheses.joints)
    for number, side in enumerate(sides):
        bones = np.isin(half.bones[:, 1], side)
        residual = hypotheses.residual[:, :, bones].mean(axis=2) if bones.any() else 0.0
        unlike = APPEARANCE_WEIGHT * hypotheses.unlikeness[:, :, number, side].sum(axis=2)
        costs.append(hypotheses.prior_cost + RESIDUAL_WEIGHT * residual + unlike)
        costs[-1] += SIDE_SWAP_COST * number
        if foot_cost is not None:
            costs[-1] += FOOT_WEIGHT * foot_cost[:, :, side].sum(axis=2)
    joints = np.concatenate([hypotheses.joints[:, :, side] for side in sides], axis=1)
    inside = np.flatnonzero(np.isin(half.bones, members).all(axis=1))
    place = np.array([[group.index(end) for end in half.bones[row]] for row in inside], int)
    ends = place.reshape(-1, 2)
    states = np.concatenate(costs, axis=1)
    states += TOO_LONG_COST * too_long(joints, ends, poses.longest[inside]).sum(axis=2)
    # all states of an annotated frame are the annotation
    states[poses.frames] = 0
    joints[poses.frames] = poses.joints[:, None, members]
    depth = np.clip(half.depth[members] - 1, 0, None)
    return LimbStates(
        joints, states, unlikeness, STEP_SPEED / fps * 2.0**depth, frozenset(shots.first)
    )


def _joining_costs(
    templates: EdgeTemplates,
    joints: Complex[np.ndarray, "T J"],
    states: LimbStates,
    group: tuple[int, ...],
) -> Float[np.ndarray, "T S"]:
    """Cost of bones from the trunk, whose joints are chosen, that are too long."""
    half, poses = templates.half, templates.poses
    cost = np.zeros(states.cost.shape)
    for (parent, child), longest in zip(half.bones.tolist(), poses.longest, strict=True):
        if parent in half.middle and child in group:
            place = states.joints[:, :, group.index(child)]
            cost += TOO_LONG_COST * (np.abs(place - joints[:, parent, None]) > longest)
    cost[poses.frames] = 0
    return cost


def _breadth_costs(
    templates: EdgeTemplates, one: LimbStates, other: LimbStates
) -> Float[np.ndarray, "T S S"]:
    """Cost of pairs of sides that are too far apart where a bone joins them."""
    half, poses = templates.half, templates.poses
    cost = np.zeros((len(one.joints), one.joints.shape[1], other.joints.shape[1]))
    for (start, stop), longest in zip(half.bones.tolist(), poses.longest, strict=True):
        ends = {start, stop}
        for place, pair in enumerate(zip(*half.sides, strict=True)):
            if ends == set(pair):
                across = one.joints[:, :, None, place] - other.joints[:, None, :, place]
                cost += TOO_LONG_COST * (np.abs(across) > longest)
    cost[poses.frames] = 0
    return cost


def _foot_costs(
    feet: FootEvidence, joints: Complex[np.ndarray, "T S J"]
) -> Float[np.ndarray, "T S J"]:
    """How far each leg ends from the nearer tracked foot, 0-1; 0 for other joints."""
    cost = np.zeros(joints.shape)
    distance = np.abs(joints[:, :, feet.ends, None] - feet.points[:, None, None])
    cost[:, :, feet.ends] = np.minimum(distance.min(axis=3) / FOOT_MATCH_DISTANCE, 1)
    return cost


def _unexplained_costs(
    templates: EdgeTemplates, hypotheses: PoseHypotheses, trunk: Int[np.ndarray, "T"]
) -> Float[np.ndarray, "T P P"]:
    """Cost of what a pair of states of the sides, and the trunk, leave of the frame's elements."""
    frames = np.arange(len(trunk))
    count = np.maximum((templates.frame_elements >= 0).sum(axis=1), 1)
    unexplained = hypotheses.unexplained
    middle = unexplained[frames, trunk, 0]
    one = np.concatenate([unexplained[:, :, 1], unexplained[:, :, 2]], axis=1)
    other = np.concatenate([unexplained[:, :, 2], unexplained[:, :, 1]], axis=1)
    left = (one * middle[:, None]) @ other.transpose(0, 2, 1)
    left[templates.poses.frames] = 0
    return UNEXPLAINED_WEIGHT * left / count[:, None, None]


def choose_one(states: LimbStates) -> Int[np.ndarray, "T"]:
    """Cheapest path of one limb."""
    return find_cheapest_path(list(states.cost), lambda _, t: states.steps(t))


def choose_two(
    one: LimbStates, other: LimbStates, clash: Float[np.ndarray, "T S S"]
) -> tuple[Int[np.ndarray, "T"], Int[np.ndarray, "T"]]:
    """Cheapest paths of both sides together; `clash` is the cost of pairs of states.

    The sides advance in turn, (a1, b1) -> (b1, a2) -> (a2, b2): see `find_cheapest_path`.
    """
    both = one.cost[:, :, None] + other.cost[:, None] + clash
    between = np.zeros(both.shape[:0:-1])
    unary = [both[0]]
    for cost in both[1:]:
        unary += [between, cost]

    def transition(_: int, turn: int) -> Float[np.ndarray, "S 1 S"]:
        side = one if turn % 2 else other
        return side.steps((turn + 1) // 2)[:, None]

    path = find_cheapest_path(unary, transition)
    return path[::2], path[1::2]
