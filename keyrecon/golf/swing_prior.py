"""The swing behind joints that were propagated from keyframes: the prior of the keyframe pipeline.

Keyframes give all joints, propagated to every frame; there is no club. Between the hands and along
the forearms a stand-in for it is held, good enough to find the key postures. The fit of the whole
swing then gives poses of a plausible swing, from which lifting takes depth signs and what nobody
marked.
"""

from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from jaxtyping import Float

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.fit.fitting import FitOptions, fit_swing
from keyrecon.golf.fit.handedness import mirror_observations
from keyrecon.golf.fit.initial_pose import initial_fit
from keyrecon.golf.fit.result import describe_fit
from keyrecon.golf.observe.club import Club
from keyrecon.golf.observe.swing_timing import TimingOptions, find_key_frames, interpolate_times
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import (
    Camera,
    InitialJoints,
    Matches,
    MotionModel,
    Observations,
    SwingMarks,
)
from keyrecon.io.video import Video
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.ranges import BODY_HEIGHTS, within
from keyrecon.records import Annotations, JointTracks


@dataclass(frozen=True)
class SwingPriorOptions:
    """How the swing prior is used on propagated joints."""

    left_handed: bool = False
    """The player swings left-handed."""
    stature: Annotated[float, BODY_HEIGHTS] = 1.75
    """Height of the player, metres; only for the perspective of a camera close by."""
    focal: Annotated[float, within(0.2, 20)] = 1.2
    """Focal length in picture widths, where nobody knows it."""
    spread: Annotated[float, within(0.001, 0.4)] = 0.02
    """How exactly surely placed joints are followed, player heights, as a standard deviation;
    smaller follows them more."""
    fit: FitOptions = field(default_factory=FitOptions)
    """How the swing is fitted."""
    timing: TimingOptions = field(default_factory=TimingOptions)
    """How the key postures are detected."""


STAND_IN_LENGTH = 0.5
"""Of the stand-in for the club, player heights: an iron's."""
LEAST_CONFIDENCE = 0.05
"""A joint of less confidence counts as one of this."""


def fit_swing_prior(
    tracks: JointTracks,
    annotations: Annotations,
    model: MotionModel,
    heights: Float[np.ndarray, "T"],
    video: Video,
    options: SwingPriorOptions = SwingPriorOptions(),
) -> Float[np.ndarray, "T 14 3"]:
    """Joints of the fitted swing in camera axes, metres.

    `heights` are the player's in every frame, px. Raises KeyreconError when the joints are not
    those of LSP14, do not swing, or lack what a swing is found by.
    """
    if annotations.skeleton.names != LSP14.names:
        raise KeyreconError("The golf prior needs the 14 joints of the default skeleton.")
    time, height = video.time, float(np.median(heights))
    fps = (len(time) - 1) / float(time[-1] - time[0])
    keys = find_key_frames(_stand_in(tracks.joints, height), height, fps, options.timing)
    observations = replace(
        _observations(tracks, annotations, height, video, options),
        keys=keys,
        phase=interpolate_times(keys, model.keys, len(time)),
    )
    right_handed = observations
    if options.left_handed:
        right_handed = mirror_observations(observations, video.width)
    start = _placing_frame(tracks.joints, keys[0])
    right_handed = replace(right_handed, initial=_initial_joints(right_handed.joints, start))
    initial = initial_fit(right_handed, model, size_body(options.stature))
    fit = fit_swing(right_handed, initial, fps, options.fit)
    return describe_fit(fit, observations, time).motion.points3d


def _observations(
    tracks: JointTracks,
    annotations: Annotations,
    height: float,
    video: Video,
    options: SwingPriorOptions,
) -> Observations:
    """Propagated joints and marks as observations of a swing."""
    frames = len(tracks.joints)
    spread = options.spread * height / np.sqrt(np.maximum(tracks.confidence, LEAST_CONFIDENCE))
    middle = np.array([(video.width - 1) / 2, (video.height - 1) / 2])
    return Observations(
        camera=Camera(options.focal * video.width, middle),
        initial=_initial_joints(tracks.joints, 0),
        height=height,
        stature=options.stature,
        joints=tracks.joints,
        spread=spread,
        club=np.full((frames, 2, 2), np.nan),
        club_spread=np.ones(frames),
        club_along=np.ones((frames, 2)),
        foreground=tuple(np.zeros((0, 2)) for _ in range(frames)),
        silhouette_distance=np.zeros((0, 2, 2)),
        matches=Matches(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2))),
        keys=np.zeros(4),
        phase=np.zeros(frames),
        left_handed=options.left_handed,
        marks=SwingMarks.of_joints(annotations.frames, annotations.joints),
    )


PLACING = tuple(
    LSP14.index(f"{side}_{name}") for name in ("hip", "knee", "ankle") for side in ("right", "left")
)
"""Joints that tell where a player stands and which way he faces."""


def _placing_frame(joints: Float[np.ndarray, "T 14 2"], near: float) -> int:
    """The frame nearest to one that has them."""
    known = np.flatnonzero(np.isfinite(joints[:, PLACING]).all(axis=(1, 2)))
    if not len(known):
        raise KeyreconError(
            "No frame has both hips, knees and ankles, by which the golf prior places the player; "
            "mark all six in one keyframe, best at the address."
        )
    return int(known[np.abs(known - near).argmin()])


def _initial_joints(joints: Float[np.ndarray, "T 14 2"], frame: int) -> InitialJoints:
    """The known joints of one frame."""
    known = np.isfinite(joints[frame]).all(axis=1)
    names = tuple(name for name, there in zip(LSP14.names, known, strict=True) if there)
    return InitialJoints(frame, names, joints[frame][known])


def _stand_in(joints: Float[np.ndarray, "T 14 2"], height: float) -> Club:
    """A club on from the forearms."""
    wrists, elbows = (
        joints[:, [LSP14.index(f"{side}_{name}") for side in ("right", "left")]]
        for name in ("wrist", "elbow")
    )
    hands, middle = _mean_known(wrists), _mean_known(elbows)
    ends = np.stack(
        [hands, hands + STAND_IN_LENGTH * height * unit_vectors(hands - middle, 1e-9)], axis=1
    )
    known = np.isfinite(ends).all(axis=(1, 2))
    if not known.any():
        raise KeyreconError(
            "No frame has a wrist and an elbow, by which the golf prior tells when the swing is; "
            "mark the arms in the keyframes, or use another prior."
        )
    frames = np.arange(len(ends))
    filled = [np.interp(frames, frames[known], c[known]) for c in ends.reshape(len(ends), 4).T]
    return Club(np.stack(filled, axis=1).reshape(-1, 2, 2), known, known)


def _mean_known(joints: Float[np.ndarray, "T n 2"]) -> Float[np.ndarray, "T 2"]:
    """Mean of the joints that are known; NaN where none is."""
    known = np.isfinite(joints)
    count = known.sum(axis=1)
    total = np.where(known, joints, 0.0).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
