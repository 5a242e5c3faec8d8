"""A motion that follows tracked joints, signs and all.

Depth signs of every frame come from a Viterbi path, the trajectory from the solver. Two
passes: the first starts from smoothed tracks, the second from what the first found, where noise
is lower and key poses agree with their neighbours in time. Long motions are cut into
overlapping windows that are blended, so memory stays bounded and cost linear.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float, Int

from keyrecon.body import Skeleton
from keyrecon.lifting.depth_evidence import DepthSignOptions, at_rate
from keyrecon.lifting.depth_signs import track_depth_signs
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.lifting.preprocessing import PreparedTracks, smooth_joints
from keyrecon.lifting.priors.depth_model import DepthModel
from keyrecon.lifting.priors.exemplars import ExemplarPrior
from keyrecon.lifting.refinement import RefineOptions, refine_motion
from keyrecon.lifting.solver import MotionState
from keyrecon.lifting.taylor import KeyPoses, foreshorten_bones, lift_foreshortened
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.progress import Progress, silent

WINDOW, OVERLAP = 2000, 100
"""Frames solved together, and shared by neighbours."""
_SMOOTH_SECONDS = 0.03
"""Smoothing of the tracks that signs are read from; half of the fastest stroke's rise."""
_SMOOTHED, _FOLLOWED = 0.02, 0.015
"""Standard deviation of smoothed and of once followed joints, body heights."""


@dataclass(frozen=True)
class InitialMotionOptions:
    """Options of the two things done in turn."""

    flips: DepthSignOptions = field(default_factory=DepthSignOptions)
    refine: RefineOptions = field(default_factory=RefineOptions)


@dataclass(frozen=True, eq=False)
class InitialFigure:
    """Who moves: body, size and known poses."""

    skeleton: Skeleton
    size: BodySize
    keys: KeyPoses
    frames: Int[np.ndarray, "K"]
    """Frames of the key poses."""
    model: DepthModel | None = None
    """What depth bones usually have."""


def estimate_initial_motion(
    guide: MotionState,
    observed: PreparedTracks,
    figure: InitialFigure,
    fps: float,
    options: InitialMotionOptions,
    progress: Progress = silent,
) -> MotionState:
    """Root and bone directions in every frame; `guide` bridges what was not observed."""
    frames = len(guide.root)
    root = np.zeros_like(guide.root)
    directions = np.zeros_like(guide.directions)
    windows = list(_windows(frames))
    for first, last, weight in progress(windows, "Lifting to 3D", len(windows)):
        part = slice(first, last)
        solved = _fit_window(
            MotionState(guide.root[part], guide.directions[part]),
            observed.part(part),
            replace(figure, frames=figure.frames - first),
            fps,
            options,
        )
        root[part] += weight[:, None] * solved.root
        directions[part] += weight[:, None, None] * solved.directions
    return MotionState(root, unit_vectors(directions))


def _windows(frames: int) -> Iterator[tuple[int, int, Float[np.ndarray, "n"]]]:
    """First and last frame of each window, and weights that add up to 1 over all windows."""
    first = 0
    while True:
        last = frames if frames - first <= WINDOW + OVERLAP else first + WINDOW
        weight = np.ones(last - first)
        ramp = (np.arange(OVERLAP) + 0.5) / OVERLAP
        if first > 0:
            weight[:OVERLAP] = ramp
        if last < frames:
            weight[-OVERLAP:] = 1 - ramp
        yield first, last, weight
        if last == frames:
            return
        first = last - OVERLAP


def _fit_window(
    guide: MotionState,
    observed: PreparedTracks,
    figure: InitialFigure,
    fps: float,
    options: InitialMotionOptions,
) -> MotionState:
    skeleton, lengths = figure.skeleton, figure.size.lengths
    bridge = guide.points(lengths, skeleton)[..., :2]
    joints = smooth_joints(observed.joints, bridge, _SMOOTH_SECONDS * fps)
    keys = figure.keys.directions
    noise, flips = _SMOOTHED, at_rate(options.flips, fps)
    guided = lengths * guide.directions[..., 2]
    for _ in range(2):
        blur = np.full(joints.shape[:2], noise)
        shown = foreshorten_bones(joints, blur, lengths, skeleton, figure.model)
        votes = ExemplarPrior(
            lengths[:, None] * keys, figure.frames, figure.keys.confidence, guided, skeleton
        )
        signs = track_depth_signs(shown, votes, figure.size.breadths, skeleton, flips)
        start = MotionState(joints[:, skeleton.root], lift_foreshortened(shown, signs.sign))
        state = refine_motion(
            start, observed, guide.directions, figure.size, skeleton, fps, options.refine
        )
        joints, noise = state.points(lengths, skeleton)[..., :2], _FOLLOWED
        keys = _confirmed_keys(figure, state)
    return state


def _confirmed_keys(figure: InitialFigure, state: MotionState) -> Float[np.ndarray, "K B 3"]:
    """Key poses as the motion passes through them, with the signs that a person confirmed."""
    inside = (figure.frames >= 0) & (figure.frames < len(state.root))
    keys = figure.keys.directions.copy()
    settled = state.directions[figure.frames[inside]]
    nearer = figure.keys.nearer[inside]
    settled[..., 2] = np.where(nearer != 0, -nearer * np.abs(settled[..., 2]), settled[..., 2])
    keys[inside] = settled
    return keys
