"""Evidence for the limbs of a hypothesis, and its weights.

Evidence of one limb: do edges lie on its outline (`residual`), do its joints and the middles of its
bones look like marked ones (`unlikeness`), have its bones the colours of marked ones
(`bone_color`), is it where optical flow from the marks and straight lines between them lead, do
other hypotheses agree? Evidence of two limbs: how many of the frame's edge elements do both and the
trunk leave unexplained, how much of its silhouette (`unexplained_silhouette`), do both lie in one
place, do they come from one pose, are their ends farther apart than ever marked?

The weights are not set by hand: with probabilities proportional to exp(-cost), those of the right
pairs of limbs were made as likely as they can be (a conditional logit, McFadden 1974) on frames
whose joints are known, of real clips marked by eye and of rendered sequences. None may be negative:
what speaks for a limb must not speak against it. `python benchmarks/choice.py` makes the table and
prints what it is worth, every clip chosen by weights from the others alone.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.propagation.edge_template import AnnotatedPoses, EdgeTemplates
from keyrecon.propagation.hypotheses import MarkPredictions, PoseHypotheses
from keyrecon.propagation.silhouette import (
    Silhouettes,
    find_holding_hand,
    limb_places,
    unexplained_silhouette,
)

COLOR_EVIDENCE = "color unlikeness"
"""Evidence that is not gathered for a half of the body that does not weigh it."""
WEIGHTS: dict[str, dict[str, float]] = {
    "upper": {
        "end residual": 2.05,
        "unlikeness": 1.62,
        "end unlikeness": 0.67,
        "bone unlikeness": 2.27,
        COLOR_EVIDENCE: 0.6,
        "other side": 0.78,
        "off flow": 0.71,
        "off lines": 0.64,
        "unexplained edges": 13.6,
        "unexplained silhouette": 20.7,
        "together": 0.36,
        "of two poses": 0.78,
        "span": 1.19,
    },
    "lower": {
        "residual": 0.30,
        "end residual": 0.05,
        "unlikeness": 1.46,
        "end unlikeness": 0.31,
        "bone unlikeness": 1.65,
        "other side": 0.18,
        "disagreement": 0.40,
        "off flow": 0.67,
        "off lines": 0.31,
        "unexplained edges": 13.9,
        "unexplained silhouette": 19.8,
        "together": 0.39,
        "of two poses": 0.03,
    },
}
"""Cost per unit of evidence, for arms and for legs; a likeness is worth as much as it says, an
element that nothing explains a 14th of all of them, a place of the silhouette a 20th. On six real
clips, as they are and mirrored, with two or three choices of marks each, chosen by weights from the
other clips, PCK@0.2 is 95.1 % (93.2 within strokes and swings; legs 97.6, arms 90.2) where it was
94.0 (91.9; 96.7, 88.5) by edges and looks alone, without the limbs that the silhouette proposes.
Either alone is worth nothing: in 18 draws of three tennis clips legs were 94.5 % before, 94.3 with
such limbs, 94.2 with that cost and 96.7 with both. On five rendered sequences it is 98.9 % with and
without. Colours along the bones of arms:
fits to frames of these clips gave a nat .3 to .8 beside the other weights, which hardly changed. Of
six of the clips, three choices of marks each, 96.0 % of all joints are right with .6, 95.2 without
and without arms looked for by colours (four of tennis and golf .7 to 2.0 points more, two .1 more
and less). To legs they add nothing: marked ones are as probable as before."""
SCALE = 4.0
"""What the evidence of a frame counts for against the length of steps. On the same clips PCK was
95.9 % with 1, 96.3 with 2 and 96.7 with 4, with weights that could be negative; with those that may
not, 96.4 with 4 and with 8."""
FLOW_DISTANCE = 0.05
"""Distance from flow that counts as one, player heights; twice that counts most. A quarter more or
less, others with it: at most 1.5 points, 2.1 mm on nine clips."""
LINE_DISTANCE, LINE_SECONDS = 0.1, 0.15
"""The same from a straight line between marks, and the time from a mark in which that is worth
least by a factor of e. A quarter more or less, others with them: at most 1.5 points, 2.1 mm on nine
clips."""
AGREEMENT_DISTANCE = 0.04
"""Hypotheses within this distance agree, player heights. A quarter more or less, others with it: at
most 1.2 points, 2.1 mm on nine clips."""
NOBODY_AGREES = 0.2
"""Agreement that a hypothesis has with none: the logarithm has an end. A quarter more or less,
others with it: at most 1.2 points, 2.1 mm on nine clips."""
OVERLAP_DISTANCE = 0.03
"""Joints of both sides nearer than this are in one place, player heights. A quarter more or less,
others with it: at most 1.2 points, 2.1 mm on nine clips."""
GRIP = 0.15
"""Wrists that hold one grip are not farther apart, player heights: a hand is .108 statures long
(Winter), .12 of the height from the middle of the head to the feet; .03 for what marks are off."""
SPAN_SPREAD = 0.03
"""Error of the distance between both hands: two eyes mark the same joint .016 apart."""


@dataclass(frozen=True, eq=False)
class SideStates:
    """The limbs of one side in all hypotheses, those of the other side after them: S states."""

    members: tuple[Int[np.ndarray, "j"], Int[np.ndarray, "j"]]
    """Joints of the side, then of the other."""
    joints: Complex[np.ndarray, "T S j"]


@dataclass(frozen=True, eq=False)
class LimbEvidence:
    """Evidence against the states of both sides and their pairs: costs before they are weighted."""

    sides: tuple[SideStates, SideStates]
    of_sides: tuple[dict[str, Float[np.ndarray, "T S"]], dict[str, Float[np.ndarray, "T S"]]]
    of_pairs: Iterator[tuple[str, Float[np.ndarray, "T S S"]]]
    """Made one after the other, to be used once: they are large."""


@dataclass(frozen=True, eq=False)
class LimbCosts:
    """The same, weighed."""

    sides: tuple[Float[np.ndarray, "T S"], Float[np.ndarray, "T S"]]
    pairs: Float[np.ndarray, "T S S"]


def find_evidence(
    templates: EdgeTemplates,
    hypotheses: PoseHypotheses,
    trunk: Int[np.ndarray, "T"],
    predictions: MarkPredictions | None,
    silhouettes: Silhouettes | None = None,
) -> LimbEvidence:
    """Of all hypotheses; `trunk` is the one that the trunk has."""
    one, other = (side_states(hypotheses, templates, side) for side in (0, 1))
    return LimbEvidence(
        (one, other),
        (
            side_evidence(templates, hypotheses, predictions, one),
            side_evidence(templates, hypotheses, predictions, other),
        ),
        pair_evidence(templates, hypotheses, trunk, (one, other), silhouettes),
    )


def weigh_evidence(half: str, evidence: LimbEvidence) -> LimbCosts:
    """Costs of states and of pairs of states."""
    weights = WEIGHTS[half]
    one, other = (
        np.sum([weights.get(name, 0.0) * values for name, values in side.items()], axis=0)
        for side in evidence.of_sides
    )
    pairs = np.zeros((*one.shape, one.shape[1]))
    for name, values in evidence.of_pairs:
        pairs += weights.get(name, 0.0) * values
    return LimbCosts((SCALE * one, SCALE * other), SCALE * pairs)


def limb_state_probabilities(costs: LimbCosts) -> tuple[Float[np.ndarray, "T S"], ...]:
    """Of the states of each side, by what is seen in a frame alone and not by the frames around it.

    What the weights were fitted to give: exp(-cost), so that of hypotheses that are told to be
    right with .8 eight in ten are.
    """
    one, other = costs.sides
    of_sides = np.zeros((2, *one.shape))
    for t, pairs in enumerate(costs.pairs):
        total = (one[t][:, None] + other[t] + pairs) / SCALE
        chance = np.exp(total.min() - total)
        chance /= chance.sum()
        of_sides[:, t] = chance.sum(axis=1), chance.sum(axis=0)
    return tuple(of_sides)


def side_states(hypotheses: PoseHypotheses, templates: EdgeTemplates, side: int) -> SideStates:
    """States of one side."""
    own = np.array(templates.half.sides[side])
    members = own, templates.half.mirror[own]
    joints = np.concatenate([hypotheses.joints[:, :, side] for side in members], axis=1)
    return SideStates(members, joints)


def side_evidence(
    templates: EdgeTemplates,
    hypotheses: PoseHypotheses,
    predictions: MarkPredictions | None,
    states: SideStates,
) -> dict[str, Float[np.ndarray, "T S"]]:
    """Evidence against each state of a side."""
    half, own = templates.half, states.members[0]
    bones = [np.isin(half.bones[:, 1], side) for side in states.members]
    ends = [half.bones[:, 1] == side[-1] for side in states.members]
    unlike, middle = hypotheses.unlikeness, hypotheses.bone_unlikeness
    shape = hypotheses.joints.shape[:2]

    def of_both(parts: list[Float[np.ndarray, "T P"]]) -> Float[np.ndarray, "T S"]:
        return np.concatenate(parts, axis=1)

    evidence = {
        "residual": of_both([hypotheses.residual[..., b].mean(axis=2) for b in bones]),
        "end residual": of_both([hypotheses.residual[..., e].mean(axis=2) for e in ends]),
        "unlikeness": of_both(
            [unlike[:, :, n, side].sum(axis=2) for n, side in enumerate(states.members)]
        ),
        "end unlikeness": of_both(
            [unlike[:, :, n, side[-1]] for n, side in enumerate(states.members)]
        ),
        "bone unlikeness": of_both([middle[:, :, n, b].sum(axis=2) for n, b in enumerate(bones)]),
        COLOR_EVIDENCE: of_both(
            [hypotheses.color_unlikeness[:, :, n, b].sum(axis=2) for n, b in enumerate(bones)]
        ),
        "other side": of_both([np.zeros(shape), np.ones(shape)]),
        "disagreement": _disagreement(hypotheses, states),
    }
    if predictions is not None:
        flow = np.abs(states.joints - predictions.flow[:, None, own]) / FLOW_DISTANCE
        sure = predictions.flow_confidence[:, None, own]
        evidence["off flow"] = (sure * np.minimum(flow, 2)).sum(axis=2)
        line = np.abs(states.joints - predictions.lines[:, None, own]) / LINE_DISTANCE
        near = np.exp(-predictions.seconds[:, None, own] / LINE_SECONDS)
        evidence["off lines"] = (near * np.minimum(line, 2)).sum(axis=2)
    return evidence


def _disagreement(hypotheses: PoseHypotheses, states: SideStates) -> Float[np.ndarray, "T S"]:
    """Minus the logarithm of how many other hypotheses have the side's joints there."""
    count = hypotheses.joints.shape[1]
    valid = np.isfinite(hypotheses.prior_cost)[:, None]
    total = np.zeros(states.joints.shape[:2])
    for place, joint in enumerate(states.members[0].tolist()):
        apart = np.abs(states.joints[:, :, None, place] - hypotheses.joints[:, None, :, joint])
        alike = valid * np.exp(-0.5 * (apart / AGREEMENT_DISTANCE) ** 2)
        agreeing = alike.sum(axis=2)
        agreeing[:, :count] -= np.where(valid[:, 0], 1, 0)
        total -= np.log(np.maximum(agreeing, 0) + NOBODY_AGREES)
    return total


def pair_evidence(
    templates: EdgeTemplates,
    hypotheses: PoseHypotheses,
    trunk: Int[np.ndarray, "T"],
    sides: tuple[SideStates, SideStates],
    silhouettes: Silhouettes | None,
) -> Iterator[tuple[str, Float[np.ndarray, "T S S"]]]:
    """Evidence against each pair of states of both sides, one kind after the other."""
    frames, (one, other) = np.arange(len(trunk)), sides
    count = np.maximum((templates.frame_elements >= 0).sum(axis=1), 1)
    unexplained = hypotheses.unexplained
    middle = unexplained[frames, trunk, 0]
    first = np.concatenate([unexplained[:, :, 1], unexplained[:, :, 2]], axis=1)
    second = np.concatenate([unexplained[:, :, 2], unexplained[:, :, 1]], axis=1)
    unexplained_edges = (first * middle[:, None]) @ second.transpose(0, 2, 1)
    yield "unexplained edges", unexplained_edges / count[:, None, None]
    if silhouettes is not None:
        half, joints = templates.half, hypotheses.joints[frames, trunk]
        places = limb_places(silhouettes, half, joints)
        holding = find_holding_hand(silhouettes, templates.poses)
        yield (
            "unexplained silhouette",
            unexplained_silhouette(places, half, joints, (one.joints, other.joints), holding),
        )
    together = np.zeros(unexplained_edges.shape)
    for place in range(1, one.joints.shape[2]):
        apart = np.abs(one.joints[:, :, None, place] - other.joints[:, None, :, place])
        together += np.exp(-0.5 * (apart / OVERLAP_DISTANCE) ** 2)
    yield "together", together
    yield (
        "of two poses",
        np.broadcast_to(1 - np.eye(unexplained_edges.shape[1]), unexplained_edges.shape),
    )
    span = np.abs(one.joints[:, :, None, -1] - other.joints[:, None, :, -1])
    yield "span", span_cost(span, marked_spans(templates.poses))


def marked_spans(poses: AnnotatedPoses) -> Float[np.ndarray, "_"]:
    """How far apart the ends of both sides are on the annotated frames that have both."""
    ends = [side[-1] for side in poses.half.sides]
    both = poses.known[:, ends].all(axis=1)
    return np.abs(poses.joints[both, ends[0]] - poses.joints[both, ends[1]])


def span_cost(
    span: Float[np.ndarray, "*n"], marked: Float[np.ndarray, "_"]
) -> Float[np.ndarray, "*n"]:
    """Cost of hands, or feet, that are farther apart than they were ever marked, nats.

    Hands that hold one club are never far apart, and where they were on all marks, they are taken
    to hold one. Where they were not, marks tell little of how far apart they come: to ask it of
    all hands cost 2.3 points in a rally whose strokes have them wider apart than any mark. If
    frames were drawn like those marked, one in as many and one more would have them farther apart
    than all marks: the most that can be said.
    """
    if not len(marked) or marked.max() > GRIP:
        return np.zeros(span.shape)
    beyond = np.maximum(span - marked.max(), 0) / SPAN_SPREAD
    return np.log(len(marked) + 1) * (1 - np.exp(-0.5 * beyond**2))
