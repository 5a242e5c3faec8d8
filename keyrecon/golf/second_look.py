"""The club looked for once more, where the fitted swing expects it.

Nothing but the club itself can tell at first where it is, so what lies on the player is left out
then: stripes, folds and gaps between arms look alike. Once a swing has been fitted, the global
model that Gehrig, Lepetit and Fua (BMVC 2003) make of polynomials, the lines near the expected one
and the one seen at first are all that need be compared. The cheapest path through the best lines
of all frames departs from the expectation as slowly as the fit is wrong.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from keyrecon.golf.expected_lines import (
    LineOptions,
    Lines,
    Sight,
    find_lines,
    lay_on,
    measure_departure,
)
from keyrecon.golf.records import FittedSwing, Observations
from keyrecon.paths import find_cheapest_path
from keyrecon.pictures import side_by_side
from keyrecon.video import Video

PLATE = 15
"""Frames whose median stands for the scene."""
USUAL = 1.0
"""Usual departures within which a line seen at first is the same club."""
ALONG = 0.12
"""Standard deviation along the shaft of hands that were only expected there, player heights."""
BRIDGED = 0.5
"""Longest time over which the fit's error is thought to last, seconds."""


@dataclass(frozen=True)
class SecondLookOptions:
    """How the club is looked for once more."""

    lines: LineOptions = field(default_factory=LineOptions)
    """What may be the club."""
    miss: float = 3.0
    """Cost of a frame in which the club is not seen: it must stand out over a fifth at least."""
    pace: float = 0.1
    """Seconds in which the fit's error may change by its usual size."""


def see_club_again(
    observations: Observations,
    video: Video,
    plate: Float[np.ndarray, "h w"],
    fitted: FittedSwing,
    height: float,
    options: SecondLookOptions = SecondLookOptions(),
) -> Observations:
    """The observations with the club of a second look at the swing; `height` of the player in px.

    `plate` is the median picture (`median_picture`).
    How far a shaft reaches was seen at first, where that was the same one.
    """
    first, resting = observations.club, np.arange(len(observations.club)) < fitted.keys[0]
    ends = look_again((video, plate), (first, fitted.club_seen), height, resting, options)
    along = np.tile([ALONG * height, np.inf], (len(ends), 1))
    for t in _find_same(ends, first, height, options.lines):
        ends[t], along[t] = lay_on(ends[t], first[t]), observations.club_along[t]
    return replace(observations, club=ends, club_along=along)


def _find_same(
    ends: Float[np.ndarray, "T 2 2"],
    first: Float[np.ndarray, "T 2 2"],
    height: float,
    options: LineOptions,
) -> Int[np.ndarray, "n"]:
    """Frames in which the club is what was seen at first."""
    pairs = zip(ends / height, first / height, strict=True)
    apart = [measure_departure(e, f[None], options)[0] for e, f in pairs]
    seen = np.isfinite(ends + first).all(axis=(1, 2))
    return np.flatnonzero(seen & (np.abs(apart).max(axis=1) < USUAL))


def look_again(
    scene: tuple[Video, Float[np.ndarray, "h w"]],
    clubs: tuple[Float[np.ndarray, "T 2 2"], Float[np.ndarray, "T 2 2"]],
    height: float,
    resting: Bool[np.ndarray, "T"],
    options: SecondLookOptions = SecondLookOptions(),
) -> Float[np.ndarray, "T 2 2"]:
    """Hand end and head of the club, px, NaN where it is not seen.

    `scene` is the video with its median picture, in which a `resting` club is too; `clubs` are
    where it was seen at first, NaN where it was not, and where it is expected; `height` is that of
    the player in px.
    """
    (video, plate), (first, expected) = scene, clubs
    swept = np.nan_to_num(np.linalg.norm(np.gradient(expected / height, axis=0), axis=2))

    def look(numbered: tuple[int, UInt8[np.ndarray, "h w"]]) -> Lines:
        frame, grey = numbered
        picture = grey.astype(np.float32)
        moved = picture if resting[frame] else picture - plate
        sight = Sight((picture, moved), height, swept[frame])
        return find_lines(sight, first[frame], expected[frame], options.lines)

    lines = list(side_by_side(look, enumerate(video.grey_frames())))
    chosen = _choose(lines, video.fps, options)
    ends = np.full_like(expected, np.nan)
    for t in np.flatnonzero(chosen >= 0):
        ends[t] = height * lines[t].ends[chosen[t]]
    return ends


def median_picture(video: Video) -> Float[np.ndarray, "h w"]:
    """The scene, and what of the player hardly moves."""
    chosen = set(np.linspace(0, len(video) - 1, PLATE).astype(int).tolist())
    pictures = [g for t, g in enumerate(video.grey_frames()) if t in chosen]
    return np.median(np.stack(pictures), axis=0).astype(np.float32)


def _choose(lines: Sequence[Lines], fps: float, options: SecondLookOptions) -> Int[np.ndarray, "T"]:
    """The line taken in every frame, -1 where none."""

    def moving(before: int, t: int) -> Float[np.ndarray, "l m"]:
        change = lines[before].departure[:, None] - lines[t].departure
        square = np.minimum((change**2).sum(axis=2), options.lines.far**2)
        return 0.5 * square * min(1.0, options.pace * fps / (t - before))

    own = [options.miss - b.worth for b in lines]
    return find_cheapest_path(own, moving, max(1, round(BRIDGED * fps)), 0.0)
