"""The motion fitted to tracked joints, depth signs and all.

Depth signs of every frame come from a Viterbi path, the trajectory from the solver. Two
passes: the first starts from smoothed tracks, the second from the first one's motion, where noise
is lower and key poses agree with their neighbours in time. Long motions are cut into
overlapping windows that are blended, so memory stays bounded and cost linear.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from keyrecon.body_models.depth_model import DepthModel, expected_depth
from keyrecon.lifting.depth_evidence import DepthSignOptions, ForeshortenedBones, at_rate
from keyrecon.lifting.depth_signs import DepthSigns, track_depth_signs
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.lifting.preprocessing import PreparedTracks, smooth_joints
from keyrecon.lifting.priors.exemplars import ExemplarPrior
from keyrecon.lifting.refinement import RefineOptions, refine_motion
from keyrecon.lifting.solver import MotionState
from keyrecon.lifting.taylor import KeyPoses, foreshorten_bones, lift_foreshortened
from keyrecon.numerics.bone_directions import bone_vectors
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.progress import Progress, silent
from keyrecon.records import Shots

WINDOW_FRAMES = 2000
"""Frames solved together. A quarter more or less, others with it: at most 2.8 mm on eight clips."""
OVERLAP_FRAMES, OVERLAP_SECONDS = 100, 2.0
"""Frames and seconds that neighbouring windows share at least: the depth model is shown .4 s to
both sides of a frame, and at a window's end nothing of one side. Frames a quarter more or less,
others with them: at most 2.8 mm on eight clips."""
_SMOOTHING_SECONDS = 0.03
"""Smoothing of the tracks from which signs are inferred; half of the fastest stroke's rise. A
quarter more or less, others with it: at most 2.8 mm on eight clips."""
_SMOOTHED_NOISE, _FITTED_NOISE = 0.02, 0.015
"""Standard deviation of smoothed and of once fitted joints, body heights. A quarter more or less,
others with them: at most 2.8 mm on eight clips."""


@dataclass(frozen=True, eq=False)
class PlayerModel:
    """Who moves: body size, key poses and the depth model."""

    size: BodySize
    keys: KeyPoses
    depth_model: DepthModel | None = None


def fit_motion(
    initial: MotionState,
    observed: PreparedTracks,
    player: PlayerModel,
    shots: Shots,
    fps: float,
    sign_options: DepthSignOptions = DepthSignOptions(),
    refine_options: RefineOptions = RefineOptions(),
    progress: Progress = silent,
) -> MotionState:
    """Root and bone directions in every frame; `initial` bridges what was not observed.

    Windows overlap within a shot, and end where it does.
    """
    root = np.zeros_like(initial.root)
    directions = np.zeros_like(initial.directions)
    windows = [window for shot in shots.parts for window in _windows(shot, fps)]
    for window in progress(windows, "Lifting to 3D", len(windows)):
        part, keys = slice(window.first, window.last), player.keys
        fitted = _fit_window(
            MotionState(initial.root[part], initial.directions[part]),
            observed.part(part),
            replace(player, keys=replace(keys, frames=keys.frames - window.first)),
            fps,
            sign_options,
            refine_options,
        )
        root[part] += window.weight[:, None] * fitted.root
        directions[part] += window.weight[:, None, None] * fitted.directions
    return MotionState(root, unit_vectors(directions))


@dataclass(frozen=True, eq=False)
class _Window:
    """Frames fitted together, and their weights, which add up to 1 over all windows."""

    first: int
    last: int
    weight: Float[np.ndarray, "n"]


def _windows(shot: slice, fps: float) -> Iterator[_Window]:
    """Windows of a shot, which share half of their frames at most."""
    lasting = max(OVERLAP_FRAMES, round(OVERLAP_SECONDS * fps))
    first, overlap = shot.start, min(lasting, WINDOW_FRAMES // 2)
    while True:
        last = shot.stop
        if shot.stop - first > WINDOW_FRAMES + overlap:
            last = first + WINDOW_FRAMES
        weight = np.ones(last - first)
        ramp = (np.arange(overlap) + 0.5) / overlap
        if first > shot.start:
            weight[:overlap] = ramp
        if last < shot.stop:
            weight[-overlap:] = 1 - ramp
        yield _Window(first, last, weight)
        if last == shot.stop:
            return
        first = last - overlap


def _fit_window(
    initial: MotionState,
    observed: PreparedTracks,
    player: PlayerModel,
    fps: float,
    sign_options: DepthSignOptions,
    refine_options: RefineOptions,
) -> MotionState:
    size, keys = player.size, player.keys
    skeleton, lengths = size.skeleton, size.lengths
    bridge = initial.points(lengths, skeleton)[..., :2]
    joints = smooth_joints(observed.joints, bridge, _SMOOTHING_SECONDS * fps)
    directions = keys.directions
    noise, sign_options = _SMOOTHED_NOISE, at_rate(sign_options, fps)
    initial_depth = lengths * initial.directions[..., 2]
    for _ in range(2):
        blur = np.full(joints.shape[:2], noise)
        vectors = bone_vectors(joints, skeleton)
        bones = replace(
            foreshorten_bones(joints, blur, lengths, skeleton),
            expected_depth=expected_depth(player.depth_model, vectors, lengths, skeleton, fps),
        )
        exemplars = ExemplarPrior(
            lengths[:, None] * directions, keys.frames, keys.confidence, initial_depth, skeleton
        )
        signs = track_depth_signs(bones, exemplars, size.breadths, skeleton, sign_options)
        start = MotionState(joints[:, skeleton.root], _likely_directions(bones, signs, lengths))
        state = refine_motion(
            start,
            observed,
            initial.directions,
            size,
            fps,
            refine_options,
            bones.expected_depth / lengths,
        )
        joints, noise = state.points(lengths, skeleton)[..., :2], _FITTED_NOISE
        directions = _fitted_key_directions(keys, state)
    return state


def _likely_directions(
    bones: ForeshortenedBones, signs: DepthSigns, lengths: Float[np.ndarray, "B"]
) -> Float[np.ndarray, "T B 3"]:
    """Directions from foreshortening so far as the sign of depth is sure, else as expected.

    Eight captures that are projected, with and without signs from a person: PA-MPJPE 37.4 and 41.8
    to 36.9 and 41.3 mm, N-MPJPE 52.6 and 57.8 to 51.9 and 57.1.
    """
    signed = lift_foreshortened(bones, signs.sign)
    known = np.isfinite(bones.expected_depth)
    sure = np.where(known, 2 * signs.probability - 1, 1.0)
    expected = np.where(known, bones.expected_depth, 0.0) / lengths
    depth = sure * signed[..., 2] + (1 - sure) * expected
    return unit_vectors(np.concatenate([signed[..., :2], depth[..., None]], axis=-1))


def _fitted_key_directions(keys: KeyPoses, state: MotionState) -> Float[np.ndarray, "K B 3"]:
    """Key poses as the motion passes through them, with the signs that a person annotated."""
    inside = (keys.frames >= 0) & (keys.frames < len(state.root))
    directions = keys.directions.copy()
    fitted = state.directions[keys.frames[inside]]
    nearer = keys.nearer[inside]
    fitted[..., 2] = np.where(nearer != 0, -nearer * np.abs(fitted[..., 2]), fitted[..., 2])
    directions[inside] = fitted
    return directions
