"""Poses from one picture under scaled orthography (Taylor, CVIU 80, 2000).

With the scale s and a bone's length l known, its depth is dz^2 = l^2 - |dp|^2 / s^2, up to the
sign. Near the image plane the square root magnifies every error, so the depth taken here is
its expected value given the marking noise (see `shown`); without noise it is Taylor's.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from keyrecon.body import Skeleton
from keyrecon.lifting.bone_directions import bone_vectors
from keyrecon.lifting.depth_evidence import DepthSignOptions, DepthSigns, ForeshortenedBones
from keyrecon.lifting.depth_signs import choose_depth_signs
from keyrecon.lifting.foreshortening import depth_doubt, depth_share
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.lifting.preprocessing import PreparedTracks
from keyrecon.lifting.priors.depth_model import DepthModel, expected_depth
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.records import Annotations

_GUESS = 0.3
"""Weight of the sign of a bone that was neither marked nor confirmed, against one that was."""


@dataclass(frozen=True, eq=False)
class KeyPoses:
    """Poses of the annotated frames."""

    directions: Float[np.ndarray, "K B 3"]
    """Unit bone directions."""
    probability: Float[np.ndarray, "K B"]
    """How likely the depth sign of each bone is, 0.5-1."""
    confidence: Float[np.ndarray, "K B"]
    """0-1: weight of each bone when other frames are compared with this pose."""
    nearer: Int[np.ndarray, "K B"]
    """Signs that a person confirmed, as in `Annotations`."""


def lift_keyframes(
    observed: PreparedTracks,
    annotations: Annotations,
    size: BodySize,
    options: DepthSignOptions = DepthSignOptions(),
    signs: DepthSigns | None = None,
) -> KeyPoses:
    """Poses of the annotated frames, with confirmed depth signs where there are any.

    Joints that were not marked on a keyframe are taken from the tracks. Without `signs` every
    picture is judged by itself.
    """
    frames, skeleton = annotations.frames, annotations.skeleton
    shown = foreshorten_bones(
        observed.joints[frames], observed.spread[frames], size.lengths, skeleton
    )
    if signs is None:
        signs = choose_depth_signs(shown, annotations.nearer, size.breadths, skeleton, options)
    marked = np.isfinite(annotations.joints[:, skeleton.bones, 0]).all(axis=-1)
    sure = marked | (annotations.nearer != 0)
    confidence = np.where(sure, 1.0, _GUESS * (2 * signs.probability - 1))
    return KeyPoses(
        lift_foreshortened(shown, signs.sign), signs.probability, confidence, annotations.nearer
    )


def foreshorten_bones(
    joints: Float[np.ndarray, "T J 2"],
    noise: Float[np.ndarray, "T J"],
    lengths: Float[np.ndarray, "B"],
    skeleton: Skeleton,
    model: DepthModel | None = None,
) -> ForeshortenedBones:
    """Everything about bones but the sign of their depth; joints and noise in units of length.

    A bone with a missing end is taken to lie anywhere: it shows nothing and may be as deep as
    it is long on average. `model` tells what depth such bones usually have.
    """
    vectors = bone_vectors(joints, skeleton)
    missing = np.isnan(vectors[..., 0])
    parents, children = skeleton.bones.T
    blur = np.sqrt(noise[:, parents] ** 2 + noise[:, children] ** 2) / lengths
    shown = np.where(missing, 0.87, np.linalg.norm(vectors, axis=-1) / lengths)
    blur = np.where(missing, 0.8, blur)
    share = depth_share(shown, blur)
    flat = np.sqrt(1 - share**2)[..., None] * unit_vectors(np.nan_to_num(vectors))
    doubt = lengths * depth_doubt(shown, blur)
    usual = expected_depth(model, vectors, lengths, skeleton)
    return ForeshortenedBones(lengths[:, None] * flat, lengths * share, doubt, usual)


def lift_foreshortened(
    shown: ForeshortenedBones, sign: Int[np.ndarray, "T B"]
) -> Float[np.ndarray, "T B 3"]:
    """Unit bone directions of the given depth signs."""
    return unit_vectors(np.concatenate([shown.flat, (sign * shown.depth)[..., None]], axis=-1))
