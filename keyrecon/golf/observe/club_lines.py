"""Lines of a picture near the club that is expected there, and what each is worth as the club.

A line counts by how far its middle is brighter, or darker, than both of its sides, in the picture
as well as in its difference to the temporal median: a rope in the scene is missing in the second,
the after-image of a club that rested there in the first, and the edge of an arm has one side only.
Against that stands how far it is turned from the expected club and how far beside it passes.

Constants were chosen on rendered swings; see benchmarks/golf.py.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from jaxtyping import Float

from keyrecon.numerics.geometry import unit_vectors
from keyrecon.numerics.picture_points import sample_picture
from keyrecon.ranges import within

SAMPLES_ALONG = 32
"""Places at which a line is sampled."""
SHAFT_PART = (0.2, 0.95)
"""Where on the club they lie, between its ends: beside the hands and the head."""
N_OFFSETS = 21
"""Offsets that are tried."""
PEAK_TURNS, PEAK_OFFSETS = 7, 7
"""Neighbouring turns and offsets among which only the best line is kept."""
SHUTTER = 0.5
"""Share of the time between frames for which a camera's shutter is open: half, as in cinema."""
BLUR_SHARES = (0.5, 1.0)
"""A blur seems narrower where it is pale, and where the club is slower than expected."""
TEXTURE = 3.0
"""By how many times what the lines that are tried stand out by on the average, a sure shaft does:
leaves and rails stand out too. Of 134 clubs marked by eye in five real swings 94 % were detected
within 5 degrees, without it 92.5 %."""
Picture = Float[np.ndarray, "h w"]


@dataclass(frozen=True)
class LineOptions:
    """Which lines may be the expected one; lengths in player heights."""

    turn: Annotated[float, within(1, 180)] = 45.0
    """Degrees by which the club may be turned from where it is expected."""
    offset: Annotated[float, within(0.003, 1)] = 0.05
    """How far beside the expected hands its line may pass."""
    usual_turn: Annotated[float, within(0.5, 180)] = 10.0
    """Degrees by which it usually is turned."""
    usual_offset: Annotated[float, within(0.001, 0.5)] = 0.025
    """How far beside it usually passes."""
    far: Annotated[float, within(0.1, 60)] = 3.0
    """Usual departures beyond which it costs no more: the fit may be wrong altogether."""
    widths: tuple[Annotated[float, within(0.001, 0.1)], ...] = (0.006, 0.012)
    """From the middle of the shaft to where the scene shows: less than half an arm's breadth. A
    blurred one is as broad as what it passes over while the shutter is open."""
    contrast: Annotated[float, within(1, 255)] = 12.0
    """Grey levels by which a sure shaft stands out."""
    gain: Annotated[float, within(0.1, 1000)] = 15.0
    """What a club that stands out from end to end is worth, in squared standard deviations."""
    detected: Annotated[float, within(0, 100)] = 3.0
    """What a line is worth besides for having been detected at first, without any expectation."""
    most: Annotated[int, within(1, 200)] = 6
    """Lines kept in a frame."""
    shortest: Annotated[float, within(0.005, 2)] = 0.1
    """A club that seems shorter than this points at the camera: its angle tells nothing."""


@dataclass(frozen=True, eq=False)
class SearchedFrame:
    """A frame in which lines are searched for."""

    layers: tuple[Picture, ...]
    """The picture, and its difference to the temporal median unless the club rests in that."""
    height: float
    """Of the player, px."""
    swept: Float[np.ndarray, "2"]
    """How far hands and head are expected to move from frame to frame, heights."""
    usual: Float[np.ndarray, "2"]
    """How far a club is usually turned from where it is expected, degrees, and how far beside it
    passes, heights."""


@dataclass(frozen=True, eq=False)
class ClubLines:
    """Lines of a frame that may be the club."""

    ends: Float[np.ndarray, "n 2 2"]
    """Hands and head, heights."""
    departure: Float[np.ndarray, "n 2"]
    """Turn and offset from the expected club, in usual ones."""
    worth: Float[np.ndarray, "n"]
    """What each gains by standing out, less what it pays for departing from expectation."""


def find_club_lines(
    searched: SearchedFrame,
    first: Float[np.ndarray, "2 2"],
    expected: Float[np.ndarray, "2 2"],
    options: LineOptions,
) -> ClubLines:
    """The lines near the expected club that stand out most, and the one detected at first.

    Where nothing can be expected, NaN, the one detected at first has to stand out alone.
    """
    ends, expected, sure = np.zeros((0, 2, 2)), expected / searched.height, options.contrast
    if np.linalg.norm(expected[1] - expected[0]) > options.shortest:
        tried = _try_lines(searched, expected, options)
        sure = max(sure, TEXTURE * float(tried.contrast.mean()))
        departure = measure_departure(expected, tried.ends, searched.usual)
        ends = _best_lines(tried, _weigh(departure, tried.contrast, sure, options), options.most)
    detected = int(np.isfinite(first).all())
    if detected:
        line = _sharpen(searched, lay_on(first / searched.height, expected), options)
        ends = np.concatenate([ends, line[None]])
    departure = measure_departure(expected, ends, searched.usual)
    worth = _weigh(departure, _contrast(searched, ends, options), sure, options)
    if np.isfinite(expected).all():
        worth[len(ends) - detected :] += options.detected
    return ClubLines(ends, departure, worth)


@dataclass(frozen=True, eq=False)
class _TriedLines:
    """Lines at all turns and offsets."""

    ends: Float[np.ndarray, "n 2 2"]
    contrast: Float[np.ndarray, "n p"]


def _try_lines(
    searched: SearchedFrame, expected: Float[np.ndarray, "2 2"], options: LineOptions
) -> _TriedLines:
    """Lines around the expected one: a row for every turn, a column for every offset."""
    turns = np.arange(-options.turn, options.turn + 0.5)
    offsets = np.linspace(-options.offset, options.offset, N_OFFSETS)
    turn, offset = (grid.ravel() for grid in np.meshgrid(turns, offsets, indexing="ij"))
    ends = _shift(expected, turn, offset)
    return _TriedLines(ends, _contrast(searched, ends, options))


def _best_lines(
    tried: _TriedLines, worth: Float[np.ndarray, "n"], most: int
) -> Float[np.ndarray, "m 2 2"]:
    """Lines that are worth more than all their neighbours, moved to the sharpest one among them."""
    worth, sharp = (v.reshape(-1, N_OFFSETS) for v in (worth, tried.contrast.mean(axis=1)))
    peaks = np.flatnonzero(worth >= cv2.dilate(worth, np.ones((PEAK_TURNS, PEAK_OFFSETS))))
    best = peaks[np.argsort(-worth.ravel()[peaks])][:most]
    return tried.ends[[_sharpest(sharp, *divmod(peak, N_OFFSETS)) for peak in best.tolist()]]


def _sharpest(sharp: Float[np.ndarray, "a b"], turn: int, offset: int) -> int:
    """Index of the line of most contrast among the neighbours of one."""
    first, left = max(0, turn - PEAK_TURNS // 2), max(0, offset - PEAK_OFFSETS // 2)
    part = sharp[first : turn + PEAK_TURNS // 2 + 1, left : offset + PEAK_OFFSETS // 2 + 1]
    k, m = divmod(int(part.argmax()), part.shape[1])
    return (first + k) * sharp.shape[1] + left + m


def lay_on(
    line: Float[np.ndarray, "2 2"], club: Float[np.ndarray, "2 2"]
) -> Float[np.ndarray, "2 2"]:
    """A club moved on to a line, hands first; the line where there is no club."""
    if np.isnan(club).any():
        return line
    unit = (line[1] - line[0]) / max(float(np.linalg.norm(line[1] - line[0])), 1e-9)
    hands = line[0] + ((club[0] - line[0]) @ unit) * unit
    return np.stack([hands, hands + np.linalg.norm(club[1] - club[0]) * unit])


def _sharpen(
    searched: SearchedFrame, line: Float[np.ndarray, "2 2"], options: LineOptions
) -> Float[np.ndarray, "2 2"]:
    """The line of most contrast among the neighbours of one: a shaft detected in part is askew."""
    turns = np.arange(-(PEAK_TURNS // 2), PEAK_TURNS // 2 + 1.0)
    offsets = turns * 2 * options.offset / (N_OFFSETS - 1)
    turn, offset = (grid.ravel() for grid in np.meshgrid(turns, offsets, indexing="ij"))
    ends = _shift(line, turn, offset)
    return ends[int(_contrast(searched, ends, options).mean(axis=1).argmax())]


def _shift(
    expected: Float[np.ndarray, "2 2"], turn: Float[np.ndarray, "n"], offset: Float[np.ndarray, "n"]
) -> Float[np.ndarray, "n 2 2"]:
    """The expected club turned about its hands by degrees and shifted sideways."""
    way = expected[1] - expected[0]
    across = np.array([-way[1], way[0]])
    angle = np.radians(turn)[:, None]
    hands = expected[0] + offset[:, None] * across / np.linalg.norm(across)
    return np.stack([hands, hands + np.cos(angle) * way + np.sin(angle) * across], axis=1)


def measure_departure(
    expected: Float[np.ndarray, "2 2"],
    ends: Float[np.ndarray, "n 2 2"],
    usual: Float[np.ndarray, "2"],
) -> Float[np.ndarray, "n 2"]:
    """Turn of lines from the expected one, and how far aside of its hands they pass, in usual ones.

    None where nothing is expected.
    """
    if np.isnan(expected).any():
        return np.zeros((len(ends), 2))
    way, theirs = expected[1] - expected[0], ends[:, 1] - ends[:, 0]
    turn = np.arctan2(way[0] * theirs[:, 1] - way[1] * theirs[:, 0], theirs @ way)
    off = ends[:, 0] - expected[0]
    length = np.maximum(np.linalg.norm(theirs, axis=1), 1e-9)
    offset = (theirs[:, 0] * off[:, 1] - theirs[:, 1] * off[:, 0]) / length
    return np.stack([np.degrees(turn), offset], axis=1) / usual


def _contrast(
    searched: SearchedFrame, ends: Float[np.ndarray, "n 2 2"], options: LineOptions
) -> Float[np.ndarray, "n p"]:
    """Grey levels by which places along lines stand out in both pictures."""
    share = np.linspace(*SHAFT_PART, SAMPLES_ALONG)
    points = ends[:, None, 0] + share[:, None] * (ends[:, None, 1] - ends[:, None, 0])
    way = ends[:, 1] - ends[:, 0]
    across = unit_vectors(np.stack([-way[:, 1], way[:, 0]], axis=1), 1e-9)
    blur = SHUTTER / 2 * (searched.swept[0] + share * (searched.swept[1] - searched.swept[0]))
    widths = [np.full(1, w) for w in options.widths]
    widths += [options.widths[0] + share * blur for share in BLUR_SHARES]
    sides = [searched.height * width[:, None] * across[:, None] for width in widths]
    return _stand_out(searched.layers, searched.height * points, sides)


def _stand_out(
    layers: Sequence[Picture],
    points: Float[np.ndarray, "n p 2"],
    sides: list[Float[np.ndarray, "n #p 2"]],
) -> Float[np.ndarray, "n p"]:
    """Grey levels by which points differ in all layers from what is on both sides, at the best of
    distances."""
    middle = [_read(layer, points) for layer in layers]
    best = [np.zeros_like(of_layer) for of_layer in middle]
    for side in sides:
        left, right = points - side, points + side
        for layer, here, most in zip(layers, middle, best, strict=True):
            one, other = here - _read(layer, left), here - _read(layer, right)
            low, high = np.minimum(one, other), np.maximum(one, other, out=one)
            # The smaller one where both are of one sign, else below 0.
            np.maximum(most, np.maximum(low, np.negative(high, out=high), out=low), out=most)
    least: Float[np.ndarray, "n p"] = np.minimum(best[0], best[-1])
    return least


def _read(picture: Picture, points: Float[np.ndarray, "n p 2"]) -> Float[np.ndarray, "n p"]:
    if not len(points):
        return np.zeros(points.shape[:2], np.float32)
    return sample_picture(picture, points, cv2.BORDER_REPLICATE)


def _weigh(
    departure: Float[np.ndarray, "n 2"],
    contrast: Float[np.ndarray, "n p"],
    sure: float,
    options: LineOptions,
) -> Float[np.ndarray, "n"]:
    """What lines gain by standing out, less what they pay for departing from expectation."""
    share = np.minimum(contrast / sure, 1.0).mean(axis=1)
    off = np.minimum((departure**2).sum(axis=1), options.far**2)
    return options.gain * share - 0.5 * off
