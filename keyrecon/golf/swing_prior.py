"""The swing behind joints that were followed by other means: the prior of the keyframe pipeline.

Keyframes give all joints, carried to every frame; there is no club. Between the hands and along the
forearms a stand-in for it is held, good enough to find the key postures. The fit of the whole swing
then gives poses that know what a swing looks like, from which lifting takes depth signs and what
nobody saw.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.fit.fitting import FitOptions, fit_swing
from keyrecon.golf.fit.initial_pose import estimate_initial_pose, start_state
from keyrecon.golf.fit.mirror import mirror_observations
from keyrecon.golf.fit.result import describe_fit
from keyrecon.golf.observe.club import Club
from keyrecon.golf.observe.swing_events import TimingOptions, find_key_frames, interpolate_times
from keyrecon.golf.prior.skeleton import size_body
from keyrecon.golf.records import Camera, Matches, MotionModel, Observations, SwingMarks
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.progress import Progress, silent
from keyrecon.records import Annotations, JointTracks


@dataclass(frozen=True)
class SwingPriorOptions:
    """How the swing prior is used on followed joints."""

    left_handed: bool = False
    """The player swings left-handed."""
    stature: float = 1.75
    """Metres; only for the perspective of a camera close by."""
    focal: float = 1.2
    """Focal length in picture widths, where nobody knows it."""
    spread: float = 0.02
    """Standard deviation of a sure joint, player heights; it grows as confidence falls."""
    fit: FitOptions = field(default_factory=FitOptions)
    """How the swing is fitted."""
    timing: TimingOptions = field(default_factory=TimingOptions)
    """How the key postures are found."""


NO_CLUB = 0.5
"""Length of the stand-in for the club, player heights."""


def fit_swing_prior(
    tracks: JointTracks,
    annotations: Annotations,
    model: MotionModel,
    seen: tuple[Float[np.ndarray, "T"], tuple[int, int]],
    time: Float[np.ndarray, "T"],
    options: SwingPriorOptions = SwingPriorOptions(),
    progress: Progress = silent,
) -> Float[np.ndarray, "T 14 3"]:
    """Joints of the fitted swing in camera axes, metres.

    `seen` is the player's height in every frame and the size of the pictures, px. Raises
    KeyreconError when the joints are not those of LSP14 or do not swing.
    """
    if annotations.skeleton.names != LSP14.names:
        raise KeyreconError("The golf prior needs the 14 joints of the default skeleton.")
    height, size = float(np.median(seen[0])), seen[1]
    fps = (len(time) - 1) / float(time[-1] - time[0])
    observations = _gather(tracks, annotations, (height, size), options)
    keys = find_key_frames(_stand_in(tracks.joints, height), height, fps, options.timing)
    mu = interpolate_times(keys, model.keys, len(time))
    start = int(np.clip(keys[0], 0, len(time) - 1))
    right_handed = observations
    if options.left_handed:
        right_handed = mirror_observations(observations, size[0])
    body = size_body(options.stature)
    address = right_handed.joints[start]
    known = np.isfinite(address).all(axis=1)
    clicked = {n: tuple(p) for n, p, k in zip(LSP14.names, address, known, strict=True) if k}
    placed = estimate_initial_pose(clicked, float(mu[start]), right_handed.camera, model, body)
    found = fit_swing(right_handed, model, body, start_state(placed, mu), fps, options.fit)
    return describe_fit(*found, observations, time, start).motion.points3d


def _gather(
    tracks: JointTracks,
    annotations: Annotations,
    player: tuple[float, tuple[int, int]],
    options: SwingPriorOptions,
) -> Observations:
    """Followed joints and marks as observations of a swing."""
    height, (width, tall) = player
    frames = len(tracks.joints)
    spread = options.spread * height / np.sqrt(np.maximum(tracks.confidence, LEAST_CONFIDENCE))
    return Observations(
        camera=Camera(options.focal * width, np.array([(width - 1) / 2, (tall - 1) / 2])),
        joints=tracks.joints,
        spread=spread,
        club=np.full((frames, 2, 2), np.nan),
        club_spread=np.ones(frames),
        club_along=np.ones((frames, 2)),
        foreground=tuple(np.zeros((0, 2)) for _ in range(frames)),
        away=(),
        matches=Matches(np.zeros(0, np.int64), np.zeros((0, 2)), np.zeros((0, 2))),
        keys=np.zeros(4),
        mu=np.zeros(frames),
        left_handed=options.left_handed,
        marks=SwingMarks(annotations.frames, annotations.joints),
    )


LEAST_CONFIDENCE = 0.05


def _stand_in(joints: Float[np.ndarray, "T 14 2"], height: float) -> Club:
    """A club on from the forearms."""
    wrists, elbows = (
        joints[:, [LSP14.index(f"{side}_{name}") for side in ("right", "left")]]
        for name in ("wrist", "elbow")
    )
    hands, middle = np.nanmean(wrists, axis=1), np.nanmean(elbows, axis=1)
    ends = np.stack([hands, hands + NO_CLUB * height * unit_vectors(hands - middle, 1e-9)], axis=1)
    known = np.isfinite(ends).all(axis=(1, 2))
    frames = np.arange(len(ends))
    filled = [np.interp(frames, frames[known], c[known]) for c in ends.reshape(len(ends), 4).T]
    return Club(np.stack(filled, axis=1).reshape(-1, 2, 2), known, known)
