"""Pose distance between every two frames of a video (Section 4.2), fast.

C(i, j) is a sum over the elements of frame i of their distance to the nearest compatible
element of frame j, no more than `reach` each. Elements of all frames that agree in colour,
rounded direction and rounded position share a cell. Then

- M(g, j), the distance from cell g to frame j, is found from the elements of frame j outwards:
  each one offers its distance to the cells within reach, and the smallest offer holds;
- H(i, g), how many elements of frame i lie in cell g, is sparse, and C = H M / n.

The elements of j stay where they are and only those of i are rounded, which costs little
accuracy (a test holds the correlation with the exact twin above 0.997). Work grows with the
number of elements for M and with the square of the number of frames for the product; a video
of more than `most` frames is therefore first reduced to exemplars (see exemplars.py).
"""

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float, Float32
from scipy.sparse import csr_matrix

from keyrecon.errors import KeyreconError
from keyrecon.keyframes.descriptor_bins import (
    BinnedElements,
    DescriptorBins,
    gather_elements,
    group_elements,
)
from keyrecon.keyframes.edge_distance import MAX_MATCH_DISTANCE
from keyrecon.keyframes.exemplars import choose_exemplars, distance_in_band, measure_band
from keyrecon.numerics.ragged import ranges
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within
from keyrecon.records import Edges, HalfName, PoseDistances, Track
from keyrecon.spreading import Spread, one_by_one
from keyrecon.timeline import take_frames

HALVES: tuple[HalfName, HalfName] = ("upper", "lower")

FRAMES_PER_BLOCK = 16
"""Frames whose distances are found together: their maps stay in the processor's cache."""


@dataclass(frozen=True)
class CompareOptions:
    """How poses are compared."""

    reach: Annotated[float, within(0.01, 1)] = MAX_MATCH_DISTANCE
    """Farthest match of two edge elements, player heights; larger lets wilder poses match.

    An element without a match counts as much.
    """
    largest: Literal["reach", "observed"] = "reach"
    """Distances are shares of the largest there can be ('reach', the same for every video) or of
    the largest in this video ('observed', as the paper prints it).

    What stands for max B of Section 4.2: the bound `reach`, or the largest mean distance that any
    two frames of this video have.
    """
    symmetry: Literal["mean", "max"] = "mean"
    """How the distances from one frame to another and back become one."""
    cell: Annotated[float, within(0.005, 0.5)] = 1 / 40
    """Width of the cells in which edge elements are compared, player heights; smaller is slower and
    closer to exact."""
    directions: Annotated[int, within(4, 360)] = 24
    """Directions that edge elements are sorted into, in a full turn."""
    most: Annotated[int, within(10, 20_000)] = 4000
    """Frames compared with one another at most; a longer video is compared by frames that stand for
    their neighbours. Memory and time grow with the square."""


def compare_frames(
    edges: tuple[Edges, ...],
    track: Track,
    options: CompareOptions = CompareOptions(),
    progress: Progress = silent,
    spread: Spread = one_by_one,
) -> PoseDistances:
    """C of every two frames for the upper and the lower body (Sections 4.1-4.3).

    Of a long video, `spread` compares each window of neighbours and each half of the exemplars.
    Raises KeyreconError where no frame has edge elements of one half.
    """
    for half in HALVES:
        if not any(getattr(e, half).any() for e in edges):
            raise KeyreconError(
                f"No frame shows edges of the {half} body; pick the colours of its clothes or "
                "skin in one more frame."
            )
    if len(edges) > options.most:
        return _compare_exemplars(edges, track, options, progress, spread)
    upper, lower = (measure_matrix(edges, track, h, options, progress) for h in HALVES)
    everyone = np.arange(len(edges))
    return PoseDistances(
        upper=upper,
        lower=lower,
        frames=everyone,
        row=everyone,
        exemplar_distance=np.zeros((2, len(edges)), dtype=np.float32),
        consecutive_distance=np.stack([np.diag(upper, 1), np.diag(lower, 1)]),
        visibility_score=score_visibility(edges, track),
    )


def _compare_exemplars(
    edges: tuple[Edges, ...],
    track: Track,
    options: CompareOptions,
    progress: Progress,
    spread: Spread,
) -> PoseDistances:
    """The same by exemplars: linear in the length of the video, but for their own matrix."""

    def compare(windows: Sequence[slice]) -> Iterator[Float32[np.ndarray, "2 W W"]]:
        parts = ((edges[window], take_frames(track, window), options) for window in windows)
        return spread(compare_window, parts)

    band = measure_band(compare, len(edges), progress)
    frames, row = choose_exemplars(band.max(axis=0), options.most)
    kept, track_kept = tuple(edges[t] for t in frames), take_frames(track, frames)
    halves = spread(measure_matrix, ((kept, track_kept, half, options) for half in HALVES))
    upper, lower = progress(halves, "Comparing exemplars", len(HALVES))
    return PoseDistances(
        upper=upper,
        lower=lower,
        frames=frames,
        row=row,
        exemplar_distance=distance_in_band(band, np.arange(len(edges)), frames[row]),
        consecutive_distance=band[:, :-1, 0],
        visibility_score=score_visibility(edges, track),
    )


def compare_window(
    edges: tuple[Edges, ...], track: Track, options: CompareOptions
) -> Float32[np.ndarray, "2 W W"]:
    """C of every two frames of a window, upper and lower body."""
    return np.stack([measure_matrix(edges, track, half, options) for half in HALVES])


def score_visibility(edges: tuple[Edges, ...], track: Track) -> Float[np.ndarray, "T"]:
    """How well each frame could be annotated, 0-1: confidence of the track times sharpness.

    Motion blur dissolves contours: a frame with fewer elements than the median is less sharp.
    """
    count = np.array([len(e.points) for e in edges])
    return track.confidence * np.clip(count / max(1.0, np.median(count)), 0, 1)


def measure_matrix(
    edges: tuple[Edges, ...],
    track: Track,
    half: HalfName,
    options: CompareOptions = CompareOptions(),
    progress: Progress = silent,
) -> Float32[np.ndarray, "T T"]:
    """C of one half of the body, player heights: symmetric, 0 on the diagonal, never NaN.

    A frame without elements is `reach` away from every other.
    """
    elements = gather_elements(edges, track, half)
    cells = group_elements(elements, options.cell, options.directions, options.reach)
    total = np.empty((len(edges), len(edges)), dtype=np.float32)
    matched = np.empty_like(total) if options.largest == "observed" else None
    _accumulate(elements, cells, options.reach, total, matched, progress)
    count = np.bincount(elements.frame, minlength=len(edges)).astype(np.float32)[:, None]
    empty = count[:, 0] == 0
    np.divide(total, count, out=total, where=count > 0)
    total[empty] = options.reach
    total[:, empty] = options.reach
    if matched is not None:
        np.divide(matched, count, out=matched, where=count > 0)
        total = _with_observed_largest(total, matched, options.reach)
    return _symmetric(total, options.symmetry)


def _accumulate(
    elements: BinnedElements,
    cells: DescriptorBins,
    reach: float,
    total: Float32[np.ndarray, "T T"],
    matched: Float32[np.ndarray, "T T"] | None,
    progress: Progress,
) -> None:
    """Fill in the summed distances and, where asked for, the numbers of matches."""
    members = csr_matrix(
        (np.ones(len(elements.frame), np.float32), (elements.frame, cells.of_element)),
        shape=(elements.n_frames, len(cells.center)),
    )
    start = np.searchsorted(elements.frame, np.arange(elements.n_frames + 1))

    def measure(first: int) -> None:
        frames = range(first, min(first + FRAMES_PER_BLOCK, elements.n_frames))
        part = slice(start[frames.start], start[frames.stop])
        offered = offer_distances(elements, cells, part, frames, reach)
        total[:, frames.start : frames.stop] = members @ offered
        if matched is not None:
            near = (offered < np.float32(reach)).astype(np.float32)
            matched[:, frames.start : frames.stop] = members @ near

    blocks = range(0, elements.n_frames, FRAMES_PER_BLOCK)
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
        for _ in progress(pool.map(measure, blocks), "Comparing frames", len(blocks)):
            pass


def offer_distances(
    elements: BinnedElements, cells: DescriptorBins, part: slice, frames: range, reach: float
) -> Float32[np.ndarray, "G B"]:
    """M for some frames, whose elements are `part`: distance of each cell to each frame."""
    cell = cells.of_element[part]
    count = cells.first[cell + 1] - cells.first[cell]
    target = cells.neighbor[ranges(cells.first[cell], count)]
    away = cells.center[target]
    away -= np.repeat(elements.points[part].view(np.complex64)[:, 0], count)
    squared = np.square(away.real) + np.square(away.imag)
    slot = target.astype(np.int64) * len(frames)
    slot += np.repeat(elements.frame[part] - frames.start, count)
    nearest = np.full(len(cells.center) * len(frames), reach * reach, dtype=np.float32)
    np.minimum.at(nearest, slot, squared)
    return np.minimum(np.sqrt(nearest), np.float32(reach)).reshape(-1, len(frames))


def _with_observed_largest(
    mean: Float32[np.ndarray, "T T"], matched: Float32[np.ndarray, "T T"], reach: float
) -> Float32[np.ndarray, "T T"]:
    """Put the largest mean distance of matches (max B) in the place of `reach`."""
    summed = mean - (1 - matched) * np.float32(reach)
    other = (matched > 0) & ~np.eye(len(mean), dtype=bool)
    mean_matched = np.divide(summed, matched, out=np.zeros_like(mean), where=other)
    return summed + (1 - matched) * mean_matched.max()


def _symmetric(directed: Float32[np.ndarray, "T T"], symmetry: str) -> Float32[np.ndarray, "T T"]:
    if symmetry == "max":
        both = np.maximum(directed, directed.T)
    else:
        both = (directed + directed.T) / np.float32(2)
    np.fill_diagonal(both, 0)
    return both
