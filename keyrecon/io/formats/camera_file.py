"""camera.npz: the camera of every frame; and a calibration file as Pose2Sim reads it.

Pose2Sim's TOML (https://perfanalytics.github.io/pose2sim, `Calib_scene.toml`) has a table per
camera: size, matrix, distortions, rotation (a rotation vector from world to camera) and translation
(metres), Z up. It holds cameras that stand still; of one that moves it can hold one frame.
"""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from keyrecon import __version__
from keyrecon.errors import KeyreconError
from keyrecon.io.durable import write_durably
from keyrecon.reading import check_numbers, read_arrays, reading
from keyrecon.world.records import COURT, GROUND, Origin, WorldCamera

ARRAYS = {
    "K": (3, 3),
    "R": (3, 3),
    "t": (3,),
    "found": (),
    "sd_centre": (3,),
    "sd_focal": (),
}
"""Arrays of a `WorldCamera` and their shape in one frame."""
TILT = "sd_tilt"
"""Another, NaN where nobody told; files of former versions lack it."""
STATURE = "stature"
"""One number, in files of cameras whose metres are those of the player's height."""
WORLDS = {
    COURT: "origin on the ground at the middle of the net, x along it, y up the court, z up",
    GROUND: "origin on the ground under the player's first stance, x right, y away, z up",
}
"""Axes of the world by the name of its origin."""


def write_camera(path: Path, camera: WorldCamera) -> None:
    """Write camera.npz; names and axes as in `WorldCamera`."""
    stature: dict[str, Any] = {} if camera.stature is None else {STATURE: np.array(camera.stature)}
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        **{name: getattr(camera, name) for name in (*ARRAYS, TILT)},
        origin=np.array(camera.origin),
        **stature,
        keyrecon_version=np.array(__version__),
    )
    write_durably(path, buffer.getvalue())


def read_camera(path: Path | str) -> WorldCamera:
    """Read what `write_camera` wrote; raises KeyreconError for any other file."""
    path = Path(path)
    with reading(path, "a camera", "make it with keyrecon court or keyrecon ground"):
        data = read_arrays(path)
        frames = len(data["found"])
        for name, shape in ARRAYS.items():
            if data[name].shape != (frames, *shape):
                raise ValueError(f"{name} has shape {data[name].shape}")
        found = data["found"].astype(bool)
        numbers = {name: data[name].astype(np.float64) for name in ARRAYS if name != "found"}
        if not all(np.isfinite(values[found]).all() for values in numbers.values()):
            raise ValueError("a camera that was found has numbers missing")
        origin = read_origin(data)
        tilt = data.get(TILT, np.full(frames, np.nan)).astype(np.float64)
        if tilt.shape != (frames,):
            raise ValueError(f"{TILT} has shape {tilt.shape}")
        check_numbers(TILT, tilt[found], gaps=origin == COURT)
        inner, turn, shift, centre, focal = (numbers[name] for name in ARRAYS if name != "found")
        stature = _read_stature(data)
        return WorldCamera(inner, turn, shift, found, centre, focal, tilt, origin, stature=stature)


def _read_stature(data: Mapping[str, np.ndarray]) -> float | None:
    """None where it told no metres; files of former versions do not say whether it did."""
    if STATURE not in data:
        return None
    stature = float(data[STATURE])
    if not 0 < stature < np.inf:
        raise ValueError(f"{STATURE} is {stature}")
    return stature


def read_origin(data: Mapping[str, np.ndarray]) -> Origin:
    """Which world the numbers of a file are in; files of former versions know courts alone."""
    named = str(data.get("origin", COURT))
    for origin in WORLDS:
        if named == origin:
            return origin
    raise ValueError(f"'{named}' is no origin of a world")


def write_calibration(
    path: Path,
    camera: WorldCamera,
    size: tuple[int, int],
    name: str,
    frames: tuple[int, int] | None = None,
) -> str:
    """Write a calibration TOML of one camera; returns what was done to it.

    Of a camera that moves, that of the middle one of the frames in which it was found; `frames` are
    the first and the last that count. Raises KeyreconError where it was found in none of them.
    """
    seen = np.flatnonzero(camera.found)
    if frames is not None:
        seen = seen[(seen >= frames[0]) & (seen <= frames[1])]
    if not len(seen):
        where = "any frame" if frames is None else f"frames {frames[0]}-{frames[1]}"
        raise KeyreconError(f"There is no camera in {where}; export others.")
    frame = int(seen[len(seen) // 2])
    turn = cv2.Rodrigues(camera.R[frame])[0].ravel()
    moves = bool(np.ptp(camera.R[seen], axis=0).max() > 0 or np.ptp(camera.focal[seen]) > 0)
    of_frame = f"of frame {frame}: the camera moves" if moves else "the camera stands still"

    def row(values: np.ndarray) -> str:
        return "[ " + ", ".join(f"{v:.10g}" for v in np.atleast_1d(values)) + "]"

    matrix = ", ".join(row(values) for values in camera.K[frame])
    lines = [
        f"# keyrecon {__version__}, {of_frame}.",
        f"# World: {WORLDS[camera.origin]}.",
        "[cam_01]",
        f'name = "{name}"',
        f"size = {row(np.array(size, dtype=float))}",
        f"matrix = [ {matrix}]",
        "distortions = [ 0.0, 0.0, 0.0, 0.0]",
        f"rotation = {row(turn)}",
        f"translation = {row(camera.t[frame])}",
        "fisheye = false",
        "",
        "[metadata]",
        "adjusted = false",
        "error = 0.0",
        "",
    ]
    write_durably(path, "\n".join(lines).encode())
    return f"; {of_frame}" if moves else ""
