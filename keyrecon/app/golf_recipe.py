"""The recipe of a golf fit: which stages make a swing from a video and clicks, in what order."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from keyrecon.errors import KeyreconError
from keyrecon.golf.candidates import find_candidates, find_slowed_keys, place_in_film
from keyrecon.golf.click_checks import check_hand, measure_hands
from keyrecon.golf.clicks import ClickedPose
from keyrecon.golf.fit.swing_search import SwingHypothesis
from keyrecon.golf.marks import unrefuted_shafts
from keyrecon.golf.observation import ObservedSwing, observe_swing
from keyrecon.golf.observe.film import choose_frames
from keyrecon.golf.observe.motion_timing import TimeShift, measure_time_shift
from keyrecon.golf.plausibility import SwingDoubt, find_doubts, is_shifted
from keyrecon.golf.records import NO_MARKS, FittedSwing, MotionModel, Observations, SwingMarks
from keyrecon.golf.scene import observe_scene
from keyrecon.golf.swing_fit import (
    FoundSwing,
    GolfOptions,
    finish_fit,
    fit_guided,
    fit_observations,
    retime,
    swing_found,
)
from keyrecon.io.video import Video
from keyrecon.keeping import Keep, call_stage
from keyrecon.progress import Progress, silent
from keyrecon.records import CameraPath


def find_swing(
    video: Video,
    camera: CameraPath,
    pose: ClickedPose,
    model: MotionModel,
    options: GolfOptions = GolfOptions(),
    keep: Keep = call_stage,
    progress: Progress = silent,
    marks: SwingMarks = NO_MARKS,
) -> FoundSwing:
    """Observe a video and fit the swing that explains it best, and holds what a person marked.

    Raises KeyreconError where no player or no swing is observed, and where hand or sides seem to be
    told wrong by somebody who has marked nothing but the clicks.
    """
    clicked, pose = pose, replace(pose, mirrored=False)
    film = keep("film", choose_frames, video, camera, pose.frame)
    scene = keep(
        "scene", observe_scene, video, film, place_in_film(pose, film),
        options=options.observation.scene, progress=progress,
    )  # fmt: skip
    if not marks.any:
        hands = keep("hands", measure_hands, scene, place_in_film(pose, film), model)
        check_hand(hands, clicked, "The clicks")
    # by other names, so that no number of corrections pushes the fit without them out of the cache
    kind = "_marked" if marks.any else ""
    candidates = keep(f"search{kind}", find_candidates, scene, pose, marks, model)
    if np.isfinite(marks.shafts).any():
        earlier = _earlier_shafts(
            lambda: find_swing(video, camera, clicked, model, options, keep, progress), marks
        )
        candidates = tuple(replace(candidate, earlier=earlier) for candidate in candidates)

    def attempt(candidate: SwingHypothesis, suffix: str) -> _Tried:
        observed = keep(
            f"observe{suffix}", observe_swing, video, scene, candidate, pose, marks, model,
            options=options.observation, progress=progress,
        )  # fmt: skip
        return _try(observed, video, model, options, keep, progress, suffix)

    tried: list[_Tried] = []
    for number, candidate in enumerate(candidates[: options.candidates], 1):
        first = attempt(candidate, f"{kind}_{number}")
        tried.append(first)
        slowed, searched = None, options.observation.find_slow_motion
        if searched and first.observed.slow_motion == 1 and options.method == "swing":
            slowed = find_slowed_keys(first.fitted.keys, first.observed.film, scene.film)
        if slowed is not None:
            tried.append(attempt(replace(candidate, keys=slowed), f"{kind}_{number}s"))
        if not tried[-1].doubts or options.method == "windows":
            break
    best = min(tried, key=lambda t: len(t.doubts))
    return keep(
        f"found{kind}", swing_found, best.fitted, best.observations, best.doubts, best.observed,
        marks, video, model,
    )  # fmt: skip


def _earlier_shafts(find: Callable[[], FoundSwing], marks: SwingMarks) -> SwingMarks:
    """The club of a fit without the marks, which a person saw and corrected.

    None where there is no such fit, or something speaks against it.
    """
    try:
        found = find()
    except KeyreconError:  # the clicks alone show no swing: what the marks are for
        return NO_MARKS
    return NO_MARKS if found.doubts else unrefuted_shafts(found.fitted, found.observations, marks)


RETIMINGS = 2
"""Times that a fit is made anew at the time at which the pictures show its downswing. Of a real
swing without masks and club around the downswing and begun .4 downswings late, the first brought
joints within a fifth of the trunk from .86 to .89 and clubs within 15 degrees from .73 to .86."""


@dataclass(frozen=True, eq=False)
class _Tried:
    """A candidate that was fitted, and what speaks against it."""

    first: Observations
    """Those before any fit."""
    fitted: FittedSwing
    observations: Observations
    observed: ObservedSwing
    shift: TimeShift
    doubts: tuple[SwingDoubt, ...]


def _try(
    observed: ObservedSwing,
    video: Video,
    model: MotionModel,
    options: GolfOptions,
    keep: Keep,
    progress: Progress,
    suffix: str,
) -> _Tried:
    """One candidate fitted, and anew at their time where the pictures show it clearly off."""
    shown = observed.film.open(video)

    def fit(first: Observations, suffix: str) -> _Tried:
        fitted, guided = fit_candidate(first, shown, model, options, keep, progress, suffix)
        shift = keep(f"timing{suffix}", measure_time_shift, shown, fitted, first.height)
        doubts = tuple(find_doubts(fitted, first, shift))
        return _Tried(first, fitted, guided, observed, shift, doubts)

    tried = fit(observed.observations, suffix)
    for number in range(RETIMINGS if options.method == "swing" else 0):
        if not is_shifted(tried.shift):
            break
        again = f"{suffix}_timed_{number + 1}"
        first = keep(f"observe{again}", retime, tried.first, tried.fitted, tried.shift, model)
        retried = fit(first, again)
        if _is_worse(retried, tried):
            break
        tried = retried
    return tried


def _is_worse(one: _Tried, other: _Tried) -> bool:
    """Whether more speaks against a fit, or the same and its downswing is no less off in time."""
    if len(one.doubts) != len(other.doubts):
        return len(one.doubts) > len(other.doubts)
    return abs(one.shift.downswings) >= abs(other.shift.downswings)


def fit_candidate(
    observations: Observations,
    video: Video,
    model: MotionModel,
    options: GolfOptions = GolfOptions(),
    keep: Keep = call_stage,
    progress: Progress = silent,
    suffix: str = "",
) -> tuple[FittedSwing, Observations]:
    """The model fitted to the observations of one candidate, with guided club detection."""
    fitted = keep(
        f"fit{suffix}", fit_observations, observations, video, model, options=options,
        progress=progress,
    )  # fmt: skip
    return refine_fit(fitted, observations, video, model, options, keep, suffix)


def refine_fit(
    fitted: FittedSwing,
    first: Observations,
    video: Video,
    model: MotionModel,
    options: GolfOptions = GolfOptions(),
    keep: Keep = call_stage,
    suffix: str = "",
) -> tuple[FittedSwing, Observations]:
    """Rounds of guided club detection and fitting after a fit to the `first` observations."""
    observations = first
    for number in range(options.guided_rounds if options.method == "swing" else 0):
        guided = keep(
            f"guided{suffix}_{number + 1}", fit_guided, first, fitted, video, model,
            options=options,
        )  # fmt: skip
        fitted, observations = guided.fitted, guided.update(first)
    fitted = keep(
        f"result{suffix}", finish_fit, observations, fitted, video, options=options.events
    )
    return fitted, observations
