"""A motion as a humanoid that turns its joints: what BVH and GLB share.

The rest pose is a T-pose that faces +Z. Names are MotionBuilder's, which Blender, Unity and
three.js know. Every joint hangs at a constant offset from its parent, so that rotations alone
carry the motion, and the root's place. The root `Hips` lies a constant way from the neck towards
the middle of the hips; `Spine` turns with the shoulders, `RightShoulder` and `LeftShoulder` about
the neck.

Hips are no rigid bone in our skeleton: lines from the neck to both hips are, and the breadth
between the hips varies by up to 4 cm. So `RHipJoint` and `LHipJoint` (as in CMU's files) lie
where a bone of constant length best reaches the hip: in the middle of its arc, as near the hip as
`HIP_ERROR` allows.

Points do not say how a bone is rolled about itself. The rule: upper arm and forearm, thigh and
shank share the hinge axis across the plane that both span (elbows bend forwards, knees
backwards); where a limb is straighter than 15 degrees the axis is interpolated from the frames
around, as it moves with the parent. The pelvis follows the line of the hips, the chest that of
the shoulders; head and hands do not roll by themselves. A foot stays level, as far as an ankle
turns, since where it points up or down is not known either.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial.transform import Rotation

from keyrecon.body import ANKLE_HEIGHT
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.conventions import StandingMotion
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.timeline import frames_before

Points = Float[np.ndarray, "T 3"]
Turns = Float[np.ndarray, "T 3 3"]
Vector = Float[np.ndarray, "3"]

STRAIGHT = np.sin(np.radians(15))
"""Sine of the flexion under which a limb does not show its hinge axis."""
STUB = 0.03
"""Length of the end of a hand in statures."""
FOOT = 0.11
"""From the ankle forwards to the tip of the foot in statures: foot length .152 (Winter) less what
lies behind the ankle."""
ANKLE_RANGE = np.radians((-20.0, 50.0))
"""How far a foot is turned from its rest across the shank to stay level: toes up, toes down
(normal ranges of the American Academy of Orthopaedic Surgeons)."""
SKULL_BASE = 0.4
"""Where the head's joint lies between neck and crown: neck .07 of .17 statures (Winter)."""
SPINE = 0.2
"""Where the spine's joint lies between hips and neck."""
HIP_ERROR = 2e-4
"""Error of a hip that is left to a bone of constant length, statures: a third of a millimetre."""
HIP_REACH = 0.015
"""Least length of the bones that lead to a hip, statures."""


class _Side(NamedTuple):
    name: str
    """In the file."""
    word: str
    """In the skeleton."""
    out: float
    """Along x in the T-pose, which faces +Z."""


SIDES = (_Side("Right", "right", -1.0), _Side("Left", "left", 1.0))


@dataclass(frozen=True, eq=False)
class RigJoint:
    """A joint of the humanoid."""

    name: str
    parent: int
    """-1 at the root."""
    offset: Vector
    """From the parent in the T-pose; at the root its place in the T-pose, which stands on y = 0."""
    turn: Turns
    """From the T-pose's axes to the world."""
    end: Vector | None = None
    """From a last joint to the end of its bone, in the T-pose."""


@dataclass(frozen=True, eq=False)
class Humanoid:
    """Joints, parents first and depth first, and where the root goes."""

    joints: tuple[RigJoint, ...]
    root: Points
    worst: float
    """Largest distance of a joint from where the motion has it, in the motion's unit."""

    def number(self, name: str) -> int:
        """Place of a joint by name."""
        return [joint.name for joint in self.joints].index(name)

    def differences(self, units: str) -> str:
        """Where joints are off because bones of the motion change their lengths; empty if not."""
        if self.worst <= 1e-3:
            return ""
        return (
            f"; up to {self.worst:.3f} {units} off, since bones of this motion change their length"
        )

    def at(self, frames: Int[np.ndarray, "N"]) -> "Humanoid":
        """The same figure in frames that are chosen."""
        joints = tuple(replace(joint, turn=joint.turn[frames]) for joint in self.joints)
        return replace(self, joints=joints, root=self.root[frames])

    def local_turn(self, joint: int) -> Turns:
        """Rotation of a joint relative to its parent's."""
        turn, parent = self.joints[joint].turn, self.joints[joint].parent
        return turn if parent < 0 else np.swapaxes(self.joints[parent].turn, 1, 2) @ turn


@dataclass(frozen=True, eq=False)
class _Node:
    """A joint before offsets are made constant."""

    name: str
    parent: str | None
    place: Points
    turn: Turns
    end: Vector | None = None


def make_humanoid(standing: StandingMotion) -> Humanoid:
    """The rig and its motion, made from frames with a figure; in others the one before is held.

    Raises KeyreconError for a skeleton without the limbs, hips and neck of a person.
    """
    if missing := missing_joints(standing.skeleton.names):
        raise KeyreconError(
            f"BVH needs a person's skeleton, and this one has no {', '.join(missing)}; use .csv, "
            ".c3d or .glb."
        )
    known = np.flatnonzero(standing.known)
    shown = standing.points[known]
    joints = {name: shown[:, j] for j, name in enumerate(standing.skeleton.names)}
    figure = _with_constant_offsets(_build_nodes(joints, standing.stature), standing.stature)
    return figure.at(frames_before(known, len(standing.points)))


def missing_joints(names: tuple[str, ...]) -> list[str]:
    """Joints of a person that a skeleton lacks."""
    needed = [f"{s}_{j}" for _, s, _ in SIDES for j in ("hip", "knee", "ankle")]
    needed += [f"{s}_{j}" for _, s, _ in SIDES for j in ("shoulder", "elbow", "wrist")]
    return [name for name in (*needed, "neck", "head_top") if name not in names]


def _build_nodes(joints: dict[str, Points], stature: float) -> list[_Node]:
    """All nodes, parents first and depth first, as files list them."""
    middle = (joints["right_hip"] + joints["left_hip"]) / 2
    neck, crown = joints["neck"], joints["head_top"]
    up = unit_vectors(neck - middle, 1e-12)
    across = joints["left_hip"] - joints["right_hip"]
    pelvis = _frame(across, up, fixed="y")
    chest = _frame(joints["left_shoulder"] - joints["right_shoulder"], up, fixed="y")
    head = _frame(chest[..., 0], crown - neck, fixed="y")
    trunk = float(np.median(np.linalg.norm(neck - middle, axis=1)))
    hips = neck - trunk * up
    skull = neck + SKULL_BASE * (crown - neck)
    nodes = [_Node("Hips", None, hips, pelvis)]
    for side in SIDES:
        nodes += _leg(joints, nodes[0], trunk, side, stature)
    nodes += [
        _Node("Spine", "Hips", hips + SPINE * trunk * up, chest),
        _Node("Neck", "Spine", neck, head),
        _Node("Head", "Neck", skull, head, np.array([0.0, _length(crown - skull), 0.0])),
    ]
    for side in SIDES:
        nodes += _arm(joints, chest, side, stature)
    return nodes


def _leg(
    joints: dict[str, Points], hips: _Node, trunk: float, side: _Side, stature: float
) -> list[_Node]:
    name, word, _ = side
    hip, knee, ankle = (joints[f"{word}_{j}"] for j in ("hip", "knee", "ankle"))
    local = np.einsum("tji,tj->ti", hips.turn, hip - hips.place)
    socket = _hip_joint(local, trunk, stature)
    hinge = _hinge(knee - hip, ankle - knee, hips.turn, rest=np.array([1.0, 0.0, 0.0]))
    thigh = _frame(hinge, hip - knee, fixed="y")
    shank = _frame(hinge, knee - ankle, fixed="y")
    tip = np.array([0.0, -ANKLE_HEIGHT * stature, FOOT * stature])
    base = f"{name[0]}HipJoint"
    return [
        _Node(base, "Hips", hips.place + hips.turn @ socket, hips.turn @ _swing(local - socket)),
        _Node(f"{name}UpLeg", base, hip, thigh),
        _Node(f"{name}Leg", f"{name}UpLeg", knee, shank),
        _Node(f"{name}Foot", f"{name}Leg", ankle, _level_foot(shank), tip),
    ]


def _arm(joints: dict[str, Points], chest: Turns, side: _Side, stature: float) -> list[_Node]:
    name, word, out = side
    neck = joints["neck"]
    shoulder, elbow, wrist = (joints[f"{word}_{j}"] for j in ("shoulder", "elbow", "wrist"))
    collar = _frame(out * (shoulder - neck), chest[..., 1], fixed="x")
    # In the T-pose the forearm bends forwards: upper arm x forearm is up on the right.
    hinge = _hinge(elbow - shoulder, wrist - elbow, collar, rest=np.array([0.0, -out, 0.0]))
    upper = _frame(out * (elbow - shoulder), -out * hinge, fixed="x")
    fore = _frame(out * (wrist - elbow), -out * hinge, fixed="x")
    return [
        _Node(f"{name}Shoulder", "Spine", neck, collar),
        _Node(f"{name}Arm", f"{name}Shoulder", shoulder, upper),
        _Node(f"{name}ForeArm", f"{name}Arm", elbow, fore),
        _Node(f"{name}Hand", f"{name}ForeArm", wrist, fore, np.array([out * STUB * stature, 0, 0])),
    ]


def _hip_joint(hip: Points, trunk: float, stature: float) -> Vector:
    """Where a bone of constant length best reaches a hip; all in the pelvis's axes.

    A hip of our skeleton moves on a sphere about the neck, one of the swing prior on a sphere about
    the pelvis; the joint lies on the way to one of these centres, as near the hip as will do.
    """
    mean = hip.mean(axis=0)
    choices = []
    for center in (np.zeros(3), np.array([0.0, trunk, 0.0])):
        way = center - mean
        for share in np.linspace(0.05, 0.98, 94):
            reach, place = share * float(np.linalg.norm(way)), mean + share * way
            if min(reach, float(np.linalg.norm(place))) < HIP_REACH * stature:
                continue
            spread = float(np.ptp(np.linalg.norm(hip - place, axis=1))) / 2
            choices.append((max(spread / stature, HIP_ERROR), reach, place))
    return min(choices, key=lambda choice: choice[:2])[2]


def _swing(links: Points) -> Turns:
    """Shortest rotations from the mean direction to each."""
    ways = unit_vectors(links, 1e-12)
    mean = unit_vectors(ways.mean(axis=0), 1e-12)
    axis, cosine = np.cross(mean, ways), ways @ mean
    turn = np.arctan2(np.linalg.norm(axis, axis=1), cosine)
    return Rotation.from_rotvec(unit_vectors(axis, 1e-12) * turn[:, None]).as_matrix()


def _level_foot(shank: Turns) -> Turns:
    """Axes of a foot that is level as far as the ankle turns about the knee's axis.

    Where the shank is upside down, the foot stays across it.
    """
    up = shank[:, 1]
    turn = np.clip(np.arctan2(up[:, 2], up[:, 1]), *ANKLE_RANGE)
    turn *= np.clip(1 + up[:, 1], 0, 1)
    return shank @ Rotation.from_euler("x", turn[:, None]).as_matrix()


def _hinge(upper: Points, lower: Points, parent: Turns, rest: Vector) -> Points:
    """Axis upper x lower where the limb is bent; elsewhere from the frames around.

    Interpolated in the parent's axes; `rest` stands in there if the limb is never bent.
    """
    turn = np.cross(unit_vectors(upper, 1e-12), unit_vectors(lower, 1e-12))
    local = np.einsum("tji,tj->ti", parent, turn)
    bent = np.flatnonzero(np.linalg.norm(turn, axis=1) > STRAIGHT)
    if not len(bent):
        return parent @ rest
    frames = np.arange(len(turn))
    known = unit_vectors(local[bent], 1e-12)
    filled = np.stack([np.interp(frames, bent, known[:, k]) for k in range(3)], axis=1)
    return np.einsum("tij,tj->ti", parent, filled)


def _frame(x: Points, y: Points, fixed: str) -> Turns:
    """Axes with x and y as given, exactly for the `fixed` one; any where both coincide."""
    x, y = unit_vectors(x, 1e-12), unit_vectors(y, 1e-12)
    z = np.cross(x, y)
    # Parallel x and y leave the roll open: take an axis that is not parallel to them.
    open_roll = np.linalg.norm(z, axis=1) < 1e-6
    spare = np.eye(3)[np.abs(x[open_roll]).argmin(axis=1)]
    z[open_roll] = np.cross(x[open_roll], spare)
    z = unit_vectors(z, 1e-12)
    columns = (x, np.cross(z, x), z) if fixed == "x" else (np.cross(y, z), y, z)
    return np.stack(columns, axis=2)


def _length(vectors: Points) -> float:
    return float(np.linalg.norm(vectors, axis=1).mean())


def _with_constant_offsets(nodes: list[_Node], stature: float) -> Humanoid:
    """The rig with mean offsets, and what that does to the places of joints."""
    numbers = {node.name: number for number, node in enumerate(nodes)}
    joints: list[RigJoint] = []
    places = [nodes[0].place]
    rest = [np.zeros(3)]
    worst = 0.0
    for node in nodes:
        parent = -1 if node.parent is None else numbers[node.parent]
        offset = np.zeros(3)
        if parent >= 0:
            above = nodes[parent]
            offset = np.einsum("tji,tj->ti", above.turn, node.place - above.place).mean(axis=0)
            places.append(places[parent] + above.turn @ offset)
            rest.append(rest[parent] + offset)
            worst = max(worst, float(np.linalg.norm(places[-1] - node.place, axis=1).max()))
        joints.append(RigJoint(node.name, parent, offset, node.turn, node.end))
    lowest = min(place[1] for place in rest) - ANKLE_HEIGHT * stature
    joints[0] = replace(joints[0], offset=np.array([0.0, -lowest, 0.0]))
    return Humanoid(tuple(joints), nodes[0].place, worst)
