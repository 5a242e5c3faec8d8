"""BVH: the motion as a humanoid that Blender, MotionBuilder and game engines can retarget.

Metres (or body heights), Y up; the rest pose is a T-pose that faces +Z, which Blender's default
axes (-Z forward, Y up) turn to its front view; tick "Update Scene FPS" on import. Names are
MotionBuilder's. The root is midway between the hips; the trunk turns about it in `Spine` with
the shoulders, `RightShoulder` and `LeftShoulder` turn about the neck.

Points do not say how a bone is rolled about itself. The rule: upper arm and forearm, thigh and
shank share the hinge axis across the plane that both span (elbows bend forwards, knees
backwards); where a limb is straighter than 15 degrees the axis is interpolated from the frames
around, as it moves with the parent. The pelvis follows the line of the hips, the chest that of
the shoulders; head, hands and feet do not roll by themselves. Hands and feet are stubs of fixed
length, since their ends are not known.

A bone whose length varies (the pelvis and trunk are not rigid in every skeleton) carries
position channels besides, so that reading the file gives every joint back.
"""

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from keyrecon.errors import KeyreconError
from keyrecon.io.durable import write_durably
from keyrecon.io.formats.conventions import at_constant_rate
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.records import Motion

Points = Float[np.ndarray, "T 3"]
Turns = Float[np.ndarray, "T 3 3"]

ORDER = "ZXY"
"""Rotation channels: the order of most files, with Y, the spin of an upright body, innermost."""
STRAIGHT = np.sin(np.radians(15))
"""Sine of the flexion under which a limb does not show its hinge axis."""
STEADY = 1e-3
"""Largest variation of a bone's length, as a share of it, that is left to the offset."""
STUB = 0.03
"""Length of the end of a hand or foot in statures."""
SKULL_BASE = 0.4
"""Where the head's joint lies between neck and crown: neck .07 of .17 statures (Winter)."""


class _Side(NamedTuple):
    name: str
    """In the file."""
    word: str
    """In the skeleton."""
    out: float
    """Along x in the T-pose, which faces +Z."""


SIDES = (_Side("Right", "right", -1.0), _Side("Left", "left", 1.0))


@dataclass(frozen=True, eq=False)
class _Node:
    """A joint of the file."""

    name: str
    parent: str | None
    place: Points
    """Where it is."""
    turn: Turns
    """From the T-pose's axes to the world."""
    rest: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Direction from the parent in the T-pose; zero where both coincide."""
    end: tuple[float, float, float] | None = None
    """Offset of its end site."""


def write_bvh(path: Path, motion: Motion) -> None:
    """Write the motion at a constant rate (resampled if need be).

    Raises KeyreconError for a skeleton without the limbs, hips and neck of a person.
    """
    points = at_constant_rate(motion)
    needed = [f"{s}_{j}" for _, s, _ in SIDES for j in ("hip", "knee", "ankle")]
    needed += [f"{s}_{j}" for _, s, _ in SIDES for j in ("shoulder", "elbow", "wrist")]
    if missing := [n for n in (*needed, "neck", "head_top") if n not in motion.skeleton.names]:
        raise KeyreconError(
            f"BVH needs a person's skeleton, and this one has no {', '.join(missing)}; use .csv, "
            ".c3d or .glb."
        )
    named = {name: points[:, j] for j, name in enumerate(motion.skeleton.names)}
    nodes = _build_nodes(named, STUB * (1.75 if motion.units == "m" else 1.0))
    write_durably(path, _format(nodes, motion.fps))


def _build_nodes(joints: dict[str, Points], stub: float) -> list[_Node]:
    """All nodes, parents first and depth first, as the file lists them."""
    hips = (joints["right_hip"] + joints["left_hip"]) / 2
    neck, crown = joints["neck"], joints["head_top"]
    pelvis = _frame(joints["left_hip"] - joints["right_hip"], neck - hips, fixed="x")
    chest = _frame(joints["left_shoulder"] - joints["right_shoulder"], neck - hips, fixed="y")
    head = _frame(chest[..., 0], crown - neck, fixed="y")
    nodes = [_Node("Hips", None, hips, pelvis)]
    for limb in (_leg(joints, pelvis, side, stub) for side in SIDES):
        nodes += limb
    nodes += [
        _Node("Spine", "Hips", hips, chest),
        _Node("Neck", "Spine", neck, head, (0.0, 1.0, 0.0)),
        _Node(
            "Head",
            "Neck",
            neck + SKULL_BASE * (crown - neck),
            head,
            (0.0, 1.0, 0.0),
            (0.0, (1 - SKULL_BASE) * _length(crown - neck), 0.0),
        ),
    ]
    for limb in (_arm(joints, chest, side, stub) for side in SIDES):
        nodes += limb
    return nodes


def _leg(joints: dict[str, Points], pelvis: Turns, side: _Side, stub: float) -> list[_Node]:
    name, word, out = side
    hip, knee, ankle = (joints[f"{word}_{j}"] for j in ("hip", "knee", "ankle"))
    hinge = _hinge(knee - hip, ankle - knee, pelvis, rest=np.array([1.0, 0.0, 0.0]))
    thigh = _frame(hinge, hip - knee, fixed="y")
    shank = _frame(hinge, knee - ankle, fixed="y")
    down = (0.0, -1.0, 0.0)
    return [
        _Node(f"{name}UpLeg", "Hips", hip, thigh, (out, 0.0, 0.0)),
        _Node(f"{name}Leg", f"{name}UpLeg", knee, shank, down),
        _Node(f"{name}Foot", f"{name}Leg", ankle, shank, down, (0.0, 0.0, stub)),
    ]


def _arm(joints: dict[str, Points], chest: Turns, side: _Side, stub: float) -> list[_Node]:
    name, word, out = side
    neck = joints["neck"]
    shoulder, elbow, wrist = (joints[f"{word}_{j}"] for j in ("shoulder", "elbow", "wrist"))
    collar = _frame(out * (shoulder - neck), chest[..., 1], fixed="x")
    # In the T-pose the forearm bends forwards: upper arm x forearm is up on the right.
    hinge = _hinge(elbow - shoulder, wrist - elbow, collar, rest=np.array([0.0, -out, 0.0]))
    upper = _frame(out * (elbow - shoulder), -out * hinge, fixed="x")
    fore = _frame(out * (wrist - elbow), -out * hinge, fixed="x")
    aside = (out, 0.0, 0.0)
    return [
        _Node(f"{name}Shoulder", "Spine", neck, collar, (0.0, 1.0, 0.0)),
        _Node(f"{name}Arm", f"{name}Shoulder", shoulder, upper, aside),
        _Node(f"{name}ForeArm", f"{name}Arm", elbow, fore, aside),
        _Node(f"{name}Hand", f"{name}ForeArm", wrist, fore, aside, (out * stub, 0.0, 0.0)),
    ]


def _hinge(upper: Points, lower: Points, parent: Turns, rest: Float[np.ndarray, "3"]) -> Points:
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


def _format(nodes: list[_Node], fps: float) -> str:
    """The file's text."""
    by_name = {node.name: node for node in nodes}
    lines, columns = ["HIERARCHY"], []
    for node in nodes:
        parent = by_name.get(node.parent or "")
        moves, offset = _movement(node, parent)
        words = [f"{axis}position" for axis in "XYZ"] if moves is not None else []
        words += [f"{axis}rotation" for axis in ORDER]
        depth = _depth(node, by_name)
        pad = "\t" * depth
        lines += [
            f"{pad}{'JOINT' if parent else 'ROOT'} {node.name}",
            f"{pad}{{",
            f"{pad}\tOFFSET {_numbers(offset)}",
            f"{pad}\tCHANNELS {len(words)} {' '.join(words)}",
        ]
        columns += ([] if moves is None else [moves]) + [_angles(node, parent)]
        lines += _close(node, nodes, by_name)
    values = np.concatenate(columns, axis=1)
    lines += ["MOTION", f"Frames: {len(values)}", f"Frame Time: {1 / fps:.10g}"]
    lines += [" ".join(np.char.mod("%.6f", row)) for row in values]
    return "\n".join(lines) + "\n"


def _depth(node: _Node, by_name: dict[str, _Node]) -> int:
    return 0 if node.parent is None else 1 + _depth(by_name[node.parent], by_name)


def _close(node: _Node, nodes: list[_Node], by_name: dict[str, _Node]) -> list[str]:
    """The end site of `node`, and the braces that close before the next node of the file."""
    depth = _depth(node, by_name)
    lines = []
    if node.end is not None:
        pad = "\t" * (depth + 1)
        lines += [f"{pad}End Site", f"{pad}{{", f"{pad}\tOFFSET {_numbers(node.end)}", f"{pad}}}"]
    following = nodes.index(node) + 1
    next_depth = _depth(nodes[following], by_name) if following < len(nodes) else 0
    return lines + ["\t" * d + "}" for d in range(depth, next_depth - 1, -1)]


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{v:.6f}" for v in values)


def _movement(
    node: _Node, parent: _Node | None
) -> tuple[Points | None, tuple[float, float, float]]:
    """Position channels, or None for a bone of constant length, and the rest offset."""
    if parent is None:
        return node.place, (0.0, 0.0, 0.0)
    local = np.einsum("tji,tj->ti", parent.turn, node.place - parent.place)
    length = _length(local)
    x, y, z = node.rest
    offset = (length * x, length * y, length * z)
    # A place that the parent's turn does not bring about needs channels of its own.
    steady = np.linalg.norm(local - np.array(offset), axis=1).max() <= STEADY * length + 1e-9
    return (None if steady else local), offset


def _angles(node: _Node, parent: _Node | None) -> Float[np.ndarray, "T 3"]:
    """Degrees of the channels, each frame's as close as can be to those of the frame before."""
    turn = node.turn if parent is None else np.swapaxes(parent.turn, 1, 2) @ node.turn
    with warnings.catch_warnings():
        # At gimbal lock the third angle is free and scipy takes 0: the rotation is still right.
        warnings.filterwarnings("ignore", "Gimbal lock", UserWarning)
        first = Rotation.from_matrix(turn).as_euler(ORDER)
    # The same rotation has a second triple of angles; it goes on where the first one turns over.
    second = first * [1, -1, 1] + np.pi
    angles = first.copy()
    for frame in range(1, len(angles)):
        before = angles[frame - 1]
        same = np.stack([first[frame], second[frame]])
        same += 2 * np.pi * np.round((before - same) / (2 * np.pi))
        angles[frame] = same[np.abs(same - before).sum(axis=1).argmin()]
    return np.degrees(angles)
