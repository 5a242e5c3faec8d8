"""What a body can do: costs, in nats, of candidate bone directions.

Under orthography a bone may point towards or away from the camera by the same amount; joint
limits tell many of these mirror images apart. Body axes: R to the person's right, U up the
trunk, F = U x R forward (right-handed like the camera's axes). A knee bends backwards only:
(thigh x shank) . R <= 0. Every cost is capped: a limit speaks against a pose, it does not
forbid it, since the joints that it is computed from are uncertain themselves.

Joint limits alone leave most depth signs open. The posture says more and tells a pose from its
mirror image in depth: hands work before the body, elbows hang beside and behind it, a forward thigh
goes with a bent knee. The directions of a limb's two bones in the axes of the trunk, taken
together, have a mean and a covariance, which are tabled here over a dance, a kick at a ball,
jumping jacks with squats and a jog, a forward jump and a golf swing, all weighing the same (CMU
motion capture, mocap.cs.cmu.edu: 05_12, 10_06, 13_30, 13_32, 64_07), left limbs mirrored, spreads
widened by 0.2 for other people and unsure trunks. `python benchmarks/posture_table.py` prints the
tables. Heavy tails (Student) keep rare poses possible.

Tried: limbs that look straight are straight (the Cauchy density of `terms.unseen_bend`) as a cost
of signs too. Without depth signs from the person, straight legs of eight rendered tennis sequences
came out straight within 7 degrees instead of bent by up to 28, and PA-MPJPE fell from 53.6 to 52.2
mm; but a dance, a kick, jumps and golf swings, lifted from their projections in four views each,
rose from 77 to 85 and from 88 to 99 mm: towards a camera, knees and elbows do bend unseen.

Groups of bones whose signs depend on each other are decided together: the trunk, each leg,
each arm. Bones of a skeleton that has no such joints stand alone and are free.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from keyrecon.body import Skeleton
from keyrecon.numerics.geometry import unit_vectors

CAP = 8.0
"""Largest cost of one broken limit, nats. Without it: at most .2 mm less, with depth signs or
without, on three rendered clips of 6 s."""
TILT = 0.1
"""Depth that an upright line gains per unit downwards: the camera looks 6 degrees down, between a
tripod at chest height and a stand. A quarter more or less, others with it: at most 2.8 mm on eight
clips."""
UPRIGHT = np.array([0.0, -1.0, -TILT]) / np.hypot(1.0, TILT)
"""Away from the ground, camera axes."""
_LEAN_FORWARD, _LEAN_SPREAD, _LEAN_ASIDE = 0.13, 0.2, 0.14
"""How far a trunk of length 1 leans, and how much that varies, with room for unknown tilt: its
mean is 0.09-0.20 and its deviation 0.08-0.26 in dancing, kicking, jumping and golf alike (CMU
motion capture, see above)."""
_MEAN = {
    "arm": np.array([0.24, -0.74, 0.09, 0.02, -0.22, 0.51]),
    "leg": np.array([0.04, -0.81, 0.37, -0.01, -0.87, -0.33]),
}
"""Mean of the upper and the lower bone's direction: outward, up, forward of each. A quarter more of
the first costs 3.7 mm without depth signs on a clip of 5 s, a quarter less nothing; what a player's
own mean is in depth, a video does not show before it is lifted."""

_COVARIANCE = {
    "arm": np.array(
        [
            [0.13, 0.00, -0.03, 0.04, 0.06, 0.02],
            [0.00, 0.18, 0.09, -0.05, 0.16, -0.05],
            [-0.03, 0.09, 0.19, -0.08, 0.16, -0.01],
            [0.04, -0.05, -0.08, 0.20, -0.07, 0.02],
            [0.06, 0.16, 0.16, -0.07, 0.45, 0.00],
            [0.02, -0.05, -0.01, 0.02, 0.00, 0.16],
        ]
    ),
    "leg": np.array(
        [
            [0.09, 0.02, -0.01, 0.03, 0.01, -0.01],
            [0.02, 0.11, 0.04, 0.00, -0.01, 0.02],
            [-0.01, 0.04, 0.13, 0.00, -0.02, 0.05],
            [0.03, 0.00, 0.00, 0.08, 0.00, 0.01],
            [0.01, -0.01, -0.02, 0.00, 0.06, -0.03],
            [-0.01, 0.02, 0.05, 0.01, -0.03, 0.11],
        ]
    ),
}
"""Of the same six numbers in the five captures, printed by `benchmarks/posture_table.py`. A quarter
more or less, others with it: at most 2.8 mm on eight clips."""
_PRECISION = {kind: np.linalg.inv(matrix) for kind, matrix in _COVARIANCE.items()}
_DEGREES_OF_FREEDOM = 8.0
"""Of the Student tails. Chosen on rendered sequences; see benchmarks/sensitivity.py. A quarter more
or less, others with it: at most 2.8 mm on eight clips."""


@dataclass(frozen=True)
class Limb:
    """Two bones in a row and the kind of joint between them."""

    bones: tuple[int, ...]
    joints: tuple[int, ...]
    """Far ends of the bones."""
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
                bones = tuple(bone_of[name] for name in members)
                joints = tuple(skeleton.index(name) for name in members)
                limbs.append(Limb(bones, joints, kind, sign))
    taken = {*trunk, *(bone for limb in limbs for bone in limb.bones)}
    head = bone_of.get("head_top") if trunk else None
    limbs += [
        Limb((bone,), (int(skeleton.bones[bone, 1]),), "head" if bone == head else "free")
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
"""Forward part of the head's direction, and its spread. A quarter more or less, others with them:
at most 2.8 mm on eight clips."""


def leg_cost(
    hips: Float[np.ndarray, "*#n 3"],
    up: Float[np.ndarray, "*#n 3"],
    thigh: Float[np.ndarray, "*#n 3"],
    shank: Float[np.ndarray, "*#n 3"],
    side: int,
) -> Float[np.ndarray, "..."]:
    """Knees bend backwards and not sideways; the rest is habit.

    `side` is 1 for the right leg, -1 for the left.
    """
    bend = (np.cross(thigh, shank) * hips).sum(-1)
    axes = limb_axes(hips, up, side)
    aside = ((shank - thigh) * hips).sum(-1) / sideways_spread(thigh, shank, hips)
    limits = hinge(bend + 0.05, 0.1) + np.minimum(0.5 * aside**2, CAP)
    return limits + posture_cost(thigh, shank, axes, "leg")


def arm_cost(
    shoulders: Float[np.ndarray, "*#n 3"],
    up: Float[np.ndarray, "*#n 3"],
    upper: Float[np.ndarray, "*#n 3"],
    forearm: Float[np.ndarray, "*#n 3"],
    side: int,
) -> Float[np.ndarray, "..."]:
    """Habit alone: shoulder and elbow together leave an arm nearly free."""
    return posture_cost(upper, forearm, limb_axes(shoulders, up, side), "arm")


_STRAIGHT_SIDEWAYS, _BENT_SIDEWAYS = 0.08, 0.25
"""Sideways part of a knee's bend (`sideways_spread`): of straight legs, and in bends of the leg's
own plane. Root mean square 0.06-0.11 of legs that are straight within 20 degrees, and 0.15-0.30 of
the bend in others, in tennis, dancing, kicking, jumping and golf alike. Tried besides: 0.12 and
0.35, which left knees 1-2 degrees more bent where they are straight. A quarter more or less, others
with them: at most 2.8 mm on eight clips."""


def sideways_spread(
    thigh: Float[np.ndarray, "*#n 3"],
    shank: Float[np.ndarray, "*#n 3"],
    hips: Float[np.ndarray, "*#n 3"],
) -> Float[np.ndarray, "*n"]:
    """How far a knee may bend along the line of the hips: a hinge bends across it.

    A difference of unit directions. What the leg bends in its own plane is a hinge's right; seen
    from the side, it is in the picture, and a bend in depth is none that a knee can make.
    """
    bend = shank - thigh
    hinged = bend - (bend * hips).sum(-1, keepdims=True) * hips
    return np.hypot(_STRAIGHT_SIDEWAYS, _BENT_SIDEWAYS * np.linalg.norm(hinged, axis=-1))


def limb_axes(
    across: Float[np.ndarray, "*#n 3"], up: Float[np.ndarray, "*#n 3"], side: int
) -> tuple[Float[np.ndarray, "*#n 3"], ...]:
    """Outward on one side, up, forward; at right angles."""
    right = unit_vectors(across - (across * up).sum(-1, keepdims=True) * up)
    return side * right, up, np.cross(up, right)


def posture_cost(
    upper: Float[np.ndarray, "*#n 3"],
    lower: Float[np.ndarray, "*#n 3"],
    axes: tuple[Float[np.ndarray, "*#n 3"], ...],
    kind: Literal["arm", "leg"],
) -> Float[np.ndarray, "..."]:
    """Cost of a limb's posture, nats: directions of its two bones by the trunk's axes.

    `axes`: outward on the limb's side, up, forward; they need not be at right angles.
    """
    parts = [(bone * axis).sum(-1) for bone in (upper, lower) for axis in axes]
    off = [part - mean for part, mean in zip(parts, _MEAN[kind], strict=True)]
    precision = _PRECISION[kind]
    squared = sum(
        (1 if i == j else 2) * precision[i, j] * off[i] * off[j]
        for i in range(6)
        for j in range(i, 6)
    )
    return 0.5 * (_DEGREES_OF_FREEDOM + 6) * np.log1p(squared / _DEGREES_OF_FREEDOM)


def head_cost(
    shoulders: Float[np.ndarray, "*#n 3"],
    up: Float[np.ndarray, "*#n 3"],
    head: Float[np.ndarray, "*#n 3"],
) -> Float[np.ndarray, "..."]:
    """The head continues the trunk."""
    forward = np.cross(up, shoulders)
    off = ((head * forward).sum(-1) - _HEAD_FORWARD) / _HEAD_SPREAD
    return hinge(0.9 - (head * up).sum(-1), 0.2) + np.minimum(0.5 * off**2, CAP)
