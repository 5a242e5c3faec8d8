"""How far a motion is from the truth, as the literature measures it.

Points are (T, J, 3) or (T, J, 2); truth that is NaN is left out of every mean, while an estimate
that is NaN where the truth is known counts as an error of unknown size and makes the mean NaN
(PCK counts it as a miss). Errors in space are in the unit of the points; `evaluate_motion`
gives millimetres.

- MPJPE: mean distance per joint with both roots at the origin (Ionescu et al., Human3.6M,
  PAMI 2014, protocol 1).
- N-MPJPE: the same after the best scale of every frame (Rhodin et al., CVPR 2018).
- PA-MPJPE: the same after the best similarity of every frame, without mirroring (protocol 2,
  "reconstruction error").
- Acceleration error: distance between second differences, per frame squared, with the root at
  the origin (Kanazawa et al., HMMR, CVPR 2019). Of several shots within each of them.
- PCK: share of joints in the picture closer to the truth than 0.2 of the torso, the distance
  from right hip to left shoulder in that frame (Sapp and Taskar, MODEC, CVPR 2013).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.errors import KeyreconError
from keyrecon.reading import check_numbers, read_arrays, reading
from keyrecon.records import Motion

Points = Float[np.ndarray, "T J 3"]
Pixels = Float[np.ndarray, "T J 2"]

LEAST_POINTS = 3
"""Points that a similarity needs; frames with fewer known ones are left out of PA-MPJPE."""


@dataclass(frozen=True)
class Scores:
    """Accuracy of a motion."""

    mpjpe: float
    """mm"""
    n_mpjpe: float
    """mm"""
    pa_mpjpe: float
    """mm"""
    acceleration: float
    """mm/frame^2"""
    pck: float
    """Share of joints within 0.2 torso lengths in the picture, 0-1."""
    median_px: float
    """Median distance in the picture, px."""
    limb_variation: float
    """Standard deviation of a bone's length over its mean, mean of all bones, 0-1."""
    limb_variation_max: float
    """The same of the worst bone."""
    by_joint: Mapping[str, float]
    """MPJPE of every joint, mm."""
    frames: int
    scaled: bool
    """Whether the motion, in body heights, was scaled to the truth as a whole first."""


def joint_errors(points: Points, truth: Points, root: Sequence[int]) -> Float[np.ndarray, "T J"]:
    """Distances with the mean of the `root` joints at the origin; NaN where truth is unknown."""
    return np.linalg.norm(_centred(points, root) - _centred(truth, root), axis=2)


def mpjpe(points: Points, truth: Points, root: Sequence[int]) -> float:
    """Mean per-joint position error, root-aligned, in the unit of the points."""
    return _mean(joint_errors(points, truth, root), _known(truth, root))


def n_mpjpe(points: Points, truth: Points, root: Sequence[int]) -> float:
    """Mean per-joint position error after the best scale of every frame, root-aligned."""
    ours, theirs = _centred(points, root), _centred(truth, root)
    scale = _best_scale(ours, theirs, axes=(1, 2))
    return _mean(np.linalg.norm(scale * ours - theirs, axis=2), _known(truth, root))


def pa_mpjpe(points: Points, truth: Points) -> float:
    """Mean per-joint position error after the best similarity of every frame."""
    known = np.isfinite(truth).all(axis=2)
    enough = known.sum(axis=1) >= LEAST_POINTS
    if not enough.any():
        return float("nan")
    if not np.isfinite(points[known & enough[:, None]]).all():
        return float("nan")
    aligned = align_similarity(points[enough], truth[enough])
    return float(np.linalg.norm(aligned - truth[enough], axis=2)[known[enough]].mean())


def align_similarity(points: Points, truth: Points) -> Points:
    """`points` moved on `truth` by each frame's best rotation, scale and shift (Umeyama 1991)."""
    known = np.isfinite(truth).all(axis=2, keepdims=True)
    weight = known / known.sum(axis=1, keepdims=True)
    ours, theirs = np.where(known, points, 0), np.where(known, truth, 0)
    our_mean = (weight * ours).sum(axis=1, keepdims=True)
    their_mean = (weight * theirs).sum(axis=1, keepdims=True)
    ours, theirs = known * (ours - our_mean), known * (theirs - their_mean)
    left, spread, right = np.linalg.svd(np.swapaxes(theirs, 1, 2) @ ours)
    # The last axis is turned where the best orthogonal matrix would mirror the figure.
    signs = np.ones_like(spread)
    signs[:, 2] = np.sign(np.linalg.det(left @ right))
    turn = (left * signs[:, None]) @ right
    size = (ours**2).sum(axis=(1, 2))
    scale = (spread * signs).sum(axis=1) / np.where(size > 0, size, 1)
    moved = (points - our_mean) @ np.swapaxes(turn, 1, 2)
    return scale[:, None, None] * moved + their_mean


def acceleration_error(
    points: Points, truth: Points, root: Sequence[int], parts: Sequence[slice] = (slice(None),)
) -> float:
    """Mean distance of second differences, root-aligned, unit per frame squared.

    Differences are taken within each of `parts`, frames that follow one another. NaN where none
    has three.
    """
    theirs, ours = (
        np.concatenate([np.diff(_centred(joints[part], root), n=2, axis=0) for part in parts])
        for joints in (truth, points)
    )
    return _mean(np.linalg.norm(ours - theirs, axis=2), _known(theirs))


def pck(points: Pixels, truth: Pixels, torso: tuple[int, int], threshold: float = 0.2) -> float:
    """Share of joints closer to the truth than `threshold` times the distance of `torso`."""
    length = np.linalg.norm(truth[:, torso[0]] - truth[:, torso[1]], axis=1)
    known = np.isfinite(truth).all(axis=2) & np.isfinite(length)[:, None]
    near = np.linalg.norm(points - truth, axis=2) < threshold * length[:, None]
    return float(near[known].mean()) if known.any() else float("nan")


def median_distance(points: Pixels, truth: Pixels) -> float:
    """Median distance of the joints that both have, px."""
    distances = np.linalg.norm(points - truth, axis=2)
    distances = distances[np.isfinite(distances)]
    return float(np.median(distances)) if len(distances) else float("nan")


def limb_variation(points: Points, bones: Int[np.ndarray, "B 2"]) -> Float[np.ndarray, "B"]:
    """Standard deviation over mean of every bone's length over time; 0 for a rigid skeleton."""
    lengths = np.linalg.norm(points[:, bones[:, 1]] - points[:, bones[:, 0]], axis=2)
    return np.nanstd(lengths, axis=0) / np.nanmean(lengths, axis=0)


def evaluate_motion(motion: Motion, truth: Mapping[str, np.ndarray]) -> Scores:
    """Accuracy over the joints that both have, matched by name; truth as `read_truth` gives it.

    The root is midway between the hips. A motion in body heights is scaled to the truth by one
    factor for the whole sequence first. Of a video of several shots, frames of those that were of
    no use are left out. Raises KeyreconError when frames or joints do not match.
    """
    ours, theirs, names = _match_joints(motion.skeleton.names, truth["joint_names"])
    if len(motion.points3d) != len(truth["points3d"]):
        raise KeyreconError(
            f"The motion has {len(motion.points3d)} frames and the truth "
            f"{len(truth['points3d'])}; evaluate against the truth of the same video and trim."
        )
    root = [names.index("right_hip"), names.index("left_hip")]
    every, true = 1000 * motion.points3d[:, ours], 1000 * truth["points3d"][:, theirs]
    scaled = motion.units != "m"
    if scaled:
        every = every * _best_scale(_centred(every, root), _centred(true, root), axes=(0, 1, 2))
    one_shot = motion.cuts is None
    inside = slice(None) if one_shot else motion.known
    parts = [slice(None)] if one_shot else motion.stretches
    points, known = every[inside], true[inside]
    pixels, known_pixels = motion.points2d[inside][:, ours], truth["points2d"][inside][:, theirs]
    torso = (names.index("right_hip"), names.index("left_shoulder"))
    errors, has_joint = joint_errors(points, known, root), _known(known, root)
    variation = limb_variation(motion.points3d[inside], motion.skeleton.bones)
    return Scores(
        mpjpe=mpjpe(points, known, root),
        n_mpjpe=n_mpjpe(points, known, root),
        pa_mpjpe=pa_mpjpe(points, known),
        acceleration=acceleration_error(every, true, root, parts),
        pck=pck(pixels, known_pixels, torso),
        median_px=median_distance(pixels, known_pixels),
        limb_variation=float(variation.mean()),
        limb_variation_max=float(variation.max()),
        by_joint={name: _mean(errors[:, j], has_joint[:, j]) for j, name in enumerate(names)},
        frames=len(points),
        scaled=scaled,
    )


def read_truth(path: Path | str) -> dict[str, np.ndarray]:
    """Arrays of a truth.npz: points3d (metres), points2d (px), joint_names, fps, and any more.

    Raises KeyreconError for a file of another kind, or arrays that do not fit each other.
    """
    path = Path(path)
    with reading(path, "a truth.npz", "it holds points3d, points2d, joint_names and fps"):
        truth = read_arrays(path)
    if missing := {"points3d", "points2d", "joint_names", "fps"} - truth.keys():
        raise KeyreconError(
            f"{path} has no {', '.join(sorted(missing))}; a truth.npz holds points3d, points2d, "
            "joint_names and fps."
        )
    shape = truth["points3d"].shape
    joints = len(np.atleast_1d(truth["joint_names"]))
    if len(shape) != 3 or shape[1:] != (joints, 3) or truth["points2d"].shape != (*shape[:2], 2):
        raise KeyreconError(
            f"{path}: points3d {shape} and points2d {truth['points2d'].shape} do not fit "
            f"{joints} joint names; they must be (frames, joints, 3) and (frames, joints, 2)."
        )
    with reading(path, "a truth.npz", "render or export it again"):
        for name in ("points3d", "points2d", "fps"):
            check_numbers(name, truth[name])
        if truth["joint_names"].dtype.kind != "U" or truth["joint_names"].ndim != 1:
            raise ValueError("joint_names is no list of names")
        if truth["fps"].size != 1 or not truth["fps"].item() > 0 or not len(truth["points3d"]):
            raise ValueError("it has no frames, or they have no rate")
    return truth


def _match_joints(
    ours: Sequence[str], theirs: Sequence[str] | np.ndarray
) -> tuple[list[int], list[int], list[str]]:
    """Indices into both of the joints that both have, and their names."""
    known = [str(name) for name in theirs]
    names = [name for name in ours if name in known]
    if missing := {"right_hip", "left_hip", "left_shoulder"} - set(names):
        raise KeyreconError(
            f"Motion and truth do not both have {', '.join(sorted(missing))}, which the measures "
            "need; name the joints as COCO does."
        )
    return [list(ours).index(n) for n in names], [known.index(n) for n in names], names


def _centred(points: Points, root: Sequence[int]) -> Points:
    return points - points[:, list(root)].mean(axis=1, keepdims=True)


def _best_scale(ours: Points, theirs: Points, axes: tuple[int, ...]) -> Float[np.ndarray, "*n"]:
    """The scale of `ours` that brings it closest to `theirs` in the sense of least squares."""
    known = np.isfinite(theirs) & np.isfinite(ours)
    ours, theirs = np.where(known, ours, 0), np.where(known, theirs, 0)
    size = (ours**2).sum(axis=axes, keepdims=True)
    return (ours * theirs).sum(axis=axes, keepdims=True) / np.where(size > 0, size, 1)


def _known(truth: Points, root: Sequence[int] = ()) -> Bool[np.ndarray, "T J"]:
    """Joints that the truth, and its root, are known of."""
    known = np.isfinite(truth).all(axis=2)
    return known & np.isfinite(truth[:, list(root)]).all(axis=(1, 2))[:, None]


def _mean(errors: Float[np.ndarray, "*n"], known: Bool[np.ndarray, "*n"]) -> float:
    """Mean where the truth is known; NaN where the estimate has gaps there."""
    return float(errors[known].mean()) if known.any() else float("nan")
