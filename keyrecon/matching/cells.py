"""Edge elements of many frames, shared out to cells of like position, direction and colour.

A cell stands for all its members by their mean. Which cells may correspond (same colour,
directions inside the cone, positions within reach) is worked out once for all frames.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int
from scipy.spatial import cKDTree

from keyrecon.matching.distance import CONE, Half, align_edges
from keyrecon.records import Edges, Track


@dataclass(frozen=True, eq=False)
class Elements:
    """Aligned edge elements of many frames, one after the other."""

    frame: Int[np.ndarray, "E"]
    points: Float32[np.ndarray, "E 2"]
    """Player heights."""
    angle: Float32[np.ndarray, "E"]
    """Direction of the tangent, rad."""
    color: Int[np.ndarray, "E"]
    n_frames: int


@dataclass(frozen=True, eq=False)
class Cells:
    """Groups of like elements, and which of them may correspond."""

    of_element: Int[np.ndarray, "E"]
    """Cell of each element."""
    center: Float32[np.ndarray, "G 2"]
    """Mean position of the members, player heights."""
    first: Int[np.ndarray, "G+1"]
    """Where each cell's neighbours start in `neighbor`, and the end of the last."""
    neighbor: Int[np.ndarray, "P"]
    """Compatible cells that a member's distance may reach."""


def gather_elements(edges: tuple[Edges, ...], track: Track, half: Half) -> Elements:
    """Align and join the elements of one half of the body."""
    aligned = [align_edges(e, track, t, half) for t, e in enumerate(edges)]
    tangent = np.concatenate([e.tangent for e in aligned])
    return Elements(
        frame=np.repeat(np.arange(len(aligned)), [len(e.points) for e in aligned]),
        points=np.concatenate([e.points for e in aligned]).astype(np.float32),
        angle=np.arctan2(tangent[:, 1], tangent[:, 0]).astype(np.float32),
        color=np.concatenate([e.color for e in aligned]),
        n_frames=len(aligned),
    )


def group_elements(elements: Elements, pitch: float, directions: int, reach: float) -> Cells:
    """Share the elements out to cells `pitch` wide and a turn / `directions` deep."""
    spatial = np.floor(elements.points / pitch).astype(np.int64)
    turn = np.floor(elements.angle * (directions / (2 * np.pi))).astype(np.int64) % directions
    key = np.stack([elements.color, turn, spatial[:, 0], spatial[:, 1]], axis=1)
    used, of_element = np.unique(_packed(key), return_inverse=True)
    weight = 1 / np.bincount(of_element, minlength=len(used))

    def mean(values: Float[np.ndarray, "E"]) -> Float[np.ndarray, "G"]:
        return np.bincount(of_element, values, minlength=len(used)) * weight

    center = np.stack([mean(elements.points[:, 0]), mean(elements.points[:, 1])], axis=1)
    angle = np.arctan2(mean(np.sin(elements.angle)), mean(np.cos(elements.angle)))
    color = np.zeros(len(used), dtype=np.int64)
    color[of_element] = elements.color
    first, neighbor = _neighborhoods(center, angle, color, reach + pitch / 2)
    return Cells(of_element, center.astype(np.float32), first, neighbor)


def _packed(key: Int[np.ndarray, "E 4"]) -> Int[np.ndarray, "E"]:
    """One number per row, different for different rows."""
    low = key.min(axis=0, initial=0)
    span = key.max(axis=0, initial=0) - low + 1
    packed = np.zeros(len(key), dtype=np.int64)
    for column in range(key.shape[1]):
        packed = packed * span[column] + key[:, column] - low[column]
    return packed


def _neighborhoods(
    center: Float[np.ndarray, "G 2"],
    angle: Float[np.ndarray, "G"],
    color: Int[np.ndarray, "G"],
    reach: float,
) -> tuple[Int[np.ndarray, "G+1"], Int[np.ndarray, "P"]]:
    """Cells of the same colour, within reach and inside the cone, for each cell."""
    # In the maximum norm of (position, scaled direction) a ball holds every pair that counts,
    # and few others: chords longer than the cone's are out before their cosine is taken.
    chord = reach / (2 * np.sin(CONE / 2))
    lifted = np.column_stack([center, chord * np.cos(angle), chord * np.sin(angle)])
    rows, columns = [], []
    for one in np.unique(color):
        members = np.flatnonzero(color == one)
        pairs = cKDTree(lifted[members]).query_pairs(reach, p=np.inf, output_type="ndarray")
        pairs = members[pairs]
        apart = center[pairs[:, 0]] - center[pairs[:, 1]]
        close = (apart**2).sum(axis=1) < reach**2
        aligned = np.cos(angle[pairs[:, 0]] - angle[pairs[:, 1]]) > np.cos(CONE)
        pairs = pairs[close & aligned]
        rows += [pairs[:, 0], pairs[:, 1], members]
        columns += [pairs[:, 1], pairs[:, 0], members]
    row, column = np.concatenate(rows), np.concatenate(columns)
    order = np.argsort(row, kind="stable")
    first = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=len(center)))])
    return first, column[order].astype(np.int32)


def ranges(start: Int[np.ndarray, "E"], count: Int[np.ndarray, "E"]) -> Int[np.ndarray, "P"]:
    """start[0], start[0] + 1, ... (count[0] numbers), then the same of the next, and so on."""
    before = np.cumsum(count) - count
    return np.arange(count.sum()) + np.repeat(start - before, count)
