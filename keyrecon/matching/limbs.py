"""Motion of limbs: many samples of the flow on every bone, as rows of least squares.

A bone's samples lie on its middle line and halfway to its outline on both sides. Where a bone
goes is fitted to all of them at once, so that a few that fall on the background do no harm.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.matching.fit import Step, keep_shape
from keyrecon.matching.flow import Flow, sample_flow
from keyrecon.matching.puppet import Puppets, bone_axes
from keyrecon.matching.rows import observe

ALONG = np.array([0.05, 0.35, 0.65, 0.95])
ASIDE = np.array([-0.5, 0.0, 0.5])
"""Where samples lie, in bone lengths and in half widths."""
THIN = 0.03
"""Half width of a bone that no outline was seen of, player heights."""
FLOW_SPREAD = 0.012
"""Error of one sample of the flow, player heights ..."""
FLOW_SHARE = 0.15
"""... and the share of a fast motion that it misses."""
STIFF = Step(reach=0.0, length=0.006, swing=0.05)
"""How little a bone changes from one frame to the next."""


@dataclass(frozen=True, eq=False)
class LimbFlow:
    """The flow, and where to look at it on a body."""

    flow: Flow
    mixture: Float[np.ndarray, "S J"]
    aside: Float[np.ndarray, "S"]
    """To the side of the bone, player heights."""
    bone: Int[np.ndarray, "S"]


def place_samples(flow: Flow, puppets: Puppets) -> LimbFlow:
    """Samples for all bones, as wide as the annotated figures are."""
    bones = puppets.half.bones
    bone = np.repeat(np.arange(len(bones)), len(ALONG) * len(ASIDE))
    along = np.tile(np.repeat(ALONG, len(ASIDE)), len(bones))
    width = np.array([_half_width(puppets, b) for b in range(len(bones))])
    aside = np.tile(ASIDE, len(bones) * len(ALONG)) * width[bone]
    mixture = np.zeros((len(bone), len(puppets.half.joints)))
    rows = np.arange(len(bone))
    mixture[rows, bones[bone, 0]] = 1 - along
    mixture[rows, bones[bone, 1]] += along
    return LimbFlow(flow, mixture, aside, bone)


def _half_width(puppets: Puppets, bone: int) -> float:
    riders = puppets.riders
    inside = (riders.bone == bone) & (riders.color >= 0)
    inside &= (riders.along > 0.2) & (riders.along < 0.8)
    return float(np.median(np.abs(riders.offset[inside].imag))) if inside.any() else THIN


def see_flow(
    limbs: LimbFlow,
    puppets: Puppets,
    frames: Int[np.ndarray, "P"],
    joints: Complex[np.ndarray, "P J"],
) -> tuple[Complex[np.ndarray, "P S"], Float[np.ndarray, "P S"]]:
    """(motion to the next frame, weight) of every sample."""
    axis = bone_axes(puppets.half, joints)[:, limbs.bone]
    points = joints @ limbs.mixture.T + 1j * limbs.aside * axis
    motion, trust = sample_flow(limbs.flow, frames, points)
    return motion, trust / (FLOW_SPREAD**2 + (FLOW_SHARE * np.abs(motion)) ** 2)


def predict_joints(
    limbs: LimbFlow,
    puppets: Puppets,
    frames: Int[np.ndarray, "P"],
    joints: Complex[np.ndarray, "P J"],
    forward: bool = True,
) -> Complex[np.ndarray, "P J"]:
    """Joints of the next frame (or the one before) by the flow on their bones."""
    found = joints
    for _ in range(2):
        if forward:
            motion, weight = see_flow(limbs, puppets, frames, joints)
        else:  # the flow that leads here starts where the limb was
            motion, weight = see_flow(limbs, puppets, frames - 1, found)
            motion = -motion
        gap = motion - (found - joints) @ limbs.mixture.T
        weight = weight / (1 + np.abs(gap) ** 2 * weight)
        mixture = np.broadcast_to(limbs.mixture, (len(joints), *limbs.mixture.shape))
        target = joints @ limbs.mixture.T + motion
        moved = observe(mixture, target, np.ones(target.shape, complex), weight, weight)
        found = (moved + keep_shape(puppets, found, joints, STIFF)).solve()
    return found
