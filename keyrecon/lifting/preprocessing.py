"""Joint tracks made ready for lifting: slips rejected, gaps bridged, in units of length."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d, median_filter

MAD_TO_SIGMA = 1.4826
HUBER_DELTA = 1.5
"""Standard deviations from which the pull of a joint that may have slipped grows no more."""


@dataclass(frozen=True, eq=False)
class PreparedTracks:
    """Joints as they are to be met, in body heights."""

    joints: Float[np.ndarray, "T J 2"]
    """NaN where missing or rejected."""
    spread: Float[np.ndarray, "T J"]
    """Standard deviation of each joint, body heights."""
    knee: Float[np.ndarray, "T J"]
    """Standard deviations beyond which a joint may have slipped; infinite where a person saw it."""

    def part(self, frames: slice) -> "PreparedTracks":
        """Some of the frames."""
        return PreparedTracks(self.joints[frames], self.spread[frames], self.knee[frames])


def reject_spikes(
    residual: Float[np.ndarray, "T J 2"], window: int, limit: float, least: float = 1e-6
) -> Bool[np.ndarray, "T J"]:
    """Joints whose residual leaves its running median by more than `limit` robust deviations.

    The residual is the difference to any plausible motion, so that fast joints are not taken
    for slips. A deviation is at least `least`: a foot that rests most of the time deviates by
    next to nothing, and its steps are no slips. Joints that were missing are not counted.
    """
    bridged = bridge_gaps(residual)
    off = np.linalg.norm(residual - median_filter(bridged, (window, 1, 1), mode="nearest"), axis=-1)
    known = np.isfinite(off).any(axis=0)
    spread = np.ones(off.shape[1])
    spread[known] = MAD_TO_SIGMA * np.nanmedian(off[:, known], axis=0) / 1.177  # of a 2D length
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
    guide: Float[np.ndarray, "T J 2"],
    sigma: float,
) -> Float[np.ndarray, "T J 2"]:
    """Joints without gaps: the guide's motion plus the smoothed, bridged difference to it."""
    return guide + gaussian_filter1d(bridge_gaps(joints - guide), sigma, axis=0, mode="nearest")
