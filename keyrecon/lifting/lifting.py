"""From joints in the picture to a motion in space: the recipe of Section 6.

Lengths and scale, depth signs of the keyframes from all frames, key poses, slerp between them (the
initial motion), rejection of outliers, signs of depth in every frame, refinement. Outliers that
remain are left to the robust loss of the refinement.
"""

from dataclasses import dataclass, field, replace
from functools import partial
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.body_models.depth_model import DepthModel
from keyrecon.errors import KeyreconError
from keyrecon.lifting.depth_evidence import DepthSignOptions
from keyrecon.lifting.interpolation import interpolate_poses
from keyrecon.lifting.keyframe_signs import infer_keyframe_signs
from keyrecon.lifting.length_correction import correct_lengths
from keyrecon.lifting.limb_lengths import (
    BodySize,
    LengthOptions,
    estimate_lengths,
)
from keyrecon.lifting.motion_fitting import PlayerModel, fit_motion
from keyrecon.lifting.perspective import (
    relative_distance,
    tracks_without_perspective,
    without_perspective,
)
from keyrecon.lifting.preprocessing import (
    PreparedTracks,
    bridge_gaps,
    keyframe_marks,
    marked_joints,
    prepare_tracks,
    reject_spikes,
)
from keyrecon.lifting.refinement import RefineOptions, descend_motion
from keyrecon.lifting.solver import MotionState
from keyrecon.lifting.taylor import lift_keyframes
from keyrecon.numerics.bone_directions import bone_vectors, pose_from_directions
from keyrecon.numerics.geometry import project_orthographic, unit_vectors
from keyrecon.progress import Progress, silent
from keyrecon.ranges import BODY_HEIGHTS, FIELDS_OF_VIEW
from keyrecon.records import Annotations, JointTracks, Keyframes, Shots

_SPIKE_SECONDS = 0.08
"""Half of the window of the median that spikes are held against: a spike is over within this. A
quarter more or less, others with it: at most 2.8 mm on eight clips."""
_SPIKE_LIMIT = 4.0
"""Robust deviations from the median beyond which a joint is an outlier. A quarter more or less,
others with it: at most 2.8 mm on eight clips."""
MIN_SPIKE_DEVIATION = 2.0
"""A deviation is at least this many times the noise of a sure track: as long as an error in both
directions of the image, sqrt 2, of a track of half the confidence."""


@dataclass(frozen=True)
class LiftOptions:
    """From the picture to space."""

    height: Annotated[float, BODY_HEIGHTS] | None = None
    """The same as --height.

    Stature of the player, metres; None gives a motion in body heights.
    """
    field_of_view: Annotated[float, FIELDS_OF_VIEW] | None = None
    """The same as --fov.

    Angle across the width of the picture, degrees; tells how strong perspective is. On four close
    views of one man (3 to 3.6 m, marked by eye and triangulated) PA-MPJPE is 57 mm instead of 68.
    """
    method: Literal["trajectory", "paper"] = "trajectory"
    """'trajectory' fits the whole motion robustly; 'paper' is projected gradient descent (Fig. 9).
    """
    lengths: LengthOptions = field(default_factory=LengthOptions)
    depth_signs: DepthSignOptions = field(default_factory=DepthSignOptions)
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
    signs: Int[np.ndarray, "K B"]
    """As `Annotations.nearer`, decided for every bone."""
    rejected: Bool[np.ndarray, "T J"]
    """Tracked joints that were taken for outliers."""


@dataclass(frozen=True, eq=False)
class LiftPriors:
    """What is known beside the tracks; None does without."""

    motion: Float[np.ndarray, "T J 3"] | None = None
    """Poses of a motion prior in camera axes, which take the place of the slerped key poses."""
    depth_model: DepthModel | None = None
    """Helps with the depth signs that nobody annotated."""
    shots: Shots | None = None
    """Nothing moves on from one to the next; None is one shot."""
    focal: Float[np.ndarray, "T"] | float | None = None
    """Focal length, px: takes perspective out of the picture. None is a picture from afar."""


def lift_motion(
    tracks: JointTracks,
    annotations: Annotations,
    keyframes: Keyframes,
    height_px: Float[np.ndarray, "T"],
    fps: float,
    priors: LiftPriors = LiftPriors(),
    options: LiftOptions = LiftOptions(),
    progress: Progress = silent,
) -> LiftResult:
    """Lift tracked joints to 3D with the help of annotated keyframes.

    `height_px` is the tracked standing height. The player has the same bones in all shots, and key
    poses serve all of them; the motion of each is fitted by itself. Where the focal length is known
    the motion is lifted twice, the second time without the perspective that the first tells of; the
    printed form knows no perspective. Raises KeyreconError without annotations.
    """
    _check(tracks, annotations)
    lift = partial(
        _lift_orthographic,
        keyframes=keyframes,
        height_px=height_px,
        fps=fps,
        priors=priors,
        options=options,
        progress=progress,
    )
    lifted = lift(tracks, annotations)
    if priors.focal is None or options.method == "paper":
        return lifted
    distance = relative_distance(lifted.points3d, lifted.scale, priors.focal)
    middle = lifted.points2d.mean(axis=1)
    lifted = lift(*tracks_without_perspective(tracks, annotations, middle, distance))
    return replace(lifted, points2d=without_perspective(lifted.points2d, middle, 1 / distance))


def _lift_orthographic(
    tracks: JointTracks,
    annotations: Annotations,
    keyframes: Keyframes,
    height_px: Float[np.ndarray, "T"],
    fps: float,
    priors: LiftPriors,
    options: LiftOptions,
    progress: Progress,
) -> LiftResult:
    """The lift by scaled orthography."""
    shots = priors.shots or Shots.between((), len(height_px))
    size = estimate_lengths(tracks, annotations, height_px, fps, options.lengths, shots)
    marks = keyframe_marks(annotations)
    tracks = replace(tracks, joints=marked_joints(tracks, annotations))
    if priors.depth_model is not None:
        rounds = options.lengths.corrections
        size = correct_lengths(size, tracks.joints, priors.depth_model, fps, rounds, shots)
    observed = prepare_tracks(tracks, marks, size, fps, options.lengths)
    signs = infer_keyframe_signs(
        observed, marks, size, shots, fps, options.depth_signs, priors.depth_model
    )
    keys = lift_keyframes(observed, marks, size, signs)
    directions = interpolate_poses(
        keys.directions, keys.frames, keyframes, observed.joints, size, shots
    )
    if priors.motion is not None:
        directions = unit_vectors(bone_vectors(priors.motion, size.skeleton))
    initial = _align_translation(directions, observed, size, shots)
    outliers = _find_outliers(observed, initial, size, shots, fps, options.lengths.track_noise)
    outliers[keys.frames] = False
    clean = replace(observed, joints=np.where(outliers[..., None], np.nan, observed.joints))
    player = PlayerModel(size, keys, priors.depth_model)
    if options.method == "paper":
        rotated = _align_rotation(initial.directions, clean, size)
        initial = _align_translation(rotated, clean, size, shots)
        state = descend_motion(initial, clean, size, shots, fps, options.refine)
    else:
        state = fit_motion(
            initial, clean, player, shots, fps, options.depth_signs, options.refine, progress
        )
    return _in_space(state, player, outliers, options.height)


def _in_space(
    state: MotionState,
    player: PlayerModel,
    outliers: Bool[np.ndarray, "T J"],
    height: float | None,
) -> LiftResult:
    """The motion in metres where the height is known, else in body heights."""
    size, keys = player.size, player.keys
    points = state.points(size.lengths, size.skeleton)
    metres = 1.0 if height is None else height
    return LiftResult(
        points3d=points * metres,
        points2d=project_orthographic(points, size.scale),
        scale=size.scale / metres,
        lengths=size.lengths * metres,
        signs=np.where(keys.directions[..., 2] > 0, -1, 1),
        rejected=outliers,
    )


def _find_outliers(
    observed: PreparedTracks,
    initial: MotionState,
    size: BodySize,
    shots: Shots,
    fps: float,
    track_noise: float,
) -> Bool[np.ndarray, "T J"]:
    """Tracked joints that leap away from where the initial motion puts them."""
    residual = observed.joints - initial.points(size.lengths, size.skeleton)[..., :2]
    window = 2 * round(_SPIKE_SECONDS * fps) + 1
    least = MIN_SPIKE_DEVIATION * track_noise
    return reject_spikes(residual, window, _SPIKE_LIMIT, least, shots)


def _align_translation(
    directions: Float[np.ndarray, "T B 3"], observed: PreparedTracks, size: BodySize, shots: Shots
) -> MotionState:
    """Poses shifted onto the observed joints, frame by frame (translation, step 1 of Fig. 9)."""
    flat = pose_from_directions(directions, size.lengths, size.skeleton)[..., :2]
    shift = np.full((len(flat), 1, 2), np.nan)
    offset = observed.joints - flat
    known = np.isfinite(offset[..., 0]).any(axis=1)
    shift[known, 0] = np.nanmedian(offset[known], axis=1)
    return MotionState(shots.in_each(bridge_gaps, shift)[:, 0], directions)


def _align_rotation(
    directions: Float[np.ndarray, "T B 3"], observed: PreparedTracks, size: BodySize
) -> Float[np.ndarray, "T B 3"]:
    """Poses turned in the image by the one angle that suits all frames (rotation, step 1)."""
    target = np.nan_to_num(bone_vectors(observed.joints, size.skeleton))
    flat = size.lengths[:, None] * directions[..., :2]
    along = (flat * target).sum()
    across = (flat[..., 0] * target[..., 1] - flat[..., 1] * target[..., 0]).sum()
    turn = np.exp(1j * np.arctan2(across, along))
    turned = (directions[..., 0] + 1j * directions[..., 1]) * turn
    return np.stack([turned.real, turned.imag, directions[..., 2]], axis=-1)


def _check(tracks: JointTracks, annotations: Annotations) -> None:
    if len(annotations.frames) == 0 or not np.isfinite(annotations.joints).any():
        raise KeyreconError("No keyframe is marked; mark joints with `keyrecon annotate` first.")
    if annotations.frames[-1] >= len(tracks.joints):
        raise KeyreconError(
            f"Frame {annotations.frames[-1]} is annotated, the video has {len(tracks.joints)}; "
            "the annotations belong to another video."
        )
