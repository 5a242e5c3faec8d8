"""Occlusion: what hides an arm lies before it.

A person marks elbows and wrists that are hidden where they must be. Within the outline of the
trunk it is nearly always the trunk that hides them, so they are behind it: of all that a mark
tells beside its place, this says most about depth. A joint that is visible there says less, since
not every tool records visibility.
"""

import numpy as np
from jaxtyping import Bool, Float

_DEPTH_SOFTNESS = 0.03
"""Depth over which a joint passes from before the trunk to behind it, body heights. A quarter more
or less, others with it: at most 2.8 mm on eight clips."""
_MAX_COST = 4.0
"""Cost of a hidden joint far before the trunk, nats: one mark in fifty is wrong. A quarter more or
less, others with it: at most 2.8 mm on eight clips."""
_OUTLINE_MARGIN = 0.04
"""How far flesh and clothes reach beyond the corners of the trunk, body heights. A quarter more or
less, others with it: at most 2.8 mm on eight clips."""


def hidden_cost(
    corners: Float[np.ndarray, "n S 4 3"],
    shoulder: Float[np.ndarray, "n S 3"],
    bones: Float[np.ndarray, "n L 2 3"],
    hidden: Bool[np.ndarray, "n 2"],
) -> Float[np.ndarray, "n S L"]:
    """Cost of arms whose hidden joints lie before the trunk, nats.

    `corners` of the trunk relative to the neck, in the order of `Anatomy.trunk`; `bones` are the
    upper arm and the forearm, `hidden` tells of elbow and wrist.
    """
    chain = np.cumsum(bones, axis=2)
    covered = hidden & within_trunk(corners[:, 0, :, :2], shoulder[:, :1, :2] + chain[:, 0, :, :2])
    depth = shoulder[:, :, None, None, 2] + chain[:, None, :, :, 2]
    ahead = corners[..., 2].mean(axis=2)[:, :, None, None] - depth
    cost = np.minimum(np.logaddexp(0.0, ahead / _DEPTH_SOFTNESS), _MAX_COST)
    return (covered[:, None, None] * cost).sum(axis=-1)


def within_trunk(
    corners: Float[np.ndarray, "n 4 2"], points: Float[np.ndarray, "n m 2"]
) -> Bool[np.ndarray, "n m"]:
    """Whether points lie within the trunk's outline in the picture, its margin included."""
    ring = corners[:, [0, 1, 3, 2]]  # right hip, left hip, left shoulder, right shoulder
    side = np.roll(ring, -1, axis=1) - ring
    off = points[:, :, None] - ring[:, None]
    long = np.maximum((side**2).sum(-1), 1e-12)[:, None]
    along = np.clip((off * side[:, None]).sum(-1) / long, 0, 1)
    apart = np.linalg.norm(off - along[..., None] * side[:, None], axis=-1).min(axis=-1)
    below = off[..., 1] < 0
    after = np.roll(below, -1, axis=-1)
    cross = off[..., 0] * side[:, None, :, 1] - off[..., 1] * side[:, None, :, 0]
    rightward = np.where(side[:, None, :, 1] > 0, cross < 0, cross > 0)
    inside = ((below != after) & rightward).sum(axis=-1) % 2 == 1
    return inside | (apart < _OUTLINE_MARGIN)
