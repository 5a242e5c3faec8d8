"""Which bone an edge element outlines, and what the outline of a bone looks like on average."""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.matching.halves import Half
from keyrecon.matching.window import Window, to_complex
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
class Riders:
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

    def take(self, rows: np.ndarray | tuple | int) -> "Riders":
        """Some of them."""
        return Riders(*(getattr(self, field.name)[rows] for field in fields(self)))


def join_riders(parts: list[Riders]) -> Riders:
    """One after the other."""
    return Riders(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Riders)))


def seat_elements(
    edges: Edges, window: Window, frame: int, pose: Complex[np.ndarray, "J"], half: Half
) -> Riders:
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
    return Riders(
        best,
        on_bone[rows, best] / length[best],
        offset[rows, best],
        tangent[rows, 0] * np.conj(axis[best]),
        edges.color[rows],
        1 / (1 + (2 * distance[rows, best] / WIDEST) ** 2),
    )


def average_outline(seated: list[Riders], half: Half) -> Riders:
    """What most annotated figures show at each place of a bone, both sides of the body together."""
    riders = join_riders(seated)
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
    return join_riders(found) if found else riders.take(np.zeros(0, int))


def _place(riders: Riders) -> Int[np.ndarray, "N"]:
    """Number of the stretch along the bone, or past one of its ends."""
    past = riders.offset.real
    along = np.minimum((riders.along * PLACES).astype(int), PLACES - 1)
    end = np.sign(past).astype(int) * (PLACES + (np.abs(past) / END_PITCH).astype(int))
    return np.where(np.abs(past) > 0.4 * END_PITCH, end, along)


def _average(riders: Riders, bone: int, share: float) -> Riders:
    """One element for many."""
    turn = riders.turn.mean()
    offset = np.median(riders.offset.real) + 1j * np.median(riders.offset.imag)
    return Riders(
        np.array([bone]),
        np.median(riders.along, keepdims=True),
        np.array([offset]),
        np.array([turn / max(abs(turn), 1e-9)]),
        riders.color[:1],
        # directions that disagree make a poor average
        np.array([share * abs(turn) * np.median(riders.weight)]),
    )


def complete_outline(riders: Riders, average: Riders, n_bones: int) -> Riders:
    """Bones that a figure shows less than half of get the average outline too, at half weight."""
    own = np.bincount(riders.bone, riders.weight, n_bones)
    usual = np.bincount(average.bone, average.weight, n_bones)
    lent = average.take(np.flatnonzero((own < usual / 2)[average.bone]))
    lent = Riders(*(getattr(lent, f.name) for f in fields(Riders)[:-1]), lent.weight / 2)
    return join_riders([riders, lent])
