"""How well a figure and a frame's edges explain one another.

Seen from the figure: do a bone's elements find counterparts? Seen from the frame: which of its
elements does each part of the figure account for? The second question tells two figures apart that
both lie on edges, one of which leaves a bare arm unexplained.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.propagation.correspondence import ElementIndex, match_elements, match_parts
from keyrecon.propagation.edge_template import EdgeTemplates, bone_axes, pose_templates
from keyrecon.propagation.registration import FittedFigures

SCORE_REACH = 0.06
"""Distance at which an element counts as wrong, player heights."""
PARTS = 3
"""Trunk, one side, the other side."""


def score_templates(
    puppets: EdgeTemplates, index: ElementIndex, figures: FittedFigures
) -> Float[np.ndarray, "P B"]:
    """Misfit of every bone, 0-1: mean distance of its elements to their matches over
    `SCORE_REACH`; 1 where nothing matches."""
    posed = pose_templates(puppets, figures.which, figures.joints)
    row, found = match_elements(index, figures.frames, posed, SCORE_REACH)
    gap = _relative(index.points[row] - posed.points, found)
    count = len(puppets.half.bones)
    slot = np.arange(len(row))[:, None] * count + puppets.riders.bone[figures.which]
    total = np.bincount(slot.ravel(), (posed.weight * gap).ravel(), len(row) * count)
    share = np.bincount(slot.ravel(), posed.weight.ravel(), len(row) * count)
    mean = np.where(share > 0, total / np.maximum(share, 1e-9), 1.0)
    return mean.reshape(len(row), count)


def _relative(gap: Complex[np.ndarray, "*n"], found: np.ndarray) -> Float[np.ndarray, "*n"]:
    """Length of gaps in `SCORE_REACH`, 1 at most and where no match was found."""
    return np.where(found, np.minimum(np.abs(gap) / SCORE_REACH, 1), 1)


def find_unexplained_edges(
    puppets: EdgeTemplates, index: ElementIndex, figures: FittedFigures
) -> Float[np.ndarray, "P 3 F"]:
    """How far each of the frame's elements is from each part of the figure, 0-1 likewise; 0 for
    padding."""
    posed = pose_templates(puppets, figures.which, figures.joints)
    part = puppets.half.limb[puppets.riders.bone[figures.which]]
    listed = puppets.listed[figures.frames]
    hit, found = match_parts(index, listed, posed, part, PARTS, SCORE_REACH)
    points = posed.points[np.arange(len(listed))[:, None, None], hit]
    far = _relative(index.points[listed][:, None] - points, found)
    return (far * (listed >= 0)[:, None]).astype(np.float32)


@dataclass(frozen=True, eq=False)
class _Outline:
    """A few elements of many figures."""

    points: Complex[np.ndarray, "P E"]
    tangent: Complex[np.ndarray, "P E"]
    color: Int[np.ndarray, "P E"]


def score_limb(
    puppets: EdgeTemplates, index: ElementIndex, figures: FittedFigures, bones: Int[np.ndarray, "b"]
) -> Float[np.ndarray, "P"]:
    """Misfit of the average outline of a few bones."""
    riders = puppets.riders.take(np.s_[puppets.average])
    on_limb = np.flatnonzero(np.isin(riders.bone, bones) & (riders.color >= 0))
    if not len(on_limb):
        return np.ones(len(figures.frames))
    limb = riders.take(on_limb)
    axis = bone_axes(puppets.half, figures.joints)[:, limb.bone]
    points = figures.joints @ puppets.share[puppets.average, on_limb].T + limb.offset * axis
    color = np.broadcast_to(limb.color, points.shape)
    outline = _Outline(points, limb.turn * axis, color)
    row, found = match_elements(index, figures.frames, outline, SCORE_REACH)
    return _relative(index.points[row] - points, found) @ limb.weight / limb.weight.sum()
