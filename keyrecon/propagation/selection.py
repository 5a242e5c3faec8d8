"""Choose among hypotheses: the cheapest path through time (Viterbi), both sides jointly.

A side (arm or leg) may take a hypothesis's joints of the same side or of the other, since
silhouettes do not tell left from right. A state costs what speaks against it and against the pair
of both sides (`evidence`, with weights learnt from truth), so that the sides do not both take the
same limb, and a step costs its length. Limbs that are longer than they can be are refused, also
where a shoulder hangs from the neck or the hips are apart. Annotated frames admit the annotation
alone.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.numerics.viterbi import find_cheapest_path
from keyrecon.propagation.bone_bounds import ROUNDING
from keyrecon.propagation.edge_template import EdgeTemplates
from keyrecon.propagation.evidence import (
    LimbCosts,
    SideStates,
    find_evidence,
    limb_state_probabilities,
    weigh_evidence,
)
from keyrecon.propagation.half_body import BodyHalf
from keyrecon.propagation.hypotheses import MarkPredictions, PoseHypotheses
from keyrecon.propagation.silhouette import Silhouettes
from keyrecon.records import Shots

STEP_SPEED = 1.5
"""Speed of a joint next to the root in a step that costs 1, player heights per second; it doubles
outwards. Halved or doubled, others with it: at most 0.7 points, 0.4 mm on one clip."""
MAX_STEP_COST = 20.0
"""Largest cost of a joint's step: a jump happens, and it should not outweigh everything else.
Halved or doubled, others with it: at most 0.3 points, 0.4 mm on one clip. Without it: the same bits
on nine of twelve clips of up to 6 s, .1 points fewer to .5 more and 1.2 mm less to .1 more on
three; kept for long videos."""
TRUNK_RESIDUAL, TRUNK_UNLIKENESS = 3.0, 4.0
"""Cost of a trunk whose elements match nothing, and of a joint of it that looks like no mark of it
at all. Halved or doubled, others with them: at most 0.3 points, 0.4 mm on one clip."""
ELSEWHERE = 0.06
"""Player heights from which a joint is somewhere else: a fifth of a trunk."""
TOO_LONG_COST = 1e3
"""Cost of a bone that is longer than it can be: no such limb while there is another. A quarter more
or less, others with it: at most 1.2 points, 2.1 mm on nine clips."""


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

    def transition_costs(self, t: int) -> Float[np.ndarray, "S S"]:
        """Cost of going from each state of frame t - 1 to each of frame t."""
        if t in self.first:
            return np.zeros((self.joints.shape[1], self.joints.shape[1]))
        step = np.abs(self.joints[t][None] - self.joints[t - 1][:, None]) / self.spread
        return np.minimum(step**2, MAX_STEP_COST).mean(axis=2)


@dataclass(frozen=True, eq=False)
class LimbProbabilities:
    """How probable each limb of one side is, by what is seen in a frame."""

    members: Int[np.ndarray, "j"]
    """Joints of the side."""
    joints: Complex[np.ndarray, "T S j"]
    probability: Float[np.ndarray, "T S"]

    def elsewhere(self, joints: Complex[np.ndarray, "T J"]) -> Float[np.ndarray, "T j"]:
        """Probability that each joint of the side is not where it is taken to be."""
        apart = np.abs(self.joints - joints[:, None, self.members])
        return np.einsum("ts,tsj->tj", self.probability, apart > ELSEWHERE)


@dataclass(frozen=True, eq=False)
class ChosenLimbs:
    """The chosen hypotheses, limb by limb."""

    joints: Complex[np.ndarray, "T J"]
    template: Int[np.ndarray, "T J"]
    """Row of the annotated frame that each joint comes from."""
    unlikeness: Float[np.ndarray, "T 2 J"]
    """How unlike marks each joint looks: those of its own side, then of the other."""
    probabilities: tuple[LimbProbabilities, LimbProbabilities]

    def elsewhere(self, joints: Complex[np.ndarray, "T J"]) -> Float[np.ndarray, "T J"]:
        """Probability that joints are elsewhere, 0 of those of the trunk; `joints` are on the sides
        of this choice."""
        result = np.zeros(joints.shape)
        for side in self.probabilities:
            result[:, side.members] = side.elsewhere(joints)
        return result


def choose_limbs(
    templates: EdgeTemplates,
    hypotheses: PoseHypotheses,
    shots: Shots,
    fps: float,
    predictions: MarkPredictions | None = None,
    silhouettes: Silhouettes | None = None,
) -> ChosenLimbs:
    """The cheapest limbs of every frame."""
    half, frames = templates.half, np.arange(len(hypotheses.template))
    joints = hypotheses.joints[:, 0].copy()
    template = np.broadcast_to(hypotheses.template[:, :1], joints.shape).copy()
    unlikeness = hypotheses.unlikeness[:, 0].copy()
    trunk = _choose_trunk(templates, hypotheses, shots, fps)
    middle = half.middle
    evidence = find_evidence(templates, hypotheses, trunk, predictions, silhouettes)
    costs = weigh_evidence(half.name, evidence)
    joints[:, middle] = hypotheses.joints[frames, trunk][:, middle]
    joints[templates.poses.frames[:, None], middle] = templates.poses.joints[:, middle]
    unlikeness[..., middle] = hypotheses.unlikeness[frames, trunk][..., middle]
    template[:, middle] = hypotheses.template[frames, trunk][:, None]
    one, other = (
        _limb_states(templates, hypotheses, joints, side, cost, shots, fps)
        for side, cost in zip(evidence.sides, costs.sides, strict=True)
    )
    clash = costs.pairs
    clash[templates.poses.frames] = 0
    clash += _breadth_costs(templates, one, other)
    weighed = LimbCosts((one.cost, other.cost), clash)
    of_one, of_other = (
        LimbProbabilities(np.array(group), state.joints, probability)
        for group, state, probability in zip(
            half.sides, (one, other), limb_state_probabilities(weighed), strict=True
        )
    )
    for state, group, path in zip(
        (one, other), half.sides, choose_limb_pair(one, other, clash), strict=True
    ):
        joints[:, group] = state.joints[frames, path]
        unlikeness[..., group] = state.unlikeness[frames, path]
        row = hypotheses.template[frames, path % hypotheses.prior_cost.shape[1]]
        template[:, group] = row[:, None]
    return ChosenLimbs(joints, template, unlikeness, (of_one, of_other))


def _choose_trunk(
    templates: EdgeTemplates, hypotheses: PoseHypotheses, shots: Shots, fps: float
) -> Int[np.ndarray, "T"]:
    """Hypotheses of what lies between the sides; by the residual alone where it has no joint."""
    half = templates.half
    if not half.middle:
        residual = hypotheses.residual[:, :, half.limb == 0].mean(axis=2)
        return np.where(np.isinf(hypotheses.prior_cost), np.inf, residual).argmin(axis=1)
    members = np.array(half.middle)
    bones = np.isin(half.bones[:, 1], members)
    cost = hypotheses.prior_cost + TRUNK_RESIDUAL * hypotheses.residual[:, :, bones].mean(axis=2)
    cost = cost + TRUNK_UNLIKENESS * hypotheses.unlikeness[:, :, 0, members].sum(axis=2)
    cost += TOO_LONG_COST * _count_too_long(templates, hypotheses.joints[:, :, members], members)
    cost[templates.poses.frames] = 0
    joints = _with_annotations(templates, hypotheses.joints[:, :, members], half.middle)
    unlikeness = hypotheses.unlikeness[..., members]
    spread = _step_spread(half, members, fps)
    return choose_limb(LimbStates(joints, cost, unlikeness, spread, frozenset(shots.first)))


def _with_annotations(
    templates: EdgeTemplates, joints: Complex[np.ndarray, "T S j"], members: tuple[int, ...]
) -> Complex[np.ndarray, "T S j"]:
    """All states of an annotated frame are the annotation."""
    joints = joints.copy()
    joints[templates.poses.frames] = templates.poses.joints[:, None, members]
    return joints


def _step_spread(
    half: BodyHalf, members: Int[np.ndarray, "j"], fps: float
) -> Float[np.ndarray, "j"]:
    return STEP_SPEED / fps * 2.0 ** np.clip(half.depth[members] - 1, 0, None)


def _limb_states(
    templates: EdgeTemplates,
    hypotheses: PoseHypotheses,
    joints: Complex[np.ndarray, "T J"],
    side: SideStates,
    cost: Float[np.ndarray, "T S"],
    shots: Shots,
    fps: float,
) -> LimbStates:
    """The same side of every hypothesis, then the other side; `joints` has the trunk."""
    own, _ = side.members
    invalid = np.isinf(hypotheses.prior_cost)
    cost = np.where(np.concatenate([invalid, invalid], axis=1), np.inf, cost)
    cost += TOO_LONG_COST * _count_too_long(templates, side.joints, own)
    cost += _joining_costs(templates, joints, side)
    cost[templates.poses.frames] = 0
    unlikeness = [
        hypotheses.unlikeness[:, :, ::order, members]
        for order, members in zip((1, -1), side.members, strict=True)
    ]
    return LimbStates(
        _with_annotations(templates, side.joints, tuple(own.tolist())),
        cost,
        np.concatenate(unlikeness, axis=1),
        _step_spread(templates.half, own, fps),
        frozenset(shots.first),
    )


def _count_too_long(
    templates: EdgeTemplates, joints: Complex[np.ndarray, "T S j"], members: Int[np.ndarray, "j"]
) -> Int[np.ndarray, "T S"]:
    """Bones between some joints that are longer than they can be."""
    place = {joint: at for at, joint in enumerate(members.tolist())}
    bones = templates.half.bones
    inside = np.flatnonzero(np.isin(bones, members).all(axis=1))
    ends = np.array([[place[a], place[b]] for a, b in bones[inside].tolist()], int)
    start, stop = ends.reshape(-1, 2).T
    length = np.abs(joints[:, :, stop] - joints[:, :, start])
    return (length > templates.poses.longest[inside] * (1 + ROUNDING)).sum(axis=2)


def _joining_costs(
    templates: EdgeTemplates, joints: Complex[np.ndarray, "T J"], side: SideStates
) -> Float[np.ndarray, "T S"]:
    """Cost of bones from the trunk, whose joints are chosen, that are too long."""
    half, own = templates.half, side.members[0].tolist()
    cost = np.zeros(side.joints.shape[:2])
    for (parent, child), longest in zip(half.bones.tolist(), templates.poses.longest, strict=True):
        if parent in half.middle and child in own:
            place = side.joints[:, :, own.index(child)]
            cost += TOO_LONG_COST * (np.abs(place - joints[:, parent, None]) > longest)
    return cost


def _breadth_costs(
    templates: EdgeTemplates, one: LimbStates, other: LimbStates
) -> Float[np.ndarray, "T S S"]:
    """Cost of pairs of sides that are too far apart where a bone joins them."""
    half, poses = templates.half, templates.poses
    cost = np.zeros((len(one.joints), one.joints.shape[1], other.joints.shape[1]))
    for (start, stop), longest in zip(half.bones.tolist(), poses.longest, strict=True):
        for place, pair in enumerate(zip(*half.sides, strict=True)):
            if {start, stop} == set(pair):
                across = one.joints[:, :, None, place] - other.joints[:, None, :, place]
                cost += TOO_LONG_COST * (np.abs(across) > longest)
    cost[poses.frames] = 0
    return cost


def choose_limb(states: LimbStates) -> Int[np.ndarray, "T"]:
    """Cheapest path of one limb."""
    return find_cheapest_path(list(states.cost), lambda _, t: states.transition_costs(t))


def choose_limb_pair(
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
        return side.transition_costs((turn + 1) // 2)[:, None]

    path = find_cheapest_path(unary, transition)
    return path[::2], path[1::2]
