"""From joints in the picture to a motion in space: the recipe of Section 6.

Lengths and scale, key poses, slerp between them, rejection of slips, signs of depth in every
frame, refinement; then slips are rejected once more against the refined motion and it is
refined again.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.errors import KeyreconError
from keyrecon.lifting.chain import pose_from_directions
from keyrecon.lifting.flips import FlipOptions, Votes, choose_signs, follow_signs
from keyrecon.lifting.interpolate import interpolate_poses
from keyrecon.lifting.lengths import BodySize, LengthOptions, estimate_lengths, marked_joints
from keyrecon.lifting.observe import reject_spikes, smooth_joints
from keyrecon.lifting.refine import Observed, RefineOptions, refine_motion
from keyrecon.lifting.solver import State
from keyrecon.lifting.taylor import lift_shown, show_bones
from keyrecon.progress import Progress, silent
from keyrecon.records import Annotations, JointTracks, Keyframes


@dataclass(frozen=True)
class LiftOptions:
    """From the picture to space."""

    height: float | None = None
    """Stature of the player, metres; None gives a motion in body heights."""
    lengths: LengthOptions = field(default_factory=LengthOptions)
    flips: FlipOptions = field(default_factory=FlipOptions)
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
    offset: Float[np.ndarray, "T 2"]
    """Where the origin of `points3d` projects, px."""
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


def lift_motion(
    tracks: JointTracks,
    annotations: Annotations,
    keyframes: Keyframes,
    height_px: Float[np.ndarray, "T"],
    fps: float,
    options: LiftOptions = LiftOptions(),
    progress: Progress = silent,
) -> LiftResult:
    """Lift tracked joints to 3D with the help of annotated keyframes.

    `height_px` is the tracked standing height. Raises KeyreconError without annotations.
    """
    _check(tracks, annotations)
    skeleton = annotations.skeleton
    size = estimate_lengths(tracks, annotations, height_px, fps, options.lengths)
    observed = _observe(tracks, annotations, size, options)
    key_directions, signs, margin = lift_keyframes(observed, annotations, size, options)
    slerped = interpolate_poses(
        key_directions, annotations.frames, keyframes, observed.joints, size.lengths, skeleton
    )
    state, rejected = _fit(observed, slerped, key_directions, size, annotations, fps, options)
    points = pose_from_directions(state.directions, size.lengths, skeleton)
    points[..., :2] += state.root[:, None]
    unit = 1.0 if options.height is None else options.height
    return LiftResult(
        points3d=points * unit,
        points2d=points[..., :2] * size.scale[:, None, None],
        scale=size.scale / unit,
        offset=np.zeros((len(points), 2)),
        lengths=size.lengths * unit,
        key_poses=pose_from_directions(key_directions, size.lengths, skeleton) * unit,
        signs=-signs,
        sign_margin=margin,
        rejected=rejected,
        upper_controls=slerped.upper,
        lower_controls=slerped.lower,
    )


def lift_keyframes(
    observed: Observed, annotations: Annotations, size: BodySize, options: LiftOptions
) -> tuple[Float[np.ndarray, "K B 3"], Int[np.ndarray, "K B"], Float[np.ndarray, "K B"]]:
    """Bone directions of the annotated frames, signs of dz, and how sure these are."""
    frames = annotations.frames
    shown = show_bones(
        observed.joints[frames], observed.spread[frames], size.lengths, annotations.skeleton
    )
    signs = choose_signs(
        shown, annotations.nearer, size.breadths, annotations.skeleton, options.flips
    )
    return lift_shown(shown, signs.sign), signs.sign, signs.probability


def _fit(
    observed: Observed,
    slerped,
    key_directions: Float[np.ndarray, "K B 3"],
    size: BodySize,
    annotations: Annotations,
    fps: float,
    options: LiftOptions,
) -> tuple[State, Bool[np.ndarray, "T J"]]:
    skeleton = annotations.skeleton
    guide = pose_from_directions(slerped.directions, size.lengths, skeleton)[..., :2]
    guide = guide + _root(observed.joints - guide)[:, None]
    rejected = reject_spikes(observed.joints - guide, 9, 4.0)
    rejected[annotations.frames] = False
    clean = _without(observed, rejected)
    if options.refine.method == "paper":
        start = State(guide[:, skeleton.root], slerped.directions)
        return refine_motion(start, clean, size, skeleton, fps, options.refine), rejected
    smooth = smooth_joints(clean.joints, guide, 1.5)
    shown = show_bones(smooth, np.minimum(observed.spread, 0.02), size.lengths, skeleton)
    votes = Votes(size.lengths[:, None] * key_directions, annotations.frames, skeleton)
    signs = follow_signs(shown, votes, size.breadths, skeleton, options.flips)
    start = State(smooth[:, skeleton.root], lift_shown(shown, signs.sign))
    return refine_motion(start, clean, size, skeleton, fps, options.refine), rejected


def _observe(
    tracks: JointTracks, annotations: Annotations, size: BodySize, options: LiftOptions
) -> Observed:
    joints = marked_joints(tracks, annotations) / size.scale[:, None, None]
    spread = options.lengths.track_noise / np.sqrt(np.clip(tracks.confidence, 0.05, 1.0))
    marked = np.isfinite(annotations.joints[..., 0])
    spread[annotations.frames] = np.where(
        marked, options.lengths.click_noise, spread[annotations.frames]
    )
    return Observed(joints, spread)


def _without(observed: Observed, rejected: Bool[np.ndarray, "T J"]) -> Observed:
    return Observed(np.where(rejected[..., None], np.nan, observed.joints), observed.spread)


def _root(offset: Float[np.ndarray, "T J 2"]) -> Float[np.ndarray, "T 2"]:
    """Median shift of all joints, bridged where none is known."""
    with np.errstate(all="ignore"):
        known = np.isfinite(offset[..., 0]).any(axis=1)
    shift = np.full((len(offset), 2), np.nan)
    shift[known] = np.nanmedian(offset[known], axis=1)
    frames = np.arange(len(offset))
    return np.stack([np.interp(frames, frames[known], shift[known, i]) for i in range(2)], axis=1)


def _check(tracks: JointTracks, annotations: Annotations) -> None:
    if len(annotations.frames) == 0 or not np.isfinite(annotations.joints).any():
        raise KeyreconError("No keyframe is annotated; mark joints with `keyrecon annotate` first.")
    if annotations.frames[-1] >= len(tracks.joints):
        raise KeyreconError(
            f"Frame {annotations.frames[-1]} is annotated, the video has {len(tracks.joints)}; "
            "the annotations belong to another video."
        )
