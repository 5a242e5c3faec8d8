"""Which two candidates are a pair of feet below a head.

Feet are alike, so a state of their path is an unordered pair; one candidate may stand for both, as
one foot hides the other now and then.
"""

import numpy as np
from jaxtyping import Float, Int

from keyrecon.segmentation.part_evidence import SHOE_RADIUS

ONE_SHOE = 1.8
"""Cost of both feet in one place, found by colour."""
ONE_PLACE = 2.5
"""Cost of two candidates in one place where filters found them: they may be one shoe."""
RAISED = 0.2
"""Foot that is lifted this far costs as much as one deviation, player heights: a racket is there
more often."""


def foot_pairs(count: int) -> Int[np.ndarray, "s 2"]:
    """All unordered pairs, a place paired with itself included: one foot behind the other."""
    first, second = np.triu_indices(count)
    return np.stack([first, second], axis=1)


def pair_costs(
    cost: Float[np.ndarray, "n"],
    pairs: Int[np.ndarray, "s 2"],
    feet: Float[np.ndarray, "n 2"],
    head: Float[np.ndarray, "2"],
    height: float,
) -> Float[np.ndarray, "s"]:
    """Cost of two feet together: their own, and their place below the head."""
    if not len(pairs):
        return np.zeros(0)
    both = feet[pairs]
    middle = both.mean(axis=1) - head
    short = np.maximum(0, 0.8 * height - middle[:, 1]) + np.maximum(0, middle[:, 1] - 1.1 * height)
    aside = np.maximum(0, np.abs(middle[:, 0]) - 0.5 * height)
    apart = np.maximum(0, np.linalg.norm(both[:, 0] - both[:, 1], axis=1) - 0.8 * height)
    off = (short**2 + aside**2 + apart**2) / (2 * (0.12 * height) ** 2)
    # One shoe taken for both feet explains less of the picture than two shoes.
    near = np.exp(-(((both[:, 0] - both[:, 1]) / (1.2 * SHOE_RADIUS * height)) ** 2).sum(axis=1))
    # A foot may be lifted, yet a racket or a knee is at its height more often.
    lifted = np.maximum(0, 0.82 * height - (both[..., 1] - head[1]))
    uneven = np.maximum(0, np.abs(both[:, 0, 1] - both[:, 1, 1]) - 0.1 * height)
    off += ((lifted**2).sum(axis=1) + uneven**2) / (2 * (0.1 * height) ** 2)
    return cost[pairs].sum(axis=1) + ONE_SHOE * near + np.minimum(off, 12.0)


def foot_pose_prior(
    both: Float[np.ndarray, "s 2 2"], head: Float[np.ndarray, "2"], height: float
) -> Float[np.ndarray, "s"]:
    """Cost of where two sure feet are below the head and beside one another."""
    middle = (both.mean(axis=1) - head) / height
    apart = np.linalg.norm(both[:, 0] - both[:, 1], axis=1) / height
    off = np.maximum(0, 0.7 - middle[:, 1]) ** 2 + np.maximum(0, middle[:, 1] - 1.15) ** 2
    off += np.maximum(0, np.abs(middle[:, 0]) - 0.5) ** 2 + np.maximum(0, apart - 0.85) ** 2
    near = np.exp(-((apart / (1.2 * SHOE_RADIUS)) ** 2))
    lifted = np.maximum(0, 0.8 - (both[..., 1] - head[1]) / height)
    raised = (lifted**2).sum(axis=1) / (2 * RAISED**2)
    return ONE_PLACE * near + np.minimum(off / (2 * 0.1**2) + raised, 12.0)
