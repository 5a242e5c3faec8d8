"""Pose distance between every two frames of a video (Section 4.2), fast.

C(i, j) is a sum over the elements of frame i of their distance to the nearest compatible
element of frame j, no more than `reach` each. Elements of all frames that agree in colour,
rounded direction and rounded position share a cell. Then

- M(g, j), the distance from cell g to frame j, is found from the elements of frame j outwards:
  each one offers its distance to the cells within reach, and the smallest offer holds;
- H(i, g), how many elements of frame i lie in cell g, is sparse, and C = H M / n.

The elements of j stay where they are and only those of i are rounded, which costs little
accuracy (a test holds the correlation with the exact twin above 0.997). Work grows with the
number of elements for M and with the square of the number of frames for the product; of a video
of more than `most` frames only exemplars are compared with one another (see exemplars.py).
"""

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float, Float32, Int
from scipy.sparse import csr_matrix

from keyrecon.errors import KeyreconError
from keyrecon.keyframes.descriptor_bins import (
    BinnedElements,
    DescriptorBins,
    gather_elements,
    group_elements,
)
from keyrecon.keyframes.edge_distance import MAX_MATCH_DISTANCE, half_of
from keyrecon.keyframes.exemplars import find_exemplars
from keyrecon.numerics.ragged import ranges
from keyrecon.numerics.threads import core_count
from keyrecon.parallel_map import ParallelMap, one_by_one
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within
from keyrecon.records import Edges, HalfName, PoseDistances, Track
from keyrecon.timeline import take_frames

HALVES: tuple[HalfName, HalfName] = ("upper", "lower")

FRAMES_PER_BLOCK = 16
"""Frames whose distances are found together: their maps stay in the processor's cache."""
EXEMPLAR_CELL = 2.0
"""Width of cells where frames are compared with exemplars, in those of `CompareOptions`. Of one
rendered sequence, distances below .03 player heights are then off by .0014 (standard deviation;
.0007 with 1, .0022 with 3; in the mean by less than .0002) and take a quarter of the time."""
WINDOW_FRAMES = 480
"""Frames of which each is compared with the next at a time."""


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
    """Directions that edge elements are sorted into, in a full turn.

    A quarter fewer: other frames are marked, and on one of four clips of 6 s this costs 3.2 mm; a
    hundredth of all numbers of the choice moves that clip by 2.6.
    """
    most: Annotated[int, within(10, 20_000)] = 4000
    """Frames compared with one another at most; of a longer video so many stand for all that are
    like them. Memory grows with the square, time as well and with the length of the video.

    A quarter more or less, others with it: at most 0.9 points, 0.7 mm on four clips.
    """


def compare_frames(
    edges: tuple[Edges, ...],
    track: Track,
    options: CompareOptions = CompareOptions(),
    progress: Progress = silent,
    parallel_map: ParallelMap = one_by_one,
) -> PoseDistances:
    """C of every two frames for the upper and the lower body (Sections 4.1-4.3).

    Of a long video, `parallel_map` compares parts with the exemplars, and each half of the
    exemplars.
    Raises KeyreconError where no frame has edge elements of one half.
    """
    for half in HALVES:
        if not any(half_of(e, half).any() for e in edges):
            raise KeyreconError(
                f"No frame shows edges of the {half} body; pick the colours of its clothes or "
                "skin in one more frame."
            )
    if len(edges) > options.most:
        return _compare_exemplars(edges, track, options, progress, parallel_map)
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
        seen=measure_seen(edges),
    )


def _compare_exemplars(
    edges: tuple[Edges, ...],
    track: Track,
    options: CompareOptions,
    progress: Progress,
    parallel_map: ParallelMap,
) -> PoseDistances:
    """The same by exemplars: linear in the length of the video, but for their own matrix."""
    coarse = replace(options, largest="reach", cell=EXEMPLAR_CELL * options.cell)

    def compare(
        known: Int[np.ndarray, "E"], parts: Sequence[Int[np.ndarray, "_"]]
    ) -> Iterator[Float32[np.ndarray, "2 _ _"]]:
        together = (np.concatenate([known, new]) for new in parts)
        inputs = (
            (tuple(edges[t] for t in frames), take_frames(track, frames), coarse, len(known))
            for frames in together
        )
        return _compare_halves(inputs, parallel_map)

    shown = np.array([[half_of(e, half).any() for half in HALVES] for e in edges])
    may_lead = np.asarray(shown.all(axis=1) if shown.all(axis=1).any() else shown.any(axis=1))
    found = find_exemplars(compare, may_lead, options.most, progress)
    kept, track_kept = tuple(edges[t] for t in found.frames), take_frames(track, found.frames)
    halves = parallel_map(compare_half, ((kept, track_kept, half, options, 0) for half in HALVES))
    upper, lower = progress(halves, "Comparing exemplars", len(HALVES))
    return PoseDistances(
        upper=upper,
        lower=lower,
        frames=found.frames,
        row=found.row,
        exemplar_distance=found.distance,
        consecutive_distance=_measure_steps(edges, track, options, progress, parallel_map),
        visibility_score=score_visibility(edges, track),
        seen=measure_seen(edges),
    )


def _measure_steps(
    edges: tuple[Edges, ...],
    track: Track,
    options: CompareOptions,
    progress: Progress,
    parallel_map: ParallelMap,
) -> Float32[np.ndarray, "2 S"]:
    """C between each frame and the next, upper and lower body."""
    windows = [
        slice(start, start + WINDOW_FRAMES + 1) for start in range(0, len(edges) - 1, WINDOW_FRAMES)
    ]
    inputs = ((edges[window], take_frames(track, window), options, 0) for window in windows)
    squares = progress(_compare_halves(inputs, parallel_map), "Comparing neighbours", len(windows))
    return np.concatenate([np.diagonal(both, 1, axis1=1, axis2=2) for both in squares], axis=1)


def _compare_halves(
    inputs: Iterable[tuple[tuple[Edges, ...], Track, CompareOptions, int]],
    parallel_map: ParallelMap,
) -> Iterator[Float32[np.ndarray, "2 N T"]]:
    """C between new frames and all (`measure_matrix`), upper and lower body side by side."""
    pieces = (
        (edges, track, half, options, n_known)
        for edges, track, options, n_known in inputs
        for half in HALVES
    )
    compared = parallel_map(compare_half, pieces)
    for upper in compared:
        yield np.stack([upper, next(compared)])


def compare_half(
    edges: tuple[Edges, ...], track: Track, half: HalfName, options: CompareOptions, n_known: int
) -> Float32[np.ndarray, "N T"]:
    """A piece of the work of `compare_frames`."""
    return measure_matrix(edges, track, half, options, n_known=n_known)


def score_visibility(edges: tuple[Edges, ...], track: Track) -> Float[np.ndarray, "T"]:
    """How well each frame could be annotated, 0-1: confidence of the track times sharpness.

    Motion blur dissolves contours: a frame with fewer elements than the median is less sharp.
    """
    count = np.array([len(e.points) for e in edges])
    return track.confidence * np.clip(count / max(1.0, np.median(count)), 0, 1)


def measure_seen(edges: tuple[Edges, ...]) -> Float[np.ndarray, "2 T"]:
    """Elements of each half of the body in each frame as a share of their median, at most 1."""
    count = np.array([[half_of(e, half).sum() for e in edges] for half in HALVES])
    usual = np.maximum(1.0, np.median(count, axis=1, keepdims=True))
    return np.minimum(count / usual, 1.0)


def measure_matrix(
    edges: Sequence[Edges],
    track: Track,
    half: HalfName,
    options: CompareOptions = CompareOptions(),
    progress: Progress = silent,
    n_known: int = 0,
) -> Float32[np.ndarray, "N T"]:
    """C of every two frames for one half of the body, player heights: 0 between a frame and itself.

    A frame without elements is `reach` away from every other. The first `n_known` frames are not
    compared with one another, and have no rows (not with `largest` 'observed', which is of all).
    """
    elements = gather_elements(edges, track, half)
    cells = group_elements(elements, options.cell, options.directions, options.reach)
    directed = _accumulate(elements, cells, options, n_known, progress)
    symmetric = _symmetric(directed, options.symmetry)
    new = np.arange(n_known, elements.n_frames)
    symmetric[new - n_known, new] = 0
    return symmetric


@dataclass(frozen=True, eq=False)
class _Directed:
    """Mean distances of the elements of one frame to another frame, between new frames and all."""

    forward: Float32[np.ndarray, "N T"]
    """From each new frame to every frame."""
    backward: Float32[np.ndarray, "K N"]
    """From each known frame to every new one."""


def _accumulate(
    elements: BinnedElements,
    cells: DescriptorBins,
    options: CompareOptions,
    n_known: int,
    progress: Progress,
) -> _Directed:
    """C as it is directed."""
    reach, n_new = options.reach, elements.n_frames - n_known
    members = csr_matrix(
        (np.ones(len(elements.frame), np.float32), (elements.frame, cells.of_element)),
        shape=(elements.n_frames, len(cells.center)),
    )
    known, new = members[:n_known], members[n_known:]
    forward = np.empty((n_new, elements.n_frames), dtype=np.float32)
    backward = np.empty((n_known, n_new), dtype=np.float32)
    matched = np.empty_like(forward) if options.largest == "observed" else None

    def measure(first: int) -> None:
        frames = range(first, min(first + FRAMES_PER_BLOCK, elements.n_frames))
        offered = cell_distances(elements, cells, frames, reach)
        forward[:, frames.start : frames.stop] = new @ offered
        if n_known and frames.stop > n_known:
            since = max(frames.start, n_known)
            backward[:, since - n_known : frames.stop - n_known] = (
                known @ offered[:, since - first :]
            )
        if matched is not None:
            near = (offered < np.float32(reach)).astype(np.float32)
            matched[:, frames.start : frames.stop] = new @ near

    blocks = range(0, elements.n_frames, FRAMES_PER_BLOCK)
    with ThreadPoolExecutor(core_count()) as pool:
        for _ in progress(pool.map(measure, blocks), "Comparing frames", len(blocks)):
            pass
    count = np.bincount(elements.frame, minlength=elements.n_frames).astype(np.float32)
    _take_means(forward, count[n_known:], count, reach)
    _take_means(backward, count[:n_known], count[n_known:], reach)
    if matched is not None:
        np.divide(matched, count[:, None], out=matched, where=count[:, None] > 0)
        forward = _with_observed_largest(forward, matched, reach)
    return _Directed(forward, backward)


def _take_means(
    total: Float32[np.ndarray, "n m"],
    count: Float32[np.ndarray, "n"],
    other: Float32[np.ndarray, "m"],
    reach: float,
) -> None:
    """Sums become means over a frame's elements; `reach` where it or the other has none."""
    np.divide(total, count[:, None], out=total, where=count[:, None] > 0)
    total[count == 0] = reach
    total[:, other == 0] = reach


def cell_distances(
    elements: BinnedElements, cells: DescriptorBins, frames: range, reach: float
) -> Float32[np.ndarray, "G B"]:
    """M for some frames: distance of each cell to each frame.

    Pairs of an element and a cell are many, so those of one frame at a time stay in the cache, and
    their numbers are made those that arrays are indexed by once, not at each use.
    """
    nearest = np.full((len(frames), len(cells.center)), reach * reach, dtype=np.float32)
    points = elements.points.view(np.complex64)[:, 0]
    starts = np.searchsorted(elements.frame, np.arange(frames.start, frames.stop + 1)).tolist()
    for row, span in enumerate(pairwise(starts)):
        part = slice(*span)
        cell = cells.of_element[part]
        count = cells.first[cell + 1] - cells.first[cell]
        target = cells.neighbor[ranges(cells.first[cell], count)].astype(np.intp)
        away = cells.center[target]
        away -= np.repeat(points[part], count)
        squared = np.square(away.real) + np.square(away.imag)
        np.minimum.at(nearest[row], target, squared)
    np.sqrt(nearest, out=nearest)
    return np.ascontiguousarray(np.minimum(nearest, np.float32(reach)).T)


def _with_observed_largest(
    mean: Float32[np.ndarray, "T T"], matched: Float32[np.ndarray, "T T"], reach: float
) -> Float32[np.ndarray, "T T"]:
    """Put the largest mean distance of matches (max B) in the place of `reach`."""
    summed = mean - (1 - matched) * np.float32(reach)
    other = (matched > 0) & ~np.eye(len(mean), dtype=bool)
    mean_matched = np.divide(summed, matched, out=np.zeros_like(mean), where=other)
    return summed + (1 - matched) * mean_matched.max()


def _symmetric(directed: _Directed, symmetry: str) -> Float32[np.ndarray, "N T"]:
    forward, known = directed.forward, len(directed.backward)
    other = np.concatenate([directed.backward.T, forward[:, known:].T], axis=1)
    return np.maximum(forward, other) if symmetry == "max" else (forward + other) / np.float32(2)
