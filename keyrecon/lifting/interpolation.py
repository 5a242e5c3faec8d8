"""A first, smooth motion from key poses (Section 6.1).

Every well-represented frame could take the pose of its keyframe. Of a run of frames with the
same keyframe most match it less well than one of them, and are better interpolated: frames are
dropped from the control points, worst reprojection first, as long as control points stay within
reach of each other and every run keeps its best frame. Between control points each bone's
direction moves on the shortest arc (slerp), so lengths stay. Upper and lower body have control
points of their own.
"""

import heapq

import numpy as np
from jaxtyping import Float, Int

from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.numerics.bone_directions import pose_from_directions
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.records import HalfKeyframes, Keyframes, Shots


def interpolate_poses(
    key_directions: Float[np.ndarray, "K B 3"],
    key_frames: Int[np.ndarray, "K"],
    keyframes: Keyframes,
    joints: Float[np.ndarray, "T J 2"],
    size: BodySize,
    shots: Shots,
) -> Float[np.ndarray, "T B 3"]:
    """Bone directions in every frame from those of the keyframes; slerped within each shot.

    `joints` in units of length; `key_frames` are the annotated frames, sorted.
    """
    skeleton = size.skeleton
    flat = pose_from_directions(key_directions, size.lengths, skeleton)[..., :2]
    lower_bone = skeleton.is_lower[skeleton.bones[:, 1]]
    directions = np.empty((len(joints), *key_directions.shape[1:]))
    for half, member, bones in (
        (keyframes.upper, ~skeleton.is_lower, ~lower_bone),
        (keyframes.lower, skeleton.is_lower, lower_bone),
    ):
        key = _key_index(half, key_frames)
        residual = reprojection_residual(flat[key][:, member], joints[:, member])
        for shot in shots.parts:
            control = choose_control_frames(half, residual, keyframes.reach, shot)
            poses = key_directions[key[control]][:, bones]
            count = shot.stop - shot.start
            directions[shot, bones] = slerp_between(poses, control - shot.start, count)
    return directions


def reprojection_residual(
    poses: Float[np.ndarray, "T J 2"], joints: Float[np.ndarray, "T J 2"]
) -> Float[np.ndarray, "T"]:
    """Median distance of joints from a pose shifted and scaled onto them.

    Infinite with fewer than half of the pose's joints: on few of them any pose fits, and on one
    exactly. The scale is not negative: a pose upside down is another one.
    """
    known = np.isfinite(joints[..., :1]) & np.isfinite(poses[..., :1])
    count = np.maximum(known.sum(axis=1), 1)
    first = np.where(known, poses, 0.0)
    second = np.where(known, joints, 0.0)
    first = np.where(known, first - (first.sum(axis=1) / count)[:, None], 0.0)
    second = np.where(known, second - (second.sum(axis=1) / count)[:, None], 0.0)
    size = np.maximum((first**2).sum(axis=(1, 2)), 1e-12)
    scale = np.maximum((first * second).sum(axis=(1, 2)), 0.0) / size
    apart = np.linalg.norm(scale[:, None, None] * first - second, axis=-1)
    apart = np.where(known[..., 0], apart, np.nan)
    of_pose = np.isfinite(poses[..., 0]).sum(axis=1)
    few = ~known.any(axis=(1, 2)) | (2 * known.sum(axis=(1, 2)) < of_pose)
    apart[few] = np.inf
    return np.nanmedian(apart, axis=1)


def choose_control_frames(
    half: HalfKeyframes, residual: Float[np.ndarray, "T"], reach: int, shot: slice = slice(None)
) -> Int[np.ndarray, "u"]:
    """Represented frames of a shot that remain control points; gaps grow to `reach` at most.

    Where none is represented, keyframes are, and in a shot without any the frame that is most like
    its keyframe.
    """
    everyone = np.arange(len(residual))[shot]
    frames = everyone[half.represented[shot]]
    if len(frames) == 0:
        frames = half.frames[np.isin(half.frames, everyone)]
    if len(frames) == 0:
        frames = everyone[[residual[shot].argmin()]]
    breaks = (np.diff(frames) > 1) | (np.diff(half.nearest[frames]) != 0)
    run = np.concatenate([[0], np.cumsum(breaks)])
    left = np.bincount(run)
    before = np.arange(-1, len(frames) - 1)
    after = np.arange(1, len(frames) + 1)
    kept = np.ones(len(frames), dtype=bool)
    heap = [(-residual[frame], int(frame), i) for i, frame in enumerate(frames)]
    heapq.heapify(heap)
    while heap:
        _, _, i = heapq.heappop(heap)
        a, b = before[i], after[i]
        at_end = a < 0 or b >= len(frames)
        if left[run[i]] == 1 or at_end or frames[b] - frames[a] > reach:
            continue
        kept[i] = False
        left[run[i]] -= 1
        after[a], before[b] = b, a
    return frames[kept]


def slerp_between(
    directions: Float[np.ndarray, "u B 3"], frames: Int[np.ndarray, "u"], count: int
) -> Float[np.ndarray, "T B 3"]:
    """Unit vectors at `frames` interpolated to all frames, and held before and after them."""
    time = np.clip(np.arange(count), frames[0], frames[-1])
    right = np.clip(np.searchsorted(frames, time, side="left"), 1, max(len(frames) - 1, 1))
    right = np.minimum(right, len(frames) - 1)
    left = np.maximum(right - 1, 0)
    share = (time - frames[left]) / np.maximum(frames[right] - frames[left], 1)
    return slerp(directions[left], directions[right], share[:, None])


def slerp(
    first: Float[np.ndarray, "*n 3"],
    second: Float[np.ndarray, "*n 3"],
    share: Float[np.ndarray, "*#n"],
) -> Float[np.ndarray, "*n 3"]:
    """Unit vectors on the shortest arc from `first` to `second`.

    Nearly opposite vectors have no shortest arc; the one through the image plane is taken.
    """
    part = np.asarray(share)[..., None]
    angle = np.arccos(np.clip((first * second).sum(-1, keepdims=True), -1.0, 1.0))
    flat = np.sin(angle)
    safe = np.where(flat > 1e-6, flat, 1.0)
    near = (1 - part) * first + part * second
    arc = (np.sin((1 - part) * angle) * first + np.sin(part * angle) * second) / safe
    result = np.where(flat > 1e-6, arc, near)
    opposite = angle > np.radians(170)
    if opposite.any():
        result = np.where(opposite, _through_image(first, second, part), result)
    return unit_vectors(result)


def _through_image(
    first: Float[np.ndarray, "*n 3"],
    second: Float[np.ndarray, "*n 3"],
    part: Float[np.ndarray, "*#n 1"],
) -> Float[np.ndarray, "*n 3"]:
    """Two arcs that meet in the image plane, at right angles to `first` as far as possible."""
    middle = np.stack([-first[..., 1], first[..., 0], np.zeros_like(first[..., 0])], axis=-1)
    size = np.linalg.norm(middle, axis=-1, keepdims=True)
    middle = np.where(size > 1e-6, middle / np.maximum(size, 1e-6), [1.0, 0.0, 0.0])
    early = np.cos(np.pi * part) * first + np.sin(np.pi * part) * middle
    late = np.sin(np.pi * part) * middle - np.cos(np.pi * part) * second
    return np.where(part < 0.5, early, late)


def _key_index(half: HalfKeyframes, key_frames: Int[np.ndarray, "K"]) -> Int[np.ndarray, "T"]:
    """Row of the key pose that stands for each frame; the closest in time if it is missing."""
    at = np.searchsorted(key_frames, half.nearest)
    below = np.clip(at - 1, 0, len(key_frames) - 1)
    above = np.clip(at, 0, len(key_frames) - 1)
    closer = np.abs(key_frames[above] - half.nearest) <= np.abs(key_frames[below] - half.nearest)
    return np.where(closer, above, below)
