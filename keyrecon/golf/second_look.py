"""The club looked for once more, where the fitted swing expects it.

Nothing but the club itself can tell at first where it is, so what lies on the player is left out
then: stripes, folds and gaps between arms look alike. Once a swing has been fitted, the global
model that Gehrig, Lepetit and Fua (BMVC 2003) make of polynomials, the lines near the expected one
and the one seen at first are all that need be compared. A line of the picture counts by how far its middle is
brighter, or darker, than both of its sides, in the picture as well as in its difference to the
temporal median: a rope in the scene is missing in the second, the ghost of a club that rested there
in the first, and the edge of an arm has one side only. The cheapest path through the best lines of
all frames departs from the expectation as slowly as the fit is wrong.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

from keyrecon.golf.records import FittedSwing, Observations
from keyrecon.paths import find_cheapest_path
from keyrecon.pictures import side_by_side
from keyrecon.video import Video

PLATE = 15
"""Frames whose median stands for the scene."""
PLACES = 32
"""Places at which a line is looked at."""
SHAFT = (0.2, 0.95)
"""Where on the club they lie, between its ends: beside the hands and the head."""
ASIDES = 21
"""Offsets that are tried on every frame."""
NEIGHBOURS = (7, 7)
"""Turns and offsets among which only the best line is kept."""
SAME_CLUB = 1e-3
"""px"""
ALONG = 0.12
"""Standard deviation along the shaft of hands that were only expected there, player heights."""
BRIDGED = 0.5
"""Longest time over which the fit's error is thought to last, seconds."""


@dataclass(frozen=True)
class SecondLookOptions:
    """How the club is looked for once more; lengths in player heights."""

    turn: float = 30.0
    """Degrees by which the club may be turned from where it is expected."""
    aside: float = 0.05
    """How far beside the expected hands its line may pass."""
    usual_turn: float = 10.0
    """Degrees by which it usually is turned."""
    usual_aside: float = 0.025
    """How far beside it usually passes."""
    widths: tuple[float, ...] = (0.006, 0.012, 0.024)
    """From the middle of the shaft to where the scene shows: sharp, and blurred by motion."""
    contrast: float = 12.0
    """Grey levels by which a sure shaft stands out."""
    gain: float = 15.0
    """What a club that stands out from end to end is worth, in squared standard deviations."""
    pace: float = 0.1
    """Seconds in which the fit's error may change by its usual size."""
    miss: float = 3.0
    """Cost of a frame in which the club is not seen: it must stand out over a fifth at least."""
    far: float = 3.0
    """Usual departures beyond which it costs no more: the fit may be wrong altogether."""
    most: int = 6
    """Lines kept in a frame."""
    shortest: float = 0.1
    """A club that seems shorter than this points at the camera: its angle tells nothing."""


@dataclass(frozen=True, eq=False)
class _Lines:
    """Lines of a frame that may be the club."""

    ends: Float[np.ndarray, "n 2 2"]
    """Hands and head, heights."""
    departure: Float[np.ndarray, "n 2"]
    """Turn and offset from the expected club, in usual ones."""
    score: Float[np.ndarray, "n"]
    """Share of the club that stands out."""


def see_club_again(
    observations: Observations,
    video: Video,
    fitted: FittedSwing,
    height: float,
    options: SecondLookOptions = SecondLookOptions(),
) -> Observations:
    """The observations with the club of a second look at the swing; `height` of the player in px.

    A club that rests at address is in the median picture too, and what the player does with it
    after the finish is no part of the fitted motion: what was seen there at first remains.
    """
    first = observations.club
    again = look_again(video, first, fitted.club_seen, height, options)
    frames = np.arange(len(first))
    known = np.isfinite(first).all(axis=(1, 2))
    kept = (frames > fitted.keys[3]) | ((frames < fitted.keys[0]) & known)
    ends = np.where(kept[:, None, None], first, again)
    same = np.abs(ends - first).max(axis=(1, 2)) < SAME_CLUB
    along = np.where(same[:, None], observations.club_along, [ALONG * height, np.inf])
    return replace(observations, club=ends, club_along=along)


def look_again(
    video: Video,
    first: Float[np.ndarray, "T 2 2"],
    expected: Float[np.ndarray, "T 2 2"],
    height: float,
    options: SecondLookOptions = SecondLookOptions(),
) -> Float[np.ndarray, "T 2 2"]:
    """Hand end and head of the club, px, NaN where it is not seen.

    `first` is where it was seen at first, NaN where it was not; `height` that of the player in px.
    """
    plate = _median_picture(video)

    def look(numbered: tuple[int, UInt8[np.ndarray, "h w"]]) -> _Lines:
        frame, grey = numbered
        pictures = grey.astype(np.float32), grey - plate
        return _find_lines(pictures, first[frame], expected[frame], height, options)

    lines = list(side_by_side(look, enumerate(video.grey_frames())))
    chosen = _choose(lines, video.fps, options)
    ends = np.full_like(expected, np.nan)
    for t in np.flatnonzero(chosen >= 0):
        ends[t] = height * lines[t].ends[chosen[t]]
    return ends


def _median_picture(video: Video) -> Float[np.ndarray, "h w"]:
    """The scene, and what of the player hardly moves."""
    chosen = set(np.linspace(0, len(video) - 1, PLATE).astype(int).tolist())
    pictures = [g for t, g in enumerate(video.grey_frames()) if t in chosen]
    return np.median(np.stack(pictures), axis=0).astype(np.float32)


def _find_lines(
    pictures: tuple[Float[np.ndarray, "h w"], Float[np.ndarray, "h w"]],
    first: Float[np.ndarray, "2 2"],
    expected: Float[np.ndarray, "2 2"],
    height: float,
    options: SecondLookOptions,
) -> _Lines:
    """The lines near the expected club that stand out most, and the one that was seen at first."""
    ends = np.zeros((0, 2, 2))
    if np.linalg.norm(expected[1] - expected[0]) > options.shortest * height:
        ends = _best_lines(pictures, expected / height, height, options)
    if np.isfinite(first).all():
        ends = np.concatenate([ends, first[None] / height])
    departure = _depart(expected / height, ends, options)
    return _Lines(ends, departure, _score(pictures, ends, height, options))


def _best_lines(
    pictures: tuple[Float[np.ndarray, "h w"], Float[np.ndarray, "h w"]],
    expected: Float[np.ndarray, "2 2"],
    height: float,
    options: SecondLookOptions,
) -> Float[np.ndarray, "n 2 2"]:
    """Lines that are worth more than all their neighbours, the best ones."""
    turns = np.arange(-options.turn, options.turn + 0.5)
    asides = np.linspace(-options.aside, options.aside, ASIDES)
    turn, aside = (grid.ravel() for grid in np.meshgrid(turns, asides, indexing="ij"))
    ends = _shift(expected, turn, aside)
    worth = _worth(_depart(expected, ends, options), _score(pictures, ends, height, options),
                   options).reshape(len(turns), ASIDES)  # fmt: skip
    peaks = np.flatnonzero(worth >= cv2.dilate(worth, np.ones(NEIGHBOURS)))
    return ends[peaks[np.argsort(-worth.ravel()[peaks])][: options.most]]


def _shift(
    expected: Float[np.ndarray, "2 2"], turn: Float[np.ndarray, "n"], aside: Float[np.ndarray, "n"]
) -> Float[np.ndarray, "n 2 2"]:
    """The expected club turned about its hands by degrees and shifted sideways."""
    way = expected[1] - expected[0]
    across = np.array([-way[1], way[0]])
    angle = np.radians(turn)[:, None]
    hands = expected[0] + aside[:, None] * across / np.linalg.norm(across)
    return np.stack([hands, hands + np.cos(angle) * way + np.sin(angle) * across], axis=1)


def _depart(
    expected: Float[np.ndarray, "2 2"],
    ends: Float[np.ndarray, "n 2 2"],
    options: SecondLookOptions,
) -> Float[np.ndarray, "n 2"]:
    """Turn of lines from the expected one and how far aside of its hands they pass."""
    way, theirs = expected[1] - expected[0], ends[:, 1] - ends[:, 0]
    turn = np.arctan2(way[0] * theirs[:, 1] - way[1] * theirs[:, 0], theirs @ way)
    off = ends[:, 0] - expected[0]
    length = np.maximum(np.linalg.norm(theirs, axis=1), 1e-9)
    aside = (theirs[:, 0] * off[:, 1] - theirs[:, 1] * off[:, 0]) / length
    return np.stack(
        [np.degrees(turn) / options.usual_turn, aside / options.usual_aside], axis=1
    )


def _score(
    pictures: tuple[Float[np.ndarray, "h w"], Float[np.ndarray, "h w"]],
    ends: Float[np.ndarray, "n 2 2"],
    height: float,
    options: SecondLookOptions,
) -> Float[np.ndarray, "n"]:
    """Share of every line that stands out in both pictures."""
    both = np.minimum(*(_stand_out(picture, ends, height, options) for picture in pictures))
    return np.minimum(both / options.contrast, 1.0).mean(axis=1)


def _stand_out(
    picture: Float[np.ndarray, "h w"],
    ends: Float[np.ndarray, "n 2 2"],
    height: float,
    options: SecondLookOptions,
) -> Float[np.ndarray, "n p"]:
    """Grey levels by which places along lines differ from both sides, at the best width."""
    share = np.linspace(*SHAFT, PLACES)[:, None]
    points = (1 - share) * ends[:, None, 0] + share * ends[:, None, 1]
    way = ends[:, 1] - ends[:, 0]
    across = np.stack([-way[:, 1], way[:, 0]], axis=1)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    middle = _read(picture, points * height)
    best = np.zeros_like(middle)
    for width in options.widths:
        one, other = (
            middle - _read(picture, (points + side * width * across[:, None]) * height)
            for side in (-1, 1)
        )
        alike = np.where(one * other > 0, np.minimum(np.abs(one), np.abs(other)), 0.0)
        best = np.maximum(best, alike)
    return best


def _read(
    picture: Float[np.ndarray, "h w"], points: Float[np.ndarray, "n p 2"]
) -> Float[np.ndarray, "n p"]:
    if not len(points):
        return np.zeros(points.shape[:2], np.float32)
    return cv2.remap(
        picture, points.astype(np.float32), None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )


def _worth(
    departure: Float[np.ndarray, "n 2"], score: Float[np.ndarray, "n"], options: SecondLookOptions
) -> Float[np.ndarray, "n"]:
    """What a line gains by standing out, less what it pays for departing from expectation."""
    off = np.minimum((departure**2).sum(axis=1), options.far**2)
    return options.gain * score - 0.5 * off


def _choose(
    lines: Sequence[_Lines], fps: float, options: SecondLookOptions
) -> Int[np.ndarray, "T"]:
    """The line taken in every frame, -1 where none."""

    def moving(before: int, t: int) -> Float[np.ndarray, "l m"]:
        change = lines[before].departure[:, None] - lines[t].departure
        square = np.minimum((change**2).sum(axis=2), options.far**2)
        return 0.5 * square * min(1.0, options.pace * fps / (t - before))

    own = [options.miss - _worth(b.departure, b.score, options) for b in lines]
    return find_cheapest_path(own, moving, max(1, round(BRIDGED * fps)), 0.0)
