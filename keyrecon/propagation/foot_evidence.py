"""Tracked feet as further evidence of where the legs end.

On clay or grass the outline of a bare leg is often lost while the tracker still holds the shoes. It
does not know left from right, so each foot counts for the ankle that it fits better, and one that
fits neither counts for nothing. How ankles lie beside tracked feet is learnt from the annotated
frames.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.propagation.half_body import BodyHalf

FOOT_MATCH_DISTANCE = 0.08
"""A foot farther from where the ankle is estimated counts for little, player heights.
Chosen on rendered sequences; see benchmarks/sensitivity.py."""
MIN_FOOT_SPREAD = 0.03
"""Error of a tracked foot at least, player heights. Chosen on rendered sequences; see
benchmarks/sensitivity.py."""


@dataclass(frozen=True, eq=False)
class FootEvidence:
    """Where the ends of both legs should be, in no particular order."""

    ends: Int[np.ndarray, "2"]
    """Positions of the joints in their half of the body."""
    points: Complex[np.ndarray, "T 2"]
    """Player coordinates."""
    spread: float
    """Median error, player heights."""


def learn_foot_offsets(
    half: BodyHalf,
    frames: Int[np.ndarray, "K"],
    joints: Complex[np.ndarray, "K J"],
    tracked: Complex[np.ndarray, "T 2"],
) -> FootEvidence:
    """Tracked feet, moved to where the ankles are on annotated frames."""
    ends = np.array([max(side, key=lambda j: half.depth[j]) for side in half.sides])
    gap = joints[:, ends] - order_feet(tracked[frames], joints[:, ends])
    shift = np.median(gap.real) + 1j * np.median(gap.imag)
    spread = float(np.median(np.abs(gap - shift)))
    return FootEvidence(ends, tracked + shift, max(spread, MIN_FOOT_SPREAD))


def order_feet(
    feet: Complex[np.ndarray, "P 2"], ends: Complex[np.ndarray, "P 2"]
) -> Complex[np.ndarray, "P 2"]:
    """Feet in the order of the leg ends that they fit better."""
    direct, crossed = (
        np.minimum(np.abs(f - ends), FOOT_MATCH_DISTANCE).sum(axis=1) for f in (feet, feet[:, ::-1])
    )
    return np.where((direct <= crossed)[:, None], feet, feet[:, ::-1])


def foot_costs(
    feet: FootEvidence, joints: Complex[np.ndarray, "T S J"]
) -> Float[np.ndarray, "T S J"]:
    """How far each leg ends from the nearer tracked foot, 0-1; 0 for other joints."""
    cost = np.zeros(joints.shape)
    distance = np.abs(joints[:, :, feet.ends, None] - feet.points[:, None, None])
    cost[:, :, feet.ends] = np.minimum(distance.min(axis=3) / FOOT_MATCH_DISTANCE, 1)
    return cost
