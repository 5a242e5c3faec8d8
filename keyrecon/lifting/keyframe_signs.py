"""Depth signs of the keyframes, inferred from the frames around them.

A single picture often fits two poses that are each other's mirror image. Over time one of them
becomes absurd: the signs of a whole sequence are tracked first, by the priors on bodies and by how
depth moves, with the person's signs fixed, and the keyframes adopt what they passed through
(automatic default A: continuity first, then key poses). Joints marked as hidden within the trunk's
outline speak for an arm behind it. Long motions are taken in chunks, with a margin on both sides.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from keyrecon.body_models.depth_model import DepthModel, expected_depth
from keyrecon.lifting.depth_evidence import DepthSignOptions, DepthSigns, at_rate
from keyrecon.lifting.depth_signs import track_depth_signs
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.lifting.preprocessing import KeyframeMarks, PreparedTracks, smooth_joints
from keyrecon.lifting.priors.exemplars import ExemplarPrior
from keyrecon.lifting.taylor import foreshorten_bones
from keyrecon.numerics.bone_directions import bone_vectors
from keyrecon.records import Shots

_SMOOTHING_SECONDS = 0.03
"""Standard deviation of the smoothing of the tracks; half of the fastest stroke's rise. A quarter
more or less, others with it: at most 2.8 mm on eight clips."""
_SMOOTHED_NOISE = 0.02
"""Standard deviation of smoothed joints, body heights; marked joints are sharper. A quarter more or
less, others with it: at most 2.8 mm on eight clips."""
_CHUNK_FRAMES, _MARGIN_FRAMES, _MARGIN_SECONDS = 2000, 100, 2.0
"""Frames decided together, and further frames and seconds at least on both sides of them that are
tracked with them. Frames a quarter more or less, others with them: at most 2.8 mm on eight
clips."""


def infer_keyframe_signs(
    observed: PreparedTracks,
    marks: KeyframeMarks,
    size: BodySize,
    shots: Shots,
    fps: float,
    options: DepthSignOptions = DepthSignOptions(),
    model: DepthModel | None = None,
) -> DepthSigns:
    """Signs of every bone in every keyframe; those that the person annotated stay."""
    skeleton, frames, nearer = size.skeleton, marks.frames, marks.nearer
    joints = _smoothed_joints(observed, marks, shots, fps)
    noise = np.full(joints.shape[:2], _SMOOTHED_NOISE)
    noise[frames] = np.where(marks.marked, observed.spread[frames], _SMOOTHED_NOISE)
    bones = foreshorten_bones(joints, noise, size.lengths, skeleton)
    expected = shots.in_each(
        lambda part: expected_depth(
            model, bone_vectors(part, skeleton), size.lengths, skeleton, fps
        ),
        joints,
    )
    bones = replace(bones, expected_depth=expected)
    vectors = np.concatenate([bones.in_plane, bones.depth[..., None]], axis=-1)[frames]
    vectors[..., 2] *= -nearer
    hidden = np.zeros(observed.joints.shape[:2], dtype=bool)
    hidden[frames] = marks.marked & ~marks.visible
    options = replace(at_rate(options, fps), exemplars=0.0, initial_motion=0.0)
    sign = np.ones(nearer.shape, dtype=np.int64)
    probability = np.ones(nearer.shape)
    margin = max(_MARGIN_FRAMES, round(_MARGIN_SECONDS * fps))
    for first, end, shot in _chunks(shots):
        inside = (frames >= first) & (frames < end)
        if not inside.any():
            continue
        start = max(first - margin, shot.start)
        chunk = slice(start, min(end + margin, shot.stop))
        part = bones.part(chunk)
        exemplars = ExemplarPrior(
            vectors=vectors,
            frames=frames - start,
            confidence=np.abs(nearer).astype(float),
            initial_depth=np.zeros(part.depth.shape),
            skeleton=skeleton,
        )
        signs = track_depth_signs(part, exemplars, size.breadths, skeleton, options, hidden[chunk])
        sign[inside] = signs.sign[frames[inside] - start]
        probability[inside] = signs.probability[frames[inside] - start]
    given = nearer != 0
    return DepthSigns(np.where(given, -nearer, sign), np.where(given, 1.0, probability))


def _chunks(shots: Shots) -> Iterator[tuple[int, int, slice]]:
    """First frames and ends of what is decided together, and the shot that it lies in."""
    for shot in shots.parts:
        for first in range(shot.start, shot.stop, _CHUNK_FRAMES):
            yield first, min(first + _CHUNK_FRAMES, shot.stop), shot


def _smoothed_joints(
    observed: PreparedTracks, marks: KeyframeMarks, shots: Shots, fps: float
) -> Float[np.ndarray, "T J 2"]:
    """Joints of all frames, smoothed; marked ones as they were marked. NaN in shots in which a
    joint is never seen."""
    sigma = _SMOOTHING_SECONDS * fps

    def smoothed(part: Float[np.ndarray, "T J 2"]) -> Float[np.ndarray, "T J 2"]:
        seen = np.isfinite(part).all(axis=2).any(axis=0)
        return np.where(seen[:, None], smooth_joints(part, np.zeros_like(part), sigma), np.nan)

    joints = shots.in_each(smoothed, observed.joints)
    marked = observed.joints[marks.frames]
    joints[marks.frames] = np.where(marks.marked[..., None], marked, joints[marks.frames])
    return joints
