"""A figure that walks about before a camera over level ground, and things that stand there."""

from dataclasses import replace

import numpy as np
from court_walker import lifted, walk

from keyrecon.records import CameraPath
from keyrecon.world.ground_evidence import GroundState
from keyrecon.world.records import GroundMark

SIZE = (1280, 720)
PRINCIPAL = (np.array(SIZE) - 1) / 2
TRUE = GroundState(np.log(1100.0), np.radians(8.0), np.radians(1.0), np.log(2.5), 0.0, 0.0)
CAMERA = TRUE.pinhole(PRINCIPAL)
ABOUT = ((-1.5, 7.0, 80), (1.0, 9.0, 20), (-2.0, 12.0, 100), (2.5, 15.0, -30), (0.0, 17.0, 190))
"""Where walks begin, metres right of the camera and away from it, and their headings, degrees."""


def walks(starts=ABOUT, steps=8, stride=0.5):
    """Joints in the world of walks from several places, one after the other."""
    parts = []
    for x, y, heading in starts:
        points = walk(steps, stride, (0.0, 0.0))[0]
        c, s = np.cos(np.radians(heading)), np.sin(np.radians(heading))
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        parts.append(points @ turn.T + [x, y, 0])
    return np.concatenate(parts)


def standing(x=0.0, y=7.0, steps=40):
    """Joints of a figure that steps on one spot."""
    return walks(((x, y, 0),), steps, 0.0)


def seen(points, camera=CAMERA, units="m", noise=0.0, seed=0):
    """The motion as a lifting has it, with an error of its size that lasts for a second or so."""
    motion = lifted(points, camera, units)
    rng = np.random.default_rng(seed)
    slow = np.repeat(rng.normal(0, noise, len(points) // 50 + 1), 50)[: len(points)]
    return replace(motion, scale=motion.scale * np.exp(slow))


def still(points):
    """The path of a camera that does not move."""
    return CameraPath(np.tile(np.eye(3), (len(points), 1, 1)), np.ones(len(points)))


def turned(azimuths, zoom=None, camera=CAMERA):
    """A camera that turns to the right by angles about the vertical, and zooms; and its path."""
    zoom = np.ones(len(azimuths)) if zoom is None else zoom
    views = []
    for azimuth, larger in zip(azimuths, zoom, strict=True):
        c, s = np.cos(azimuth), np.sin(azimuth)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        views.append(replace(camera, focal=larger * camera.focal, rotation=camera.rotation @ turn))
    to_world = np.array([view.rotation.T @ np.linalg.inv(_inner(view)) for view in views])
    path = np.linalg.inv(to_world[0]) @ to_world
    return views, CameraPath(path / path[:, 2:, 2:], np.ones(len(path)))


def _inner(view):
    (x, y), focal = view.principal, view.focal
    return np.array([[focal, 0, x], [0, focal, y], [0, 0, 1.0]])


def seen_by(views, points):
    """The motion as a lifting has it whose every frame has its own view."""
    parts = [seen(frame[None], view) for frame, view in zip(points, views, strict=True)]
    arrays = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("points2d", "points2d_propagated", "points3d", "scale")
    }
    return replace(seen(points), **arrays)


def mark(kind, ends, metres=None, camera=CAMERA, frame=0):
    """A mark on two points of the world."""
    start, end = camera.project(np.array(ends, dtype=float))
    return GroundMark(kind, frame, tuple(start.tolist()), tuple(end.tolist()), metres)


def posts(camera=CAMERA, leaning=0.0):
    """Two upright things, left and right; the right one leans by so many metres at its top."""
    return (
        mark("vertical", [(-3.5, 8, 0), (-3.5, 8, 2.5)], camera=camera),
        mark("vertical", [(3.8, 9, 0), (3.8 + leaning, 9, 2.5)], camera=camera),
    )


HORIZON = mark("horizon", [(-3e4, 1e5, 2.5), (4e4, 1e5, 2.5)])
"""Far away, as high as the camera."""
