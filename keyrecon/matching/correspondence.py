"""Which edge element of a frame an element of a figure corresponds to.

The nearest one of the same colour in place and direction together: the chord between two unit
tangents, times `BEND`, counts like a distance. Elements that differ by 45 degrees are so far
apart already that they only match when they lie close, and opposite ones never do, which is the
paper's rule (Section 4.1) with a soft edge. All frames share one k-d tree; frame and colour are a
further axis on which different values are out of reach.
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Complex, Float, Int
from scipy.spatial import cKDTree

from keyrecon.matching.window import Window, from_complex, to_complex
from keyrecon.records import Edges

BEND = 0.08
"""Player heights that a chord of length one counts for."""
APART = 10.0
"""Spacing of frames and colours on their axis: more than any reach."""
LEAF = 32
"""Elements in a leaf of a tree: a run through these is quicker than a walk down to fewer."""


@dataclass(frozen=True, eq=False)
class ElementIndex:
    """Edge elements of all frames, ready to be looked up."""

    points: Complex[np.ndarray, "N"]
    """Player coordinates."""
    tangent: Complex[np.ndarray, "N"]
    color: Int[np.ndarray, "N"]
    n_colors: int
    tree: cKDTree


def index_elements(edges: tuple[Edges, ...], window: Window) -> ElementIndex:
    """Put the elements of all frames into player coordinates and one tree."""
    frame = np.repeat(np.arange(len(edges)), [len(e.points) for e in edges])
    points = window.from_pixels(np.concatenate([e.points for e in edges]), frame)
    tangent = to_complex(np.concatenate([e.tangent for e in edges]))
    color = np.concatenate([e.color for e in edges])
    n_colors = int(color.max(initial=0)) + 1
    key = frame * n_colors + color
    tree = cKDTree(_lift(points, tangent, key), leafsize=LEAF, balanced_tree=False)
    return ElementIndex(points, tangent, color, n_colors, tree)


def _lift(
    points: Complex[np.ndarray, "*n"], tangent: Complex[np.ndarray, "*n"], key: np.ndarray
) -> Float[np.ndarray, "*n 5"]:
    lifted = np.empty((*points.shape, 5))
    lifted[..., :2] = from_complex(points)
    lifted[..., 2:4] = BEND * from_complex(tangent)
    lifted[..., 4] = APART * key
    return lifted


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
    known = (placed.color >= 0) & (placed.color < index.n_colors)
    key = np.where(known, frames[:, None] * index.n_colors + placed.color, -1)
    lifted = _lift(placed.points, placed.tangent, key)
    _, row = index.tree.query(lifted, distance_upper_bound=reach)
    found = row < len(index.points)
    return np.where(found, row, 0), found


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
    count, room = placed.points.shape
    figure = np.arange(count)
    key = (figure[:, None] * parts + part) * index.n_colors + placed.color
    lifted = _lift(placed.points, placed.tangent, np.where(placed.color < 0, -1, key))
    tree = cKDTree(
        lifted.reshape(-1, 5), leafsize=LEAF, balanced_tree=False, compact_nodes=False
    )
    keys = (figure[:, None] * parts + np.arange(parts)) * index.n_colors
    keys = keys[:, :, None] + index.color[listed][:, None]
    wanted = np.empty((*keys.shape, 5))
    wanted[...] = _lift(index.points[listed], index.tangent[listed], np.zeros(1))[:, None]
    wanted[..., 4] = APART * np.where(listed[:, None] < 0, -2, keys)
    _, hit = tree.query(wanted, distance_upper_bound=reach)
    found = (hit < count * room) & (listed >= 0)[:, None]
    return np.where(found, hit - figure[:, None, None] * room, 0), found


def spread_choice(count: int, most: int) -> Int[np.ndarray, "N"]:
    """At most `most` of `count` numbers, evenly spread."""
    return np.arange(count) if count <= most else np.linspace(0, count - 1, most).astype(int)


def list_elements(
    edges: tuple[Edges, ...], name: str, most: int
) -> Int[np.ndarray, "T F"]:
    """Rows of the index of each frame's upper or lower elements, at most `most`; -1 pads."""
    rows = np.full((len(edges), most), -1)
    first = 0
    for t, e in enumerate(edges):
        inside = first + np.flatnonzero(getattr(e, name))
        inside = inside[spread_choice(len(inside), most)]
        rows[t, : len(inside)] = inside
        first += len(e.points)
    return rows
