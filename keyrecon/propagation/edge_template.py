"""Which bone an edge element outlines, and what the outline of a bone looks like on average.

Puppets: the edge elements of annotated frames, each riding on a bone.

An element belongs to the bone it outlines: the near bone that lies on its left, where the
element's region is (a skin contour across the chest belongs to the arm in front of it, not to the
torso), and that runs along it. Seen from the bone from a to b it sits at a share of the length and
at an offset that stays as wide when the bone is foreshortened,

    e = a + along (b - a) + offset (b - a) / |b - a|,        all complex,

so its place is linear in the joints once the bone's direction is known. That turns "bring the
annotated figure onto this frame's edges" into small linear least squares.
"""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from keyrecon.numerics.geometry import to_complex
from keyrecon.propagation.body_frame import BodyFrame
from keyrecon.propagation.correspondence import list_elements, spread_choice
from keyrecon.propagation.foot_evidence import FootEvidence
from keyrecon.propagation.half_body import BodyHalf
from keyrecon.records import Edges

WIDEST = 0.16
"""Farthest an outline lies from its bone, player heights: the side of a loose shirt."""
ALONG_COST = 0.05
"""An element square to a bone counts as this much farther away, player heights."""
FACING = 0.35
"""Cosine between an element's left and the way to its bone, at least."""
PLACES = 8
"""Places along a bone at which its average outline has an element, on either side."""
END_PITCH = 0.025
"""Spacing of such places past the end of a bone (hand, foot, crown), player heights."""
USUAL = 0.25
"""Share of the annotated figures that must show an element for the average to have it."""


@dataclass(frozen=True, eq=False)
class TemplateElements:
    """Edge elements as their bones see them."""

    bone: Int[np.ndarray, "*n"]
    along: Float[np.ndarray, "*n"]
    """0 at the parent end, 1 at the child end."""
    offset: Complex[np.ndarray, "*n"]
    """Real part past an end, imaginary part to the side; player heights."""
    turn: Complex[np.ndarray, "*n"]
    """Direction of the tangent."""
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
    edges: Edges, window: BodyFrame, frame: int, pose: Complex[np.ndarray, "J"], half: BodyHalf
) -> TemplateElements:
    """The elements of a frame that outline a bone; none ride on bones with an unknown end."""
    point = window.from_pixels(edges.points, frame)[:, None]
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
    way = -offset * axis / np.maximum(distance, 1e-9)
    facing = (way * np.conj(-1j * tangent)).real
    cost = distance + ALONG_COST * np.abs((tangent * np.conj(axis)).imag)
    cost[~((facing > FACING) & (distance < WIDEST) & known)] = np.inf
    best = cost.argmin(axis=1)
    rows = np.flatnonzero(np.isfinite(cost[np.arange(len(best)), best]))
    best = best[rows]
    return TemplateElements(
        best,
        on_bone[rows, best] / length[best],
        offset[rows, best],
        tangent[rows, 0] * np.conj(axis[best]),
        edges.color[rows],
        1 / (1 + (2 * distance[rows, best] / WIDEST) ** 2),
    )


def average_outline(seated: list[TemplateElements], half: BodyHalf) -> TemplateElements:
    """What most annotated figures show at each place of a bone, both sides of the body together."""
    riders = join_elements(seated)
    figure = np.repeat(np.arange(len(seated)), [len(one.bone) for one in seated])
    pair = np.minimum(riders.bone, half.bone_mirror[riders.bone])
    places = np.column_stack([pair, _place(riders), np.sign(riders.offset.imag), riders.color])
    places, group = np.unique(places, axis=0, return_inverse=True)
    group = group.ravel()
    found = []
    for place, (bone, *_) in enumerate(places.astype(int)):
        members = np.flatnonzero(group == place)
        bones = {int(bone), int(half.bone_mirror[bone])}
        shown = len(np.unique(figure[members] * len(half.bones) + riders.bone[members]))
        share = shown / (len(seated) * len(bones))
        if share >= USUAL:
            found += [_average(riders.take(members), b, share) for b in bones]
    return join_elements(found) if found else riders.take(np.zeros(0, int))


def _place(riders: TemplateElements) -> Int[np.ndarray, "N"]:
    """Number of the stretch along the bone, or past one of its ends."""
    past = riders.offset.real
    along = np.minimum((riders.along * PLACES).astype(int), PLACES - 1)
    end = np.sign(past).astype(int) * (PLACES + (np.abs(past) / END_PITCH).astype(int))
    return np.where(np.abs(past) > 0.4 * END_PITCH, end, along)


def _average(riders: TemplateElements, bone: int, share: float) -> TemplateElements:
    """One element for many."""
    turn = riders.turn.mean()
    offset = np.median(riders.offset.real) + 1j * np.median(riders.offset.imag)
    return TemplateElements(
        np.array([bone]),
        np.median(riders.along, keepdims=True),
        np.array([offset]),
        np.array([turn / max(abs(turn), 1e-9)]),
        riders.color[:1],
        # directions that disagree make a poor average
        np.array([share * abs(turn) * np.median(riders.weight)]),
    )


def complete_template(
    riders: TemplateElements, average: TemplateElements, n_bones: int
) -> TemplateElements:
    """Bones that a figure shows less than half of get the average outline too, at half weight."""
    own = np.bincount(riders.bone, riders.weight, n_bones)
    usual = np.bincount(average.bone, average.weight, n_bones)
    lent = average.take(np.flatnonzero((own < usual / 2)[average.bone]))
    lent = TemplateElements(
        *(getattr(lent, f.name) for f in fields(TemplateElements)[:-1]), lent.weight / 2
    )
    return join_elements([riders, lent])


@dataclass(frozen=True, eq=False)
class AnnotatedPoses:
    """Annotated joints of one half of the body, in player coordinates, complete."""

    half: BodyHalf
    frames: Int[np.ndarray, "K"]
    joints: Complex[np.ndarray, "K J"]
    known: Bool[np.ndarray, "K J"]
    """False where a joint was not marked and stands where it usually does."""


@dataclass(frozen=True, eq=False)
class EdgeTemplates:
    """Annotated figures of one half of the body and, as the last row, their average outline."""

    poses: AnnotatedPoses
    riders: TemplateElements
    """Arrays of K + 1 rows and E elements."""
    share: Float[np.ndarray, "N E J"]
    """Share of every joint in the place of every element; N = K + 1."""
    listed: Int[np.ndarray, "T F"]
    """The half's own elements in every frame (rows of the index), -1 for none."""
    feet: FootEvidence | None = None
    """For the lower body."""

    @property
    def half(self) -> BodyHalf:
        """The half of the body."""
        return self.poses.half

    @property
    def average(self) -> int:
        """Row of the average outline."""
        return len(self.riders.bone) - 1


def make_edge_templates(
    edges: tuple[Edges, ...], window: BodyFrame, poses: AnnotatedPoses, most: int
) -> EdgeTemplates:
    """Seat the elements of annotated frames on their bones, at most `most` each."""
    half, seated = poses.half, []
    for frame, pose, known in zip(poses.frames, poses.joints, poses.known, strict=True):
        marked = np.where(known, pose, np.nan)
        riders = assign_to_bones(edges[frame], window, int(frame), marked, half)
        seated.append(riders.take(spread_choice(len(riders.bone), most)))
    average = average_outline(seated, half)
    seated = [complete_template(riders, average, len(half.bones)) for riders in seated]
    return _pad([*seated, average], poses, list_elements(edges, half.name, most))


def _pad(
    figures: list[TemplateElements], poses: AnnotatedPoses, listed: Int[np.ndarray, "T F"]
) -> EdgeTemplates:
    """One array per property, filled up with elements that weigh and match nothing."""
    half, room = poses.half, max(1, *(len(riders.bone) for riders in figures))
    columns = {}
    for column in fields(TemplateElements):
        first = getattr(figures[0], column.name)
        columns[column.name] = np.full((len(figures), room), column.name == "color", first.dtype)
        columns[column.name] *= -1
        for row, riders in enumerate(figures):
            columns[column.name][row, : len(riders.bone)] = getattr(riders, column.name)
    riders = TemplateElements(**columns)
    share = np.zeros((*riders.bone.shape, len(half.joints)), np.float32)
    rows, places = np.indices(riders.bone.shape)
    share[rows, places, half.bones[riders.bone, 0]] = 1 - riders.along
    share[rows, places, half.bones[riders.bone, 1]] += riders.along
    return EdgeTemplates(poses, riders, share, listed)


@dataclass(frozen=True, eq=False)
class PosedTemplates:
    """Puppets in poses: element e of figure p lies at share[p, e] @ joints[p] + free[p, e]."""

    share: Float[np.ndarray, "P E J"]
    free: Complex[np.ndarray, "P E"]
    points: Complex[np.ndarray, "P E"]
    tangent: Complex[np.ndarray, "P E"]
    color: Int[np.ndarray, "P E"]
    weight: Float[np.ndarray, "P E"]


def pose_templates(
    puppets: EdgeTemplates,
    which: Int[np.ndarray, "P"],
    joints: Complex[np.ndarray, "P J"],
    every: int = 1,
) -> PosedTemplates:
    """Each n-th element of puppets `which` with their joints at `joints`."""
    riders = puppets.riders.take(np.s_[which, ::every])
    share = puppets.share[which, ::every]
    axis = np.take_along_axis(bone_axes(puppets.half, joints), riders.bone, axis=1)
    free = riders.offset * axis
    points = (share @ joints[..., None])[..., 0] + free
    return PosedTemplates(share, free, points, riders.turn * axis, riders.color, riders.weight)


def bone_axes(half: BodyHalf, joints: Complex[np.ndarray, "P J"]) -> Complex[np.ndarray, "P B"]:
    """Unit vectors from parent to child."""
    bone = joints[:, half.bones[:, 1]] - joints[:, half.bones[:, 0]]
    return bone / np.maximum(np.abs(bone), 1e-6)
