"""The club in every frame: the most consistent of many hypotheses, then a smooth motion.

First the cheapest path through the hypotheses of all frames is found by dynamic programming: it
gains what was detected of the shafts it takes, and pays for the movement of hands and club head and
for frames it passes over. Then a local model of the motion, hands and head each a quadratic in time
over a window of frames, is fitted robustly to the path (the 2D motion model of Section 4.2 of the
CVPR 2005 paper, after Lepetit, Shahrokni and Fua, CVPR 2003): what does not fit is left out, and
frames without a shaft, those blurred at impact, get their club from the frames around.

Constants were chosen on rendered swings; see benchmarks/golf.py.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.errors import KeyreconError
from keyrecon.golf.observe.shaft_hypotheses import ShaftHypotheses
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.numerics.viterbi import find_cheapest_path, longest_gap
from keyrecon.ranges import within

NOWHERE = np.full((2, 2), np.nan)
FEWEST_SHAFTS = 5
"""Shafts that a local motion is fitted to, at least."""
REWEIGHTINGS = 8
"""Of a window."""
ALONG_WEIGHT = 0.04
"""Weight of an end along the shaft against across, where it may not be the true end."""

USUAL_TURN, USUAL_OFFSET = 40.0, 0.15
"""Degrees by which a club is usually turned from where a hypothesis about the swing has it, and
player heights that its hands are off: wrists are cocked early or late."""
MOST_SURPRISE, FINISH_SURPRISE = 5.0, 0.5
"""Greatest cost of a shaft elsewhere: half a club that was detected well. From a downswing after
the hit on less than any shaft is worth: behind his back a golfer holds the club level or lets it
hang, 100 degrees apart. On a real swing whose shaft lies level behind the head, clubs within 15
degrees rose from .73 to 1."""

LEAST_SHAFT, NEVER = 0.12, 1e6
"""A shaft detected over less is not taken (player heights), and what taking it costs: such crumbs
lie anywhere. Of 122 clubs marked by eye in five real swings the first detection had 108 right and 4
wrong with crumbs of .05 and more, 105 and none of .12, 101 and none of .15; those that were lost
lie between their neighbours, and the guided detection finds them."""


@dataclass(frozen=True)
class ClubOptions:
    """How a club moves; lengths in player heights, times in seconds."""

    gain: Annotated[float, within(0.6, 200)] = 12.0
    """What one height of shaft is worth."""
    hands: Annotated[float, within(0.1, 60)] = 3.0
    """Usual speed of the hands, heights per second."""
    head: Annotated[float, within(0.6, 200)] = 12.0
    """Usual speed of the club head, heights per second."""
    jump: Annotated[float, within(0.2, 80)] = 4.0
    """Greatest cost of a movement from one frame to the next."""
    miss: Annotated[float, within(0.03, 10)] = 0.5
    """Cost of a frame without a shaft."""
    gap: Annotated[float, within(0.06, 20)] = 1.2
    """Longest time that is bridged, unless nothing is seen for longer: at the top a club may point
    at the camera for long."""
    window: Annotated[float, within(0.004, 1)] = 0.07
    """Time on either side that the local motion is fitted over."""
    off: Annotated[float, within(0.002, 0.7)] = 0.035
    """Distance from the local motion at which a shaft counts for a quarter, where it rests."""
    off_moving: Annotated[float, within(0.01, 5)] = 0.2
    """The same for a moving shaft, as a share of its movement from frame to frame: a quadratic
    fits a fast club less well."""
    min_confidence: Annotated[float, within(0, 1)] = 0.08
    """A shaft that counts for less was something else."""


@dataclass(frozen=True, eq=False)
class Club:
    """Where the club is."""

    ends: Float[np.ndarray, "T 2 2"]
    """Where the hands hold it, and its head, px; NaN before and after all that was detected."""
    detected: Bool[np.ndarray, "T"]
    """False where the club comes from the frames around."""
    tip: Bool[np.ndarray, "T"]
    """Whether the hand end is where the hands are; else they may be farther on in its line."""


@dataclass(frozen=True, eq=False)
class ExpectedSwing:
    """What a hypothesis about the swing expects."""

    club: Float[np.ndarray, "T 2 2"]
    """px"""
    keys: Float[np.ndarray, "4"]
    """Frames of start, top, hit and finish."""


def track_club(
    shafts: Sequence[ShaftHypotheses],
    height: float,
    fps: float,
    options: ClubOptions = ClubOptions(),
    expected: ExpectedSwing | None = None,
) -> Club:
    """The club of every frame; `height` of the player in px, `fps` of the world.

    `expected` is what a hypothesis about the swing has. Raises KeyreconError where hardly any
    shaft was detected.
    """
    path = choose_shafts(shafts, height, fps, options, expected)
    pairs = list(zip(shafts, path.tolist(), strict=True))
    taken = np.array([s.ends[k] if k >= 0 else NOWHERE for s, k in pairs])
    tip = np.array([k >= 0 and bool(s.tip[k]) for s, k in pairs])
    local = _local_motion(taken, tip, height, fps, options)
    detected = (path >= 0) & (local.confidence > options.min_confidence)
    if detected.sum() < FEWEST_SHAFTS:
        raise KeyreconError(
            f"A club was seen in only {detected.sum()} of {len(path)} frames; the video must show "
            "a whole swing, sharp enough to see the shaft."
        )
    ends = np.where(detected[:, None, None], _lengthen(taken, local.ends), local.ends)
    return Club(ends, detected, tip & detected)


@dataclass(frozen=True, eq=False)
class _LocalMotion:
    """Hands and head by a quadratic in time around every frame."""

    ends: Float[np.ndarray, "T 2 2"]
    confidence: Float[np.ndarray, "T"]
    """Weight of the shaft taken in each frame, 0-1."""


def _local_motion(
    taken: Float[np.ndarray, "T 2 2"],
    tip: Bool[np.ndarray, "T"],
    height: float,
    fps: float,
    options: ClubOptions,
) -> _LocalMotion:
    """A robust fit to the shafts taken.

    A head end is only known across the shaft: how far the shaft was detected along its line depends
    on the light.
    """
    frames = np.flatnonzero(np.isfinite(taken[:, 0, 0]))
    model, confidence = np.full_like(taken, np.nan), np.zeros(len(taken))
    if len(frames) < FEWEST_SHAFTS:
        return _LocalMotion(model, confidence)
    for t in range(frames[0], frames[-1] + 1):
        near = _neighbours(frames, t, max(FEWEST_SHAFTS, round(2 * options.window * fps) + 1))
        time = (near - t) / max(1, np.abs(near - t).max())
        steps = np.abs(np.diff(taken[near], axis=0)).sum(axis=2) / np.diff(near)[:, None]
        off = options.off * height + options.off_moving * float(np.median(steps.max(axis=1)))
        model[t], weight = _fit_window(taken[near], tip[near], time, off)
        if t in near:
            confidence[t] = weight[np.searchsorted(near, t)]
    return _LocalMotion(model, confidence)


def _neighbours(frames: Int[np.ndarray, "n"], t: int, count: int) -> Int[np.ndarray, "m"]:
    """The frames nearest to t among those with a shaft, in order."""
    return np.sort(frames[np.argsort(np.abs(frames - t), kind="stable")[:count]])


def _fit_window(
    ends: Float[np.ndarray, "n 2 2"],
    tip: Bool[np.ndarray, "n"],
    time: Float[np.ndarray, "n"],
    off: float,
) -> tuple[Float[np.ndarray, "2 2"], Float[np.ndarray, "n"]]:
    """Ends at time 0 and the weight of each shaft, by iteratively reweighted least squares."""
    basis = np.stack([np.ones_like(time), time, time**2], axis=1)
    unit = unit_vectors(ends[:, 1] - ends[:, 0], 1e-9)
    across = np.eye(2) - unit[:, :, None] * unit[:, None, :]
    along = np.stack([np.where(tip, 1.0, ALONG_WEIGHT), np.full(len(tip), ALONG_WEIGHT)], axis=1)
    metric = across[:, None] + along[..., None, None] * (np.eye(2) - across)[:, None]
    nearness = 1 / (1 + (2 * time) ** 2)
    weight = np.ones(len(time))
    for _ in range(REWEIGHTINGS):
        metrics = metric * (nearness * weight)[:, None, None, None]
        coefficients = np.stack(
            [_weighted_quadratic(basis, ends[:, e], metrics[:, e]) for e in range(2)]
        )
        residual = ends - np.einsum("nk,ekx->nex", basis, coefficients)
        square = np.einsum("nex,nexy,ney->n", residual, metric, residual) / off**2
        weight = 1 / (1 + square) ** 2
    return coefficients[:, 0], weight


def _weighted_quadratic(
    basis: Float[np.ndarray, "n 3"],
    points: Float[np.ndarray, "n 2"],
    metric: Float[np.ndarray, "n 2 2"],
) -> Float[np.ndarray, "3 2"]:
    """Coefficients of the quadratic nearest to points, each with a metric of its own."""
    left = np.einsum("ni,nj,nxy->ixjy", basis, basis, metric).reshape(6, 6)
    right = np.einsum("ni,nxy,ny->ix", basis, metric, points).ravel()
    damping = 1e-6 * np.trace(left) * np.eye(6)
    return np.linalg.solve(left + damping, right).reshape(3, 2)


def _lengthen(
    taken: Float[np.ndarray, "T 2 2"], model: Float[np.ndarray, "T 2 2"]
) -> Float[np.ndarray, "T 2 2"]:
    """Shafts as they were detected, reaching as far as the local motion if that is farther."""
    along = taken[:, 1] - taken[:, 0]
    length = np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    unit = along / length
    reach = ((model[:, 1] - taken[:, 0]) * unit).sum(axis=1, keepdims=True)
    return np.stack([taken[:, 0], taken[:, 0] + unit * np.maximum(length, reach)], axis=1)


def choose_shafts(
    shafts: Sequence[ShaftHypotheses],
    height: float,
    fps: float,
    options: ClubOptions = ClubOptions(),
    expected: ExpectedSwing | None = None,
) -> Int[np.ndarray, "T"]:
    """Hypothesis taken in every frame, -1 where none."""

    def moving(before: int, t: int) -> Float[np.ndarray, "l m"]:
        return _movement(shafts[before], shafts[t], height, (t - before) / fps, options)

    costs = [
        np.where(now.weight < LEAST_SHAFT, NEVER, -options.gain * now.weight) for now in shafts
    ]
    if expected is not None:
        finish = expected.keys[2] + (expected.keys[2] - expected.keys[1])
        costs = [
            cost + np.minimum(
                _surprise(now, where, height), FINISH_SURPRISE if t > finish else MOST_SURPRISE
            )
            for t, (cost, now, where) in enumerate(zip(costs, shafts, expected.club, strict=True))
        ]  # fmt: skip
    gap = max(round(options.gap * fps), longest_gap(costs))
    return find_cheapest_path(costs, moving, gap, options.miss)


def _surprise(
    shafts: ShaftHypotheses,
    expected: Float[np.ndarray, "2 2"],
    height: float,
) -> Float[np.ndarray, "n"]:
    """What shafts pay for lying elsewhere than a hypothesis about the swing has the club."""
    way, observed = expected[1] - expected[0], shafts.ends[:, 1] - shafts.ends[:, 0]
    cross = way[0] * observed[:, 1] - way[1] * observed[:, 0]
    turn = np.arctan2(cross, observed @ way) / np.radians(USUAL_TURN)
    turn = turn * min(1.0, 4 * float(np.linalg.norm(way)) / height)
    off = np.linalg.norm(shafts.ends[:, 0] - expected[0], axis=1) / (USUAL_OFFSET * height)
    surprise: Float[np.ndarray, "n"] = 0.5 * (turn**2 + off**2)
    return surprise


def _movement(
    before: ShaftHypotheses,
    after: ShaftHypotheses,
    height: float,
    seconds: float,
    options: ClubOptions,
) -> Float[np.ndarray, "l m"]:
    moved = np.linalg.norm(before.ends[:, None] - after.ends[None], axis=3) / height
    usual = np.array([options.hands, options.head]) * seconds
    return np.minimum(0.5 * ((moved / usual) ** 2).sum(axis=2), options.jump)
