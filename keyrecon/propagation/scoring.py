"""Fit scores: how well a posed template and a frame's edges explain one another.

From the template's side: do a bone's elements find counterparts? From the frame's: which of its
elements does each part of the template account for? The second question tells two poses apart that
both lie on edges, one of which leaves a bare arm unexplained.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from keyrecon.propagation.correspondence import (
    ElementIndex,
    bone_axes,
    match_elements,
    match_frame_to_parts,
    pose_templates,
)
from keyrecon.propagation.edge_template import EdgeTemplates
from keyrecon.propagation.registration import TemplateFits

SCORE_RADIUS = 0.06
"""Distance at which an element counts as wrong, player heights. Chosen on
rendered sequences; see benchmarks/sensitivity.py."""
BODY_PARTS = 3
"""Trunk, one side, the other side."""


def score_templates(
    templates: EdgeTemplates, index: ElementIndex, fits: TemplateFits
) -> Float[np.ndarray, "P B"]:
    """Residual of every bone, 0-1: mean distance of its elements to their matches over
    `SCORE_RADIUS`; 1 where nothing matches."""
    posed = pose_templates(templates, fits.template, fits.joints)
    row, matched = match_elements(index, fits.frames, posed, SCORE_RADIUS)
    distance = _relative_distance(index.points[row] - posed.points, matched)
    count = len(templates.half.bones)
    slot = np.arange(len(row))[:, None] * count + templates.elements.bone[fits.template]
    total = np.bincount(slot.ravel(), (posed.weight * distance).ravel(), len(row) * count)
    weight = np.bincount(slot.ravel(), posed.weight.ravel(), len(row) * count)
    mean = np.where(weight > 0, total / np.maximum(weight, 1e-9), 1.0)
    return mean.reshape(len(row), count)


def _relative_distance(
    gap: Complex[np.ndarray, "*n"], matched: Bool[np.ndarray, "*n"]
) -> Float[np.ndarray, "*n"]:
    """Length of gaps in `SCORE_RADIUS`, 1 at most and where there is no match."""
    return np.where(matched, np.minimum(np.abs(gap) / SCORE_RADIUS, 1), 1)


def find_unexplained_edges(
    templates: EdgeTemplates, index: ElementIndex, fits: TemplateFits
) -> Float[np.ndarray, "P 3 F"]:
    """How far each of the frame's elements is from each part of the template, 0-1 likewise; 0 for
    padding."""
    posed = pose_templates(templates, fits.template, fits.joints)
    part = templates.half.limb[templates.elements.bone[fits.template]]
    listed = templates.frame_elements[fits.frames]
    nearest, matched = match_frame_to_parts(index, listed, posed, part, BODY_PARTS, SCORE_RADIUS)
    points = posed.points[np.arange(len(listed))[:, None, None], nearest]
    distance = _relative_distance(index.points[listed][:, None] - points, matched)
    return (distance * (listed >= 0)[:, None]).astype(np.float32)


@dataclass(frozen=True, eq=False)
class _LimbOutline:
    """The elements of one limb in many poses."""

    points: Complex[np.ndarray, "P E"]
    tangent: Complex[np.ndarray, "P E"]
    color: Int[np.ndarray, "P E"]


def score_limb(
    templates: EdgeTemplates, index: ElementIndex, fits: TemplateFits, bones: Int[np.ndarray, "b"]
) -> Float[np.ndarray, "P"]:
    """Residual of the average outline of a few bones."""
    average = templates.elements.take(np.s_[templates.average])
    on_limb = np.flatnonzero(np.isin(average.bone, bones) & (average.color >= 0))
    if not len(on_limb):
        return np.ones(len(fits.frames))
    limb = average.take(on_limb)
    axis = bone_axes(templates.half, fits.joints)[:, limb.bone]
    weights = templates.joint_weights[templates.average, on_limb]
    points = fits.joints @ weights.T + limb.offset * axis
    color = np.broadcast_to(limb.color, points.shape)
    outline = _LimbOutline(points, limb.bone_tangent * axis, color)
    row, matched = match_elements(index, fits.frames, outline, SCORE_RADIUS)
    distance = _relative_distance(index.points[row] - points, matched)
    return distance @ limb.weight / limb.weight.sum()
