"""GLB (binary glTF 2.0): an animated stick figure that any 3D viewer shows.

A ball for every joint and a stick for every bone, moved by keys at the frames' own times (a
variable rate needs no resampling). Y up, Z towards the camera; metres or body heights.
"""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from keyrecon import __version__
from keyrecon.errors import KeyreconError
from keyrecon.io.durable import write_durably
from keyrecon.io.formats.conventions import y_up
from keyrecon.records import Motion

Json = dict[str, Any]

BALL, STICK = 0.016, 0.010
"""Radii of joints and bones in statures."""
RIGHT, LEFT, MIDDLE = (0.85, 0.35, 0.13, 1.0), (0.10, 0.45, 0.75, 1.0), (0.45, 0.45, 0.45, 1.0)
"""Colours of the sides, linear RGBA."""

FLOAT, UNSIGNED_SHORT = 5126, 5123


class _Buffer:
    """The binary part of the file, and the accessors that describe it."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[Json] = []
        self.accessors: list[Json] = []

    def add(self, array: np.ndarray, bounds: bool = False) -> int:
        """Append an array; returns the number of its accessor."""
        floats = array.dtype.kind == "f"
        stored = np.ascontiguousarray(array, dtype="<f4" if floats else "<u2")
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": stored.nbytes})
        self.data += stored.tobytes() + bytes(-stored.nbytes % 4)
        width = 1 if stored.ndim == 1 else stored.shape[1]
        accessor = {
            "bufferView": len(self.views) - 1,
            "componentType": FLOAT if floats else UNSIGNED_SHORT,
            "count": len(stored),
            "type": {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[width],
        }
        if bounds:
            accessor["min"] = np.atleast_1d(stored.min(axis=0)).tolist()
            accessor["max"] = np.atleast_1d(stored.max(axis=0)).tolist()
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def write_glb(path: Path, motion: Motion) -> None:
    """Write an animated figure; raises KeyreconError where a joint is missing."""
    points = y_up(motion.points3d)
    if not np.isfinite(points).all():
        frame, joint = np.argwhere(~np.isfinite(points).all(axis=2))[0]
        raise KeyreconError(
            f"Frame {frame} has no {motion.skeleton.names[joint]}; this format needs every joint, "
            "use .csv or .npz."
        )
    size = 1.75 if motion.units == "m" else 1.0
    buffer = _Buffer()
    meshes = _meshes(buffer, BALL * size, STICK * size)
    nodes, animation = _animate(buffer, motion, points)
    document = {
        "asset": {"version": "2.0", "generator": f"keyrecon {__version__}"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes))), "extras": {"units": motion.units}}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": [
            {
                "pbrMetallicRoughness": {
                    "baseColorFactor": colour,
                    "metallicFactor": 0.0,
                    "roughnessFactor": 0.8,
                }
            }
            for colour in (MIDDLE, LEFT, RIGHT)
        ],
        "animations": [animation],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.data)}],
    }
    write_durably(path, _pack(document, bytes(buffer.data)))


def _meshes(buffer: _Buffer, ball: float, stick: float) -> list[Json]:
    """Ball and stick in the three colours; the stick is 1 long along +Y."""
    meshes = []
    for name, (vertices, normals, faces) in (("joint", _ball()), ("bone", _stick())):
        shape = np.array([ball] * 3 if name == "joint" else [stick, 1.0, stick])
        attributes = {
            "POSITION": buffer.add(vertices * shape, bounds=True),
            "NORMAL": buffer.add(normals),
        }
        indices = buffer.add(faces.ravel())
        for material, side in enumerate(("middle", "left", "right")):
            primitive = {"attributes": attributes, "indices": indices, "material": material}
            meshes.append({"name": f"{name} {side}", "primitives": [primitive]})
    return meshes


def _ball() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A unit ball of 8 x 12 facets: vertices, normals, faces."""
    rows, columns = 9, 13
    polar, turn = np.meshgrid(np.linspace(0, np.pi, rows), np.linspace(0, 2 * np.pi, columns))
    across = np.sin(polar)
    grid = np.stack([across * np.cos(turn), np.cos(polar), -across * np.sin(turn)], axis=2)
    return grid.reshape(-1, 3), grid.reshape(-1, 3), _grid_faces(columns, rows)


def _stick() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """An open cylinder of radius 1 from y = 0 to 1: vertices, normals, faces."""
    columns = 9
    height, turn = np.meshgrid([1.0, 0.0], np.linspace(0, 2 * np.pi, columns))
    normals = np.stack([np.cos(turn), np.zeros_like(turn), -np.sin(turn)], axis=2)
    grid = normals + np.stack([np.zeros_like(turn), height, np.zeros_like(turn)], axis=2)
    return grid.reshape(-1, 3), normals.reshape(-1, 3), _grid_faces(columns, 2)


def _grid_faces(columns: int, rows: int) -> np.ndarray:
    """Triangles of a grid of vertices, counter-clockwise from outside."""
    corner = (np.arange(columns - 1)[:, None] * rows + np.arange(rows - 1)).ravel()
    below, beside, opposite = corner + 1, corner + rows, corner + rows + 1
    faces = [np.stack([corner, below, opposite], 1), np.stack([corner, opposite, beside], 1)]
    return np.concatenate(faces).astype(np.uint16)


def _animate(
    buffer: _Buffer, motion: Motion, points: Float[np.ndarray, "T J 3"]
) -> tuple[list[Json], Json]:
    """Nodes of joints and bones, and the animation that moves them."""
    times = buffer.add(motion.time - motion.time[0], bounds=True)
    names, colours = motion.skeleton.names, _colours(motion)
    nodes: list[Json] = []
    samplers: list[Json] = []
    channels: list[Json] = []
    moves = [buffer.add(points[:, j]) for j in range(len(names))]

    def animate(path: str, values: int) -> None:
        samplers.append({"input": times, "output": values, "interpolation": "LINEAR"})
        target = {"node": len(nodes) - 1, "path": path}
        channels.append({"sampler": len(samplers) - 1, "target": target})

    for joint, name in enumerate(names):
        nodes.append({"name": name, "mesh": colours[joint]})
        animate("translation", moves[joint])
    for parent, child in motion.skeleton.bones:
        bone = points[:, child] - points[:, parent]
        length = np.linalg.norm(bone, axis=1)
        nodes.append({"name": f"{names[parent]} to {names[child]}", "mesh": 3 + colours[child]})
        animate("translation", moves[parent])
        animate("rotation", buffer.add(_quaternions(bone / np.maximum(length, 1e-9)[:, None])))
        animate(
            "scale", buffer.add(np.stack([np.ones_like(length), length, np.ones_like(length)], 1))
        )
    return nodes, {"name": "motion", "samplers": samplers, "channels": channels}


def _colours(motion: Motion) -> list[int]:
    """Material of every joint: 0 on the midline, 1 left, 2 right."""
    colours = [0] * len(motion.skeleton.names)
    for left, right in motion.skeleton.mirrored:
        colours[left], colours[right] = 1, 2
    return colours


def _quaternions(directions: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T 4"]:
    """Shortest rotations from +Y to each direction, x y z w, without flips of sign."""
    axis = np.cross([0.0, 1.0, 0.0], directions)
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, directions[:, 1])
    # Straight down, any horizontal axis will do.
    safe = np.where(sine[:, None] > 1e-9, axis / np.maximum(sine, 1e-9)[:, None], [1.0, 0.0, 0.0])
    turns = Rotation.from_rotvec(safe * angle[:, None]).as_quat()
    flips = np.sign((turns[1:] * turns[:-1]).sum(axis=1))
    turns[1:] *= np.cumprod(np.where(flips < 0, -1.0, 1.0))[:, None]
    return turns


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
