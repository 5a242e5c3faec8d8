"""motion.npz: everything that is known of a motion, as plain arrays without pickles."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool

from keyrecon import __version__
from keyrecon.body import Skeleton, check_skeleton
from keyrecon.io.durable import write_durably
from keyrecon.io.formats.camera_file import read_origin
from keyrecon.reading import check_numbers, read_arrays, reading
from keyrecon.records import SOURCES, Motion
from keyrecon.world.records import WorldCamera, WorldMotion

ARRAYS = {
    "points3d": "TJ3",
    "points2d": "TJ2",
    "points2d_propagated": "TJ2",
    "confidence": "TJ",
    "source": "TJ",
    "scale": "T",
    "time": "T",
    "keyframes": "K",
}
"""Arrays of a `Motion` and the letters of their axes."""
KINDS = {"source": np.int64, "keyframes": np.int64, "cuts": np.int64}
"""Arrays that are whole numbers."""
WITH_GAPS = ("points3d", "points2d", "points2d_propagated", "expected_error", "scale")
UNITS = ("m", "body heights")
OPTIONAL = {"expected_error": "TJ", "exchange_evidence": "T2", "elsewhere": "TJ", "cuts": "C"}
"""Arrays that files of former versions and of golf fits lack; `cuts` that of one shot."""
ABOUT = (
    *("source_names", "joint_names", "parents", "mirrored", "proportions", "lower"),
    *("fps", "units", "keyrecon_version"),
)
"""What else every file holds."""
FRAME_NUMBERS = ("key_postures",)
"""Further arrays that hold numbers of frames."""
NOT_BY_FRAME = (
    *("key_posture_names", "key_postures_shown", "vertical", "left_handed", "doubts", "notes"),
    "origin",
)
"""Further arrays that say one thing of the whole motion; all others have a row for every frame."""


OF_WORLD = (
    *("points3d_world", "root_world", "contact", "camera_K", "camera_R", "camera_t", "origin"),
)
"""Further arrays that put a motion into the world."""


def write_motion(
    path: Path,
    motion: Motion,
    world: tuple[WorldMotion, WorldCamera] | None = None,
    more: Mapping[str, np.ndarray] | None = None,
) -> None:
    """Write motion.npz; axes and units as in `records.Motion`, names as listed in the README.

    `world` is the motion on the court and the camera that put it there, where they are known;
    `more` are further arrays for those who know of them; readers of motions leave them aside.
    """
    skeleton = motion.skeleton
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        **{name: getattr(motion, name) for name in (*ARRAYS, *_known(motion))},
        source_names=np.array(SOURCES),
        joint_names=np.array(skeleton.names),
        parents=np.array(skeleton.parents),
        mirrored=np.array(skeleton.mirrored).reshape(-1, 2),
        proportions=np.array(skeleton.proportions),
        lower=np.array(skeleton.lower, dtype=np.int64),
        fps=np.array(motion.fps),
        units=np.array(motion.units),
        keyrecon_version=np.array(__version__),
        **({} if world is None else _on_court(*world)),
        **(dict[str, Any](more or {})),
    )
    write_durably(path, buffer.getvalue())


def _on_court(motion: WorldMotion, camera: WorldCamera) -> dict[str, Any]:
    return {
        "points3d_world": motion.points,
        "root_world": motion.root,
        "contact": motion.contact,
        "camera_K": camera.K,
        "camera_R": camera.R,
        "camera_t": camera.t,
        "origin": np.array(camera.origin),
    }


def _known(motion: Motion) -> list[str]:
    return [name for name in OPTIONAL if getattr(motion, name) is not None]


def read_motion(path: Path | str) -> Motion:
    """Read what `write_motion` wrote; raises KeyreconError for any other file."""
    with reading(Path(path), "a motion", "make it with keyrecon run"):
        return _motion(read_arrays(Path(path)))


def read_further_arrays(path: Path | str) -> dict[str, np.ndarray]:
    """What a file holds besides a `Motion`: the motion on the court, a swing's club and keys."""
    with reading(Path(path), "a motion", "make it with keyrecon run"):
        return _further_arrays(read_arrays(Path(path)))


def read_whole_motion(path: Path) -> tuple[Motion, dict[str, np.ndarray]]:
    """The motion and what else the file holds, of one run even where another replaces the file."""
    with reading(path, "a motion", "make it with keyrecon run"):
        data = read_arrays(path)
        return _motion(data), _further_arrays(data)


def _motion(data: dict[str, np.ndarray]) -> Motion:
    _check_shapes(data)
    _check_values(data)
    return Motion(
        skeleton=check_skeleton(_skeleton(data)),
        **{name: data[name].astype(KINDS.get(name, np.float64)) for name in ARRAYS},
        **{
            name: data[name].astype(KINDS.get(name, np.float64))
            for name in OPTIONAL
            if name in data
        },
        fps=float(data["fps"]),
        units=str(data["units"]),
    )


def _further_arrays(data: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    known = (*ARRAYS, *OPTIONAL, *ABOUT)
    further = {name: values for name, values in data.items() if name not in known}
    for name, values in further.items():
        per_frame = name not in (*FRAME_NUMBERS, *NOT_BY_FRAME)
        if per_frame and values.shape[:1] != data["time"].shape:
            raise ValueError(f"{name} has shape {values.shape}")
    read_origin(further)
    world = further.get("points3d_world", data["points3d"])
    if world.shape != data["points3d"].shape:
        raise ValueError(f"points3d_world has shape {world.shape}")
    return further


def motion_on_court(
    data: Mapping[str, np.ndarray], path: Path
) -> tuple[WorldMotion, WorldCamera] | None:
    """The motion on the court and the camera, of a file's further arrays; None without them.

    How sure the camera is, and the size by the court, are not in the file: they are NaN. `path` is
    named where they are damaged.
    """
    if "points3d_world" not in data:
        return None
    with reading(path, "a motion on the court", "make it with keyrecon court"):
        unknown = np.full(data["camera_t"].shape, np.nan)
        inner, turn, shift = (data[f"camera_{name}"].astype(float) for name in "KRt")
        known = np.isfinite(inner).all(axis=(1, 2))
        return (
            WorldMotion(
                data["points3d_world"].astype(float),
                data["root_world"].astype(float),
                data["contact"].astype(bool),
                float("nan"),
            ),
            WorldCamera(
                inner, turn, shift, known, unknown, unknown[:, 0], unknown[:, 0], read_origin(data)
            ),
        )


def cut_further_arrays(
    arrays: Mapping[str, np.ndarray], first: int, last: int
) -> dict[str, np.ndarray]:
    """The same of frames first..last; numbers of frames count from the new start."""
    cut: dict[str, np.ndarray] = {}
    for name, values in arrays.items():
        if name in FRAME_NUMBERS:
            cut[name] = values - first
        else:
            cut[name] = values if name in NOT_BY_FRAME else values[first : last + 1]
    return cut


def _skeleton(data: dict[str, np.ndarray]) -> Skeleton:
    return Skeleton(
        names=tuple(data["joint_names"].tolist()),
        parents=tuple(data["parents"].tolist()),
        mirrored=tuple((a, b) for a, b in data["mirrored"].tolist()),
        proportions=tuple(data["proportions"].tolist()),
        lower=tuple(data["lower"].tolist()),
    )


def _check_values(data: dict[str, np.ndarray]) -> None:
    """Raise ValueError for values that no motion has; joints that nobody saw are NaN in pixels."""
    _check_kinds(data)
    if not len(data["time"]) or (np.diff(data["time"]) <= 0).any():
        raise ValueError("it has no frames, or their times do not grow")
    known = _frames_with_motion(data)
    if not data["fps"].item() > 0 or not (data["scale"][known] > 0).all():
        raise ValueError("fps and scale must be above 0")
    if str(data["units"]) not in UNITS:
        raise ValueError(f"units must be one of {', '.join(UNITS)}")
    for name in ("keyframes", "cuts"):
        frames = data.get(name, np.zeros(0))
        if not ((frames >= 0) & (frames < len(data["time"]))).all():
            raise ValueError(f"{name} are outside of its frames")


def _check_kinds(data: dict[str, np.ndarray]) -> None:
    for name in (*ARRAYS, *(OPTIONAL.keys() & data.keys()), "fps", "proportions"):
        check_numbers(name, data[name], gaps=name in WITH_GAPS)
    whole = [name for name in KINDS if name in data]
    for name in (*whole, "parents", "mirrored", "lower"):
        if data[name].dtype.kind not in "iu" and data[name].size:
            raise ValueError(f"{name} are no whole numbers")


def _frames_with_motion(data: dict[str, np.ndarray]) -> Bool[np.ndarray, "T"]:
    """ValueError where a frame is known in part, or none is."""
    known = np.isfinite(data["points3d"]).all(axis=(1, 2))
    for name in ("points3d", "points2d", "scale"):
        finite = np.isfinite(data[name]).reshape(len(known), -1)
        if not (finite == known[:, None]).all():
            raise ValueError(f"{name} is not a finite number in every frame that has a motion")
    if not known.any():
        raise ValueError("no frame has a motion")
    return known


def _check_shapes(data: dict[str, np.ndarray]) -> None:
    """Raise ValueError when arrays are out of step with each other."""
    sizes = {
        "T": len(data["time"]),
        "J": len(data["joint_names"]),
        "K": len(data["keyframes"]),
        "C": data["cuts"].size if "cuts" in data else 0,
        "2": 2,
        "3": 3,
    }
    for name, axes in {**ARRAYS, **{n: a for n, a in OPTIONAL.items() if n in data}}.items():
        expected = tuple(sizes[axis] for axis in axes)
        if data[name].shape != expected:
            raise ValueError(f"{name} has shape {data[name].shape} instead of {expected}")
    source = data["source"]
    if source.size and not (source.min() >= 0 and source.max() < len(SOURCES)):
        raise ValueError(f"a source is not one of 0 to {len(SOURCES) - 1}")
