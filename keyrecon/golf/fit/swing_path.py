"""The likeliest swings through a table of how badly each phase explains each frame.

A swing is a path through the table: the player stands at address, swings up, down and through, and
rests. Between its key postures the phase runs evenly, which leaves four numbers: when the top is,
and how long downswing, upswing and follow-through last. All their values within what golfers do are
tried: sums along the table's straight lines make that as exact as dynamic programming, and pace and
tempo bound it. Key postures that a person marked are passed where they were marked.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

Segment = Callable[[int, int], np.ndarray]
"""(part of the swing, its length in frames) -> cost where it begins at each frame."""
Of = TypeVar("Of")
UNMARKED = np.full(4, np.nan)
"""No key posture was marked."""
SLOWEST_CAMERA = 24.0
"""No camera takes fewer pictures per second, however slowly they are shown: a downswing has at
least 3 of them."""
DOWNSWING_SECONDS = (0.15, 0.5)
"""From the top to the hit. Tour players take .23-.28 s, amateurs .25-.4 (Cochran & Stobbs, The
Search for the Perfect Swing, 1968; Novosel & Garrity, Tour Tempo, 2004)."""
TEMPO = (1.5, 6.0)
"""Upswing to downswing: 3 to 1 for tour players, 2 to 4 for most others (Novosel & Garrity)."""
RATIOS = 1.12
"""Step between durations that are tried."""
SAME = 0.5
"""Hypotheses are the same where top and hit differ by less, downswings."""


@dataclass(frozen=True)
class SearchLimits:
    """Which swings are tried; times in seconds of the world."""

    downswing: tuple[float, float] = DOWNSWING_SECONDS
    """Shortest and longest from the top to the hit."""
    tempo: tuple[float, float] = TEMPO
    """Upswing to downswing."""
    follow: tuple[float, float] = (1.0, 5.0)
    """From the hit to the finish, in downswings."""
    fastest_camera: float = 1000.0
    """Frames per second up to which slow motion that nobody told of is tried; 0 for none."""
    most: int = 4
    """Hypotheses."""


@dataclass(frozen=True, eq=False)
class SwingPath:
    """A way through the table of costs."""

    keys: Float[np.ndarray, "4"]
    cost: float


def best_paths(
    costs: Float[np.ndarray, "T P"],
    key_times: Float[np.ndarray, "4"],
    phases: Float[np.ndarray, "P"],
    fps: float,
    limits: SearchLimits = SearchLimits(),
    marked: Float[np.ndarray, "4"] = UNMARKED,
) -> list[SwingPath]:
    """The likeliest swings through a table of costs, of different tops and hits, best first.

    Before the start the player is at address, after the finish at the finish; what a film ends
    before is not counted. A path passes `marked` key postures, NaN where none is, as near as the
    steps of durations allow.
    """
    frames = len(costs)
    rows = np.interp(key_times, phases, np.arange(len(phases)))
    address, finish = (np.append(0.0, np.cumsum(costs[:, k])) for k in (0, -1))
    shortest, longest = limits.downswing
    fewest = shortest * max(fps, SLOWEST_CAMERA)
    downs = _durations(fewest, longest * max(fps, limits.fastest_camera), frames / 2)
    lengths: dict[tuple[int, int], np.ndarray] = {}

    def segment(part: int, length: int) -> Float[np.ndarray, "T"]:
        """Cost of a part of the swing that begins at each frame; frames beyond the film free."""
        if (part, length) not in lengths:
            lengths[part, length] = _line_sums(costs, rows[part], rows[part + 1], length)
        return lengths[part, length]

    paths: list[SwingPath] = []
    for down in downs:
        ups = _durations(limits.tempo[0] * down, limits.tempo[1] * down, frames)
        throughs = _durations(limits.follow[0] * down, limits.follow[1] * down, 10 * frames)
        tops = np.arange(1, frames - down)
        before, up_of = _best_before(address, segment, ups, tops, marked[0])
        after, through_of = _best_after(finish, segment, throughs, tops + down, marked[3])
        total = (before + segment(1, down)[tops] + after) / frames
        held = _is_near(tops, marked[1], 0) & _is_near(
            tops + down, marked[2], 0 if np.isnan(marked[1]) else down
        )
        total = np.where(held, total, np.inf)
        for top in _local_minima(total, max(1, down // 2)):
            hit = tops[top] + down
            keys = np.array([tops[top] - up_of[top], tops[top], hit, hit + through_of[top]], float)
            paths.append(SwingPath(keys, float(total[top])))
    return [path for path, _ in distinct_paths([(p, None) for p in paths], limits.most)]


def _durations(shortest: float, longest: float, most: float | int) -> list[int]:
    """Numbers of frames from a shortest to a longest duration."""
    low, high = max(1.0, shortest), min(longest, most)
    if high < low:
        return []
    number = max(2, int(np.ceil(np.log(high / low) / np.log(RATIOS))) + 1)
    return np.unique(np.rint(np.geomspace(low, high, number)).astype(int)).tolist()


def _line_sums(
    costs: Float[np.ndarray, "T P"], low: float, high: float, length: int
) -> Float[np.ndarray, "T"]:
    """Sums along a straight line from one row to another that begins at each frame."""
    frames = len(costs)
    row = np.rint(low + (high - low) * np.arange(length) / length).astype(int)
    padded = np.concatenate([costs, np.zeros((length, costs.shape[1]))])
    total = np.zeros(frames)
    for step in range(length):
        total += padded[step : step + frames, row[step]]
    return total


def _is_near(frames: Int[np.ndarray, "n"], marked: float, length: int) -> Bool[np.ndarray, "n"]:
    """Whether frames are that of a mark, by the step between lengths; all are where none is."""
    room = 0.5 + (RATIOS - 1) * length
    return np.isnan(marked) | (np.abs(frames - marked) <= room)


def _best_before(
    address: Float[np.ndarray, "n"], segment: Segment, ups: list[int],
    tops: Int[np.ndarray, "m"], marked: float = np.nan,
) -> tuple[Float[np.ndarray, "m"], Int[np.ndarray, "m"]]:  # fmt: skip
    """Least cost of all frames before each top, and how long the upswing is then."""
    total = np.full(len(tops), np.inf)
    chosen = np.zeros(len(tops), int)
    for up in ups:
        starts = tops - up
        inside = (starts >= 0) & _is_near(starts, marked, up)
        cost = np.where(inside, address[np.maximum(starts, 0)], np.inf)
        cost = cost + segment(0, up)[np.maximum(starts, 0)]
        better = cost < total
        total, chosen = np.where(better, cost, total), np.where(better, up, chosen)
    return total, chosen


def _best_after(
    finish: Float[np.ndarray, "n"], segment: Segment, throughs: list[int],
    hits: Int[np.ndarray, "m"], marked: float = np.nan,
) -> tuple[Float[np.ndarray, "m"], Int[np.ndarray, "m"]]:  # fmt: skip
    """Least cost of all frames from each hit on, and how long the follow-through is then."""
    total = np.full(len(hits), np.inf)
    chosen = np.zeros(len(hits), int)
    last = len(finish) - 1
    for through in throughs:
        ends = np.minimum(hits + through, last)
        cost = segment(2, through)[np.minimum(hits, last - 1)] + finish[-1] - finish[ends]
        better = (cost < total) & _is_near(hits + through, marked, through)
        total, chosen = np.where(better, cost, total), np.where(better, through, chosen)
    return total, chosen


def _local_minima(total: Float[np.ndarray, "n"], reach: int) -> Int[np.ndarray, "m"]:
    """Places of values that none within reach is below."""
    if not np.isfinite(total).any():
        return np.zeros(0, int)
    padded = np.pad(np.where(np.isfinite(total), total, np.inf), reach, constant_values=np.inf)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    return np.flatnonzero(np.isfinite(total) & (total <= windows.min(axis=1)))


def distinct_paths(candidates: list[tuple[SwingPath, Of]], most: int) -> list[tuple[SwingPath, Of]]:
    """The best ones of which no two have about the same top and hit."""
    kept: list[tuple[SwingPath, Of]] = []
    for path, more in sorted(candidates, key=lambda f: f[0].cost):
        down = path.keys[2] - path.keys[1]
        if all(np.abs(path.keys[1:3] - p.keys[1:3]).max() > SAME * down for p, _ in kept):
            kept.append((path, more))
        if len(kept) == most:
            break
    return kept
