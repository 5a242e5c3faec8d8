"""The 3D pose of one keyframe while it is being marked.

Taylor's reconstruction leaves the sign of every bone's depth open. Sign vectors of the trunk, and
of each limb given the trunk, cost what is unusual for bodies (`lifting.priors.anatomy`) and unlike
the keyframes whose signs a person gave, where they look alike in the picture. The cheapest pose is
the estimate; sums over exp(-cost) say how certain each sign is; the next cheapest poses that differ
to the eye are the alternatives. Signs that the person gave hold.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.body import Skeleton
from keyrecon.lifting.depth_evidence import DepthSignOptions, ForeshortenedBones, sign_states
from keyrecon.lifting.depth_signs import sign_costs
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.lifting.priors.anatomy import anatomy_of
from keyrecon.lifting.priors.exemplars import ExemplarPrior
from keyrecon.lifting.taylor import foreshorten_bones

MAX_ALTERNATIVES = 3
"""Other poses offered at most."""
MAX_EXTRA_COST = 6.0
"""Cost above the best up to which a pose is offered, nats: odds of 400 to 1."""
MIN_DEPTH_CHANGE = 0.12
"""Of some joint, for a pose to look different, body heights: a forearm's length."""
SINGLE_FRAME = replace(DepthSignOptions(), exemplars=1.0, annotated=100.0)
"""A picture by itself counts once, and what the person says holds."""


@dataclass(frozen=True, eq=False)
class FrameObservation:
    """One frame's joints: marked, or suggested where they are not marked."""

    joints: Float[np.ndarray, "J 2"]
    """Body heights; NaN where nothing is known."""
    spread: Float[np.ndarray, "J"]
    """Standard deviation of each joint, body heights."""
    nearer: Int[np.ndarray, "B"]
    """Signs that the person gave, as in `Annotations`."""


@dataclass(frozen=True, eq=False)
class Alternative:
    """Another pose that fits the picture as well."""

    nearer: Int[np.ndarray, "B"]
    points3d: Float[np.ndarray, "J 3"]
    cost: float
    """Above that of the most plausible pose, nats."""


@dataclass(frozen=True, eq=False)
class PoseEstimate:
    """What is known of the pose of one frame."""

    points3d: Float[np.ndarray, "J 3"]
    """Body heights, camera axes, the root at depth 0; NaN where the joint is unknown."""
    nearer: Int[np.ndarray, "B"]
    """Sign of every bone, given or chosen."""
    certainty: Float[np.ndarray, "B"]
    """0 a coin toss, 1 certain; 1 where the person gave the sign, 0 where an end is unknown."""
    stretch: Float[np.ndarray, "B"]
    """Length in the picture over the bone's length; cannot be well above 1. NaN: unknown."""
    alternatives: tuple[Alternative, ...]


@dataclass(frozen=True, eq=False)
class _SignCosts:
    """Cost of the trunk's states and of each limb's states given the trunk's, nats."""

    groups: tuple[tuple[int, ...], ...]
    """Bones of the trunk, then those of each limb."""
    trunk: Float[np.ndarray, "S"]
    limbs: tuple[Float[np.ndarray, "S _"], ...]

    def signs(self, states: tuple[int, ...]) -> Int[np.ndarray, "B"]:
        """Sign of every bone when the groups are in these states: 1 farther, as in `Signs`."""
        sign = np.ones(sum(map(len, self.groups)), dtype=np.int64)
        for bones, state in zip(self.groups, states, strict=True):
            sign[list(bones)] = sign_states(len(bones))[state]
        return sign


def estimate_pose(
    observation: FrameObservation,
    size: BodySize,
    skeleton: Skeleton,
    exemplars: ExemplarPrior | None = None,
) -> PoseEstimate:
    """The most plausible pose, how certain its signs are, and what else it could be.

    `exemplars` holds keyframes whose signs are known (not this one). A limb of which a joint is
    unknown stays undecided, and all signs do until the trunk is known.
    """
    ends = observation.joints[skeleton.bones]
    known = np.isfinite(ends).all(axis=(1, 2))
    foreshortened = foreshorten_bones(
        observation.joints[None], observation.spread[None], size.lengths, skeleton
    )
    foreshortened = replace(foreshortened, depth=foreshortened.depth * known)
    costs = _cost_signs(foreshortened, observation.nearer, known, size, skeleton, exemplars)
    ranked = sorted(_enumerate_poses(costs), key=lambda pose: pose.cost)
    sign = costs.signs(ranked[0].states)
    given = observation.nearer != 0
    return PoseEstimate(
        points3d=_points(observation, foreshortened.depth[0] * sign, skeleton),
        nearer=-sign,
        certainty=np.where(given, 1.0, _sign_certainty(costs, sign) * known),
        stretch=np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1) / size.lengths,
        alternatives=tuple(
            _differing(observation, foreshortened.depth[0], costs, ranked, skeleton)
        ),
    )


def _cost_signs(
    foreshortened: ForeshortenedBones,
    nearer: Int[np.ndarray, "B"],
    known: Bool[np.ndarray, "B"],
    size: BodySize,
    skeleton: Skeleton,
    exemplars: ExemplarPrior | None,
) -> _SignCosts:
    """Costs of all states; where joints are unknown only what the person said counts."""
    anatomy = anatomy_of(skeleton)
    trunk, limbs = sign_costs(foreshortened, nearer[None], size.breadths, skeleton, SINGLE_FRAME)
    groups = (anatomy.trunk, *(limb.bones for limb in anatomy.limbs))
    free = [SINGLE_FRAME.annotated * _contradicts(bones, nearer) for bones in groups]
    if not known[list(anatomy.trunk)].all():
        return _SignCosts(groups, free[0], tuple(cost[None] + 0 * trunk.T for cost in free[1:]))
    each = []
    for bones, cost, contradiction in zip(groups[1:], limbs, free[1:], strict=True):
        complete = known[list(bones)].all()
        prior = (
            exemplars.cost(bones, foreshortened, SINGLE_FRAME) if exemplars and complete else 0.0
        )
        each.append(cost[0] + prior if complete else contradiction + 0 * cost[0])
    if exemplars and anatomy.trunk:
        trunk = trunk + exemplars.cost(anatomy.trunk, foreshortened, SINGLE_FRAME)
    return _SignCosts(groups, trunk[0], tuple(each))


def _contradicts(bones: tuple[int, ...], nearer: Int[np.ndarray, "B"]) -> Float[np.ndarray, "S"]:
    """How many given signs each state contradicts."""
    return (sign_states(len(bones)) * nearer[list(bones)] > 0).sum(axis=1).astype(float)


@dataclass(frozen=True)
class _RankedPose:
    """States of the trunk and of each limb, and their cost, nats."""

    cost: float
    states: tuple[int, ...]


def _enumerate_poses(costs: _SignCosts) -> Iterator[_RankedPose]:
    """For every state of the trunk its cheapest limbs, and these with one limb changed."""
    for s, trunk in enumerate(costs.trunk.tolist()):
        best = [int(limb[s].argmin()) for limb in costs.limbs]
        total = trunk + sum(float(limb[s].min()) for limb in costs.limbs)
        yield _RankedPose(total, (s, *best))
        for place, limb in enumerate(costs.limbs):
            for state in set(range(limb.shape[1])) - {best[place]}:
                changed = (s, *best[:place], state, *best[place + 1 :])
                yield _RankedPose(total + float(limb[s, state] - limb[s].min()), changed)


def _sign_certainty(costs: _SignCosts, sign: Int[np.ndarray, "B"]) -> Float[np.ndarray, "B"]:
    """|2 p - 1| of each sign's probability p over all poses."""
    likely = [np.exp(limb.min(axis=1, keepdims=True) - limb) for limb in costs.limbs]
    best = costs.trunk + sum(limb.min(axis=1) for limb in costs.limbs)
    trunk = np.exp(best.min() - best) * np.prod([limb.sum(axis=1) for limb in likely], axis=0)
    trunk = trunk / trunk.sum()
    shares = [trunk, *(trunk @ (limb / limb.sum(axis=1, keepdims=True)) for limb in likely)]
    certainty = np.zeros(len(sign))
    for bones, share in zip(costs.groups, shares, strict=True):
        agree = sign_states(len(bones)) == sign[list(bones)]
        certainty[list(bones)] = np.abs(2 * (share[:, None] * agree).sum(axis=0) - 1)
    return certainty


def _points(
    observation: FrameObservation, depth: Float[np.ndarray, "B"], skeleton: Skeleton
) -> Float[np.ndarray, "J 3"]:
    """Joints where the picture has them, depths added up from the root."""
    along = skeleton.ancestry @ depth
    along = np.where(np.isfinite(observation.joints[:, 0]), along, np.nan)
    middle = np.nanmean(observation.joints, axis=0) if np.isfinite(along).any() else np.zeros(2)
    return np.column_stack([observation.joints - middle, along])


def _differing(
    observation: FrameObservation,
    depth: Float[np.ndarray, "B"],
    costs: _SignCosts,
    ranked: list[_RankedPose],
    skeleton: Skeleton,
) -> Iterator[Alternative]:
    """The cheapest poses of which each looks different from all before it."""
    chains, least = skeleton.ancestry, ranked[0].cost
    offered = [chains @ (depth * costs.signs(ranked[0].states))]
    for pose in ranked[1:]:
        if pose.cost - least > MAX_EXTRA_COST or len(offered) > MAX_ALTERNATIVES:
            return
        sign = costs.signs(pose.states)
        along = chains @ (depth * sign)
        if min(np.abs(along - other).max() for other in offered) > MIN_DEPTH_CHANGE:
            offered.append(along)
            points = _points(observation, depth * sign, skeleton)
            yield Alternative(-sign, points, pose.cost - least)
