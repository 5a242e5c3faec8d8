"""Edge templates: the edge elements of annotated frames, each attached to a bone.

An element belongs to the bone it outlines: the near bone that lies on its left, where the
element's region is (a skin contour across the chest belongs to the arm in front of it, not to the
torso), and that runs along it. In the coordinates of the bone from a to b it sits at a share of the
length and at an offset that stays as wide when the bone is foreshortened,

    e = a + along (b - a) + offset (b - a) / |b - a|,        all complex,

so its place is linear in the joints once the bone's direction is known. That turns "bring the
annotated template onto this frame's edges" into small linear least squares. What most annotated
frames have at each place of a bone makes the average outline, which stands in for what a single
template lacks.

Tracked feet are further evidence of where the legs end. On clay or grass the outline of a bare leg
is often lost while the tracker still holds the shoes. It does not know left from right, so each
foot counts for the ankle that it fits better, and one that fits neither counts for nothing. How
ankles lie beside tracked feet is learnt from the annotated frames.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from keyrecon.numerics.geometry import to_complex
from keyrecon.propagation.body_frame import BodyFrame
from keyrecon.propagation.half_body import BodyHalf
from keyrecon.records import Edges, Preparation

MAX_OUTLINE_OFFSET = 0.16
"""Farthest an outline lies from its bone, player heights: the side of a loose shirt. Halved or
doubled, others with it: at most 0.1 points, 0.1 mm on one clip."""
ANGLE_WEIGHT = 0.05
"""An element square to a bone counts as this much farther away, player heights. Halved or doubled,
others with it: at most 0.1 points, 0.2 mm on one clip."""
MIN_FACING_COSINE = 0.35
"""Cosine between an element's left and the way to its bone, at least: they may differ by 70
degrees. Halved or doubled, others with it: at most 0.1 points, 0.3 mm on one clip."""
BONE_BINS = 8
"""Bins along a bone in which its average outline has an element, on either side. Halved or doubled,
others with it: at most 0.1 points, 0.3 mm on one clip."""
END_BIN_LENGTH = 0.025
"""Length of such bins past the end of a bone (hand, foot, crown), player heights. Halved or
doubled, others with it: at most 0.1 points, 0.1 mm on one clip."""
MIN_OUTLINE_SHARE = 0.25
"""Share of the annotated frames that must have an element for the average outline to have it. A
quarter more or less: up to 5.0 mm on one of four clips, 3.6 on another; other clicks on the same
joints change them by up to 5. How many frames show an outline is what it is to tell, so a video
does not tell it."""
FOOT_MATCH_DISTANCE = 0.08
"""A foot farther from where the ankle is estimated counts for little, player heights. Halved or
doubled, others with it: at most 0.1 points, 0.3 mm on one clip."""
MIN_FOOT_SPREAD = 0.03
"""Error of a tracked foot at least, player heights. Halved or doubled, others with it: at most 0.1
points, 0.5 mm on one clip."""


@dataclass(frozen=True, eq=False)
class TemplateElements:
    """Edge elements in the coordinates of their bones."""

    bone: Int[np.ndarray, "*n"]
    along: Float[np.ndarray, "*n"]
    """0 at the parent end, 1 at the child end."""
    offset: Complex[np.ndarray, "*n"]
    """Real part past an end, imaginary part to the side; player heights."""
    bone_tangent: Complex[np.ndarray, "*n"]
    """Direction of the tangent relative to the bone."""
    color: Int[np.ndarray, "*n"]
    """-1 for padding."""
    weight: Float[np.ndarray, "*n"]

    def take(self, rows: np.ndarray | tuple | int) -> "TemplateElements":
        """Some of them."""
        return TemplateElements(*(getattr(self, field.name)[rows] for field in fields(self)))


def join_elements(parts: list[TemplateElements]) -> TemplateElements:
    """One after the other."""
    return TemplateElements(
        *(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(TemplateElements))
    )


def assign_to_bones(
    edges: Edges, body_frame: BodyFrame, frame: int, pose: Complex[np.ndarray, "J"], half: BodyHalf
) -> TemplateElements:
    """The elements of a frame that outline a bone; none belong to bones with an unknown end."""
    point = body_frame.from_pixels(edges.points, frame)[:, None]
    tangent = to_complex(edges.tangent)[:, None]
    known = np.isfinite(pose)[half.bones].all(axis=1)
    ends = np.nan_to_num(pose)[half.bones]
    start, bone = ends[:, 0], ends[:, 1] - ends[:, 0]
    length = np.maximum(np.abs(bone), 1e-6)
    axis = bone / length
    local = (point - start) * np.conj(axis)
    on_bone = np.clip(local.real, 0, length)
    offset = local - on_bone
    distance = np.abs(offset)
    # left of the tangent on a picture whose y points down is -i times it
    to_bone = -offset * axis / np.maximum(distance, 1e-9)
    facing = (to_bone * np.conj(-1j * tangent)).real
    cost = distance + ANGLE_WEIGHT * np.abs((tangent * np.conj(axis)).imag)
    cost[~((facing > MIN_FACING_COSINE) & (distance < MAX_OUTLINE_OFFSET) & known)] = np.inf
    best = cost.argmin(axis=1)
    rows = np.flatnonzero(np.isfinite(cost[np.arange(len(best)), best]))
    best = best[rows]
    return TemplateElements(
        best,
        on_bone[rows, best] / length[best],
        offset[rows, best],
        tangent[rows, 0] * np.conj(axis[best]),
        edges.color[rows],
        1 / (1 + (2 * distance[rows, best] / MAX_OUTLINE_OFFSET) ** 2),
    )


def average_outline(frames: list[TemplateElements], half: BodyHalf) -> TemplateElements:
    """What most annotated frames have in each bin of a bone, both sides of the body together."""
    elements = join_elements(frames)
    frame = np.repeat(np.arange(len(frames)), [len(one.bone) for one in frames])
    pair = np.minimum(elements.bone, half.bone_mirror[elements.bone])
    bins = np.column_stack(
        [pair, _bin_along_bone(elements), np.sign(elements.offset.imag), elements.color]
    )
    bins, group = np.unique(bins, axis=0, return_inverse=True)
    group = group.ravel()
    outline = []
    for number, (bone, *_) in enumerate(bins.astype(int)):
        members = np.flatnonzero(group == number)
        bones = {int(bone), int(half.bone_mirror[bone])}
        occupied = len(np.unique(frame[members] * len(half.bones) + elements.bone[members]))
        share = occupied / (len(frames) * len(bones))
        if share >= MIN_OUTLINE_SHARE:
            outline += [_average(elements.take(members), b, share) for b in bones]
    return join_elements(outline) if outline else elements.take(np.zeros(0, int))


def _bin_along_bone(elements: TemplateElements) -> Int[np.ndarray, "N"]:
    """Number of the stretch along the bone, or past one of its ends."""
    past = elements.offset.real
    along = np.minimum((elements.along * BONE_BINS).astype(int), BONE_BINS - 1)
    end = np.sign(past).astype(int) * (BONE_BINS + (np.abs(past) / END_BIN_LENGTH).astype(int))
    return np.where(np.abs(past) > 0.4 * END_BIN_LENGTH, end, along)


def _average(elements: TemplateElements, bone: int, share: float) -> TemplateElements:
    """One element for many."""
    tangent = elements.bone_tangent.mean()
    offset = np.median(elements.offset.real) + 1j * np.median(elements.offset.imag)
    return TemplateElements(
        np.array([bone]),
        np.median(elements.along, keepdims=True),
        np.array([offset]),
        np.array([tangent / max(abs(tangent), 1e-9)]),
        elements.color[:1],
        # directions that disagree make a poor average
        np.array([share * abs(tangent) * np.median(elements.weight)]),
    )


def complete_template(
    elements: TemplateElements, average: TemplateElements, n_bones: int
) -> TemplateElements:
    """Bones of which less than half is outlined get the average outline too, at half weight."""
    present = np.bincount(elements.bone, elements.weight, n_bones)
    expected = np.bincount(average.bone, average.weight, n_bones)
    added = average.take(np.flatnonzero((present < expected / 2)[average.bone]))
    return join_elements([elements, replace(added, weight=added.weight / 2)])


def choose_evenly(count: int, most: int) -> Int[np.ndarray, "N"]:
    """At most `most` of `count` numbers, evenly spread."""
    return np.arange(count) if count <= most else np.linspace(0, count - 1, most).astype(int)


def list_half_elements(edges: tuple[Edges, ...], name: str, most: int) -> Int[np.ndarray, "T F"]:
    """Rows of the index of each frame's upper or lower elements, at most `most`; -1 pads."""
    rows = np.full((len(edges), most), -1)
    first = 0
    for t, e in enumerate(edges):
        inside = first + np.flatnonzero(getattr(e, name))
        inside = inside[choose_evenly(len(inside), most)]
        rows[t, : len(inside)] = inside
        first += len(e.points)
    return rows


@dataclass(frozen=True, eq=False)
class AnnotatedPoses:
    """Annotated joints of one half of the body, in player coordinates, complete."""

    half: BodyHalf
    frames: Int[np.ndarray, "K"]
    joints: Complex[np.ndarray, "K J"]
    known: Bool[np.ndarray, "K J"]
    """False where a joint was not marked and stands where it does on the median."""
    longest: Float[np.ndarray, "B"]
    """Length that each bone has in the picture at most, player heights."""


@dataclass(frozen=True, eq=False)
class FootEvidence:
    """Where the ends of both legs should be, in no particular order."""

    ends: Int[np.ndarray, "2"]
    """Positions of the joints in their half of the body."""
    points: Complex[np.ndarray, "T 2"]
    """Player coordinates."""
    seen: Bool[np.ndarray, "T"]
    """False where the feet were not seen and lie between places where they were."""
    spread: float
    """Median error, player heights."""

    def part(self, frames: slice | Int[np.ndarray, "n"]) -> "FootEvidence":
        """That of some frames."""
        return replace(self, points=self.points[frames], seen=self.seen[frames])


def feet_in_sight(preparation: Preparation) -> Bool[np.ndarray, "T"]:
    """Frames in which the feet were seen, not interpolated or put beneath the picture."""
    track = preparation.track
    return (track.confidence > 0) & track.feet_inside(preparation.video.height)


def learn_foot_offsets(
    poses: AnnotatedPoses,
    tracked: Complex[np.ndarray, "T 2"],
    seen: Bool[np.ndarray, "T"],
) -> FootEvidence:
    """Tracked feet, moved to where the ankles are on frames in which both were marked and seen."""
    half, frames = poses.half, poses.frames
    ends = np.array([max(side, key=lambda j: half.depth[j]) for side in half.sides])
    gap = poses.joints[:, ends] - order_feet(tracked[frames], poses.joints[:, ends])
    used = seen[frames] & poses.known[:, ends].all(axis=1)
    gap = gap[used] if used.any() else gap
    shift = np.median(gap.real) + 1j * np.median(gap.imag)
    spread = float(np.median(np.abs(gap - shift)))
    return FootEvidence(ends, tracked + shift, seen, max(spread, MIN_FOOT_SPREAD))


def order_feet(
    feet: Complex[np.ndarray, "P 2"], ends: Complex[np.ndarray, "P 2"]
) -> Complex[np.ndarray, "P 2"]:
    """Feet in the order of the leg ends that they fit better."""
    direct, crossed = (
        np.minimum(np.abs(f - ends), FOOT_MATCH_DISTANCE).sum(axis=1) for f in (feet, feet[:, ::-1])
    )
    return np.where((direct <= crossed)[:, None], feet, feet[:, ::-1])


@dataclass(frozen=True, eq=False)
class EdgeTemplates:
    """Templates of one half of the body: one per annotated frame, the average outline last."""

    poses: AnnotatedPoses
    elements: TemplateElements
    """Arrays of K + 1 rows and E elements."""
    joint_weights: Float[np.ndarray, "N E J"]
    """Weight of every joint in the position of every element; N = K + 1."""
    frame_elements: Int[np.ndarray, "T F"]
    """The half's elements in every frame (rows of the index), -1 for none."""
    feet: FootEvidence | None = None
    """For the lower body."""

    @property
    def half(self) -> BodyHalf:
        """The half of the body."""
        return self.poses.half

    @property
    def average(self) -> int:
        """Row of the average outline."""
        return len(self.elements.bone) - 1


def make_edge_templates(
    edges: tuple[Edges, ...], body_frame: BodyFrame, poses: AnnotatedPoses, most: int
) -> EdgeTemplates:
    """Templates of the annotated frames, of at most `most` elements each."""
    half, outlines = poses.half, []
    for frame, pose, known in zip(poses.frames, poses.joints, poses.known, strict=True):
        marked = np.where(known, pose, np.nan)
        elements = assign_to_bones(edges[frame], body_frame, int(frame), marked, half)
        outlines.append(elements.take(choose_evenly(len(elements.bone), most)))
    average = average_outline(outlines, half)
    outlines = [complete_template(elements, average, len(half.bones)) for elements in outlines]
    return _pad([*outlines, average], poses, list_half_elements(edges, half.name, most))


def _pad(
    outlines: list[TemplateElements],
    poses: AnnotatedPoses,
    frame_elements: Int[np.ndarray, "T F"],
) -> EdgeTemplates:
    """One array per property, filled up with elements that weigh and match nothing."""
    half, width = poses.half, max(1, *(len(elements.bone) for elements in outlines))
    columns = {}
    for column in fields(TemplateElements):
        first = getattr(outlines[0], column.name)
        columns[column.name] = np.full((len(outlines), width), column.name == "color", first.dtype)
        columns[column.name] *= -1
        for row, elements in enumerate(outlines):
            columns[column.name][row, : len(elements.bone)] = getattr(elements, column.name)
    elements = TemplateElements(**columns)
    weights = np.zeros((*elements.bone.shape, len(half.joints)), np.float32)
    rows, places = np.indices(elements.bone.shape)
    weights[rows, places, half.bones[elements.bone, 0]] = 1 - elements.along
    weights[rows, places, half.bones[elements.bone, 1]] += elements.along
    return EdgeTemplates(poses, elements, weights, frame_elements)
