"""Which edge element of a frame corresponds to which of a posed template, and how well they fit.

The nearest one of the same colour in place and direction together (`nearest_elements`).

Scores tell how well a posed template and a frame's edges explain one another. From the template's
side: do a bone's elements find counterparts? From the frame's: which of its elements does each part
of the template account for? The second question tells two poses apart that both lie on edges, one
of which leaves a bare arm unexplained.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Complex, Float, Float32, Int

from keyrecon.numerics.geometry import to_complex
from keyrecon.propagation.body_frame import BodyFrame
from keyrecon.propagation.edge_template import EdgeTemplates
from keyrecon.propagation.half_body import BodyHalf
from keyrecon.propagation.nearest_elements import (
    PADDING_DISTANCE,
    describe_elements,
    find_nearest,
    find_nearest_in_parts,
    with_norms,
)
from keyrecon.records import Edges

SCORE_RADIUS = 0.06
"""Distance at which an element counts as wrong, player heights. A quarter more or less: at most 1.0
mm on three of four clips, 4.1 on one, which other clicks on the same joints change as much."""
HYPOTHESIS_SPREAD = 0.06
"""Distance at which a chosen hypothesis loses most of its pull, player heights. Halved or doubled,
others with it: at most 0.1 points, 0.5 mm on one clip."""
BODY_PARTS = 3
"""Trunk, one side, the other side."""
BLOCK = 128
"""Fits in work at a time: few enough for the processor's cache."""
WORKERS = 2
"""Blocks in work at the same time; look-ups and matrix products run beside one another."""


@dataclass(frozen=True, eq=False)
class ElementIndex:
    """Edge elements of all frames, ready to be matched."""

    points: Complex[np.ndarray, "N"]
    """Player coordinates."""
    tangent: Complex[np.ndarray, "N"]
    color: Int[np.ndarray, "N"]
    first: Int[np.ndarray, "T"]
    """Row of each frame's first element."""
    descriptors: Float32[np.ndarray, "T 6 F"]
    """Each frame's elements side by side, (b, |b|^2)."""


def index_elements(edges: tuple[Edges, ...], body_frame: BodyFrame) -> ElementIndex:
    """Put the elements of all frames into player coordinates, frame by frame.

    Where no frame has any there is one that belongs to none, so that a row of nothing stands for
    something.
    """
    count = np.array([len(e.points) for e in edges])
    frame = np.repeat(np.arange(len(edges)), count)
    points = body_frame.from_pixels(np.concatenate([e.points for e in edges]), frame)
    tangent = to_complex(np.concatenate([e.tangent for e in edges]))
    color = np.concatenate([e.color for e in edges])
    first = np.cumsum(count) - count
    descriptors = np.zeros((len(edges), 6, max(1, count.max(initial=0))), np.float32)
    descriptors[:, 5] = PADDING_DISTANCE
    place = np.arange(len(frame)) - first[frame]
    descriptors[frame, :, place] = with_norms(describe_elements(points, tangent, color)).T
    if not len(points):
        points, tangent, color = np.zeros(1, complex), np.ones(1, complex), np.zeros(1, np.int64)
    return ElementIndex(points, tangent, color, first, descriptors)


@dataclass(frozen=True, eq=False)
class PosedTemplates:
    """Templates in poses: element e of p lies at joint_weights[p, e] @ joints[p] + offset[p, e]."""

    joint_weights: Float[np.ndarray, "P E J"]
    offset: Complex[np.ndarray, "P E"]
    points: Complex[np.ndarray, "P E"]
    tangent: Complex[np.ndarray, "P E"]
    color: Int[np.ndarray, "P E"]
    weight: Float[np.ndarray, "P E"]


def pose_templates(
    templates: EdgeTemplates,
    rows: Int[np.ndarray, "P"],
    joints: Complex[np.ndarray, "P J"],
    stride: int = 1,
) -> PosedTemplates:
    """Each n-th element of the templates in `rows` with their joints at `joints`."""
    elements = templates.elements.take(np.s_[rows, ::stride])
    weights = templates.joint_weights[rows, ::stride]
    axis = np.take_along_axis(bone_axes(templates.half, joints), elements.bone, axis=1)
    offset = elements.offset * axis
    points = (weights @ joints[..., None])[..., 0] + offset
    return PosedTemplates(
        weights, offset, points, elements.bone_tangent * axis, elements.color, elements.weight
    )


def bone_axes(half: BodyHalf, joints: Complex[np.ndarray, "P J"]) -> Complex[np.ndarray, "P B"]:
    """Unit vectors from parent to child."""
    bone = joints[:, half.bones[:, 1]] - joints[:, half.bones[:, 0]]
    return bone / np.maximum(np.abs(bone), 1e-6)


@dataclass(frozen=True, eq=False)
class TemplateFits:
    """P fits: which template takes which pose in which frame."""

    frames: Int[np.ndarray, "P"]
    template: Int[np.ndarray, "P"]
    """Rows of the templates."""
    joints: Complex[np.ndarray, "P J"]

    def take(self, part: slice) -> "TemplateFits":
        """Some of them."""
        return TemplateFits(self.frames[part], self.template[part], self.joints[part])

    def in_blocks(
        self, work: Callable[["TemplateFits"], tuple[np.ndarray, ...]]
    ) -> tuple[np.ndarray, ...]:
        """Results of `work` on a few of the fits at a time, in order and joined."""
        slices = [slice(at, at + BLOCK) for at in range(0, len(self.frames), BLOCK)]
        with ThreadPoolExecutor(WORKERS) as pool:
            parts = list(pool.map(lambda part: work(self.take(part)), slices))
        return tuple(np.concatenate(columns) for columns in zip(*parts, strict=True))

    def moved(self, joints: Complex[np.ndarray, "P J"]) -> "TemplateFits":
        """The same in other poses."""
        return TemplateFits(self.frames, self.template, joints)


@runtime_checkable
class PlacedElements(Protocol):
    """Elements of P posed templates: position, direction and colour."""

    @property
    def points(self) -> Complex[np.ndarray, "P E"]:
        """Player coordinates."""
        ...

    @property
    def tangent(self) -> Complex[np.ndarray, "P E"]:
        """Unit vectors along the edge."""
        ...

    @property
    def color(self) -> Int[np.ndarray, "P E"]:
        """-1 matches nothing."""
        ...


def match_elements(
    index: ElementIndex, frames: Int[np.ndarray, "P"], placed: PlacedElements, radius: float
) -> tuple[Int[np.ndarray, "P E"], Bool[np.ndarray, "P E"]]:
    """(row of the index, whether there is one within `radius` player heights)."""
    queries = describe_elements(placed.points, placed.tangent, placed.color)
    place, matched = find_nearest(queries, index.descriptors[frames], radius)
    return np.where(matched, index.first[frames][:, None] + place, 0), matched


def match_frame_elements(
    index: ElementIndex,
    frame_elements: Int[np.ndarray, "P F"],
    placed: PlacedElements,
    radius: float,
) -> tuple[Int[np.ndarray, "P F"], Bool[np.ndarray, "P F"]]:
    """For each of the frame's elements, the template's element it corresponds to, likewise."""
    queries, descriptors = _describe_both(index, frame_elements, placed)
    nearest, matched = find_nearest(queries, descriptors, radius)
    matched &= frame_elements >= 0
    return np.where(matched, nearest, 0), matched


@dataclass(frozen=True, eq=False)
class MatchedElements:
    """Pairs of an element of a posed template and one of its frame, for P fits."""

    row: Int[np.ndarray, "P R"]
    """Of the frame's elements in the index."""
    joint_weights: Float[np.ndarray, "P R J"]
    offset: Complex[np.ndarray, "P R"]
    points: Complex[np.ndarray, "P R"]
    """Where the template's elements lie."""
    weight: Float[np.ndarray, "P R"]
    """0 where nothing corresponds."""


def match_both_ways(
    templates: EdgeTemplates, index: ElementIndex, fits: TemplateFits, radius: float, stride: int
) -> tuple[MatchedElements, MatchedElements]:
    """(what each n-th element of the templates corresponds to, what each n-th of the frame's)."""
    posed = pose_templates(templates, fits.template, fits.joints, stride)
    row, matched = match_elements(index, fits.frames, posed, radius)
    weight = matched * posed.weight
    forward = MatchedElements(row, posed.joint_weights, posed.offset, posed.points, weight)
    listed = templates.frame_elements[fits.frames, ::stride]
    nearest, matched = match_frame_elements(index, listed, posed, radius)
    points, offset, weight = (
        np.take_along_axis(values, nearest, axis=1)
        for values in (posed.points, posed.offset, posed.weight)
    )
    joint_weights = posed.joint_weights[np.arange(len(nearest))[:, None], nearest]
    return forward, MatchedElements(listed, joint_weights, offset, points, matched * weight)


def match_frame_to_parts(
    index: ElementIndex,
    frame_elements: Int[np.ndarray, "P F"],
    placed: PlacedElements,
    part: Int[np.ndarray, "P E"],
    parts: int,
    radius: float,
) -> tuple[Int[np.ndarray, "P N F"], Bool[np.ndarray, "P N F"]]:
    """For each of the frame's elements, its counterpart in each part of the body."""
    queries, descriptors = _describe_both(index, frame_elements, placed)
    nearest, matched = find_nearest_in_parts(queries, descriptors, part, parts, radius)
    matched &= (frame_elements >= 0)[:, None]
    return np.where(matched, nearest, 0), matched


def _describe_both(
    index: ElementIndex, frame_elements: Int[np.ndarray, "P F"], placed: PlacedElements
) -> tuple[Float32[np.ndarray, "P 5 F"], Float32[np.ndarray, "P 6 E"]]:
    """The frame's elements, and those that are looked for among the template's."""
    queries = describe_elements(
        index.points[frame_elements], index.tangent[frame_elements], index.color[frame_elements]
    )
    return queries, with_norms(describe_elements(placed.points, placed.tangent, placed.color))


@dataclass(frozen=True, eq=False)
class FitScores:
    """How well P fits and their frames' edges explain one another."""

    residual: Float[np.ndarray, "P B"]
    """Of every bone, 0-1: mean distance of its elements to their matches over `SCORE_RADIUS`; 1
    where nothing matches."""
    unexplained: Float32[np.ndarray, "P 3 F"]
    """How far each of the frame's elements is from each part of the template, 0-1 likewise; 0 for
    padding."""


def score_fits(templates: EdgeTemplates, index: ElementIndex, fits: TemplateFits) -> FitScores:
    """From both sides."""
    posed = pose_templates(templates, fits.template, fits.joints)
    return FitScores(
        _residuals(templates, index, fits, posed), _unexplained(templates, index, fits, posed)
    )


def score_bones(
    templates: EdgeTemplates, index: ElementIndex, fits: TemplateFits
) -> Float[np.ndarray, "P B"]:
    """The residuals alone."""
    posed = pose_templates(templates, fits.template, fits.joints)
    return _residuals(templates, index, fits, posed)


def _residuals(
    templates: EdgeTemplates, index: ElementIndex, fits: TemplateFits, posed: PosedTemplates
) -> Float[np.ndarray, "P B"]:
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


def _unexplained(
    templates: EdgeTemplates, index: ElementIndex, fits: TemplateFits, posed: PosedTemplates
) -> Float32[np.ndarray, "P 3 F"]:
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


def joint_confidence(
    templates: EdgeTemplates,
    index: ElementIndex,
    chosen: Complex[np.ndarray, "T J"],
    joints: Complex[np.ndarray, "T J"],
    side_probability: Float[np.ndarray, "T"] | None = None,
) -> Float[np.ndarray, "T J"]:
    """Confidence 0-1: share of the outline matched around a joint, less where the `chosen`
    hypothesis lay elsewhere, and where it is uncertain which side is which."""
    frames = np.arange(len(joints))
    fits = TemplateFits(frames, np.full(len(frames), templates.average), joints)
    score = 1 - score_bones(templates, index, fits)
    ends = np.zeros((len(templates.half.bones), joints.shape[1]))
    ends[np.arange(len(ends))[:, None], templates.half.bones] = 1
    around = score @ ends / np.maximum(ends.sum(axis=0), 1)
    moved = np.abs(joints - chosen) / HYPOTHESIS_SPREAD
    if side_probability is not None:
        around = around * side_confidence(templates.half, joints, side_probability)
    return around * np.exp(-0.5 * moved**2)


def side_confidence(
    half: BodyHalf, joints: Complex[np.ndarray, "T J"], probability: Float[np.ndarray, "T"]
) -> Float[np.ndarray, "T J"]:
    """How sure the `probability` of left and right lets joints be, 0-1: limbs that are together are
    there either way."""
    apart = np.abs(joints - joints[:, half.mirror]) / HYPOTHESIS_SPREAD
    return 1 - (1 - probability[:, None]) * (1 - np.exp(-0.5 * apart**2))
