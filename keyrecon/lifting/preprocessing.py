"""Joint tracks made ready for lifting: outliers rejected, gaps bridged, in units of length."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import gaussian_filter1d, median_filter

from keyrecon.lifting.limb_lengths import BodySize, LengthOptions, joint_noise
from keyrecon.records import Annotations, JointTracks, Shots

MAD_TO_SIGMA = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""
RAYLEIGH_MEDIAN = 1.177
"""Median length of a 2D vector over the standard deviation of its parts: sqrt(2 ln 2)."""
HUBER_DELTA = 1.5
"""Standard deviations from which the pull of a joint that may be an outlier grows no more: 96 %
efficient where errors are normal (Huber, Robust Statistics, 1981, has 1.345 for 95 %)."""


@dataclass(frozen=True, eq=False)
class KeyframeMarks:
    """What a person said of the joints of the annotated frames besides where they are."""

    frames: Int[np.ndarray, "K"]
    marked: Bool[np.ndarray, "K J"]
    visible: Bool[np.ndarray, "K J"]
    nearer: Int[np.ndarray, "K B"]
    """As in `Annotations`."""


def keyframe_marks(annotations: Annotations) -> KeyframeMarks:
    """The annotations without places: those are in the tracks."""
    marked = np.isfinite(annotations.joints[..., 0])
    return KeyframeMarks(annotations.frames, marked, annotations.visible, annotations.nearer)


def marked_joints(tracks: JointTracks, annotations: Annotations) -> Float[np.ndarray, "T J 2"]:
    """The tracks with every annotated joint where the person placed it."""
    joints = tracks.joints.copy()
    joints[annotations.frames] = np.where(
        np.isnan(annotations.joints), joints[annotations.frames], annotations.joints
    )
    return joints


@dataclass(frozen=True, eq=False)
class PreparedTracks:
    """Observed joints, in body heights."""

    joints: Float[np.ndarray, "T J 2"]
    """NaN where missing or rejected."""
    spread: Float[np.ndarray, "T J"]
    """Standard deviation of each joint, body heights."""
    huber_delta: Float[np.ndarray, "T J"]
    """Standard deviations beyond which a joint counts as an outlier; infinite where a person saw
    it."""

    def part(self, frames: slice) -> "PreparedTracks":
        """Some of the frames."""
        return PreparedTracks(self.joints[frames], self.spread[frames], self.huber_delta[frames])


def prepare_tracks(
    tracks: JointTracks,
    marks: KeyframeMarks,
    size: BodySize,
    fps: float,
    options: LengthOptions,
) -> PreparedTracks:
    """Joints and their spread in body heights; annotated ones are sharper.

    `tracks` have the annotated joints at their marks. Errors of propagated joints stay alike for a
    while: all of these frames together count once.
    """
    joints = tracks.joints / size.scale[:, None, None]
    alike = max(options.correlation * fps, 1.0)
    spread = np.sqrt(alike) * joint_noise(tracks.confidence, options)
    frames, marked = marks.frames, marks.marked
    spread[frames] = np.where(marked, options.click_noise, spread[frames])
    delta = np.full(spread.shape, HUBER_DELTA)
    delta[frames] = np.where(marked & marks.visible, np.inf, HUBER_DELTA)
    return PreparedTracks(joints, spread, delta)


def reject_spikes(
    residual: Float[np.ndarray, "T J 2"],
    window: int,
    limit: float,
    least: float = 1e-6,
    shots: Shots | None = None,
) -> Bool[np.ndarray, "T J"]:
    """Joints whose residual leaves its running median by more than `limit` robust deviations.

    The residual is the difference to any plausible motion, so that fast joints are not taken
    for outliers. A deviation is at least `least`: a foot that rests most of the time deviates by
    next to nothing, and its steps are no outliers. Joints that were missing are not counted. The
    median runs within each of the `shots`; None is one.
    """
    if shots is None:
        shots = Shots.between((), len(residual))

    def median(values: Float[np.ndarray, "T J 2"]) -> Float[np.ndarray, "T J 2"]:
        return median_filter(bridge_gaps(values), (window, 1, 1), mode="nearest")

    off = np.linalg.norm(residual - shots.in_each(median, residual), axis=-1)
    known = np.isfinite(off).any(axis=0)
    spread = np.ones(off.shape[1])
    spread[known] = MAD_TO_SIGMA * np.nanmedian(off[:, known], axis=0) / RAYLEIGH_MEDIAN
    return off > limit * np.maximum(spread, least)


def bridge_gaps(values: Float[np.ndarray, "T J D"]) -> Float[np.ndarray, "T J D"]:
    """Missing entries replaced by straight lines over time; 0 where a joint never shows."""
    frames = np.arange(len(values))
    filled = values.copy()
    for joint in range(values.shape[1]):
        known = np.isfinite(values[:, joint, 0])
        for axis in range(values.shape[2]):
            column = values[known, joint, axis]
            filled[:, joint, axis] = np.interp(frames, frames[known], column) if known.any() else 0
    return filled


def smooth_joints(
    joints: Float[np.ndarray, "T J 2"],
    initial: Float[np.ndarray, "T J 2"],
    sigma: float,
) -> Float[np.ndarray, "T J 2"]:
    """Joints without gaps: the initial motion plus the smoothed, bridged difference to it."""
    return initial + gaussian_filter1d(bridge_gaps(joints - initial), sigma, axis=0, mode="nearest")
