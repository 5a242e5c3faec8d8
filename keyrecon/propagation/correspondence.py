"""Which edge element of a frame an element of a figure corresponds to.

The nearest one of the same colour in place and direction together: the chord between two unit
tangents, times `BEND`, counts like a distance. Elements that differ by 45 degrees are so far
apart already that they only match when they lie close, and opposite ones never do, which is the
paper's rule (Section 4.1) with a soft edge. Colour is a further axis on which different values are
out of reach. A frame has a few hundred elements at most, so the distances of all pairs,

    |a - b|^2 = |a|^2 + (-2 a, 1) . (b, |b|^2),

come from one small matrix product in single precision, and no tree is as quick.
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Complex, Float32, Int

from keyrecon.numerics.geometry import to_complex
from keyrecon.propagation.body_frame import BodyFrame
from keyrecon.records import Edges

BEND = 0.08
"""Player heights that a chord of length one counts for."""
APART = 0.25
"""Spacing of colours on their axis: more than any reach, and little, for the sake of precision."""
NOWHERE = 1e3
"""Square of the distance of what only fills up an array."""
CACHE = 1 << 18
"""Distances in work at a time: they stay in the processor's cache."""


@dataclass(frozen=True, eq=False)
class ElementIndex:
    """Edge elements of all frames, ready to be looked up."""

    points: Complex[np.ndarray, "N"]
    """Player coordinates."""
    tangent: Complex[np.ndarray, "N"]
    color: Int[np.ndarray, "N"]
    first: Int[np.ndarray, "T"]
    """Row of each frame's first element."""
    offered: Float32[np.ndarray, "T 6 F"]
    """Each frame's elements side by side, (b, |b|^2)."""


def index_elements(edges: tuple[Edges, ...], window: BodyFrame) -> ElementIndex:
    """Put the elements of all frames into player coordinates, frame by frame."""
    count = np.array([len(e.points) for e in edges])
    frame = np.repeat(np.arange(len(edges)), count)
    points = window.from_pixels(np.concatenate([e.points for e in edges]), frame)
    tangent = to_complex(np.concatenate([e.tangent for e in edges]))
    color = np.concatenate([e.color for e in edges])
    first = np.cumsum(count) - count
    offered = np.zeros((len(edges), 6, max(1, count.max(initial=0))), np.float32)
    offered[:, 5] = NOWHERE
    offered[frame, :, np.arange(len(frame)) - first[frame]] = _offer(_lift(points, tangent, color))
    return ElementIndex(points, tangent, color, first, offered)


def _lift(
    points: Complex[np.ndarray, "*n"],
    tangent: Complex[np.ndarray, "*n"],
    color: Int[np.ndarray, "*n"],
) -> Float32[np.ndarray, "*n 5"]:
    """Coordinates in which distance tells how well elements correspond."""
    lifted = np.empty((*points.shape, 5), np.float32)
    lifted[..., 0], lifted[..., 1] = points.real, points.imag
    lifted[..., 2], lifted[..., 3] = BEND * tangent.real, BEND * tangent.imag
    lifted[..., 4] = APART * color
    return lifted


def _offer(lifted: Float32[np.ndarray, "*n 5"]) -> Float32[np.ndarray, "*n 6"]:
    """(b, |b|^2)"""
    return np.concatenate([lifted, np.square(lifted).sum(axis=-1, keepdims=True)], axis=-1)


def _find_nearest(
    wanted: Float32[np.ndarray, "P Q 5"], offered: Float32[np.ndarray, "P 6 F"], reach: float
) -> tuple[Int[np.ndarray, "P Q"], Bool[np.ndarray, "P Q"]]:
    """(position among the offered elements, whether it lies within `reach`)."""
    both = np.empty((*wanted.shape[:2], 6), np.float32)
    both[..., :5], both[..., 5] = -2 * wanted, 1
    nearest, least = np.empty(both.shape[:2], int), np.empty(both.shape[:2], np.float32)
    step = max(1, CACHE // (wanted.shape[1] * offered.shape[2]))
    apart = np.empty((step, wanted.shape[1], offered.shape[2]), np.float32)
    figure, element = np.ogrid[:step, : wanted.shape[1]]
    for at in range(0, len(wanted), step):
        part = slice(at, at + step)
        count = len(both[part])
        np.matmul(both[part], offered[part], out=apart[:count])
        apart[:count].argmin(axis=2, out=nearest[part])
        least[part] = apart[figure[:count], element, nearest[part]]
    return nearest, least + np.square(wanted).sum(axis=2) < reach**2


@runtime_checkable
class Placed(Protocol):
    """Elements of P figures: where they are, where they point, what colour they have."""

    points: Complex[np.ndarray, "P E"]
    tangent: Complex[np.ndarray, "P E"]
    color: Int[np.ndarray, "P E"]
    """-1 matches nothing."""


def match_elements(
    index: ElementIndex, frames: Int[np.ndarray, "P"], placed: Placed, reach: float
) -> tuple[Int[np.ndarray, "P E"], Bool[np.ndarray, "P E"]]:
    """(row of the index, whether there is one within `reach` player heights)."""
    wanted = _lift(placed.points, placed.tangent, placed.color)
    slot, found = _find_nearest(wanted, index.offered[frames], reach)
    return np.where(found, index.first[frames][:, None] + slot, 0), found


def match_back(
    index: ElementIndex, listed: Int[np.ndarray, "P F"], placed: Placed, reach: float
) -> tuple[Int[np.ndarray, "P F"], Bool[np.ndarray, "P F"]]:
    """For each of the frame's elements, the figure's element it belongs to, likewise."""
    hit, found = match_parts(index, listed, placed, np.zeros(placed.color.shape, int), 1, reach)
    return hit[:, 0], found[:, 0]


def match_parts(
    index: ElementIndex,
    listed: Int[np.ndarray, "P F"],
    placed: Placed,
    part: Int[np.ndarray, "P E"],
    parts: int,
    reach: float,
) -> tuple[Int[np.ndarray, "P N F"], Bool[np.ndarray, "P N F"]]:
    """For each of the frame's elements, the element it belongs to in each part of the figure."""
    wanted = _lift(index.points[listed], index.tangent[listed], index.color[listed])
    offered = _offer(_lift(placed.points, placed.tangent, placed.color)).transpose(0, 2, 1)
    hits = np.zeros((len(listed), parts, listed.shape[1]), int)
    found = np.zeros(hits.shape, bool)
    for number in range(parts):
        others = offered.copy()
        others[:, 5] += NOWHERE * (part != number)
        hits[:, number], found[:, number] = _find_nearest(wanted, others, reach)
    found &= (listed >= 0)[:, None]
    return np.where(found, hits, 0), found


def spread_choice(count: int, most: int) -> Int[np.ndarray, "N"]:
    """At most `most` of `count` numbers, evenly spread."""
    return np.arange(count) if count <= most else np.linspace(0, count - 1, most).astype(int)


def list_elements(edges: tuple[Edges, ...], name: str, most: int) -> Int[np.ndarray, "T F"]:
    """Rows of the index of each frame's upper or lower elements, at most `most`; -1 pads."""
    rows = np.full((len(edges), most), -1)
    first = 0
    for t, e in enumerate(edges):
        inside = first + np.flatnonzero(getattr(e, name))
        inside = inside[spread_choice(len(inside), most)]
        rows[t, : len(inside)] = inside
        first += len(e.points)
    return rows
