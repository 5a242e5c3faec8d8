"""GLB (binary glTF 2.0): an animated, skinned figure for Blender, Unity, three.js and viewers.

Joints are a tree of nodes with a skin, so that programs see an armature and can retarget it; the
rest pose is the T-pose of `formats.humanoid`, whose names they know, and the mesh is a simple
body around it. Keys stand at the frames' own times: a variable rate needs no resampling. Y up, Z
towards the camera, the figure faces +Z at rest; metres or body heights.

A skeleton that is no person's has its joints as a tree of nodes too, moved by translations alone,
and capsules that follow both of a bone's ends.
"""

import json
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial.transform import Rotation

from keyrecon import __version__
from keyrecon.io.durable import write_durably
from keyrecon.io.formats.body_mesh import MeshPart, body_parts, capsule, rest_places
from keyrecon.io.formats.conventions import StandingMotion, World, stand_on_floor
from keyrecon.io.formats.humanoid import make_humanoid, missing_joints
from keyrecon.records import Motion

Json = dict[str, Any]

RIGHT, LEFT, MIDDLE = (0.85, 0.35, 0.13, 1.0), (0.10, 0.45, 0.75, 1.0), (0.45, 0.45, 0.45, 1.0)
"""Colours of the sides, linear RGBA."""
STICK = 0.012
"""Radius of the bones of a skeleton that is no person's, statures."""

FLOAT, UNSIGNED_SHORT = 5126, 5123
VERTICES, INDICES = 34962, 34963
"""What a part of the buffer is for."""
KINDS = {(): "SCALAR", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}


@dataclass(eq=False)
class _Buffer:
    """The binary part of the file, and the accessors that describe it."""

    data: bytearray = field(default_factory=bytearray)
    views: list[Json] = field(default_factory=list)
    accessors: list[Json] = field(default_factory=list)

    def add(self, array: np.ndarray, target: int | None = None, bounds: bool = False) -> int:
        """Append an array; returns the number of its accessor."""
        floats = array.dtype.kind == "f"
        stored = np.ascontiguousarray(array, dtype="<f4" if floats else "<u2")
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": stored.nbytes}
        self.views.append(view | ({} if target is None else {"target": target}))
        self.data += stored.tobytes() + bytes(-stored.nbytes % 4)
        accessor = {
            "bufferView": len(self.views) - 1,
            "componentType": FLOAT if floats else UNSIGNED_SHORT,
            "count": len(stored),
            "type": KINDS[stored.shape[1:]],
        }
        if bounds:
            accessor["min"] = np.atleast_1d(stored.min(axis=0)).tolist()
            accessor["max"] = np.atleast_1d(stored.max(axis=0)).tolist()
        self.accessors.append(accessor)
        return len(self.accessors) - 1


@dataclass(frozen=True, eq=False)
class _Figure:
    """What moves: joints, parents first, at rest and over time."""

    names: tuple[str, ...]
    parents: tuple[int, ...]
    rest: Float[np.ndarray, "n 3"]
    """Places at rest, where no joint is turned."""
    moves: dict[int, Float[np.ndarray, "T 3"]]
    """Translations relative to the parent, of the joints that have any."""
    turns: dict[int, Float[np.ndarray, "T 4"]]
    """Rotations relative to the parent, x y z w."""
    parts: list[MeshPart]
    weights: list[Int[np.ndarray, "V"]]
    """The joint that each vertex of a part follows."""


def write_glb(path: Path, motion: Motion, world: World = None) -> str:
    """Write an animated figure; returns what was done, as the scene's extras say too.

    Raises KeyreconError where a joint is missing.
    """
    shown = stand_on_floor(motion, even_times=False, world=world)
    standing = shown.standing_still()
    person = not missing_joints(motion.skeleton.names)
    figure = _person(shown) if person else _sticks(standing)
    buffer = _Buffer()
    nodes, skin = _joint_nodes(buffer, figure)
    mesh, materials = _mesh(buffer, figure)
    nodes.append({"name": "Body", "mesh": 0, "skin": 0})
    extras = {
        "units": standing.units,
        "axes": "Y up, x to the right of the picture, z towards the camera",
        "placing": standing.placing,
        "times": standing.timing,
    }
    document = {
        "asset": {"version": "2.0", "generator": f"keyrecon {__version__}", "extras": extras},
        "scene": 0,
        "scenes": [{"nodes": [0, len(nodes) - 1], "extras": extras}],
        "nodes": nodes,
        "skins": [skin],
        "meshes": [mesh],
        "materials": materials,
        "animations": [_animation(buffer, figure, standing.time)],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.data)}],
    }
    write_durably(path, _pack(document, bytes(buffer.data)))
    return f"Y up; {standing.placing}; {standing.timing}"


def _person(standing: StandingMotion) -> _Figure:
    rig = make_humanoid(standing)
    parts = body_parts(rig, standing.stature)
    return _Figure(
        names=tuple(joint.name for joint in rig.joints),
        parents=tuple(joint.parent for joint in rig.joints),
        rest=rest_places(rig),
        moves={0: rig.root},
        turns={n: _quaternions(rig.local_turn(n)) for n in range(len(rig.joints))},
        parts=parts,
        weights=[np.full(len(part.vertices), part.joint) for part in parts],
    )


def _sticks(standing: StandingMotion) -> _Figure:
    """Any skeleton: the first frame is the rest pose, bones are stretched between their joints."""
    skeleton = standing.skeleton
    order = [skeleton.root, *skeleton.bones[:, 1].tolist()]
    points = standing.points[:, order]
    parents = tuple(-1 if k == skeleton.root else order.index(skeleton.parents[k]) for k in order)
    radius = STICK * standing.stature
    parts, weights = [], []
    for joint, parent in enumerate(parents):
        if parent >= 0:
            surface = capsule(points[0, parent], points[0, joint], (radius, radius))
            parts.append(MeshPart(joint, *surface))
            half = len(surface[0]) // 2
            weights.append(np.repeat([parent, joint], half))
    return _Figure(
        names=tuple(skeleton.names[k] for k in order),
        parents=parents,
        rest=points[0],
        moves={
            joint: points[:, joint] - (points[:, parent] if parent >= 0 else 0)
            for joint, parent in enumerate(parents)
        },
        turns={},
        parts=parts,
        weights=weights,
    )


def _joint_nodes(buffer: _Buffer, figure: _Figure) -> tuple[list[Json], Json]:
    """A node for each joint, and the skin that binds the mesh to them."""
    nodes: list[Json] = []
    for joint, name in enumerate(figure.names):
        parent = figure.parents[joint]
        offset = figure.rest[joint] - (figure.rest[parent] if parent >= 0 else 0)
        node: Json = {"name": name, "translation": [round(v, 6) for v in offset.tolist()]}
        children = [k for k, above in enumerate(figure.parents) if above == joint]
        nodes.append(node | ({"children": children} if children else {}))
    inverse = np.tile(np.eye(4), (len(nodes), 1, 1))
    inverse[:, 3, :3] = -figure.rest  # stored column by column
    skin = {
        "name": "Armature",
        "joints": list(range(len(nodes))),
        "skeleton": 0,
        "inverseBindMatrices": buffer.add(inverse),
    }
    return nodes, skin


def _mesh(buffer: _Buffer, figure: _Figure) -> tuple[Json, list[Json]]:
    """The body in the colours of its sides, each part bound to its joints."""
    sides = [_side(figure.names[part.joint]) for part in figure.parts]
    primitives: list[Json] = []
    materials: list[Json] = []
    for name, colour in (("middle", MIDDLE), ("left", LEFT), ("right", RIGHT)):
        members = [k for k, side in enumerate(sides) if side == name]
        if not members:
            continue
        parts = [figure.parts[k] for k in members]
        starts = np.cumsum([0, *(len(part.vertices) for part in parts)])[:-1]
        joint = np.concatenate([figure.weights[k] for k in members])
        joints = np.stack([joint, *np.zeros((3, len(joint)), dtype=np.int64)], axis=1)
        weights = np.tile([1.0, 0.0, 0.0, 0.0], (len(joint), 1))
        vertices = np.concatenate([part.vertices for part in parts])
        faces = np.concatenate([part.faces + s for part, s in zip(parts, starts, strict=True)])
        attributes = {
            "POSITION": buffer.add(vertices, VERTICES, bounds=True),
            "NORMAL": buffer.add(np.concatenate([part.normals for part in parts]), VERTICES),
            "JOINTS_0": buffer.add(joints, VERTICES),
            "WEIGHTS_0": buffer.add(weights, VERTICES),
        }
        indices = buffer.add(faces.ravel(), INDICES)
        primitives.append(
            {"attributes": attributes, "indices": indices, "material": len(materials)}
        )
        look = {"baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 0.8}
        materials.append({"name": name, "pbrMetallicRoughness": look})
    return {"name": "Body", "primitives": primitives}, materials


def _side(name: str) -> str:
    word = name.lower()
    if word.startswith("left") or name == "LHipJoint":
        return "left"
    return "right" if word.startswith("right") or name == "RHipJoint" else "middle"


def _animation(buffer: _Buffer, figure: _Figure, time: Float[np.ndarray, "T"]) -> Json:
    keys = buffer.add(time, bounds=True)
    samplers: list[Json] = []
    channels: list[Json] = []
    for path, tracks in (("translation", figure.moves), ("rotation", figure.turns)):
        for node, values in tracks.items():
            samplers.append({"input": keys, "output": buffer.add(values)})
            target = {"node": node, "path": path}
            channels.append({"sampler": len(samplers) - 1, "target": target})
    return {"name": "motion", "samplers": samplers, "channels": channels}


def _quaternions(turns: Float[np.ndarray, "T 3 3"]) -> Float[np.ndarray, "T 4"]:
    """x y z w without flips of sign."""
    quaternions = Rotation.from_matrix(turns).as_quat()
    flips = np.sign((quaternions[1:] * quaternions[:-1]).sum(axis=1))
    quaternions[1:] *= np.cumprod(np.where(flips < 0, -1.0, 1.0))[:, None]
    return quaternions


def _pack(document: Json, data: bytes) -> bytes:
    """Header, JSON chunk padded by spaces, binary chunk (already a multiple of four)."""
    text = json.dumps(document, allow_nan=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + len(data)
    return (
        struct.pack("<4sII", b"glTF", 2, total)
        + struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(data), b"BIN\0")
        + data
    )
