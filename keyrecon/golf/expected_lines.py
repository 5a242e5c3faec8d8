"""Lines of a picture near the one that is expected.

A line counts by how far its middle is brighter, or darker, than both of its sides, in the picture
as well as in its difference to the temporal median: a rope in the scene is missing in the second,
the ghost of a club that rested there in the first, and the edge of an arm has one side only.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float

PLACES = 32
"""Places at which a line is looked at."""
SHAFT = (0.2, 0.95)
"""Where on the club they lie, between its ends: beside the hands and the head."""
ASIDES = 21
"""Offsets that are tried."""
NEIGHBOURS = (7, 7)
"""Turns and offsets among which only the best line is kept."""
SHUTTER = 0.5
"""Share of the time between frames for which a camera's shutter is open."""
BLURS = (0.5, 1.0)
"""A blur seems narrower where it is pale, and where the club is slower than expected."""
Picture = Float[np.ndarray, "h w"]


@dataclass(frozen=True)
class LineOptions:
    """Which lines may be the expected one; lengths in player heights."""

    turn: float = 45.0
    """Degrees by which the club may be turned from where it is expected."""
    aside: float = 0.05
    """How far beside the expected hands its line may pass."""
    usual_turn: float = 10.0
    """Degrees by which it usually is turned."""
    usual_aside: float = 0.025
    """How far beside it usually passes."""
    far: float = 3.0
    """Usual departures beyond which it costs no more: the fit may be wrong altogether."""
    widths: tuple[float, ...] = (0.006, 0.012)
    """From the middle of the shaft to where the scene shows: less than half an arm's breadth. A
    blurred one is as broad as what it passes over while the shutter is open."""
    contrast: float = 12.0
    """Grey levels by which a sure shaft stands out."""
    gain: float = 15.0
    """What a club that stands out from end to end is worth, in squared standard deviations."""
    known: float = 3.0
    """What a line is worth besides for having been seen at first, without any expectation."""
    most: int = 6
    """Lines kept in a frame."""
    shortest: float = 0.1
    """A club that seems shorter than this points at the camera: its angle tells nothing."""


@dataclass(frozen=True, eq=False)
class Sight:
    """A frame in which lines are looked for."""

    pictures: tuple[Picture, Picture]
    """The frame, and its difference to the median."""
    height: float
    """Of the player, px."""
    swept: Float[np.ndarray, "2"]
    """How far hands and head are expected to move from frame to frame, heights."""


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines of a frame that may be the club."""

    ends: Float[np.ndarray, "n 2 2"]
    """Hands and head, heights."""
    departure: Float[np.ndarray, "n 2"]
    """Turn and offset from the expected club, in usual ones."""
    worth: Float[np.ndarray, "n"]
    """What each gains by standing out, less what it pays for departing from expectation."""


def find_lines(
    sight: Sight,
    first: Float[np.ndarray, "2 2"],
    expected: Float[np.ndarray, "2 2"],
    options: LineOptions,
) -> Lines:
    """The lines near the expected club that stand out most, and the one that was seen at first.

    Where nothing can be expected, NaN, the one that was seen at first has to stand out alone.
    """
    ends, expected = np.zeros((0, 2, 2)), expected / sight.height
    if np.linalg.norm(expected[1] - expected[0]) > options.shortest:
        ends = _best_lines(sight, expected, options)
    known = int(np.isfinite(first).all())
    if known:
        line = _sharpen(sight, lay_on(first / sight.height, expected), options)
        ends = np.concatenate([ends, line[None]])
    departure = measure_departure(expected, ends, options)
    worth = _weigh(departure, _contrast(sight, ends, options), options)
    if np.isfinite(expected).all():
        worth[len(ends) - known :] += options.known
    return Lines(ends, departure, worth)


def _best_lines(
    sight: Sight, expected: Float[np.ndarray, "2 2"], options: LineOptions
) -> Float[np.ndarray, "n 2 2"]:
    """Lines that are worth more than all their neighbours, moved to the sharpest one among them."""
    turns = np.arange(-options.turn, options.turn + 0.5)
    asides = np.linspace(-options.aside, options.aside, ASIDES)
    turn, aside = (grid.ravel() for grid in np.meshgrid(turns, asides, indexing="ij"))
    ends = _shift(expected, turn, aside)
    contrast = _contrast(sight, ends, options)
    worth = _weigh(measure_departure(expected, ends, options), contrast, options)
    worth, sharp = (v.reshape(len(turns), ASIDES) for v in (worth, contrast.mean(axis=1)))
    peaks = np.flatnonzero(worth >= cv2.dilate(worth, np.ones(NEIGHBOURS)))
    best = peaks[np.argsort(-worth.ravel()[peaks])][: options.most]
    return ends[[_sharpest(sharp, divmod(peak, ASIDES)) for peak in best.tolist()]]


def _sharpest(sharp: Float[np.ndarray, "a b"], peak: tuple[int, int]) -> int:
    """Index of the line of most contrast among the neighbours of one."""
    (i, j), (di, dj) = peak, (n // 2 for n in NEIGHBOURS)
    low = max(0, i - di), max(0, j - dj)
    part = sharp[low[0] : i + di + 1, low[1] : j + dj + 1]
    k, m = divmod(int(part.argmax()), part.shape[1])
    return (low[0] + k) * sharp.shape[1] + low[1] + m


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
    sight: Sight, line: Float[np.ndarray, "2 2"], options: LineOptions
) -> Float[np.ndarray, "2 2"]:
    """The line of most contrast among the neighbours of one: a shaft seen in part is askew."""
    turns = np.arange(-(NEIGHBOURS[0] // 2), NEIGHBOURS[0] // 2 + 1.0)
    asides = turns * 2 * options.aside / (ASIDES - 1)
    turn, aside = (grid.ravel() for grid in np.meshgrid(turns, asides, indexing="ij"))
    ends = _shift(line, turn, aside)
    return ends[int(_contrast(sight, ends, options).mean(axis=1).argmax())]


def _shift(
    expected: Float[np.ndarray, "2 2"], turn: Float[np.ndarray, "n"], aside: Float[np.ndarray, "n"]
) -> Float[np.ndarray, "n 2 2"]:
    """The expected club turned about its hands by degrees and shifted sideways."""
    way = expected[1] - expected[0]
    across = np.array([-way[1], way[0]])
    angle = np.radians(turn)[:, None]
    hands = expected[0] + aside[:, None] * across / np.linalg.norm(across)
    return np.stack([hands, hands + np.cos(angle) * way + np.sin(angle) * across], axis=1)


def measure_departure(
    expected: Float[np.ndarray, "2 2"],
    ends: Float[np.ndarray, "n 2 2"],
    options: LineOptions,
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
    aside = (theirs[:, 0] * off[:, 1] - theirs[:, 1] * off[:, 0]) / length
    return np.stack([np.degrees(turn) / options.usual_turn, aside / options.usual_aside], axis=1)


def _contrast(
    sight: Sight, ends: Float[np.ndarray, "n 2 2"], options: LineOptions
) -> Float[np.ndarray, "n p"]:
    """Grey levels by which places along lines stand out in both pictures."""
    share = np.linspace(*SHAFT, PLACES)
    points = ends[:, None, 0] + share[:, None] * (ends[:, None, 1] - ends[:, None, 0])
    way = ends[:, 1] - ends[:, 0]
    across = np.stack([-way[:, 1], way[:, 0]], axis=1)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    blur = SHUTTER / 2 * (sight.swept[0] + share * (sight.swept[1] - sight.swept[0]))
    widths = [np.full(PLACES, w) for w in options.widths]
    widths += [options.widths[0] + share * blur for share in BLURS]
    sides = [sight.height * width[:, None] * across[:, None] for width in widths]
    return np.minimum(*(_stand_out(p, sight.height * points, sides) for p in sight.pictures))


def _stand_out(
    picture: Picture, points: Float[np.ndarray, "n p 2"], sides: list[Float[np.ndarray, "n p 2"]]
) -> Float[np.ndarray, "n p"]:
    """Grey levels by which points differ from what is on both sides, at the best of distances."""
    middle = _read(picture, points)
    best = np.zeros_like(middle)
    for side in sides:
        one, other = middle - _read(picture, points - side), middle - _read(picture, points + side)
        alike = np.where(one * other > 0, np.minimum(np.abs(one), np.abs(other)), 0.0)
        best = np.maximum(best, alike)
    return best


def _read(picture: Picture, points: Float[np.ndarray, "n p 2"]) -> Float[np.ndarray, "n p"]:
    if not len(points):
        return np.zeros(points.shape[:2], np.float32)
    return cv2.remap(
        picture, points.astype(np.float32), None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )


def _weigh(
    departure: Float[np.ndarray, "n 2"], contrast: Float[np.ndarray, "n p"], options: LineOptions
) -> Float[np.ndarray, "n"]:
    """What lines gain by standing out, less what they pay for departing from expectation."""
    share = np.minimum(contrast / options.contrast, 1.0).mean(axis=1)
    off = np.minimum((departure**2).sum(axis=1), options.far**2)
    return options.gain * share - 0.5 * off
