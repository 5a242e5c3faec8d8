"""Refinement: the motion fitted to the observed joints (Section 6.2 and Fig. 9).

Two ways. `descend_motion` is the paper's projected gradient descent: joints move towards the
observed ones, then bone lengths and a low-pass are enforced, again and again. `refine_motion`
minimises one cost over the unit directions of all bones: robust reprojection weighted by
confidence, small second differences in time, a pull to the slerped key poses, the breadths of
hips and shoulders, a head that continues the trunk, and balance: people at work stand over their
feet, which holds the trunk's lean along the line of sight. Lengths are exact in both.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from keyrecon.lifting import terms
from keyrecon.lifting.bone_directions import bone_vectors
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.lifting.preprocessing import PreparedTracks
from keyrecon.lifting.priors.anatomy import TILT, anatomy_of
from keyrecon.lifting.solver import MotionState, Smoothness, solve
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.paper.gradient_descent import descend, keep_lengths, low_pass

_MIN_TRUNK_HEIGHT = 0.3
"""Height of the trunk's middle above the ankles from which the tilt of the camera is read."""
_HIPS_ALONG_SPINE = 0.95
"""Part of the bones from neck to hips that goes along the spine: trunk over neck to hip of
`keyrecon.body.MARKED_LENGTHS`."""


@dataclass(frozen=True)
class RefineOptions:
    """How the motion is fitted to the observed joints.

    Chosen on rendered sequences; see benchmarks/sensitivity.py.
    """

    rounds: int = 12
    """Steps of the trajectory solver at most."""
    tolerance: float = 1e-3
    """Relative gain below which the trajectory solver stops."""
    acceleration: float = 0.006
    """Expected second difference of a bone's end in 1/50 s, body heights."""
    breadth_spread: float = 0.03
    """How far hip and shoulder breadth may stray, body heights."""
    head_spread: float = 0.35
    """How far the head may lean out of the trunk's line, radians."""
    balance_spread: float = 0.055
    """How far the middle of the trunk may be from above the feet along the line of sight, body
    heights; 0.03-0.08 in every activity."""
    balance_correlation: float = 0.15
    """Seconds over which a lack of balance lasts; it counts once."""
    bend_noise: float = 0.12
    """Error of a limb's bend in the picture, as a difference of unit directions: two eyes place
    hips 2.2 % of the height apart per axis, knees and ankles 1 %, and a thigh is 24 % long."""
    bend_correlation: float = 0.15
    """Seconds over which a bend lasts; it counts once."""
    key_spread: float = 0.4
    """How far a bone may turn away from the slerped key poses at no great cost, radians."""
    step: float = 0.2
    """lambda of Fig. 9."""
    descents: int = 3000
    """Iterations of Fig. 9 at most; it stops where it has converged."""
    sigma: float = 0.5
    """Standard deviation of the low-pass of Fig. 9, frames."""


def refine_motion(
    start: MotionState,
    observed: PreparedTracks,
    initial: Float[np.ndarray, "T B 3"],
    size: BodySize,
    fps: float,
    options: RefineOptions = RefineOptions(),
) -> MotionState:
    """Root and bone directions fitted to the observed joints from a start near them.

    `initial` holds the directions of the initial motion, the slerped key poses.
    """
    recipe = [terms.reprojection(observed, size.lengths, size.skeleton)]
    recipe += _trunk_terms(size, options)
    recipe += _balance_terms(start, size, fps, options)
    recipe += _bend_terms(start, size, fps, options)
    recipe.append(terms.key_pose_prior(initial, options.key_spread))
    expected = options.acceleration * (50.0 / fps) ** 2
    smoothness = Smoothness(1 / expected**2, size.lengths**2 / expected**2)
    return solve(start, recipe, smoothness, options.rounds, options.tolerance)


def descend_motion(
    start: MotionState,
    observed: PreparedTracks,
    size: BodySize,
    options: RefineOptions = RefineOptions(),
) -> MotionState:
    """Projected gradient descent from the slerped key poses (Fig. 9)."""
    skeleton = size.skeleton
    root = skeleton.root
    points = start.points(size.lengths, skeleton)
    lengths = keep_lengths(size.lengths, skeleton)
    fitted = descend(
        points, observed.joints, (lengths, low_pass(options.sigma)), options.step, options.descents
    )
    valid = lengths(fitted)
    return MotionState(valid[:, root, :2], unit_vectors(bone_vectors(valid, skeleton)))


def _trunk_terms(size: BodySize, options: RefineOptions) -> list[terms.Term]:
    """What holds the trunk together: breadths, and the head above it."""
    lengths, skeleton, spread = size.lengths, size.skeleton, options.breadth_spread
    recipe = [
        terms.breadth(pair.left, pair.right, float(length), spread, lengths, skeleton)
        for pair, length in zip(skeleton.breadths, size.breadths, strict=True)
    ]
    anatomy = anatomy_of(skeleton)
    for limb in anatomy.limbs:
        if limb.kind == "head":
            share = np.zeros(len(lengths))
            share[list(anatomy.trunk[:2])] = 0.5 / _HIPS_ALONG_SPINE
            share[list(limb.bones)] = 1.0
            recipe.append(terms.alignment(share, options.head_spread))
    return recipe


def _bend_terms(
    start: MotionState, size: BodySize, fps: float, options: RefineOptions
) -> list[terms.Term]:
    """Knees and elbows bend no more in depth than the picture gives reason for."""
    weight = 1 / max(options.bend_correlation * fps, 1.0)
    return [
        terms.unseen_bend(
            (limb.bones[0], limb.bones[1]), start.directions, options.bend_noise, weight
        )
        for limb in anatomy_of(size.skeleton).limbs
        if len(limb.bones) == 2
    ]


def _balance_terms(
    start: MotionState, size: BodySize, fps: float, options: RefineOptions
) -> list[terms.Term]:
    """The middle of the trunk stays over the point between the ankles."""
    skeleton = size.skeleton
    corners = [f"{side}_{name}" for name in ("hip", "ankle") for side in ("right", "left")]
    if not set(corners) <= set(skeleton.names):
        return []
    ways = skeleton.ancestry * size.lengths
    hips, ankles = ways[[skeleton.index(name) for name in corners]].reshape(2, 2, -1).mean(axis=1)
    share = 0.5 * (ways[skeleton.root] + hips) - ankles
    stance = np.einsum("b,tbi->ti", share, start.directions)
    high = stance[stance[:, 1] < -_MIN_TRUNK_HEIGHT]
    slope = float(np.median(high[:, 2] / high[:, 1])) if len(high) else TILT
    spread = options.balance_spread * np.sqrt(max(options.balance_correlation * fps, 1.0))
    return [terms.balance(share, 0.5 * (slope + TILT), spread)]
