"""Which two candidates are a pair of feet below a head.

Feet are alike, so a state of their path is an unordered pair; one candidate may stand for both, as
one foot hides the other now and then.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from keyrecon.segmentation.part_evidence import SHOE_RADIUS

FOOT_SKIP_COST = 7.0
"""Cost of a frame without a pair of feet: one bad foot costs less, a wrong pair more. Halved,
others with it: at most 0.8 points, 0.6 mm on one clip."""
MAX_PAIRS = 30
"""Pairs kept of each frame, the cheapest. Halved, others with it: at most 0.8 points, 0.6 mm on one
clip."""


@dataclass(frozen=True)
class FootPosePrior:
    """Where two feet usually are, player heights; what is beyond costs its square, nats."""

    same_place: float
    """Cost of two candidates in one place: one shoe taken for both explains less of the picture."""
    min_below_head: float
    """Mid-feet are farther below the head than this,"""
    max_below_head: float
    """and less than this."""
    max_apart: float
    """Distance of the feet in a wide lunge."""
    spread: float
    """Deviation of what is beyond these."""
    foot_below_head: float
    """A foot that is less far below the head than this is lifted."""
    lift_spread: float
    """Deviation of a lifted foot: a racket or a knee is at its height more often."""
    max_uneven: float = np.inf
    """Difference in height of the two feet beyond which one is lifted."""
    max_aside: float = 0.5
    """Distance of mid-feet from the vertical line through the head."""
    max_cost: float = 12.0
    """A posture costs at most this: a rare one outweighs no clear candidate."""


COLOR_PRIOR = FootPosePrior(
    same_place=1.8,
    min_below_head=0.8,
    max_below_head=1.1,
    max_apart=0.8,
    spread=0.12,
    foot_below_head=0.82,
    lift_spread=0.1,
    max_uneven=0.1,
)
"""For candidates detected by colour and shape, which lines and rackets have too: strict. Halved,
others with it: at most 0.8 points, 0.6 mm on one clip."""
FILTER_PRIOR = FootPosePrior(
    same_place=2.5,
    min_below_head=0.7,
    max_below_head=1.15,
    max_apart=0.85,
    spread=0.1,
    foot_below_head=0.8,
    lift_spread=0.2,
)
"""For candidates of filters that know the player's feet; two in one place are often one shoe.
Halved, others with it: at most 0.4 points, 1.7 mm on one clip."""


def foot_pairs(count: int) -> Int[np.ndarray, "s 2"]:
    """All unordered pairs, a place paired with itself included: one foot behind the other."""
    first, second = np.triu_indices(count)
    return np.stack([first, second], axis=1)


def foot_pose_cost(
    both: Float[np.ndarray, "s 2 2"],
    head: Float[np.ndarray, "2"],
    height: float,
    prior: FootPosePrior,
) -> Float[np.ndarray, "s"]:
    """Cost of where pairs of feet are below the head and beside one another, nats."""
    middle = (both.mean(axis=1) - head) / height
    apart = np.linalg.norm(both[:, 0] - both[:, 1], axis=1) / height
    below = middle[:, 1]
    off = _beyond(prior.min_below_head - below) + _beyond(below - prior.max_below_head)
    off += _beyond(np.abs(middle[:, 0]) - prior.max_aside) + _beyond(apart - prior.max_apart)
    same = np.exp(-((apart / (1.2 * SHOE_RADIUS)) ** 2))
    each = (both[..., 1] - head[1]) / height
    lifted = _beyond(prior.foot_below_head - each).sum(axis=1)
    lifted += _beyond(np.abs(each[:, 0] - each[:, 1]) - prior.max_uneven)
    cost = off / (2 * prior.spread**2) + lifted / (2 * prior.lift_spread**2)
    return prior.same_place * same + np.minimum(cost, prior.max_cost)


def _beyond(excess: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Square of what is above zero."""
    return np.maximum(0, excess) ** 2
