"""Edge elements of many frames, shared out to cells of like position, direction and colour.

A cell stands for all its members by their mean. Which cells may correspond (same colour,
directions inside the cone, positions within reach) is worked out once for all frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Complex64, Float, Float32, Int

from keyrecon.keyframes.edge_distance import (
    MAX_DIRECTION_DIFFERENCE,
    half_of,
    half_origins,
)
from keyrecon.numerics.ragged import ranges
from keyrecon.records import Edges, HalfName, Track

BINS_PER_STRIP = 512
"""Cells whose neighbours are found together. A quarter more or less, others with it: at most 0.9
points, 2.2 mm on four clips; halved: the same bits."""


@dataclass(frozen=True, eq=False)
class BinnedElements:
    """Aligned edge elements of many frames, one after the other."""

    frame: Int[np.ndarray, "E"]
    points: Float32[np.ndarray, "E 2"]
    """Player heights."""
    angle: Float32[np.ndarray, "E"]
    """Direction of the tangent, rad."""
    color: Int[np.ndarray, "E"]
    n_frames: int


@dataclass(frozen=True, eq=False)
class DescriptorBins:
    """Groups of like elements, and which of them may correspond."""

    of_element: Int[np.ndarray, "E"]
    """Cell of each element."""
    center: Complex64[np.ndarray, "G"]
    """Mean position of the members, x + iy in player heights."""
    first: Int[np.ndarray, "G+1"]
    """Where each cell's neighbours start in `neighbor`, and the end of the last."""
    neighbor: Int[np.ndarray, "P"]
    """Compatible cells that a member's distance may reach."""


def gather_elements(edges: Sequence[Edges], track: Track, half: HalfName) -> BinnedElements:
    """Align and join the elements of one half of the body."""
    inside = np.concatenate([half_of(e, half) for e in edges])
    points, tangent, color = (
        np.concatenate([getattr(e, name) for e in edges])[inside]
        for name in ("points", "tangent", "color")
    )
    frame = np.repeat(np.arange(len(edges)), [len(e.points) for e in edges])[inside]
    aligned = (points - half_origins(track, half)[frame]) / track.height[frame, None]
    return BinnedElements(
        frame=frame,
        points=aligned.astype(np.float32),
        angle=np.arctan2(tangent[:, 1], tangent[:, 0]).astype(np.float32),
        color=color,
        n_frames=len(edges),
    )


@dataclass(frozen=True, eq=False)
class _BinGrid:
    """Numbers of the places that a cell may have: colour, turn, column and row, one in another."""

    place: Int[np.ndarray, "E"]
    """Of each element."""
    directions: int
    near: int
    """Columns and rows between cells within reach at most: so many more are free all around."""
    columns: int
    rows: int

    @property
    def layer(self) -> int:
        """Places of one colour and turn."""
        return self.columns * self.rows

    def beside(
        self, place: Int[np.ndarray, "n"]
    ) -> tuple[Int[np.ndarray, "n D"], Int[np.ndarray, "n D"]]:
        """Runs of places, from and up to, with all that may correspond."""
        apart = int(np.ceil(MAX_DIRECTION_DIFFERENCE * self.directions / (2 * np.pi)))
        turn = place // self.layer % self.directions
        turned = (turn[:, None] + np.arange(-apart, apart + 1)) % self.directions
        turned = place[:, None] + (turned - turn[:, None]) * self.layer
        sideways = np.arange(-self.near, self.near + 1) * self.rows
        middle = (turned[:, :, None] + sideways).reshape(len(place), -1)
        return middle - self.near, middle + self.near + 1


def group_elements(
    elements: BinnedElements, pitch: float, directions: int, reach: float
) -> DescriptorBins:
    """Share the elements out to cells `pitch` wide and a turn / `directions` deep."""
    reach = reach + pitch / 2
    grid = _lay_grid(elements, pitch, directions, reach)
    occupied, of_element = np.unique(grid.place, return_inverse=True)
    weight = 1 / np.bincount(of_element, minlength=len(occupied))

    def mean(values: Float[np.ndarray, "E"]) -> Float[np.ndarray, "G"]:
        return np.bincount(of_element, values, minlength=len(occupied)) * weight

    center = mean(elements.points[:, 0]) + 1j * mean(elements.points[:, 1])
    heading = mean(np.cos(elements.angle)) + 1j * mean(np.sin(elements.angle))
    heading /= np.maximum(np.abs(heading), 1e-9)
    first, neighbor = _neighborhoods(occupied, grid, center, heading, reach)
    return DescriptorBins(of_element, center.astype(np.complex64), first, neighbor)


def _lay_grid(elements: BinnedElements, pitch: float, directions: int, reach: float) -> _BinGrid:
    spatial = np.floor(elements.points / pitch).astype(np.int64)
    turn = np.floor(elements.angle * (directions / (2 * np.pi))).astype(np.int64) % directions
    near = int(np.ceil(reach / pitch))
    low = spatial.min(axis=0, initial=0) - near
    columns, rows = (spatial.max(axis=0, initial=0) - low + near + 1).tolist()
    column, row = (spatial - low).T
    place = ((elements.color * directions + turn) * columns + column) * rows + row
    return _BinGrid(place, directions, near, columns, rows)


def _neighborhoods(
    occupied: Int[np.ndarray, "G"],
    grid: _BinGrid,
    center: Complex[np.ndarray, "G"],
    heading: Complex[np.ndarray, "G"],
    reach: float,
) -> tuple[Int[np.ndarray, "G+1"], Int[np.ndarray, "P"]]:
    """Cells of the same colour, within reach and inside the cone, for each cell."""
    counts, neighbors = [np.zeros(1, int)], []
    for at in range(0, len(occupied), BINS_PER_STRIP):
        strip = slice(at, at + BINS_PER_STRIP)
        # the cells are in order of their places, so that a run of places is a run of cells
        start, stop = (np.searchsorted(occupied, p) for p in grid.beside(occupied[strip]))
        room = (stop - start).sum(axis=1)
        column = ranges(start.ravel(), (stop - start).ravel())
        row = np.repeat(np.arange(len(room)), room)
        away = center[column] - center[strip][row]
        close = np.flatnonzero(away.real**2 + away.imag**2 < reach**2)
        row, column = row[close], column[close]
        aligned = (heading[column] * np.conj(heading[strip])[row]).real > np.cos(
            MAX_DIRECTION_DIFFERENCE
        )
        neighbors.append(column[aligned].astype(np.int32))
        counts.append(np.bincount(row[aligned], minlength=len(room)))
    return np.cumsum(np.concatenate(counts)), np.concatenate(neighbors)
