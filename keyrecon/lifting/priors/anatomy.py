"""What a body can do: costs, in nats, of candidate bone directions.

Under orthography a bone may point towards or away from the camera by the same amount; joint
limits tell many of these mirror images apart. Body axes: R to the person's right, U up the
trunk, F = U x R forward (right-handed like the camera's axes). A knee bends backwards only:
(thigh x shank) . R <= 0. Every cost is capped: a limit speaks against a pose, it does not
forbid it, since the joints that it is computed from are uncertain themselves.

Groups of bones whose signs depend on each other are decided together: the trunk, each leg,
each arm. Bones of a skeleton that has no such joints stand alone and are free.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from keyrecon.body import Skeleton
from keyrecon.lifting.priors.posture import posture_cost
from keyrecon.numerics.geometry import unit_vectors

CAP = 8.0
"""Largest cost of one broken limit, nats."""
TILT = 0.1
"""Depth that an upright line gains per unit downwards: the camera looks 6 degrees down, between
a tripod at chest height and a stand."""
UPRIGHT = np.array([0.0, -1.0, -TILT]) / np.hypot(1.0, TILT)
"""Away from the ground, camera axes."""
_LEAN_FORWARD, _LEAN_SPREAD, _LEAN_ASIDE = 0.13, 0.2, 0.14
"""How far a trunk of length 1 leans, and how much that varies, with room for unknown tilt: its
mean is 0.09-0.20 and its deviation 0.08-0.26 in dancing, kicking, jumping and golf alike (CMU
motion capture, see `posture`)."""


@dataclass(frozen=True)
class Limb:
    """Two bones in a row and the kind of joint between them."""

    bones: tuple[int, ...]
    kind: str
    """'leg', 'arm', 'head' or 'free'."""
    side: int = 0
    """1 on the person's right, -1 on the left, 0 on the midline."""


@dataclass(frozen=True)
class Anatomy:
    """Bones by the group in which their signs are decided."""

    trunk: tuple[int, ...]
    """Right hip, left hip, right shoulder, left shoulder; empty where one is missing."""
    limbs: tuple[Limb, ...]


def anatomy_of(skeleton: Skeleton) -> Anatomy:
    """Groups of a skeleton, by joint names and by the tree."""
    bone_of = {skeleton.names[child]: b for b, (_, child) in enumerate(skeleton.bones)}
    corners = ("right_hip", "left_hip", "right_shoulder", "left_shoulder")
    joined = all(
        name in bone_of and skeleton.parents[skeleton.index(name)] == skeleton.root
        for name in corners
    )
    trunk = tuple(bone_of[name] for name in corners) if joined else ()
    limbs = []
    for side, sign in (("right", 1), ("left", -1)):
        for kind, names in (("leg", ("knee", "ankle")), ("arm", ("elbow", "wrist"))):
            members = [f"{side}_{name}" for name in names]
            if trunk and all(name in bone_of for name in members):
                limbs.append(Limb(tuple(bone_of[name] for name in members), kind, sign))
    taken = {*trunk, *(bone for limb in limbs for bone in limb.bones)}
    head = bone_of.get("head_top") if trunk else None
    limbs += [
        Limb((bone,), "head" if bone == head else "free")
        for bone in range(len(skeleton.bones))
        if bone not in taken
    ]
    return Anatomy(trunk, tuple(limbs))


def hinge(excess: Float[np.ndarray, "*n"], softness: float) -> Float[np.ndarray, "*n"]:
    """0 up to a limit, then growing with the square of the excess, capped."""
    return np.minimum(0.5 * (np.maximum(excess, 0.0) / softness) ** 2, CAP)


def trunk_axes(
    corners: Float[np.ndarray, "*n 4 3"],
) -> tuple[Float[np.ndarray, "*n 3"], ...]:
    """Hip axis, shoulder axis (to the right) and U of trunks given by their corners.

    Corners relative to the neck, in the order of `Anatomy.trunk`.
    """
    hips = unit_vectors(corners[..., 0, :] - corners[..., 1, :])
    shoulders = unit_vectors(corners[..., 2, :] - corners[..., 3, :])
    up = unit_vectors(-(corners[..., 0, :] + corners[..., 1, :]))
    return hips, shoulders, up


def trunk_cost(
    corners: Float[np.ndarray, "*n 4 3"], breadths: Float[np.ndarray, "2"]
) -> Float[np.ndarray, "*n"]:
    """Breadths that a trunk must keep, twist up to 50 degrees, girdles across the spine."""
    hips, shoulders, up = trunk_axes(corners)
    cost = np.zeros(corners.shape[:-2])
    for first, wanted in zip((0, 2), breadths, strict=True):
        across = np.linalg.norm(corners[..., first, :] - corners[..., first + 1, :], axis=-1)
        cost += np.minimum(0.5 * ((across / wanted - 1) / 0.2) ** 2, CAP)
    cost += hinge(np.cos(np.radians(50)) - (hips * shoulders).sum(-1), 0.3)
    for axis in (hips, shoulders):
        cost += hinge(np.abs((axis * up).sum(-1)) - 0.5, 0.2)
    return cost + lean_cost(unit_vectors(hips + shoulders), up)


def lean_cost(
    across: Float[np.ndarray, "*n 3"], up: Float[np.ndarray, "*n 3"]
) -> Float[np.ndarray, "*n"]:
    """People at work lean forward a little, and rarely back or to the side."""
    right = unit_vectors(across - (across * UPRIGHT).sum(-1, keepdims=True) * UPRIGHT)
    forward = np.cross(UPRIGHT, right)
    ahead = ((up * forward).sum(-1) - _LEAN_FORWARD) / _LEAN_SPREAD
    aside = (up * right).sum(-1) / _LEAN_ASIDE
    return np.minimum(0.5 * (ahead**2 + aside**2), CAP)


_HEAD_FORWARD, _HEAD_SPREAD = 0.1, 0.4
"""Forward part of the head's direction, and its spread."""


def leg_cost(
    hips: Float[np.ndarray, "*#n 3"],
    up: Float[np.ndarray, "*#n 3"],
    thigh: Float[np.ndarray, "*#n 3"],
    shank: Float[np.ndarray, "*#n 3"],
    side: int,
) -> Float[np.ndarray, "..."]:
    """Knees bend backwards; the rest is habit. `side` is 1 for the right leg, -1 for the left."""
    bend = (np.cross(thigh, shank) * hips).sum(-1)
    axes = limb_axes(hips, up, side)
    return hinge(bend + 0.05, 0.1) + posture_cost(thigh, shank, axes, "leg")


def arm_cost(
    shoulders: Float[np.ndarray, "*#n 3"],
    up: Float[np.ndarray, "*#n 3"],
    upper: Float[np.ndarray, "*#n 3"],
    forearm: Float[np.ndarray, "*#n 3"],
    side: int,
) -> Float[np.ndarray, "..."]:
    """Habit alone: shoulder and elbow together leave an arm nearly free."""
    return posture_cost(upper, forearm, limb_axes(shoulders, up, side), "arm")


def limb_axes(
    across: Float[np.ndarray, "*#n 3"], up: Float[np.ndarray, "*#n 3"], side: int
) -> tuple[Float[np.ndarray, "*#n 3"], ...]:
    """Outward on one side, up, forward; at right angles."""
    right = unit_vectors(across - (across * up).sum(-1, keepdims=True) * up)
    return side * right, up, np.cross(up, right)


def head_cost(
    shoulders: Float[np.ndarray, "*#n 3"],
    up: Float[np.ndarray, "*#n 3"],
    head: Float[np.ndarray, "*#n 3"],
) -> Float[np.ndarray, "..."]:
    """The head continues the trunk."""
    forward = np.cross(up, shoulders)
    off = ((head * forward).sum(-1) - _HEAD_FORWARD) / _HEAD_SPREAD
    return hinge(0.9 - (head * up).sum(-1), 0.2) + np.minimum(0.5 * off**2, CAP)
