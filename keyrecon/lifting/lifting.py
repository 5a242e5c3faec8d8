"""From joints in the picture to a motion in space: the recipe of Section 6.

Lengths and scale, depth signs of the keyframes from all frames, key poses, slerp between them,
rejection of slips, signs of depth in every frame, refinement. Slips that remain are left to the
robust loss of the refinement.
"""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.body import Skeleton
from keyrecon.errors import KeyreconError
from keyrecon.lifting.bone_directions import bone_vectors, pose_from_directions
from keyrecon.lifting.depth_evidence import DepthSignOptions
from keyrecon.lifting.initial_motion import (
    InitialFigure,
    InitialMotionOptions,
    estimate_initial_motion,
)
from keyrecon.lifting.interpolation import Interpolation, interpolate_poses
from keyrecon.lifting.keyframe_signs import infer_keyframe_signs
from keyrecon.lifting.limb_lengths import (
    BodySize,
    LengthOptions,
    estimate_lengths,
    joint_noise,
    marked_joints,
)
from keyrecon.lifting.preprocessing import HUBER_DELTA, PreparedTracks, bridge_gaps, reject_spikes
from keyrecon.lifting.priors.depth_model import DepthModel
from keyrecon.lifting.refinement import RefineOptions, descend_motion
from keyrecon.lifting.solver import MotionState
from keyrecon.lifting.taylor import lift_keyframes
from keyrecon.numerics.geometry import project_orthographic, unit_vectors
from keyrecon.progress import Progress, silent
from keyrecon.records import Annotations, JointTracks, Keyframes

_SPIKE_FRAMES = 9
"""A joint that slips comes back within half of this."""


@dataclass(frozen=True)
class LiftOptions:
    """From the picture to space."""

    height: float | None = None
    """Stature of the player, metres; None gives a motion in body heights."""
    method: Literal["trajectory", "paper"] = "trajectory"
    """'trajectory': robust fit of bone directions; 'paper': projected gradient descent (Fig. 9)."""
    lengths: LengthOptions = field(default_factory=LengthOptions)
    flips: DepthSignOptions = field(default_factory=DepthSignOptions)
    refine: RefineOptions = field(default_factory=RefineOptions)


@dataclass(frozen=True, eq=False)
class LiftResult:
    """A motion in space and how it came about."""

    points3d: Float[np.ndarray, "T J 3"]
    """Camera axes, metres or body heights; the depth of the root is 0."""
    points2d: Float[np.ndarray, "T J 2"]
    """Projection of `points3d`, px."""
    scale: Float[np.ndarray, "T"]
    """px per unit"""
    lengths: Float[np.ndarray, "B"]
    """Bone lengths, metres or body heights."""
    key_poses: Float[np.ndarray, "K J 3"]
    """Poses of the keyframes relative to the root, metres or body heights."""
    signs: Int[np.ndarray, "K B"]
    """As `Annotations.nearer`, decided for every bone."""
    sign_margin: Float[np.ndarray, "K B"]
    """Probability of each sign, 0.5-1."""
    rejected: Bool[np.ndarray, "T J"]
    """Tracked joints that were taken for slips."""
    upper_controls: Int[np.ndarray, "u"]
    """Control frames of the upper body (Section 6.1)."""
    lower_controls: Int[np.ndarray, "l"]


def lift_motion(  # noqa: PLR0913
    tracks: JointTracks,
    annotations: Annotations,
    keyframes: Keyframes,
    height_px: Float[np.ndarray, "T"],
    fps: float,
    expected: Float[np.ndarray, "T J 3"] | None = None,
    model: DepthModel | None = None,
    options: LiftOptions = LiftOptions(),
    progress: Progress = silent,
) -> LiftResult:
    """Lift tracked joints to 3D with the help of annotated keyframes.

    `height_px` is the tracked standing height. `expected`, poses of a motion prior in camera axes,
    take the place of the slerped key poses; `model` helps with the depth signs that nobody gave.
    Raises KeyreconError without annotations.
    """
    _check(tracks, annotations)
    skeleton = annotations.skeleton
    size = estimate_lengths(tracks, annotations, height_px, fps, options.lengths)
    observed = _preprocess(tracks, annotations, size, fps, options)
    signs = infer_keyframe_signs(observed, annotations, size, fps, options.flips, model)
    keys = lift_keyframes(observed, annotations, size, options.flips, signs)
    slerped = interpolate_poses(
        keys.directions, annotations.frames, keyframes, observed.joints, size.lengths, skeleton
    )
    between = slerped.directions if expected is None else _directions(expected, skeleton)
    guide = _place(between, observed, size, skeleton)
    slips = _find_outliers(observed, guide, size, annotations, options)
    clean = replace(observed, joints=np.where(slips[..., None], np.nan, observed.joints))
    figure = InitialFigure(skeleton, size, keys, annotations.frames, model)
    if options.method == "paper":
        upright = _rolled(guide.directions, clean, size, skeleton)
        guide = _place(upright, clean, size, skeleton)
        state = descend_motion(guide, clean, size, skeleton, options.refine)
    else:
        follow = InitialMotionOptions(options.flips, options.refine)
        state = estimate_initial_motion(guide, clean, figure, fps, follow, progress)
    return _in_space(state, figure, slerped, slips, options.height)


def _in_space(
    state: MotionState,
    figure: InitialFigure,
    slerped: Interpolation,
    slips: Bool[np.ndarray, "T J"],
    height: float | None,
) -> LiftResult:
    """The motion in metres where the height is known, else in body heights."""
    size, keys = figure.size, figure.keys
    points = state.points(size.lengths, figure.skeleton)
    key_poses = pose_from_directions(keys.directions, size.lengths, figure.skeleton)
    metres = 1.0 if height is None else height
    return LiftResult(
        points3d=points * metres,
        points2d=project_orthographic(points, size.scale),
        scale=size.scale / metres,
        lengths=size.lengths * metres,
        key_poses=key_poses * metres,
        signs=np.where(keys.directions[..., 2] > 0, -1, 1),
        sign_margin=keys.probability,
        rejected=slips,
        upper_controls=slerped.upper,
        lower_controls=slerped.lower,
    )


def _find_outliers(
    observed: PreparedTracks,
    guide: MotionState,
    size: BodySize,
    annotations: Annotations,
    options: LiftOptions,
) -> Bool[np.ndarray, "T J"]:
    """Tracked joints that leap away from where the guide puts them; marks are never slips."""
    residual = observed.joints - guide.points(size.lengths, annotations.skeleton)[..., :2]
    slips = reject_spikes(residual, _SPIKE_FRAMES, 4.0, 1.4 * options.lengths.track_noise)
    slips[annotations.frames] = False
    return slips


def _directions(
    points: Float[np.ndarray, "T J 3"], skeleton: Skeleton
) -> Float[np.ndarray, "T B 3"]:
    return unit_vectors(bone_vectors(points, skeleton))


def _place(
    directions: Float[np.ndarray, "T B 3"],
    observed: PreparedTracks,
    size: BodySize,
    skeleton: Skeleton,
) -> MotionState:
    """Poses shifted onto the observed joints, frame by frame (translation, step 1 of Fig. 9)."""
    flat = pose_from_directions(directions, size.lengths, skeleton)[..., :2]
    shift = np.full((len(flat), 1, 2), np.nan)
    offset = observed.joints - flat
    known = np.isfinite(offset[..., 0]).any(axis=1)
    shift[known, 0] = np.nanmedian(offset[known], axis=1)
    return MotionState(bridge_gaps(shift)[:, 0], directions)


def _rolled(
    directions: Float[np.ndarray, "T B 3"],
    observed: PreparedTracks,
    size: BodySize,
    skeleton: Skeleton,
) -> Float[np.ndarray, "T B 3"]:
    """Poses turned in the image by the one angle that suits all frames (rotation, step 1)."""
    shown = np.nan_to_num(bone_vectors(observed.joints, skeleton))
    flat = size.lengths[:, None] * directions[..., :2]
    along = (flat * shown).sum()
    across = (flat[..., 0] * shown[..., 1] - flat[..., 1] * shown[..., 0]).sum()
    turn = np.exp(1j * np.arctan2(across, along))
    turned = (directions[..., 0] + 1j * directions[..., 1]) * turn
    return np.stack([turned.real, turned.imag, directions[..., 2]], axis=-1)


def _preprocess(
    tracks: JointTracks,
    annotations: Annotations,
    size: BodySize,
    fps: float,
    options: LiftOptions,
) -> PreparedTracks:
    """Joints and their spread in body heights; annotated ones are sharper.

    Errors of propagated joints stay alike for a while: all of these frames together count once.
    """
    joints = marked_joints(tracks, annotations) / size.scale[:, None, None]
    alike = max(options.lengths.correlation * fps, 1.0)
    spread = np.sqrt(alike) * joint_noise(tracks.confidence, options.lengths)
    marked = np.isfinite(annotations.joints[..., 0])
    spread[annotations.frames] = np.where(
        marked, options.lengths.click_noise, spread[annotations.frames]
    )
    knee = np.full(spread.shape, HUBER_DELTA)
    knee[annotations.frames] = np.where(marked & annotations.visible, np.inf, HUBER_DELTA)
    return PreparedTracks(joints, spread, knee)


def _check(tracks: JointTracks, annotations: Annotations) -> None:
    if len(annotations.frames) == 0 or not np.isfinite(annotations.joints).any():
        raise KeyreconError("No keyframe is annotated; mark joints with `keyrecon annotate` first.")
    if annotations.frames[-1] >= len(tracks.joints):
        raise KeyreconError(
            f"Frame {annotations.frames[-1]} is annotated, the video has {len(tracks.joints)}; "
            "the annotations belong to another video."
        )
