"""Projected gradient descent as printed (Section 6.2, Eq. 5 and 6, Fig. 9).

Joints move towards the observed ones, then onto the manifold of valid motions: constant bone
lengths and smooth paths. Each constraint is a `Projection`, positions -> positions. A second
projection of the lengths leaves the motion alone. Repeated inside the descent the low-pass bites
harder than once: with step lambda the loop's gain is lambda H / (1 - (1 - lambda) H), so its -3 dB
point lies where a single pass still has H = 0.707 / (lambda + 0.707 (1 - lambda)), 0.923 for
lambda = 0.2. The low-pass acts on the depth too, where no data pull: the longer the descent, the
flatter the motion.

What the text leaves open here (missing joints, the gradient's factor, how lengths are reset, the
low-pass, what comes first, when it has converged) and what was chosen: `choices.md`, rows of Eq. 6
and Fig. 9.
"""

import logging
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import brentq

from keyrecon.body import Skeleton

logger = logging.getLogger(__name__)

CONVERGED = 1e-5
"""Rms change of all coordinates in one iteration, body heights: a fiftieth of a millimetre."""

HIGHEST = 0.5
"""The highest frequency that a video has, cycles per frame."""
NO_LOW_PASS = 0.1
"""Standard deviation of a low-pass, frames, whose kernel is a single frame."""

Projection = Callable[[Float[np.ndarray, "T J 3"]], Float[np.ndarray, "T J 3"]]


def keep_lengths(lengths: Float[np.ndarray, "B"], skeleton: Skeleton) -> Projection:
    """Give every bone its length, from the root to the leaves; directions stay.

    A bone of no length takes the direction away from the camera.
    """

    def project(points: Float[np.ndarray, "T J 3"]) -> Float[np.ndarray, "T J 3"]:
        valid = points.copy()
        for bone, (parent, child) in enumerate(skeleton.bones):
            along = points[:, child] - points[:, parent]
            size = np.linalg.norm(along, axis=-1, keepdims=True)
            toward = np.where(size > 1e-12, along / np.maximum(size, 1e-12), [0.0, 0.0, 1.0])
            valid[:, child] = valid[:, parent] + lengths[bone] * toward
        return valid

    return project


def low_pass(sigma: float) -> Projection:
    """Gaussian filter over time with a standard deviation of `sigma` frames; zero phase."""

    def project(points: Float[np.ndarray, "T J 3"]) -> Float[np.ndarray, "T J 3"]:
        return gaussian_filter1d(points, sigma, axis=0, mode="nearest")

    return project


def sigma_at(sigma: float, frame_rate: float, step: float) -> float:
    """Standard deviation of a low-pass that cuts off at the same frequency at another frame rate.

    In frames at that rate; `frame_rate` in that for which `sigma` is given. The cut-off is that of
    the descent when it has converged with the `step`, -3 dB, found from the gain of the sampled
    kernel: at one frame and less that is not the gain of a Gaussian. A `sigma` that takes less
    than 3 dB of everything keeps its gain at the highest frequency. Where a video is too slow to
    have the cut-off frequency nothing is filtered.
    """
    if frame_rate == 1:
        return sigma
    least = np.sqrt(0.5) / (step + np.sqrt(0.5) * (1 - step))
    gain = max(least, _gain(sigma, HIGHEST))
    cut_off = HIGHEST if gain > least else brentq(lambda f: _gain(sigma, f) - gain, 0.0, HIGHEST)
    if cut_off >= HIGHEST * frame_rate:
        return NO_LOW_PASS
    return float(
        brentq(
            lambda width: _gain(width, cut_off / frame_rate) - gain,
            NO_LOW_PASS,
            2 * sigma * frame_rate + 1,
        )
    )


def _gain(sigma: float, frequency: float) -> float:
    """What one pass of the low-pass leaves of a frequency, cycles per frame."""
    reach = int(4 * sigma + 0.5) + 1
    impulse = np.zeros(2 * reach + 1)
    impulse[reach] = 1.0
    kernel = gaussian_filter1d(impulse, sigma, mode="constant")
    return float(kernel @ np.cos(2 * np.pi * frequency * np.arange(-reach, reach + 1)))


def descend(
    start: Float[np.ndarray, "T J 3"],
    observed: Float[np.ndarray, "T J 2"],
    projections: Sequence[Projection],
    step: float,
    rounds: int,
) -> Float[np.ndarray, "T J 3"]:
    """Steps 3 to 5: move joints towards the observed ones, then onto the constraints, again.

    Missing joints (NaN) do not pull, and nothing pulls along the depth. Positions in units of
    length. Says so where it has not converged after `rounds` iterations.
    """
    points = start
    for _ in range(rounds):
        gradient = np.nan_to_num(points[..., :2] - observed)
        moved = np.concatenate([points[..., :2] - step * gradient, points[..., 2:]], axis=-1)
        for project in projections:
            moved = project(moved)
        change = np.sqrt(((moved - points) ** 2).mean())
        points = moved
        if change < CONVERGED:
            return points
    logger.warning("The descent has not converged after %d iterations.", rounds)
    return points
