"""Reduce a long video to exemplars that stand for all frames of a pose like theirs.

Strokes recur, so the poses of hours are far fewer than the frames. The frames are gone through in
order: one that no exemplar is near becomes one itself, and where there are too many, what counts as
near is widened until few enough of them remain (the doubling algorithm of Charikar, Chekuri, Feder
and Motwani, "Incremental clustering and dynamic information retrieval", STOC 1997, with the
smallest width that does in place of the double). Then every frame is given the exemplar nearest to
it, wherever in the video that is. Work grows with the length of the video times the number of
exemplars.

Half an hour of tennis (45 000 frames, `benchmarks/marks_needed.py`): with exemplars that stood for
their neighbours in time, .45 s each, nine frames in ten were within .041 player heights of their
keyframe (upper body; .045 lower), with these within .022 (.025), with as many marks or fewer.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Int

from keyrecon.progress import Progress, silent

WIDTH_PRECISION = 1e-4
"""What counts as near is found to this, player heights. A hundredth of a pixel of the player in the
crops; only longer videos than `CompareOptions.most` come to it."""

Compare = Callable[
    [Int[np.ndarray, "E"], Sequence[Int[np.ndarray, "N"]]],
    Iterator[Float32[np.ndarray, "2 N E+N"]],
]
"""Distances of the frames of each part, the second argument, to those of the first argument and to
one another; of the upper and the lower body."""


@dataclass(frozen=True, eq=False)
class Exemplars:
    """Frames that stand for others."""

    frames: Int[np.ndarray, "M"]
    """Ascending."""
    row: Int[np.ndarray, "T"]
    """Which of them stands for each frame."""
    distance: Float32[np.ndarray, "2 T"]
    """How far each frame is from it, upper and lower body."""


def find_exemplars(
    compare: Compare, may_lead: Bool[np.ndarray, "T"], most: int, progress: Progress = silent
) -> Exemplars:
    """At most `most` of the frames that `may_lead`, and which frames each stands for.

    A frame that may not lead, as nothing is seen of one half of the body, is given one like any
    other.
    """
    frames = _lead(compare, may_lead, most, progress)
    return _assign(compare, frames, len(may_lead), progress)


def _lead(
    compare: Compare, may_lead: Bool[np.ndarray, "T"], most: int, progress: Progress
) -> Int[np.ndarray, "M"]:
    """The exemplars, ascending."""
    chosen = np.zeros(0, dtype=np.int64)
    among = np.zeros((0, 0), dtype=np.float32)
    width = 0.0
    parts = _parts(np.flatnonzero(may_lead), most)
    for part in progress(parts, "Finding exemplars", len(parts)):
        apart = next(compare(chosen, [part])).max(axis=0)
        old, new = np.hsplit(apart, [len(chosen)])
        square = np.block([[among, old.T], [old, new]])
        leaders, width = _fewest_leaders(square, width, most)
        chosen, among = np.concatenate([chosen, part])[leaders], square[np.ix_(leaders, leaders)]
    return np.sort(chosen)


def _assign(
    compare: Compare, exemplars: Int[np.ndarray, "M"], n_frames: int, progress: Progress
) -> Exemplars:
    """Every frame's nearest exemplar."""
    row = np.empty(n_frames, dtype=np.int64)
    distance = np.empty((2, n_frames), dtype=np.float32)
    parts = _parts(np.arange(n_frames), len(exemplars))
    measured = progress(compare(exemplars, parts), "Assigning frames to exemplars", len(parts))
    for frames, both in zip(parts, measured, strict=True):
        own = both[:, :, : len(exemplars)]
        row[frames] = own.max(axis=0).argmin(axis=1)
        distance[:, frames] = own[:, np.arange(len(frames)), row[frames]]
    row[exemplars], distance[:, exemplars] = np.arange(len(exemplars)), 0
    return Exemplars(exemplars, row, distance)


def _parts(frames: Int[np.ndarray, "n"], size: int) -> list[Int[np.ndarray, "N"]]:
    """Frames a few at a time."""
    return np.split(frames, np.arange(size, len(frames), size))


def _fewest_leaders(
    square: Float32[np.ndarray, "n n"], width: float, most: int
) -> tuple[Int[np.ndarray, "M"], float]:
    """Frames that all others are near, at most `most`, and the `width` that this takes at least."""
    leaders = _leaders(square, width)
    low, high = width, float(square.max(initial=0))
    if len(leaders) <= most:
        return leaders, width
    leaders, width = _leaders(square, high), high
    while high - low > WIDTH_PRECISION:
        middle = (low + high) / 2
        fewer = _leaders(square, middle)
        if len(fewer) <= most:
            leaders, width, high = fewer, middle, middle
        else:
            low = middle
    return leaders, width


def _leaders(square: Float32[np.ndarray, "n n"], width: float) -> Int[np.ndarray, "M"]:
    """Frames that are near none of those before them."""
    served = np.zeros(len(square), dtype=bool)
    leaders = []
    for frame in range(len(square)):
        if not served[frame]:
            leaders.append(frame)
            served |= square[frame] <= width
    return np.array(leaders, dtype=np.int64)
