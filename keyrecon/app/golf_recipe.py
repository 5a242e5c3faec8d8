"""The recipe of a golf fit: which stages make a swing from a video and clicks, in what order."""

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
from keyrecon.golf.scene import SwingScene, observe_scene
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
    search = _Search(video, scene, pose, model, options, keep, progress)
    if not marks.any:
        search.check_hand(clicked)
        return search.find(marks)
    has_shafts = bool(np.isfinite(marks.shafts).any())
    return search.find(marks, _earlier_shafts(search, clicked, marks) if has_shafts else NO_MARKS)


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


@dataclass(frozen=True, eq=False)
class _Search:
    """A film in which a swing is looked for, and how; with what marks it is told each time."""

    video: Video
    scene: SwingScene
    pose: ClickedPose
    model: MotionModel
    options: GolfOptions
    keep: Keep
    progress: Progress

    def check_hand(self, clicked: ClickedPose) -> None:
        """Raises KeyreconError where the swing goes round the other way than was clicked."""
        placed = place_in_film(self.pose, self.scene.film)
        hands = self.keep("hands", measure_hands, self.scene, placed, self.model)
        check_hand(hands, clicked, "The clicks")

    def find(self, marks: SwingMarks, earlier: SwingMarks = NO_MARKS) -> FoundSwing:
        """The swing that explains the film best; its club may be where one was found `earlier`.

        Stages have names of their own where there are marks, so that no number of corrections
        pushes the fit without them out of the cache.
        """
        keep, options, kind = self.keep, self.options, "_marked" if marks.any else ""
        found = keep(f"search{kind}", find_candidates, self.scene, self.pose, marks, self.model)
        candidates = [replace(one, earlier=earlier) for one in found[: options.candidates]]
        tried: list[_Tried] = []
        for number, candidate in enumerate(candidates, 1):
            first = self._try(candidate, marks, f"{kind}_{number}")
            tried.append(first)
            slowed, searched = None, options.observation.find_slow_motion
            if searched and first.observed.slow_motion == 1 and options.method == "swing":
                slowed = find_slowed_keys(first.fitted.keys, first.observed.film, self.scene.film)
            if slowed is not None:
                slower = replace(candidate, keys=slowed)
                tried.append(self._try(slower, marks, f"{kind}_{number}s"))
            if not tried[-1].doubts or options.method == "windows":
                break
        best = min(tried, key=lambda t: len(t.doubts))
        return keep(
            f"found{kind}", swing_found, best.fitted, best.observations, best.doubts,
            best.observed, marks, self.video, self.model,
        )  # fmt: skip

    def _try(self, candidate: SwingHypothesis, marks: SwingMarks, suffix: str) -> _Tried:
        """One candidate fitted, and anew at their time where the pictures show it clearly off."""
        keep, options, model = self.keep, self.options, self.model
        observed = keep(
            f"observe{suffix}", observe_swing, self.video, self.scene, candidate, self.pose, marks,
            model, options=options.observation, progress=self.progress,
        )  # fmt: skip
        tried = self._fit(observed, observed.observations, suffix)
        for number in range(RETIMINGS if options.method == "swing" else 0):
            if not is_shifted(tried.shift):
                break
            again = f"{suffix}_timed_{number + 1}"
            first = keep(f"observe{again}", retime, tried.first, tried.fitted, tried.shift, model)
            retried = self._fit(observed, first, again)
            if _is_worse(retried, tried):
                break
            tried = retried
        return tried

    def _fit(self, observed: ObservedSwing, first: Observations, suffix: str) -> _Tried:
        """A fit to the first observations of a candidate, and what speaks against it."""
        shown, keep = observed.film.open(self.video), self.keep
        fitted, guided = fit_candidate(
            first, shown, self.model, self.options, keep, self.progress, suffix
        )
        shift = keep(f"timing{suffix}", measure_time_shift, shown, fitted, first.height)
        doubts = tuple(find_doubts(fitted, first, shift))
        return _Tried(first, fitted, guided, observed, shift, doubts)


def _earlier_shafts(search: _Search, clicked: ClickedPose, marks: SwingMarks) -> SwingMarks:
    """The club of the fit without the marks, which a person saw and corrected.

    None where there is no such fit, or something speaks against it.
    """
    try:
        search.check_hand(clicked)
        found = search.find(NO_MARKS)
    except KeyreconError:  # the clicks alone show no swing: what the marks are for
        return NO_MARKS
    return NO_MARKS if found.doubts else unrefuted_shafts(found.fitted, found.observations, marks)


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
