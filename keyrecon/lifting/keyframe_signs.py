"""Depth signs of the keyframes, read from the frames around them.

A single picture often fits two poses that are each other's mirror image. Over time one of them
becomes absurd: the signs of a whole sequence are followed first, by what bodies do and by how
depth moves, with the person's signs pinned, and the keyframes adopt what they passed through
(automatic default A: continuity first, then key poses). Joints marked as hidden within the trunk's
outline speak for an arm behind it. Long motions are taken in pieces, with frames on both sides that
are only looked at.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from keyrecon.lifting.depth_evidence import DepthSignOptions, DepthSigns, at_rate
from keyrecon.lifting.depth_signs import track_depth_signs
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.lifting.preprocessing import PreparedTracks, smooth_joints
from keyrecon.lifting.priors.depth_model import DepthModel
from keyrecon.lifting.priors.exemplars import ExemplarPrior
from keyrecon.lifting.taylor import foreshorten_bones
from keyrecon.records import Annotations

_SMOOTH_SECONDS = 0.03
_SMOOTHED = 0.02
"""Standard deviation of smoothed joints, body heights; marked joints are sharper."""
_PIECE, _ASIDE = 2000, 100
"""Frames decided together, and frames looked at on both sides of them."""


def infer_keyframe_signs(
    observed: PreparedTracks,
    annotations: Annotations,
    size: BodySize,
    fps: float,
    options: DepthSignOptions = DepthSignOptions(),
    model: DepthModel | None = None,
) -> DepthSigns:
    """Signs of every bone in every keyframe; those that the person confirmed stay."""
    frames, nearer = annotations.frames, annotations.nearer
    joints, noise = _joints(observed, annotations, fps)
    shown = foreshorten_bones(joints, noise, size.lengths, annotations.skeleton, model)
    vectors = np.concatenate([shown.flat, shown.depth[..., None]], axis=-1)[frames]
    vectors[..., 2] *= -nearer
    hidden = np.zeros(observed.joints.shape[:2], dtype=bool)
    hidden[frames] = np.isfinite(annotations.joints[..., 0]) & ~annotations.visible
    alone = replace(at_rate(options, fps), votes=0.0, guide=0.0)
    sign = np.ones(nearer.shape, dtype=np.int64)
    probability = np.ones(nearer.shape)
    for first in range(0, len(shown.flat), _PIECE):
        inside = (frames >= first) & (frames < first + _PIECE)
        if not inside.any():
            continue
        start = max(first - _ASIDE, 0)
        piece = slice(start, first + _PIECE + _ASIDE)
        seen = shown.part(piece)
        votes = ExemplarPrior(
            vectors,
            frames - start,
            np.abs(nearer).astype(float),
            np.zeros(seen.depth.shape),
            annotations.skeleton,
        )
        signs = track_depth_signs(
            seen, votes, size.breadths, annotations.skeleton, alone, hidden[piece]
        )
        sign[inside] = signs.sign[frames[inside] - start]
        probability[inside] = signs.probability[frames[inside] - start]
    confirmed = nearer != 0
    return DepthSigns(np.where(confirmed, -nearer, sign), np.where(confirmed, 1.0, probability))


def _joints(
    observed: PreparedTracks, annotations: Annotations, fps: float
) -> tuple[Float[np.ndarray, "T J 2"], Float[np.ndarray, "T J"]]:
    """Joints of all frames, smoothed, and their noise; keyframes as they were marked."""
    frames = annotations.frames
    still = np.zeros_like(observed.joints)
    joints = smooth_joints(observed.joints, still, _SMOOTH_SECONDS * fps)
    noise: Float[np.ndarray, "T J"] = np.full(joints.shape[:2], _SMOOTHED)
    marked = np.isfinite(annotations.joints[..., 0])
    joints[frames] = np.where(marked[..., None], observed.joints[frames], joints[frames])
    noise[frames] = np.where(marked, observed.spread[frames], _SMOOTHED)
    return joints, noise
