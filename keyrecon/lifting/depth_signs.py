"""Which end of a bone is nearer the camera.

Under scaled orthography a bone's |dz| follows from its length, its sign does not; but given
scale and lengths the 2^B reconstructions fall apart into small groups (trunk, legs, arms),
coupled through joint limits. For single poses the cheapest signs of trunk and limbs are found
exactly: limbs hang on the trunk as a tree. Over time each group is a chain whose states are
the sign vectors of its bones; a second-order cost on depth lets a bone swing through the image
plane, which a first-order one would take for a bounce. The key poses vote, where they look
alike in the picture, for the depths that the person confirmed there.
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

_USUAL_SPREAD = 0.4
"""How far depths are from the usual, in lengths of the bone: root mean square over players whose
captures a model had not learnt from."""
_CHUNK = 200
"""Frames whose jumps are weighed at once: 7 MB."""


def choose_depth_signs(
    shown: ForeshortenedBones,
    nearer: Int[np.ndarray, "T B"],
    breadths: Float[np.ndarray, "P"],
    skeleton: Skeleton,
    options: DepthSignOptions = DepthSignOptions(),
) -> DepthSigns:
    """Cheapest signs of every pose by itself: an exact minimum over all sign vectors.

    `nearer` as in `Annotations` (1: child end nearer, dz < 0); `breadths` in statures.
    """
    anatomy = anatomy_of(skeleton)
    trunk, limbs = sign_costs(shown, nearer, breadths, skeleton, options)
    total = trunk + sum(cost.min(axis=-1) for cost in limbs)
    sign = np.ones(nearer.shape, dtype=np.int64)
    probability = np.ones(nearer.shape)
    rows = np.arange(len(sign))
    best = total.argmin(axis=1)
    if anatomy.trunk:
        bones = list(anatomy.trunk)
        sign[:, bones], probability[:, bones] = _read(best, total, len(bones))
    for limb, cost in zip(anatomy.limbs, limbs, strict=True):
        given = cost[rows, best % cost.shape[1]]
        bones = list(limb.bones)
        sign[:, bones], probability[:, bones] = _read(given.argmin(axis=1), given, len(bones))
    return DepthSigns(sign, probability)


def sign_costs(
    shown: ForeshortenedBones,
    nearer: Int[np.ndarray, "T B"],
    breadths: Float[np.ndarray, "P"],
    skeleton: Skeleton,
    options: DepthSignOptions = DepthSignOptions(),
) -> tuple[Float[np.ndarray, "T S"], list[Float[np.ndarray, "T S _"]]]:
    """Cost of every trunk state, and of every state of each limb given it, nats.

    States as `sign_states` lists them, limbs in the order of `anatomy_of`.
    """
    anatomy = anatomy_of(skeleton)
    trunk, limbs = _costs(shown, breadths, anatomy, (1.0, 1.0))
    trunk = trunk + _contradiction(anatomy.trunk, nearer, options.confirmed)
    limbs = [
        cost + _contradiction(limb.bones, nearer, options.confirmed)[:, None]
        for limb, cost in zip(anatomy.limbs, limbs, strict=True)
    ]
    return trunk, limbs


def track_depth_signs(
    shown: ForeshortenedBones,
    votes: ExemplarPrior,
    breadths: Float[np.ndarray, "P"],
    skeleton: Skeleton,
    options: DepthSignOptions = DepthSignOptions(),
    hidden: Bool[np.ndarray, "T J"] | None = None,
) -> DepthSigns:
    """Signs in every frame of a sequence, group by group: trunk first, then what hangs on it.

    `hidden` tells of joints that were marked though they could not be seen.
    """
    anatomy = anatomy_of(skeleton)
    trunk, limbs = _costs(shown, breadths, anatomy, (options.limits, options.usual))
    if hidden is not None:
        limbs = _with_hidden(limbs, shown, hidden, skeleton)
    sign = np.ones(shown.depth.shape, dtype=np.int64)
    probability = np.ones(shown.depth.shape)
    rows = np.arange(len(sign))
    best = np.zeros(len(sign), dtype=np.int64)
    if anatomy.trunk:
        total = trunk + sum(cost.min(axis=-1) for cost in limbs)
        total += votes.cost(anatomy.trunk, shown, options)
        total += votes.guided(anatomy.trunk, shown, options)
        best = _path(total, anatomy.trunk, shown, options)
        bones = list(anatomy.trunk)
        sign[:, bones], probability[:, bones] = _read(best, total, len(bones))
    for limb, cost in zip(anatomy.limbs, limbs, strict=True):
        given = cost[rows, best % cost.shape[1]]
        given += votes.cost(limb.bones, shown, options)
        given += votes.guided(limb.bones, shown, options)
        path = _path(given, limb.bones, shown, options)
        bones = list(limb.bones)
        sign[:, bones], probability[:, bones] = _read(path, given, len(bones))
    return DepthSigns(sign, probability)


def _path(
    cost: Float[np.ndarray, "T S"],
    bones: tuple[int, ...],
    shown: ForeshortenedBones,
    options: DepthSignOptions,
) -> Int[np.ndarray, "T"]:
    members = list(bones)
    return second_order_path(cost, shown.depth[:, members], shown.doubt[:, members], options)


def second_order_path(
    cost: Float[np.ndarray, "T S"],
    depth: Float[np.ndarray, "T g"],
    doubt: Float[np.ndarray, "T g"],
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
        first = chunk * _CHUNK
        last = min(first + _CHUNK, frames - 2)
        return _jumps(depth[first : last + 2], doubt[first + 1 : last + 1], options)

    def transition(before: int, _: int) -> Float[np.ndarray, "S S S"]:
        return jumps_of(before // _CHUNK)[before % _CHUNK]

    pairs = np.broadcast_to(cost[2:, None], (frames - 2, states, states))
    return find_cheapest_path([cost[0][:, None] + cost[1], *pairs], transition)


def _jumps(
    depth: Float[np.ndarray, "m g"], doubt: Float[np.ndarray, "n g"], options: DepthSignOptions
) -> Float[np.ndarray, "n S S S"]:
    """Cost of all states of three frames in a row: a sum over bones, of their own signs."""
    signs = np.array([1.0, -1.0])
    before, now, after = (depth[k : k + len(doubt), :, None] * signs for k in range(3))
    bend = before[..., :, None, None] - 2 * now[..., None, :, None] + after[..., None, None, :]
    each = bend**2 / (2 * (options.jerk**2 + doubt**2))[..., None, None, None]
    bones, total = doubt.shape[1], np.zeros(1)
    for bone in range(bones):
        own = [2 if b == bone else 1 for b in range(bones)]
        total = total + each[:, bone].reshape(-1, *own, *own, *own)
    return np.minimum(total, options.reach).reshape(-1, *[2**bones] * 3)


def _costs(
    shown: ForeshortenedBones,
    breadths: Float[np.ndarray, "P"],
    anatomy: Anatomy,
    weights: tuple[float, float],
) -> tuple[Float[np.ndarray, "T S"], list[Float[np.ndarray, "T S _"]]]:
    """Cost of every trunk state, and of every limb state given it.

    `weights` of joint limits and of what is usual. The latter is not asked about the trunk: its
    lean cannot be told from a camera that looks down, so what is usual there tells of cameras.
    """
    limits, usual = weights
    trunk, limbs = _limit_costs(shown, breadths, anatomy)
    return limits * trunk, [
        limits * cost + usual * _unusual(limb.bones, shown)[:, None]
        for limb, cost in zip(anatomy.limbs, limbs, strict=True)
    ]


def _unusual(bones: tuple[int, ...], shown: ForeshortenedBones) -> Float[np.ndarray, "T S"]:
    """How far the depth of a group of bones is from the usual, for every sign vector, nats."""
    depth, doubt = sign_depths(bones, shown)
    usual = shown.usual[:, None, list(bones)]
    length = np.sqrt((shown.flat**2).sum(axis=-1) + shown.depth**2)[:, None, list(bones)]
    spread = (_USUAL_SPREAD * length) ** 2 + doubt[:, None] ** 2
    return np.nan_to_num((depth - usual) ** 2 / (2 * spread)).sum(axis=-1)


def _limit_costs(
    shown: ForeshortenedBones, breadths: Float[np.ndarray, "P"], anatomy: Anatomy
) -> tuple[Float[np.ndarray, "T S"], list[Float[np.ndarray, "T S _"]]]:
    """Cost of joint limits for every trunk state, and of every limb state given it."""
    frames = len(shown.flat)
    if not anatomy.trunk:
        free = [np.zeros((frames, 1, 2 ** len(limb.bones))) for limb in anatomy.limbs]
        return np.zeros((frames, 1)), free
    corners = _candidates(anatomy.trunk, shown)
    trunk = trunk_cost(corners, breadths)
    hips, shoulders, up = trunk_axes(corners)
    limbs = []
    for limb in anatomy.limbs:
        bones = _candidates(limb.bones, shown)[:, None]
        bones = unit_vectors(bones, 1e-9)
        axes = hips if limb.kind == "leg" else shoulders
        limbs.append(_limb_cost(limb, bones, axes[:, :, None], up[:, :, None]))
    return trunk, limbs


def _with_hidden(
    limbs: list[Float[np.ndarray, "T S _"]],
    shown: ForeshortenedBones,
    hidden: Bool[np.ndarray, "T J"],
    skeleton: Skeleton,
) -> list[Float[np.ndarray, "T S _"]]:
    """Costs of the arms with those of hidden joints that would lie before the trunk."""
    anatomy = anatomy_of(skeleton)
    frames = np.flatnonzero(hidden.any(axis=1))
    if not anatomy.trunk or not len(frames):
        return limbs
    seen = shown.part(frames)
    corners = _candidates(anatomy.trunk, seen)
    result = []
    for limb, cost in zip(anatomy.limbs, limbs, strict=True):
        if limb.kind == "arm":
            joints = list(skeleton.bones[list(limb.bones), 1])
            shoulder = corners[:, :, 2 if limb.side > 0 else 3]
            bones = _candidates(limb.bones, seen)
            cost[frames] += hidden_cost(corners, shoulder, bones, hidden[frames][:, joints])
        result.append(cost)
    return result


def _limb_cost(
    limb: Limb,
    bones: Float[np.ndarray, "T 1 L g 3"],
    axis: Float[np.ndarray, "T S 1 3"],
    up: Float[np.ndarray, "T S 1 3"],
) -> Float[np.ndarray, "T S L"]:
    if limb.kind == "leg":
        return leg_cost(axis, up, bones[..., 0, :], bones[..., 1, :], limb.side)
    if limb.kind == "arm":
        return arm_cost(axis, up, bones[..., 0, :], bones[..., 1, :], limb.side)
    if limb.kind == "head":
        return head_cost(axis, up, bones[..., 0, :])
    return np.zeros((*axis.shape[:2], bones.shape[2]))


def _candidates(bones: tuple[int, ...], shown: ForeshortenedBones) -> Float[np.ndarray, "T S g 3"]:
    """Bone vectors for every sign vector of a group."""
    depth, _ = sign_depths(bones, shown)
    flat = np.broadcast_to(shown.flat[:, None, list(bones)], (*depth.shape, 2))
    return np.concatenate([flat, depth[..., None]], axis=-1)


def _contradiction(
    bones: tuple[int, ...], nearer: Int[np.ndarray, "T B"], cost: float
) -> Float[np.ndarray, "T S"]:
    if not bones:
        return np.zeros((len(nearer), 1))
    wanted = -nearer[:, None, list(bones)]
    return cost * ((sign_states(len(bones)) * wanted) < 0).sum(-1)


def _read(
    best: Int[np.ndarray, "T"], cost: Float[np.ndarray, "T S"], bones: int
) -> tuple[Int[np.ndarray, "T g"], Float[np.ndarray, "T g"]]:
    """Signs of the chosen states, and their probability by the costs of all states."""
    states = sign_states(bones)
    chosen = states[best]
    weight = np.exp(-(cost - cost.min(axis=1, keepdims=True)))
    same = states[None] == chosen[:, None]
    agree = (weight[..., None] * same).sum(1) / weight.sum(1)[:, None]
    return chosen, np.maximum(agree, 0.5)
