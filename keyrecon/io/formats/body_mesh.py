"""A simple body around a rig: a tapered capsule for each bone, a box-like trunk, head and feet.

Every vertex belongs to one joint, which it follows rigidly. Shapes are those of the rest pose.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from keyrecon.io.formats.humanoid import Humanoid, Vector

RADII = {
    "Shoulder": (0.035, 0.032),
    "Arm": (0.030, 0.026),
    "ForeArm": (0.026, 0.018),
    "Hand": (0.020, 0.016),
    "UpLeg": (0.048, 0.035),
    "Leg": (0.034, 0.022),
    "Foot": (0.026, 0.018),
    "Neck": (0.030, 0.028),
    "Head": (0.042, 0.042),
}
"""Radii at both ends of a bone in statures, by the end of the joint's name: a slim figure, so that
limbs stay apart."""
TRUNK = {"Hips": (0.080, 0.060), "Spine": (0.085, 0.065)}
"""Half breadth and half depth of the trunk's two parts, statures."""
RINGS, SEGMENTS = 4, 12
"""Rings of each round end, and facets around."""


@dataclass(frozen=True, eq=False)
class MeshPart:
    """Part of a surface that moves with one joint."""

    joint: int
    vertices: Float[np.ndarray, "V 3"]
    """In the rest pose, which stands on y = 0."""
    normals: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    """Counter-clockwise from outside."""


def body_parts(figure: Humanoid, stature: float) -> list[MeshPart]:
    """The surface of a humanoid, one part for each joint that has a bone."""
    places = rest_places(figure)
    parts = []
    for number, joint in enumerate(figure.joints):
        start = places[number]
        if joint.name in TRUNK:
            end = places[figure.number("Spine" if joint.name == "Hips" else "Neck")]
            low = start + (stature * 0.03 if joint.name == "Spine" else 0) * np.array([0.0, 1, 0])
            half = np.array(TRUNK[joint.name]) * stature
            surface = capsule(low, end, (half[0], half[0]), half[1] / half[0])
        elif radii := _radii(joint.name):
            end = _far_end(figure, places, number)
            surface = capsule(start, end, (radii[0] * stature, radii[1] * stature))
        else:
            continue
        parts.append(MeshPart(number, *surface))
    return parts


def rest_places(figure: Humanoid) -> Float[np.ndarray, "n 3"]:
    """Joints of the rest pose."""
    places: list[Vector] = []
    for joint in figure.joints:
        places.append(joint.offset + (places[joint.parent] if joint.parent >= 0 else 0))
    return np.array(places)


def capsule(
    start: Vector, end: Vector, radii: tuple[float, float], flat: float = 1.0
) -> tuple[Float[np.ndarray, "V 3"], Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]]:
    """Vertices, normals and faces of a tapered capsule; `flat` scales it along its own z.

    Both halves are cut by the same number of rings, the first half of the vertices at `start`.
    """
    way = end - start
    length = float(np.linalg.norm(way))
    polar = np.concatenate(
        [np.linspace(-np.pi / 2, 0, RINGS + 1), np.linspace(0, np.pi / 2, RINGS + 1)]
    )
    turn = np.linspace(0, 2 * np.pi, SEGMENTS + 1)
    radius = np.repeat(radii, RINGS + 1)
    along = np.repeat([0.0, length], RINGS + 1) + radius * np.sin(polar)
    ring = np.stack([np.cos(turn), -np.sin(turn)], axis=1)
    around = np.tile(ring, (len(polar), 1))
    slope, along, out = (np.repeat(v, len(ring)) for v in (polar, along, radius * np.cos(polar)))
    points = np.stack([out * around[:, 0], along, flat * out * around[:, 1]], axis=1)
    level = np.cos(slope)
    normals = np.stack([level * around[:, 0], np.sin(slope), level * around[:, 1] / flat], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    axes = _axes(way)
    vertices = start + points @ axes.T
    return vertices, normals @ axes.T, _grid_faces(len(polar), SEGMENTS + 1)


def _radii(name: str) -> tuple[float, float] | None:
    """The longest ending that fits: 'RightForeArm' is a forearm, not an arm."""
    endings = [ending for ending in RADII if name.endswith(ending)]
    return RADII[max(endings, key=len)] if endings else None


def _far_end(figure: Humanoid, places: Float[np.ndarray, "n 3"], number: int) -> Vector:
    joint = figure.joints[number]
    if joint.end is not None:
        return places[number] + joint.end
    child = next(k for k, other in enumerate(figure.joints) if other.parent == number)
    return places[child]


def _axes(way: Vector) -> Float[np.ndarray, "3 3"]:
    """Columns x, y, z with y along `way` and z as near to +Z as can be."""
    y = way / max(float(np.linalg.norm(way)), 1e-12)
    guide = np.array([0.0, 0.0, 1.0]) if abs(y[2]) < 0.9 else np.array([0.0, -1.0, 0.0])
    x = np.cross(y, guide)
    x /= np.linalg.norm(x)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def _grid_faces(rows: int, columns: int) -> Int[np.ndarray, "F 3"]:
    """Triangles of a grid whose rows go up and whose columns go round clockwise from above."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    beside, above, opposite = corner + 1, corner + columns, corner + columns + 1
    faces = [np.stack([corner, beside, opposite], 1), np.stack([corner, opposite, above], 1)]
    return np.concatenate(faces)
