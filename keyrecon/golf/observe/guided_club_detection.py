"""Guided club detection: lines of a picture near the club that a fitted swing expects.

Nothing but the club itself can tell at first where it is, so what lies on the player is left out
then: stripes, folds and gaps between arms look alike. Once a swing has been fitted, the global
model that Gehrig, Lepetit and Fua (BMVC 2003) make of polynomials, the lines near the expected club
and the one detected at first are all that need be compared (`club_lines`). The cheapest path
through the best lines of all frames departs from the expectation as slowly as the fit is wrong.

Constants were chosen on rendered swings; see benchmarks/golf.py.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from keyrecon.golf.observe.club_lines import (
    ClubLines,
    LineOptions,
    SearchedFrame,
    find_club_lines,
    lay_on,
    measure_departure,
)
from keyrecon.golf.records import FittedSwing, Observations
from keyrecon.io.frame_reader import side_by_side
from keyrecon.io.video import Video
from keyrecon.numerics.geometry import signed_angles
from keyrecon.numerics.viterbi import find_cheapest_path, longest_gap
from keyrecon.ranges import within

EARLY = 0.01
"""Seconds by which a fit usually is early or late: a fast club is turned by more than one that
rests. Of 134 clubs marked by eye in five real swings 91 % were detected within 5 degrees without
it, 92.5 % with .005, .01 and .02."""
MEDIAN_FRAMES = 15
"""Frames whose median stands for the scene."""
SAME_CLUB = 1.0
"""Usual departures within which a line detected at first is the same club."""
EXPECTED_SPREAD = 0.12
"""Standard deviation along the shaft of hands that were only expected there, player heights."""
BRIDGED_SECONDS = 0.5
"""Longest time over which the fit's error is thought to last; what is unseen for longer is bridged
all the same, since a path that ended there would lose all on one side."""


@dataclass(frozen=True)
class GuidedDetectionOptions:
    """How the club is detected with the help of a fitted swing."""

    lines: LineOptions = field(default_factory=LineOptions)
    """What may be the club."""
    miss: Annotated[float, within(0.1, 60)] = 3.0
    """Cost of a frame without the club: it must stand out over a fifth at least."""
    pace: Annotated[float, within(0.005, 2)] = 0.1
    """Seconds in which the fit's error may change by its usual size."""


@dataclass(frozen=True, eq=False)
class ExpectedClubs:
    """What is known of the club in every frame; ends are hands and head, px."""

    first: Float[np.ndarray, "T 2 2"]
    """Where it was detected at first, NaN where it was not."""
    expected: Float[np.ndarray, "T 2 2"]
    resting: Bool[np.ndarray, "T"]
    """Whether it rests, so that it is in the median picture too."""
    height: float
    """Of the player, px."""


def detect_club_guided(
    observations: Observations,
    video: Video,
    fitted: FittedSwing,
    options: GuidedDetectionOptions = GuidedDetectionOptions(),
) -> Observations:
    """The observations with the club of a guided detection.

    How far a shaft reaches was detected at first, where that was the same one.
    """
    first, height = observations.club, observations.height
    resting = np.arange(len(first)) < fitted.keys[0]
    ends = detect_clubs(video, ExpectedClubs(first, fitted.club2d, resting, height), options)
    along = np.tile([EXPECTED_SPREAD * height, np.inf], (len(ends), 1))
    for t in _find_same(ends, first, height, options.lines):
        ends[t], along[t] = lay_on(ends[t], first[t]), observations.club_along[t]
    return replace(observations, club=ends, club_along=along)


def _find_same(
    ends: Float[np.ndarray, "T 2 2"],
    first: Float[np.ndarray, "T 2 2"],
    height: float,
    options: LineOptions,
) -> Int[np.ndarray, "n"]:
    """Frames in which the club is what was detected at first."""
    pairs = zip(ends / height, first / height, strict=True)
    usual = np.array([options.usual_turn, options.usual_offset])
    apart = [measure_departure(e, f[None], usual)[0] for e, f in pairs]
    both = np.isfinite(ends + first).all(axis=(1, 2))
    return np.flatnonzero(both & (np.abs(apart).max(axis=1) < SAME_CLUB))


def detect_clubs(
    video: Video, clubs: ExpectedClubs, options: GuidedDetectionOptions = GuidedDetectionOptions()
) -> Float[np.ndarray, "T 2 2"]:
    """Hand end and head of the club, px, NaN where it is not detected."""
    median, height, expected = median_picture(video), clubs.height, clubs.expected
    swept = np.nan_to_num(np.linalg.norm(np.gradient(expected / height, axis=0), axis=2))
    usual = _usual_departures(expected, swept, video.fps, options.lines)

    def detect(numbered: tuple[int, UInt8[np.ndarray, "h w"]]) -> ClubLines:
        frame, grey = numbered
        picture = grey.astype(np.float32)
        layers = (picture,) if clubs.resting[frame] else (picture, picture - median)
        searched = SearchedFrame(layers, height, swept[frame], usual[frame])
        return find_club_lines(searched, clubs.first[frame], expected[frame], options.lines)

    lines = list(side_by_side(detect, enumerate(video.grey_frames())))
    chosen = _choose(lines, video.fps, options)
    ends = np.full_like(expected, np.nan)
    for t in np.flatnonzero(chosen >= 0):
        ends[t] = height * lines[t].ends[chosen[t]]
    return ends


def _usual_departures(
    expected: Float[np.ndarray, "T 2 2"],
    swept: Float[np.ndarray, "T 2"],
    fps: float,
    options: LineOptions,
) -> Float[np.ndarray, "T 2"]:
    """How far clubs are usually turned from where they are expected, degrees, and how far beside
    they pass, heights: by more where they move fast, since the fit is early or late."""
    way = expected[:, 1] - expected[:, 0]
    turn = np.abs(np.degrees(signed_angles(way[:-1], way[1:])))
    turned = np.nan_to_num(np.fmax(np.append(turn[:1], turn), np.append(turn, turn[-1:])))
    moved = EARLY * fps * np.stack([turned, swept[:, 0]], axis=1)
    return np.hypot([options.usual_turn, options.usual_offset], moved)


def median_picture(video: Video) -> Float[np.ndarray, "h w"]:
    """The scene, and what of the player hardly moves."""
    chosen = set(np.linspace(0, len(video) - 1, MEDIAN_FRAMES).astype(int).tolist())
    ordered = np.sort(np.stack(list(video.grey_frames(chosen))), axis=0)
    middle = ordered[[(len(ordered) - 1) // 2, len(ordered) // 2]]
    median: Float[np.ndarray, "h w"] = middle.mean(axis=0, dtype=np.float32)
    return median


def _choose(
    lines: Sequence[ClubLines], fps: float, options: GuidedDetectionOptions
) -> Int[np.ndarray, "T"]:
    """The line taken in every frame, -1 where none."""

    def moving(before: int, t: int) -> Float[np.ndarray, "l m"]:
        change = lines[before].departure[:, None] - lines[t].departure
        square = np.minimum((change**2).sum(axis=2), options.lines.far**2)
        return 0.5 * square * min(1.0, options.pace * fps / (t - before))

    costs = [options.miss - b.worth for b in lines]
    gap = max(round(BRIDGED_SECONDS * fps), longest_gap(costs))
    return find_cheapest_path(costs, moving, gap, 0.0)
