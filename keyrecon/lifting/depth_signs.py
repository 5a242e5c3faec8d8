"""Which end of a bone is nearer the camera.

Under scaled orthography a bone's |dz| follows from its length, its sign does not; but given
scale and lengths the 2^B reconstructions fall apart into small groups (trunk, legs, arms),
coupled through joint limits. For single poses the cheapest signs of trunk and limbs are found
exactly: limbs hang on the trunk as a tree. Over time each group is a chain whose states are
the sign vectors of its bones; a second-order cost on depth lets a bone swing through the image
plane, which a first-order one would take for a bounce. Key poses that are alike in the picture
are exemplars of the depths that the person annotated there.
"""

from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.body import Skeleton
from keyrecon.lifting.depth_evidence import (
    DepthSignOptions,
    DepthSigns,
    ForeshortenedBones,
    sign_depths,
    sign_states,
)
from keyrecon.lifting.priors.anatomy import (
    Anatomy,
    Limb,
    anatomy_of,
    arm_cost,
    head_cost,
    leg_cost,
    trunk_axes,
    trunk_cost,
)
from keyrecon.lifting.priors.exemplars import ExemplarPrior
from keyrecon.lifting.priors.occlusion import hidden_cost
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.numerics.viterbi import find_cheapest_path

_EXPECTED_DEPTH_SPREAD = 0.4
"""Error of a depth model as the choice of signs takes it, in lengths of the bone. With what it is
off for players of tennis that it has not learnt from (.10 to .18) eight sequences come out at 43.4
instead of 44.6 mm without signs from a person, but dance, a kick and jumps, when nothing of the
kind was learnt, at 63.5 instead of 61.3. A quarter more costs 3.8 mm where nobody gave signs, on
one of eight clips of 6 s; no video without signs shows how far a model is off."""
_CHUNK_FRAMES = 200
"""Frames whose transitions are computed at once: 7 MB."""


def choose_depth_signs(
    bones: ForeshortenedBones,
    nearer: Int[np.ndarray, "T B"],
    breadths: Float[np.ndarray, "P"],
    skeleton: Skeleton,
    options: DepthSignOptions = DepthSignOptions(),
) -> DepthSigns:
    """Cheapest signs of every pose by itself: an exact minimum over all sign vectors.

    `nearer` as in `Annotations` (1: child end nearer, dz < 0); `breadths` in statures.
    """
    anatomy = anatomy_of(skeleton)
    trunk, limbs = sign_costs(bones, nearer, breadths, skeleton, options)
    total = trunk + sum(cost.min(axis=-1) for cost in limbs)
    sign = np.ones(nearer.shape, dtype=np.int64)
    probability = np.ones(nearer.shape)
    rows = np.arange(len(sign))
    best = total.argmin(axis=1)
    if anatomy.trunk:
        group = list(anatomy.trunk)
        sign[:, group], probability[:, group] = _signs_of_states(best, total, len(group))
    for limb, cost in zip(anatomy.limbs, limbs, strict=True):
        given = cost[rows, best % cost.shape[1]]
        group = list(limb.bones)
        signs = _signs_of_states(given.argmin(axis=1), given, len(group))
        sign[:, group], probability[:, group] = signs
    return DepthSigns(sign, probability)


def sign_costs(
    bones: ForeshortenedBones,
    nearer: Int[np.ndarray, "T B"],
    breadths: Float[np.ndarray, "P"],
    skeleton: Skeleton,
    options: DepthSignOptions = DepthSignOptions(),
) -> tuple[Float[np.ndarray, "T S"], list[Float[np.ndarray, "T S _"]]]:
    """Cost of every trunk state, and of every state of each limb given it, nats.

    States as `sign_states` lists them, limbs in the order of `anatomy_of`.
    """
    anatomy = anatomy_of(skeleton)
    trunk, limbs = _prior_costs(bones, breadths, anatomy, 1.0, 1.0)
    trunk = trunk + _contradiction_cost(anatomy.trunk, nearer, options.annotated)
    limbs = [
        cost + _contradiction_cost(limb.bones, nearer, options.annotated)[:, None]
        for limb, cost in zip(anatomy.limbs, limbs, strict=True)
    ]
    return trunk, limbs


def track_depth_signs(
    bones: ForeshortenedBones,
    exemplars: ExemplarPrior,
    breadths: Float[np.ndarray, "P"],
    skeleton: Skeleton,
    options: DepthSignOptions = DepthSignOptions(),
    hidden: Bool[np.ndarray, "T J"] | None = None,
) -> DepthSigns:
    """Signs in every frame of a sequence, group by group: trunk first, then what hangs on it.

    `hidden`: joints that were marked as not visible.
    """
    anatomy = anatomy_of(skeleton)
    trunk, limbs = _prior_costs(
        bones, breadths, anatomy, options.joint_limits, options.expected_depth
    )
    if hidden is not None:
        limbs = _with_occlusion(limbs, bones, hidden, anatomy)
    sign = np.ones(bones.depth.shape, dtype=np.int64)
    probability = np.ones(bones.depth.shape)
    rows = np.arange(len(sign))
    best = np.zeros(len(sign), dtype=np.int64)
    if anatomy.trunk:
        total = trunk + sum(cost.min(axis=-1) for cost in limbs)
        total += exemplars.cost(anatomy.trunk, bones, options)
        total += exemplars.initial_motion_cost(anatomy.trunk, bones, options)
        group = list(anatomy.trunk)
        best = second_order_path(
            total, bones.depth[:, group], bones.depth_spread[:, group], options
        )
        sign[:, group], probability[:, group] = _signs_of_states(best, total, len(group))
    for limb, cost in zip(anatomy.limbs, limbs, strict=True):
        given = cost[rows, best % cost.shape[1]]
        given += exemplars.cost(limb.bones, bones, options)
        given += exemplars.initial_motion_cost(limb.bones, bones, options)
        group = list(limb.bones)
        path = second_order_path(
            given, bones.depth[:, group], bones.depth_spread[:, group], options
        )
        sign[:, group], probability[:, group] = _signs_of_states(path, given, len(group))
    return DepthSigns(sign, probability)


def second_order_path(
    cost: Float[np.ndarray, "T S"],
    depth: Float[np.ndarray, "T g"],
    depth_spread: Float[np.ndarray, "T g"],
    options: DepthSignOptions,
) -> Int[np.ndarray, "T"]:
    """Cheapest sequence of states; jumps in the second difference of depth cost.

    `depth` is |dz| of a group of bones, whose sign vectors are the states.
    """
    frames, states = cost.shape
    if frames < 3:
        return cost.argmin(axis=1)

    @lru_cache(maxsize=1)
    def jumps_of(chunk: int) -> Float[np.ndarray, "n S S S"]:
        first = chunk * _CHUNK_FRAMES
        last = min(first + _CHUNK_FRAMES, frames - 2)
        return _jump_costs(depth[first : last + 2], depth_spread[first + 1 : last + 1], options)

    def transition(before: int, _: int) -> Float[np.ndarray, "S S S"]:
        return jumps_of(before // _CHUNK_FRAMES)[before % _CHUNK_FRAMES]

    pairs = np.broadcast_to(cost[2:, None], (frames - 2, states, states))
    return find_cheapest_path([cost[0][:, None] + cost[1], *pairs], transition)


def _jump_costs(
    depth: Float[np.ndarray, "m g"],
    depth_spread: Float[np.ndarray, "n g"],
    options: DepthSignOptions,
) -> Float[np.ndarray, "n S S S"]:
    """Cost of all states of three frames in a row: a sum over bones, each with its own sign."""
    signs = np.array([1.0, -1.0])
    before, now, after = (depth[k : k + len(depth_spread), :, None] * signs for k in range(3))
    bend = before[..., :, None, None] - 2 * now[..., None, :, None] + after[..., None, None, :]
    variance = options.acceleration**2 + depth_spread**2
    each = bend**2 / (2 * variance)[..., None, None, None]
    bones, total = depth_spread.shape[1], np.zeros(1)
    for bone in range(bones):
        axes = [2 if b == bone else 1 for b in range(bones)]
        total = total + each[:, bone].reshape(-1, *axes, *axes, *axes)
    return np.minimum(total, options.max_jump_cost).reshape(-1, *[2**bones] * 3)


def _prior_costs(
    bones: ForeshortenedBones,
    breadths: Float[np.ndarray, "P"],
    anatomy: Anatomy,
    limit_weight: float,
    expected_depth_weight: float,
) -> tuple[Float[np.ndarray, "T S"], list[Float[np.ndarray, "T S _"]]]:
    """Cost of every trunk state, and of every limb state given it."""
    trunk, limbs = _limit_costs(bones, breadths, anatomy)
    trunk = limit_weight * trunk
    if anatomy.trunk:
        trunk += expected_depth_weight * _expected_depth_cost(anatomy.trunk, bones)
    return trunk, [
        limit_weight * cost
        + expected_depth_weight * _expected_depth_cost(limb.bones, bones)[:, None]
        for limb, cost in zip(anatomy.limbs, limbs, strict=True)
    ]


def _expected_depth_cost(
    group: tuple[int, ...], bones: ForeshortenedBones
) -> Float[np.ndarray, "T S"]:
    """How far the depth of a group of bones is from the expected, for every sign vector, nats."""
    depth, members = sign_depths(group, bones), list(group)
    expected = bones.expected_depth[:, None, members]
    length = np.sqrt((bones.in_plane**2).sum(axis=-1) + bones.depth**2)[:, None, members]
    variance = (_EXPECTED_DEPTH_SPREAD * length) ** 2 + bones.depth_spread[:, None, members] ** 2
    return np.nan_to_num((depth - expected) ** 2 / (2 * variance)).sum(axis=-1)


def _limit_costs(
    bones: ForeshortenedBones, breadths: Float[np.ndarray, "P"], anatomy: Anatomy
) -> tuple[Float[np.ndarray, "T S"], list[Float[np.ndarray, "T S _"]]]:
    """Cost of joint limits for every trunk state, and of every limb state given it."""
    frames = len(bones.in_plane)
    if not anatomy.trunk:
        free = [np.zeros((frames, 1, 2 ** len(limb.bones))) for limb in anatomy.limbs]
        return np.zeros((frames, 1)), free
    corners = _vectors_of_states(anatomy.trunk, bones)
    trunk = trunk_cost(corners, breadths)
    hips, shoulders, up = trunk_axes(corners)
    limbs = []
    for limb in anatomy.limbs:
        directions = unit_vectors(_vectors_of_states(limb.bones, bones)[:, None], 1e-9)
        axes = hips if limb.kind == "leg" else shoulders
        limbs.append(_limb_cost(limb, directions, axes[:, :, None], up[:, :, None]))
    return trunk, limbs


def _with_occlusion(
    limbs: list[Float[np.ndarray, "T S _"]],
    bones: ForeshortenedBones,
    hidden: Bool[np.ndarray, "T J"],
    anatomy: Anatomy,
) -> list[Float[np.ndarray, "T S _"]]:
    """Costs of the arms with those of hidden joints that would lie before the trunk."""
    frames = np.flatnonzero(hidden.any(axis=1))
    if not anatomy.trunk or not len(frames):
        return limbs
    observed = bones.part(frames)
    corners = _vectors_of_states(anatomy.trunk, observed)
    result = []
    for limb, cost in zip(anatomy.limbs, limbs, strict=True):
        if limb.kind == "arm":
            shoulder = corners[:, :, 2 if limb.side > 0 else 3]
            vectors = _vectors_of_states(limb.bones, observed)
            cost[frames] += hidden_cost(
                corners, shoulder, vectors, hidden[frames][:, list(limb.joints)]
            )
        result.append(cost)
    return result


def _limb_cost(
    limb: Limb,
    directions: Float[np.ndarray, "T 1 L g 3"],
    axis: Float[np.ndarray, "T S 1 3"],
    up: Float[np.ndarray, "T S 1 3"],
) -> Float[np.ndarray, "T S L"]:
    if limb.kind == "leg":
        return leg_cost(axis, up, directions[..., 0, :], directions[..., 1, :], limb.side)
    if limb.kind == "arm":
        return arm_cost(axis, up, directions[..., 0, :], directions[..., 1, :], limb.side)
    if limb.kind == "head":
        return head_cost(axis, up, directions[..., 0, :])
    return np.zeros((*axis.shape[:2], directions.shape[2]))


def _vectors_of_states(
    group: tuple[int, ...], bones: ForeshortenedBones
) -> Float[np.ndarray, "T S g 3"]:
    """Bone vectors for every sign vector of a group."""
    depth = sign_depths(group, bones)
    in_plane = np.broadcast_to(bones.in_plane[:, None, list(group)], (*depth.shape, 2))
    return np.concatenate([in_plane, depth[..., None]], axis=-1)


def _contradiction_cost(
    group: tuple[int, ...], nearer: Int[np.ndarray, "T B"], cost: float
) -> Float[np.ndarray, "T S"]:
    if not group:
        return np.zeros((len(nearer), 1))
    annotated = -nearer[:, None, list(group)]
    return cost * ((sign_states(len(group)) * annotated) < 0).sum(-1)


def _signs_of_states(
    best: Int[np.ndarray, "T"], cost: Float[np.ndarray, "T S"], bones: int
) -> tuple[Int[np.ndarray, "T g"], Float[np.ndarray, "T g"]]:
    """Signs of the chosen states, and their probability by the costs of all states."""
    states = sign_states(bones)
    chosen = states[best]
    weight = np.exp(-(cost - cost.min(axis=1, keepdims=True)))
    same = states[None] == chosen[:, None]
    agree = (weight[..., None] * same).sum(1) / weight.sum(1)[:, None]
    return chosen, np.maximum(agree, 0.5)
