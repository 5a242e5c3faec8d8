"""Poses from one picture under scaled orthography (Taylor, CVIU 80, 2000).

With the scale s and a bone's length l known, its depth is dz^2 = l^2 - |dp|^2 / s^2, up to the
sign. Near the image plane the square root magnifies every error, so the depth taken here is
its expected value given the marking noise (see `shown`); without noise it is Taylor's.
"""

import numpy as np
from jaxtyping import Float, Int

from keyrecon.body import Skeleton
from keyrecon.lifting.chain import bone_vectors, unit
from keyrecon.lifting.flips import Shown
from keyrecon.lifting.shown import depth_doubt, depth_share


def show_bones(
    joints: Float[np.ndarray, "T J 2"],
    noise: Float[np.ndarray, "T J"],
    lengths: Float[np.ndarray, "B"],
    skeleton: Skeleton,
) -> Shown:
    """Everything about bones but the sign of their depth; joints and noise in units of length.

    A bone with a missing end is taken to lie anywhere: it shows nothing and may be as deep as
    it is long on average.
    """
    vectors = bone_vectors(joints, skeleton)
    missing = np.isnan(vectors[..., 0])
    parents, children = skeleton.bones.T
    blur = np.sqrt(noise[:, parents] ** 2 + noise[:, children] ** 2) / lengths
    shown = np.where(missing, 0.87, np.linalg.norm(vectors, axis=-1) / lengths)
    blur = np.where(missing, 0.8, blur)
    share = depth_share(shown, blur)
    flat = np.sqrt(1 - share**2)[..., None] * unit(np.nan_to_num(vectors))
    return Shown(lengths[:, None] * flat, lengths * share, lengths * depth_doubt(shown, blur))


def lift_shown(shown: Shown, sign: Int[np.ndarray, "T B"]) -> Float[np.ndarray, "T B 3"]:
    """Unit bone directions of the given depth signs."""
    return unit(np.concatenate([shown.flat, (sign * shown.depth)[..., None]], axis=-1))
