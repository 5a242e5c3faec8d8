"""Marks that look wrong: not refused, but worth another look. Every line names frame and limb."""

import numpy as np
from jaxtyping import Float

from keyrecon.records import Annotations

STRETCH = 1.5
"""A bone may look this much longer than the body's scale allows: people's proportions differ
from the table by up to a third, and clicks are off by a few per cent of a bone."""
NEIGHBOURS = 9
"""Annotated frames whose scales are compared: a player grows and shrinks slowly."""


def implausible_bones(annotations: Annotations, stretch: float = STRETCH) -> list[str]:
    """Bones that look longer than they are: under scaled orthography none can (Taylor 2000).

    A frame's scale in px per stature is at least every |bone| / length. Its third largest value
    stands for it, since one misplaced joint spoils two bones, and the median over neighbouring
    annotated frames for poses in which all limbs point at the camera.
    """
    skeleton = annotations.skeleton
    parent, child = skeleton.bones.T
    lengths = np.linalg.norm(annotations.joints[:, child] - annotations.joints[:, parent], axis=2)
    scale = lengths / skeleton.lengths
    allowed = stretch * _scale_nearby(scale)
    warnings = []
    for row, bone in np.argwhere(scale > allowed[:, None]):
        limb = " to ".join(skeleton.names[j] for j in skeleton.bones[bone])
        warnings.append(
            f"frame {annotations.frames[row]}: {limb} is {lengths[row, bone]:.0f} px long, more "
            f"than the {allowed[row] * skeleton.lengths[bone]:.0f} px that the body's size "
            "allows; check both joints."
        )
    return warnings


def _scale_nearby(scale: Float[np.ndarray, "K B"]) -> Float[np.ndarray, "K"]:
    """Third largest scale of each frame, median over the neighbouring ones; NaN if unknown."""
    ranked = np.sort(np.where(np.isfinite(scale), scale, -np.inf), axis=1)
    own = np.where(np.isfinite(ranked[:, -3]), ranked[:, -3], np.nan)
    known = np.flatnonzero(np.isfinite(own))
    nearby = np.full(len(own), np.nan)
    for row in known:
        closest = known[np.argsort(np.abs(known - row), kind="stable")[:NEIGHBOURS]]
        nearby[row] = np.median(own[closest])
    return nearby


def joints_outside(
    annotations: Annotations, size: tuple[int, int], margin: float = 0.02
) -> list[str]:
    """Joints outside the picture by more than `margin` of its width."""
    edge = np.array(size) - 1
    beyond = np.maximum(-annotations.joints, annotations.joints - edge).max(axis=2)
    return [
        f"frame {annotations.frames[row]}: {annotations.skeleton.names[joint]} is "
        f"{beyond[row, joint]:.0f} px outside the picture."
        for row, joint in np.argwhere(beyond > margin * size[0])
    ]
