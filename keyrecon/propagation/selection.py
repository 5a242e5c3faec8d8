"""Choose proposals: the cheapest path through time (Viterbi), each side of the body on its own.

A side (arm or leg) may take a proposal's own side or the other one, since silhouettes do not tell
left from right. Both sides are chosen together: what counts most is how much of the frame's edges
they and the trunk leave unexplained, so that they do not both take the same limb. Besides, a step
costs its length, and a proposal its misfit with the edges and the doubt it comes with. Annotated
frames admit the annotation alone.

The weights were tried at half and twice their values on rendered strokes and serves; none of
them moves the share of joints that are right by more than half a percent.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.numerics.viterbi import find_cheapest_path
from keyrecon.propagation.edge_template import EdgeTemplates
from keyrecon.propagation.foot_evidence import foot_costs
from keyrecon.propagation.half_body import BodyHalf
from keyrecon.propagation.hypotheses import PoseHypotheses

STEP_SPREAD = 0.03
"""Usual step of a joint next to the root, player heights; doubles outwards."""
STEP_MOST = 20.0
"""Largest cost of a joint's step: a jump happens, and it should not outweigh everything else."""
RESIDUAL_WEIGHT = 3.0
"""Cost of a limb whose elements find nothing."""
ASTRAY = 2.0
"""Cost of a leg that ends where no foot was tracked."""
SWAP = 1.0
"""Cost of taking left for right."""
UNEXPLAINED = 48.0
"""Cost of leaving all of the frame's elements unexplained."""


@dataclass(frozen=True, eq=False)
class LimbStates:
    """What a few joints may be in every frame: S states."""

    joints: Complex[np.ndarray, "T S J"]
    cost: Float[np.ndarray, "T S"]
    spread: Float[np.ndarray, "J"]
    """Error of a joint's step, player heights."""

    def steps(self, t: int) -> Float[np.ndarray, "S S"]:
        """Cost of going from each state of frame t - 1 to each of frame t."""
        miss = np.abs(self.joints[t][None] - self.joints[t - 1][:, None]) / self.spread
        return np.minimum(miss**2, STEP_MOST).mean(axis=2)


def choose_limbs(
    puppets: EdgeTemplates, candidates: PoseHypotheses
) -> tuple[Complex[np.ndarray, "T J"], Int[np.ndarray, "T J"]]:
    """(joints, puppet they come from)."""
    half, every = puppets.half, np.arange(len(candidates.which))
    joints = candidates.joints[:, 0].copy()
    which = np.broadcast_to(candidates.which[:, :1], joints.shape).copy()
    groups = [half.middle, *half.sides]
    states = [_limb_states(puppets, candidates, group) for group in groups]
    paths = [choose_one(states[0]) if half.middle else _best_trunk(candidates, half)]
    paths += choose_two(*states[1:], _unexplained(puppets, candidates, paths[0]))
    for group, state, path in zip(groups, states, paths, strict=True):
        joints[:, group] = state.joints[every, path]
        which[:, group] = candidates.which[every, path % candidates.doubt.shape[1]][:, None]
    return joints, which


def _best_trunk(candidates: PoseHypotheses, half: BodyHalf) -> Int[np.ndarray, "T"]:
    """Proposals by the misfit of what lies between the sides."""
    misfit = candidates.misfit[:, :, half.limb == 0].mean(axis=2)
    return np.where(np.isinf(candidates.doubt), np.inf, misfit).argmin(axis=1)


def _limb_states(
    puppets: EdgeTemplates,
    candidates: PoseHypotheses,
    group: tuple[int, ...],
) -> LimbStates:
    """The group's own side of every proposal, then the other side."""
    half, poses, group = puppets.half, puppets.poses, np.array(group, int)
    twin = half.mirror[group]
    sides = [group] if np.array_equal(group, twin) else [group, twin]
    costs = []
    astray = None if puppets.feet is None else foot_costs(puppets.feet, candidates.joints)
    for side in sides:
        bones = np.isin(half.bones[:, 1], side)
        misfit = candidates.misfit[:, :, bones].mean(axis=2) if bones.any() else 0.0
        costs.append(candidates.doubt + RESIDUAL_WEIGHT * misfit + SWAP * len(costs))
        if astray is not None:
            costs[-1] += ASTRAY * astray[:, :, side].sum(axis=2)
    states = np.concatenate(costs, axis=1)
    # all states of an annotated frame are the annotation
    states[poses.frames] = 0
    joints = np.concatenate([candidates.joints[:, :, side] for side in sides], axis=1)
    joints[poses.frames] = poses.joints[:, None, group]
    depth = np.clip(half.depth[group] - 1, 0, None)
    return LimbStates(joints, states, STEP_SPREAD * 2.0**depth)


def _unexplained(
    puppets: EdgeTemplates, candidates: PoseHypotheses, trunk: Int[np.ndarray, "T"]
) -> Float[np.ndarray, "T P P"]:
    """Cost of what a pair of states of the sides, and the trunk, leave of the frame's elements."""
    every = np.arange(len(trunk))
    count = np.maximum((puppets.listed >= 0).sum(axis=1), 1)
    middle = candidates.far[every, trunk, 0]
    one = np.concatenate([candidates.far[:, :, 1], candidates.far[:, :, 2]], axis=1)
    other = np.concatenate([candidates.far[:, :, 2], candidates.far[:, :, 1]], axis=1)
    left = (one * middle[:, None]) @ other.transpose(0, 2, 1)
    left[puppets.poses.frames] = 0
    return UNEXPLAINED * left / count[:, None, None]


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
