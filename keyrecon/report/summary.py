"""Numbers that tell whether a result can be trusted, with and without a known truth.

Lengths in the picture are given in player heights (head centre to feet, from the track), so that
they compare across videos. Everything in space is relative to the camera: one camera does not
say how far away the player is, so joints are compared around the root of the skeleton.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.body import Skeleton
from keyrecon.records import SOURCES, Motion, Track


@dataclass(frozen=True, eq=False)
class Truth:
    """Joints as they really were, in the order of the motion's skeleton; NaN where unknown."""

    points3d: Float[np.ndarray, "T J 3"]
    """Camera axes, any unit."""
    points2d: Float[np.ndarray, "T J 2"]
    """px"""


def arrange_truth(truth: Mapping[str, np.ndarray], skeleton: Skeleton) -> Truth:
    """Arrays of a truth.npz in the order of the skeleton, matched by name."""
    places = {str(name): place for place, name in enumerate(truth["joint_names"])}
    frames = len(truth["points3d"])
    points3d = np.full((frames, len(skeleton.names), 3), np.nan)
    points2d = np.full((frames, len(skeleton.names), 2), np.nan)
    for joint, name in enumerate(skeleton.names):
        if name in places:
            points3d[:, joint] = truth["points3d"][:, places[name]]
            points2d[:, joint] = truth["points2d"][:, places[name]]
    return Truth(points3d, points2d)


def center_on_root(points3d: Float[np.ndarray, "T J 3"], root: int) -> Float[np.ndarray, "T J 3"]:
    """Points relative to one joint."""
    return points3d - points3d[:, root : root + 1]


def scale_truth(motion: Motion, truth3d: Float[np.ndarray, "T J 3"]) -> Float[np.ndarray, "T J 3"]:
    """Truth around the root in the units of the motion: one scale for the whole sequence."""
    root = motion.skeleton.root
    true, estimated = center_on_root(truth3d, root), center_on_root(motion.points3d, root)
    both = np.isfinite(true) & np.isfinite(estimated)
    scale = (true[both] @ estimated[both]) / max(float(true[both] @ true[both]), 1e-12)
    return true * scale


def error_per_frame(motion: Motion, truth: Truth) -> Float[np.ndarray, "T"]:
    """Mean distance of the joints to the true ones around the root, in units of the motion."""
    estimated = center_on_root(motion.points3d, motion.skeleton.root)
    distance = np.linalg.norm(estimated - scale_truth(motion, truth.points3d), axis=-1)
    known = np.isfinite(distance)
    total = np.where(known, distance, 0).sum(axis=1)
    return np.where(known.any(axis=1), total / np.maximum(known.sum(axis=1), 1), np.nan)


def bone_lengths(
    points3d: Float[np.ndarray, "T J 3"], skeleton: Skeleton
) -> Float[np.ndarray, "T B"]:
    """Length of every bone in every frame, in the order of `skeleton.bones`."""
    parent, child = skeleton.bones.T
    return np.linalg.norm(points3d[:, child] - points3d[:, parent], axis=-1)


def expected_length(motion: Motion) -> float | None:
    """Mean expected error of all joints across the picture, in units of the motion; None where it
    is not known."""
    errors = expected_lengths(motion)
    return None if errors is None else float(np.nanmean(errors))


def expected_lengths(motion: Motion) -> Float[np.ndarray, "T J"] | None:
    """Expected errors across the picture in units of the motion."""
    if motion.expected_error is None:
        return None
    return motion.expected_error / motion.scale[:, None]


def hinges(skeleton: Skeleton) -> list[int]:
    """Joints that bend between two bones of one limb: elbows and knees, left before right."""
    children = [skeleton.parents.count(joint) for joint in range(len(skeleton.names))]
    bending = {
        joint
        for joint, parent in enumerate(skeleton.parents)
        if children[joint] == 1 and parent not in (-1, skeleton.root)
    }
    return [joint for pair in skeleton.mirrored for joint in pair if joint in bending]


def hinge_angles(
    points3d: Float[np.ndarray, "T J 3"], skeleton: Skeleton
) -> Float[np.ndarray, "T n"]:
    """Angle between both bones at every hinge, radians: pi is straight, less is bent."""
    angles = []
    for joint in hinges(skeleton):
        child = skeleton.parents.index(joint)
        inward = points3d[:, skeleton.parents[joint]] - points3d[:, joint]
        outward = points3d[:, child] - points3d[:, joint]
        crossed = np.linalg.norm(np.cross(inward, outward), axis=-1)
        angles.append(np.arctan2(crossed, (inward * outward).sum(axis=-1)))
    return np.array(angles).reshape(len(angles), len(points3d)).T


def source_shares(motion: Motion) -> Float[np.ndarray, "J S"]:
    """Share of frames in which each joint comes from each of SOURCES."""
    source = motion.source[motion.known]
    return np.stack([(source == kind).mean(axis=0) for kind in range(len(SOURCES))], axis=1)


def missing_shares(motion: Motion) -> Float[np.ndarray, "J"]:
    """Share of frames in which nothing in the picture told of each joint."""
    return source_shares(motion)[:, SOURCES.index("interpolated")]


def correction(motion: Motion, track: Track) -> Float[np.ndarray, "J"]:
    """How far refinement moved each joint in the picture (median over frames), player heights."""
    moved = np.linalg.norm(motion.points2d - motion.points2d_propagated, axis=-1)
    return _median_known(moved / track.height[:, None])


def joint_acceleration(
    points2d: Float[np.ndarray, "T J 2"], motion: Motion, track: Track
) -> Float[np.ndarray, "J"]:
    """Mean acceleration of each joint across the picture, player heights / s^2: noise shows here.

    `points2d` are joints of the motion. NaN for a joint never seen in three frames running.
    """
    sizes = []
    for part, placed in zip(motion.stretches, _in_heights(points2d, motion, track), strict=True):
        time = stretch_times(motion, part)
        velocity = np.diff(placed, axis=0) / np.diff(time)[:, None, None]
        between = (time[2:] - time[:-2]) / 2
        sizes.append(np.linalg.norm(np.diff(velocity, axis=0) / between[:, None, None], axis=-1))
    size = np.concatenate(sizes)
    known = np.isfinite(size)
    total = np.where(known, size, 0).sum(axis=0)
    return np.where(known.any(axis=0), total / np.maximum(known.sum(axis=0), 1), np.nan)


def foot_speed(motion: Motion, track: Track) -> Float[np.ndarray, "steps"]:
    """Speed across the picture of the slower foot, player heights / s.

    A player on the ground has one foot at rest most of the time; with a camera at rest its speed
    should then be near 0, and what is left is slip.
    """
    feet = _leaves(motion.skeleton, motion.skeleton.is_lower)
    placed = _in_heights(motion.points2d[:, feet], motion, track)
    speeds = [
        np.linalg.norm(np.diff(own, axis=0), axis=-1).min(axis=1)
        / np.diff(stretch_times(motion, part))
        for part, own in zip(motion.stretches, placed, strict=True)
    ]
    return np.concatenate(speeds)


ROUNDED = 1.001e-3
"""Seconds by which the times of even frames may be off: files round them to a millisecond at the
coarsest, which at 240 frames a second is a quarter of a frame."""


def stretch_times(motion: Motion, part: slice) -> Float[np.ndarray, "n"]:
    """Seconds of the frames of a stretch, without what the file rounded where they are even."""
    time = motion.time[part]
    even = np.linspace(time[0], time[-1], len(time))
    return even if np.abs(time - even).max() <= ROUNDED else time


def _in_heights(
    points2d: Float[np.ndarray, "T J 2"], motion: Motion, track: Track
) -> list[Float[np.ndarray, "_ J 2"]]:
    """Joints of every stretch in its own usual player height: shots show the player at sizes of
    their own."""
    return [points2d[part] / np.median(track.height[part]) for part in motion.stretches]


def truth_error_2d(
    motion: Motion, truth2d: Float[np.ndarray, "T J 2"], track: Track
) -> Float[np.ndarray, "J"]:
    """Median distance to the true joints in the picture, player heights."""
    return _median_known(np.linalg.norm(motion.points2d - truth2d, axis=-1) / track.height[:, None])


def order_by_pose(distances: Float[np.ndarray, "K K"]) -> Int[np.ndarray, "K"]:
    """Keyframes ordered so that similar poses are neighbours.

    First coordinate of classical scaling (Torgerson 1952): opposite strokes come to lie at
    opposite ends, which is what makes them stand out over time.
    """
    squared = np.nan_to_num(distances) ** 2
    centered = squared - squared.mean(axis=0) - squared.mean(axis=1)[:, None] + squared.mean()
    axis = np.linalg.eigh(-(centered + centered.T) / 2)[1][:, -1]
    order = np.argsort(axis)
    return order if order[0] < order[-1] else order[::-1]


def _leaves(skeleton: Skeleton, among: Bool[np.ndarray, "J"]) -> list[int]:
    ends = set(range(len(skeleton.names))) - set(skeleton.parents)
    return [joint for joint in sorted(ends) if among[joint]] or sorted(ends)


def _median_known(values: Float[np.ndarray, "T J"]) -> Float[np.ndarray, "J"]:
    """Median over frames; NaN for a joint without any value."""
    columns = [column[np.isfinite(column)] for column in values.T]
    return np.array([np.median(column) if len(column) else np.nan for column in columns])
