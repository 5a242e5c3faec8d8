"""`keyrecon golf fit`: from a video and a few clicks to a motion, an overlay and a report."""

import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from keyrecon.errors import KeyreconError
from keyrecon.golf.clicks import GolfClicks
from keyrecon.golf.fit.fitting import FitOptions, fit_sliding_windows, fit_swing, refit_swing
from keyrecon.golf.fit.initial_pose import estimate_initial_pose, start_state
from keyrecon.golf.fit.mirror import mirror_clicks, mirror_observations
from keyrecon.golf.fit.proportions import ProportionOptions, refit_proportions
from keyrecon.golf.fit.result import describe_fit
from keyrecon.golf.observe.guided_club_detection import (
    GuidedDetectionOptions,
    detect_club_guided,
    median_picture,
)
from keyrecon.golf.observe.observation import ObservationOptions, observe_swing
from keyrecon.golf.observe.swing_events import (
    SwingEventOptions,
    detect_swing_events,
    interpolate_times,
)
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import FittedSwing, MotionModel, Observations, SwingState
from keyrecon.io.formats.clicks import read_clicks
from keyrecon.io.formats.model_file import BUILT_IN_SWING_PRIOR, read_motion_model
from keyrecon.io.formats.motion_file import write_motion
from keyrecon.io.video import Video, open_video
from keyrecon.numerics.geometry import warp_points
from keyrecon.progress import Progress, silent
from keyrecon.report.golf_page import write_golf_report
from keyrecon.report.golf_pictures import write_golf_overlay
from keyrecon.tracking.camera_motion import estimate_camera_motion

SHAKE = 0.04
"""Share of the picture's width by which a standing camera may seem to move: a player who fills
the picture and a hand on the tripod move it by half of that."""


@dataclass(frozen=True)
class GolfOptions:
    """From a video to a fitted swing."""

    method: Literal["swing", "windows"] = "swing"
    """'swing' fits all frames at once; 'windows' slides over three frames as in the paper."""
    look: ObservationOptions = field(default_factory=ObservationOptions)
    """What is followed in the video."""
    fit: FitOptions = field(default_factory=FitOptions)
    """How the model is fitted to it."""
    again: int = 2
    """How many times the club is looked for again where the fitted swing expects it."""
    second_look: GuidedDetectionOptions = field(default_factory=GuidedDetectionOptions)
    """How it is looked for then."""
    rests: SwingEventOptions = field(default_factory=SwingEventOptions)
    """When hands rest."""
    proportions: ProportionOptions = field(default_factory=ProportionOptions)
    """How annotated keyframes tell the player's proportions."""
    slowmo: float = 1.0
    """How many times slower than real the video plays."""


def fit_video(
    video: Video,
    clicks: GolfClicks,
    model: MotionModel,
    options: GolfOptions = GolfOptions(),
    progress: Progress = silent,
) -> tuple[FittedSwing, Observations]:
    """Look at a swing, fit the model to it, and look again with what the fit has shown."""
    observations = observe_swing(video, clicks, model.keys, options.look, progress)
    fitted = fit_observations(observations, clicks, model, video, options)
    return refine_fit(fitted, observations, clicks, model, video, options)


def refine_fit(
    fitted: FittedSwing,
    observations: Observations,
    clicks: GolfClicks,
    model: MotionModel,
    video: Video,
    options: GolfOptions = GolfOptions(),
) -> tuple[FittedSwing, Observations]:
    """The club looked for again where it is expected by now, and the fit with it, in turns.

    In turns, too, the hands tell when the swing begins and ends, better than club or fit do.
    """
    seen, looks = observations, options.again if options.method == "swing" else 0
    plate = median_picture(video) if looks else None
    for _ in range(looks):
        seen = detect_club_guided(
            observations, video, plate, fitted, clicks.height, options.second_look
        )
        keys = detect_swing_events(video, seen.foreground, fitted, clicks.height, options.rests)
        keys[1:3] = observations.keys[1:3]  # told by the club alone: a fit must not guide itself
        seen = replace(seen, keys=keys, mu=interpolate_times(keys, model.keys, len(video)))
        fitted = fit_observations(seen, clicks, model, video, options, fitted.state)
    keys = detect_swing_events(video, seen.foreground, fitted, clicks.height, options.rests)
    return replace(fitted, keys=keys), seen


def fit_observations(
    observations: Observations,
    clicks: GolfClicks,
    model: MotionModel,
    video: Video,
    options: GolfOptions = GolfOptions(),
    before: SwingState | None = None,
) -> FittedSwing:
    """Fit the model to what was seen, from scratch or going on from a state found `before`.

    Left-handers are mirrored on the way in and out; states are those of right-handers.
    """
    seen, clicked = observations, dict(clicks.joints)
    if clicks.left_handed:
        seen, clicked = mirror_observations(seen, video.width), mirror_clicks(clicked, video.width)
    body = size_body(clicks.stature)
    placed = estimate_initial_pose(clicked, float(seen.mu[clicks.frame]), seen.camera, model, body)
    start = start_state(placed, seen.mu)
    if before is not None:
        found = refit_swing(seen, model, body, (start, before), video.fps, options.fit)
    else:
        fit = fit_swing if options.method == "swing" else fit_sliding_windows
        found = fit(seen, model, body, start, video.fps, options.fit)
    if seen.marks is not None and options.method == "swing":
        settings = options.fit, options.proportions
        found = refit_proportions(found, seen, start, video.fps, settings)
    return describe_fit(*found, observations, video.time, clicks.frame)


def fit_file(
    video_file: Path,
    clicks_file: Path,
    out: Path,
    prior: Path = BUILT_IN_SWING_PRIOR,
    options: GolfOptions = GolfOptions(),
    progress: Progress = silent,
) -> str:
    """Fit a swing and write motion.npz, overlay.mp4 and report.html; returns what to tell."""
    began = time.perf_counter()
    clicks, model = read_clicks(clicks_file), read_motion_model(prior)
    video = open_video(video_file, slow_motion=options.slowmo)
    require_still_camera(video, progress)
    fitted, observations = fit_video(video, clicks, model, options, progress)
    out.mkdir(parents=True, exist_ok=True)
    write_motion(out / "motion.npz", fitted.motion)
    write_golf_overlay(out / "overlay.mp4", video, fitted, observations.camera, progress)
    write_golf_report(out / "report.html", fitted, observations, model, video)
    spent = time.perf_counter() - began
    return (
        f"{tell_tempo(fitted, video.fps)}\n"
        f"{out}/motion.npz, overlay.mp4, report.html: {len(video)} frames, "
        f"{spent:.0f} s ({spent / len(video):.2f} s per frame)."
    )


def require_still_camera(video: Video, progress: Progress = silent) -> None:
    """Raises KeyreconError where the camera moves: the model stands in one place before it."""
    to_middle = estimate_camera_motion(video, progress=progress).to_reference
    corners = np.array([(0.0, 0.0), (video.width, 0.0), (0.0, video.height)])
    moved = np.linalg.norm(warp_points(to_middle[:, None], corners[None]) - corners, axis=2)
    usual = float(np.percentile(moved.max(axis=1), 90))
    if usual > SHAKE * video.width:
        raise KeyreconError(
            f"The camera moves: the scene shifts by {usual:.0f} px and more. A golf fit needs a "
            "camera that stands still; film from a tripod or stabilise the video first."
        )


def tell_tempo(fitted: FittedSwing, fps: float) -> str:
    """Key postures and tempo in words."""
    start, top, hit, finish = fitted.keys
    up, down = (top - start) / fps, (hit - top) / fps
    return (
        f"Upswing from frame {start:.0f}, top {top:.0f}, hit {hit:.0f}, finish {finish:.0f}; "
        f"{up:.2f} s up, {down:.2f} s down, tempo {up / down:.1f} : 1."
    )
