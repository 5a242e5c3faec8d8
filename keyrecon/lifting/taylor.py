"""Poses from one picture under scaled orthography (Taylor, CVIU 80, 2000).

With the scale s and a bone's length l known, its depth is dz^2 = l^2 - |dp|^2 / s^2, up to the
sign. Near the image plane the square root magnifies every error, so the depth taken here is
its expected value given the marking noise (see `foreshortening`); without noise it is Taylor's.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from keyrecon.body import Skeleton
from keyrecon.lifting.depth_evidence import DepthSigns, ForeshortenedBones
from keyrecon.lifting.foreshortening import depth_share
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.lifting.preprocessing import KeyframeMarks, PreparedTracks
from keyrecon.numerics.bone_directions import bone_vectors
from keyrecon.numerics.geometry import unit_vectors

_INFERRED_CONFIDENCE = 0.3
"""Weight of the sign of a bone that was neither marked nor annotated, against one that was. A
quarter more or less, others with it: at most 2.8 mm on eight clips."""
_MISSING_FORESHORTENING, _MISSING_NOISE = 0.87, 0.8
"""What stands for a bone with a missing end: sqrt(1 - 1/4), the foreshortening at the mean depth
share of 1/2, and a noise under which the picture says nothing."""


@dataclass(frozen=True, eq=False)
class KeyPoses:
    """Poses of the annotated frames."""

    frames: Int[np.ndarray, "K"]
    directions: Float[np.ndarray, "K B 3"]
    """Unit bone directions."""
    confidence: Float[np.ndarray, "K B"]
    """0-1: weight of each bone when other frames are compared with this pose."""
    nearer: Int[np.ndarray, "K B"]
    """Signs that a person annotated, as in `Annotations`."""


def lift_keyframes(
    observed: PreparedTracks, marks: KeyframeMarks, size: BodySize, signs: DepthSigns
) -> KeyPoses:
    """Poses of the annotated frames with the given depth signs.

    Joints that were not marked on a keyframe are taken from the tracks.
    """
    joints, noise = observed.joints[marks.frames], observed.spread[marks.frames]
    bones = foreshorten_bones(joints, noise, size.lengths, size.skeleton)
    sure = marks.marked[:, size.skeleton.bones].all(axis=-1) | (marks.nearer != 0)
    return KeyPoses(
        frames=marks.frames,
        directions=lift_foreshortened(bones, signs.sign),
        confidence=np.where(sure, 1.0, _INFERRED_CONFIDENCE * (2 * signs.probability - 1)),
        nearer=marks.nearer,
    )


def foreshorten_bones(
    joints: Float[np.ndarray, "T J 2"],
    noise: Float[np.ndarray, "T J"],
    lengths: Float[np.ndarray, "B"],
    skeleton: Skeleton,
) -> ForeshortenedBones:
    """Everything about bones but the sign of their depth; joints and noise in units of length.

    A bone with a missing end may lie in any direction: the picture says nothing of it, and it is
    as deep as such bones are on average. Nothing is expected of depths.
    """
    vectors = bone_vectors(joints, skeleton)
    missing = np.isnan(vectors[..., 0])
    parents, children = skeleton.bones.T
    blur = np.sqrt(noise[:, parents] ** 2 + noise[:, children] ** 2) / lengths
    foreshortening = np.linalg.norm(vectors, axis=-1) / lengths
    foreshortening = np.where(missing, _MISSING_FORESHORTENING, foreshortening)
    blur = np.where(missing, _MISSING_NOISE, blur)
    share, spread = depth_share(foreshortening, blur)
    in_plane = np.sqrt(1 - share**2)[..., None] * unit_vectors(np.nan_to_num(vectors))
    return ForeshortenedBones(
        in_plane=lengths[:, None] * in_plane,
        depth=lengths * share,
        depth_spread=lengths * spread,
        expected_depth=np.full(share.shape, np.nan),
    )


def lift_foreshortened(
    bones: ForeshortenedBones, sign: Int[np.ndarray, "T B"]
) -> Float[np.ndarray, "T B 3"]:
    """Unit bone directions of the given depth signs."""
    return unit_vectors(np.concatenate([bones.in_plane, (sign * bones.depth)[..., None]], axis=-1))
