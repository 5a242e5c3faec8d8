"""Reduce a long video to exemplars that stand for their neighbours in time.

Frames are compared with those at most `MAX_LAG` later: a band along the diagonal of the distance
matrix, whose cost grows with the length of the video alone. Time is then cut into segments
whose frames all lie within a threshold of one frame among them, the exemplar. The smallest
threshold that leaves no more than the wanted number of exemplars is found by bisection. While
a player waits one exemplar stands for a second; in a stroke nearly every frame is one.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from jaxtyping import Float32, Int

from keyrecon.progress import Progress, silent

MAX_LAG = 64
"""Longest distance in frames between a frame and its exemplar. It bounds the time of comparing, and
no exemplar needs more before a video has 2 x 64 frames for each of them: 512 000 for 4000."""
WINDOW_FRAMES = 448
"""Frames compared at a time, the next MAX_LAG on top."""


def measure_band(
    compare: Callable[[Sequence[slice]], Iterator[Float32[np.ndarray, "2 W W"]]],
    n_frames: int,
    progress: Progress = silent,
) -> Float32[np.ndarray, "2 T L"]:
    """Distance of each frame to those 1..MAX_LAG later, both halves; infinite beyond the end.

    `compare` measures all distances within each of some windows of frames.
    """
    band = np.full((2, n_frames, MAX_LAG), np.inf, dtype=np.float32)
    windows = [
        slice(start, min(n_frames, start + WINDOW_FRAMES + MAX_LAG))
        for start in range(0, n_frames, WINDOW_FRAMES)
    ]
    squares = progress(compare(windows), "Comparing neighbours", len(windows))
    for window, square in zip(windows, squares, strict=True):
        start = window.start
        for lag in range(1, min(MAX_LAG, window.stop - start - 1) + 1):
            diagonal = np.diagonal(square, lag, axis1=1, axis2=2)[:, :WINDOW_FRAMES]
            band[:, start : start + diagonal.shape[1], lag - 1] = diagonal
    return band


def distance_in_band(
    band: Float32[np.ndarray, "2 T L"], one: Int[np.ndarray, "T"], other: Int[np.ndarray, "T"]
) -> Float32[np.ndarray, "2 T"]:
    """Distance between frames that lie at most MAX_LAG apart."""
    early, lag = np.minimum(one, other), np.abs(one - other)
    return np.where(lag > 0, band[:, early, lag - 1], np.float32(0))


def choose_exemplars(
    band: Float32[np.ndarray, "T L"], max_exemplars: int
) -> tuple[Int[np.ndarray, "M"], Int[np.ndarray, "T"]]:
    """(frame of each exemplar, exemplar of each frame), at most about `max_exemplars`."""
    levels = np.unique(np.concatenate([[0], band[np.isfinite(band)]]))
    low, high = 0, len(levels) - 1
    while low < high:
        middle = (low + high) // 2
        if len(_segment(band, levels[middle])[0]) <= max_exemplars:
            high = middle
        else:
            low = middle + 1
    frames, stop = _segment(band, levels[high])
    return frames, np.repeat(np.arange(len(frames)), np.diff(stop, prepend=0))


def _segment(
    band: Float32[np.ndarray, "T L"], threshold: float
) -> tuple[Int[np.ndarray, "M"], Int[np.ndarray, "M"]]:
    """Exemplars, and the end of the segment of each.

    From the first free frame the exemplar is the last one that is near it all along, and the
    segment ends where frames leave the exemplar.
    """
    over = band > threshold
    near = np.where(over.any(axis=1), over.argmax(axis=1), band.shape[1])
    frames, stops, start = [], [], 0
    while start < len(band):
        frame = min(start + int(near[start]), len(band) - 1)
        start = min(frame + int(near[frame]), len(band) - 1) + 1
        frames.append(frame)
        stops.append(start)
    return np.array(frames), np.array(stops)
