"""The stages of a golf fit: observe, fit, and detect the club again where the fit expects it.

Observations come first (`observation`): of the frames that are fitted (`observe.film`), with the
swings that these may show. The motion model is fitted to the likeliest of them. Then, in rounds,
the club is detected once more where the fitted swing expects it, the hands tell when the swing
begins and ends better than club or fit do, and the model is fitted to both. A downswing that runs
ahead of what moves in the pictures, or behind it, is fitted anew at their time. A fit that does not
explain its film (`plausibility`) gives way to the next candidate. At last the swing is given in
every frame of the file, before the camera as it moved.
"""

from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float

from keyrecon.golf.fit.fitting import (
    FitOptions,
    fit_swing,
    follow_observations,
    refit_swing,
)
from keyrecon.golf.fit.handedness import mirror_observations
from keyrecon.golf.fit.in_file import observations_in_file, swing_in_file
from keyrecon.golf.fit.initial_pose import initial_fit
from keyrecon.golf.fit.proportions import ProportionOptions, refit_proportions
from keyrecon.golf.fit.result import describe_fit
from keyrecon.golf.marks import carry_marks, hold_club, hold_joints, hold_keys, hold_observations
from keyrecon.golf.observation import ObservationOptions, ObservedSwing
from keyrecon.golf.observe.guided_club_detection import GuidedDetectionOptions, detect_club_guided
from keyrecon.golf.observe.motion_timing import TimeShift
from keyrecon.golf.observe.swing_events import SwingEventOptions, detect_swing_events
from keyrecon.golf.observe.swing_timing import interpolate_times, order_keys
from keyrecon.golf.plausibility import SwingDoubt, shown_keys
from keyrecon.golf.prior.skeleton import mark_neck, size_body
from keyrecon.golf.records import FittedSwing, MotionModel, Observations, SwingMarks, SwingState
from keyrecon.io.video import Video
from keyrecon.paper.sliding_windows import WindowOptions, fit_sliding_windows
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within


@dataclass(frozen=True)
class GolfOptions:
    """From a video to a fitted swing."""

    method: Literal["swing", "windows"] = "swing"
    """'swing' fits all frames at once; 'windows' slides over three frames as in the paper."""
    prior: str = ""
    """File of the swing prior, as seen from the project's folder; without one the built-in."""
    observation: ObservationOptions = field(default_factory=ObservationOptions)
    """What is observed in the video."""
    fit: FitOptions = field(default_factory=FitOptions)
    """How the model is fitted to it."""
    windows: WindowOptions = field(default_factory=WindowOptions)
    """The paper's sliding windows, where they are asked for."""
    candidates: Annotated[int, within(1, 10)] = 3
    """Swings that are tried at most, while none explains the film."""
    guided_rounds: Annotated[int, within(0, 20)] = 2
    """How many times the club is detected again where the fitted swing expects it."""
    guided_detection: GuidedDetectionOptions = field(default_factory=GuidedDetectionOptions)
    """How it is detected then."""
    events: SwingEventOptions = field(default_factory=SwingEventOptions)
    """When hands rest."""
    proportions: ProportionOptions = field(default_factory=ProportionOptions)
    """How clicks and annotated keyframes tell the player's proportions."""


@dataclass(frozen=True, eq=False)
class GuidedFit:
    """What a round of guided club detection changes."""

    club: Float[np.ndarray, "T 2 2"]
    club_along: Float[np.ndarray, "T 2"]
    keys: Float[np.ndarray, "4"]
    phase: Float[np.ndarray, "T"]
    marks: SwingMarks
    fitted: FittedSwing

    def update(self, observations: Observations) -> Observations:
        """The observations of this round."""
        return hold_observations(replace(
            observations, club=self.club, club_along=self.club_along, keys=self.keys,
            phase=self.phase, marks=self.marks,
        ))  # fmt: skip


def fit_observations(
    observations: Observations,
    video: Video,
    model: MotionModel,
    options: GolfOptions = GolfOptions(),
    previous: SwingState | None = None,
    progress: Progress = silent,
) -> FittedSwing:
    """Fit the model to what was observed, from scratch or going on from a `previous` state.

    Left-handers are mirrored on the way in and out; states are those of right-handers.
    """
    mirrored = observations
    if observations.left_handed:
        mirrored = mirror_observations(observations, video.width)
    initial = initial_fit(mirrored, model, mark_neck(size_body(observations.stature)))
    if previous is not None:
        learnt = replace(previous, deviation=None)
        fit = refit_swing(mirrored, initial, learnt, video.fps, options.fit)
    elif options.method == "swing":
        fit = fit_swing(mirrored, initial, video.fps, options.fit)
    else:
        fit = fit_sliding_windows(mirrored, initial, options.windows, progress)
    if options.method == "swing":
        fit = refit_proportions(fit, mirrored, initial, video.fps, options.fit, options.proportions)
        if options.fit.follow:
            fit = follow_observations(fit, mirrored, initial, video.fps, options.fit)
    return describe_fit(fit, observations, video.time)


def fit_guided(
    observations: Observations,
    fitted: FittedSwing,
    video: Video,
    model: MotionModel,
    options: GolfOptions = GolfOptions(),
) -> GuidedFit:
    """The club detected where a fitted swing expects it, and the fit with it.

    `observations` are the first ones: their key postures at top and hit follow from the club alone,
    since a fit must not confirm itself. Marks between its frames go along with it.
    """
    guided = detect_club_guided(observations, video, fitted, options.guided_detection)
    keys = detect_swing_events(video, guided, fitted, options.events)
    keys[1:3] = observations.keys[1:3]
    keys = hold_keys(keys, observations.marks)
    phase = interpolate_times(keys, model.keys, len(video))
    marks = carry_marks(observations.marks, fitted)
    guided = hold_observations(replace(guided, keys=keys, phase=phase, marks=marks))
    fitted = fit_observations(guided, video, model, options, fitted.state)
    return GuidedFit(guided.club, guided.club_along, keys, phase, marks, fitted)


def retime(
    observations: Observations, fitted: FittedSwing, shift: TimeShift, model: MotionModel
) -> Observations:
    """The observations with top and hit when the pictures show them, and not when a fit has them.

    What a person marked stays.
    """
    keys = observations.keys.copy()
    keys[1:3] = fitted.keys[1:3] + shift.frames
    keys = hold_keys(order_keys(keys), observations.marks)
    phase = interpolate_times(keys, model.keys, len(observations.phase))
    return hold_observations(replace(observations, keys=keys, phase=phase))


def finish_fit(
    observations: Observations,
    fitted: FittedSwing,
    video: Video,
    options: SwingEventOptions = SwingEventOptions(),
) -> FittedSwing:
    """The fitted swing with its beginning and end as the hands in the picture tell them."""
    keys = detect_swing_events(video, observations, fitted, options)
    return replace(fitted, keys=hold_keys(keys, observations.marks))


@dataclass(frozen=True, eq=False)
class FoundSwing:
    """A swing found in a video, in every frame of its file."""

    fitted: FittedSwing
    observations: Observations
    """As far as they belong to frames of the file."""
    doubts: tuple[SwingDoubt, ...]
    """What speaks against it."""
    notes: tuple[str, ...]
    """What was found of the film: slow motion, repeated frames, cuts, what it does not show."""
    shown: tuple[bool, bool, bool, bool]
    """Which key postures the film shows, or a person marked."""


def swing_found(
    fitted: FittedSwing,
    observations: Observations,
    doubts: tuple[SwingDoubt, ...],
    observed: ObservedSwing,
    marks: SwingMarks,
    video: Video,
    model: MotionModel,
) -> FoundSwing:
    """A fitted film as a swing in every frame of the file, with the file's `marks` held.

    Its times are seconds of the world, also where nobody told of the slow motion.
    """
    film = observed.film
    doubts = tuple(replace(d, frame=film.frame_in_file(d.frame)) for d in doubts)
    marked = np.isfinite(marks.keys).tolist()
    seen = shown_keys(film.keys_in_file(fitted.keys), film)
    start, top, hit, finish = (one or other for one, other in zip(seen, marked, strict=True))
    notes = (*_describe_film(observed, len(video)), *_describe_missing(start, finish))
    if not film.is_whole(video):
        time = video.time / observed.slow_motion
        fitted = swing_in_file(fitted, observations, film, time, model)
        observations = replace(observations_in_file(observations, film), marks=marks)
    fitted = hold_joints(fitted, marks, observations.camera.focal)
    fitted = hold_club(fitted, marks, observations.club, observations.camera.focal)
    keys = np.clip(hold_keys(fitted.keys, marks), 0, len(video) - 1)
    fitted = replace(fitted, keys=keys)
    return FoundSwing(fitted, observations, doubts, notes, (start, top, hit, finish))


def _describe_missing(start: bool, finish: bool) -> list[str]:
    """What the film does not show of a swing, and what cannot be told then, in words."""
    notes = []
    if not start:
        notes.append(
            "the start is not shown, since the film begins within the upswing: there is no tempo, "
            "and nothing that is counted from the address"
        )
    if not finish:
        notes.append(
            "the finish is not shown, since the film ends in the follow-through: there are no "
            "numbers of it"
        )
    return notes


def _describe_film(observed: ObservedSwing, frames: int) -> list[str]:
    """What a person should know of the film, in words."""
    film, notes = observed.film, []
    if film.repeated > LEAST_REPEATED:
        notes.append(f"{film.repeated:.0%} of the frames repeat the one before")
    if observed.slow_motion > 1:
        notes.append(
            f"the film seems slowed down {observed.slow_motion:.1f} times, and seconds are told "
            "as they were without that; give --slowmo if you know better"
        )
    if film.shot != (0, frames - 1):
        notes.append(f"only frames {film.shot[0]} to {film.shot[1]} show the shot that was clicked")
    if film.file_range != film.shot:
        first, last = film.file_range
        notes.append(
            f"the swing was found in frames {first} to {last}; nothing is "
            "fitted to the others (their confidence is 0)"
        )
    return notes


LEAST_REPEATED = 0.02
"""Share of repeated frames that is worth a word."""
