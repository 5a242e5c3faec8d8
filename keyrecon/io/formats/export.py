"""A motion in other programs' formats, told by suffix. The overlay video is the report's work."""

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path

import numpy as np

from keyrecon.errors import KeyreconError
from keyrecon.io.formats.bvh_motion import write_bvh
from keyrecon.io.formats.c3d import write_c3d
from keyrecon.io.formats.camera_file import read_origin
from keyrecon.io.formats.coco import write_coco_motion
from keyrecon.io.formats.conventions import WITH_WORLD, World, WorldJoints, describe_times
from keyrecon.io.formats.csv_table import write_csv
from keyrecon.io.formats.glb import write_glb
from keyrecon.io.formats.motion_file import write_motion
from keyrecon.io.formats.netcdf import write_netcdf
from keyrecon.io.formats.trc import write_trc
from keyrecon.records import Motion

WRITERS: dict[str, Callable[[Path, Motion, World], str]] = {
    ".bvh": write_bvh,
    ".c3d": write_c3d,
    ".glb": write_glb,
}
"""What writes a motion that stands on its floor; .trc numbers the video's frames besides."""

SUFFIXES = (*WRITERS, ".trc", ".csv", ".nc", ".npz", ".json")
ELSEWHERE = {
    ".fbx": "write .glb or .bvh, open it in Blender (File > Import) and save it there "
    "(File > Export > FBX)",
    ".usd": "write .glb, open it in Blender (File > Import) and save it there "
    "(File > Export > USD)",
    ".gltf": "write .glb, the same in one file",
    ".mov": "write .mp4",
    ".avi": "write .mp4",
}
"""Formats that people ask for, and the way to them."""


PACKAGES = {
    ".c3d": ("c3d", ("c3d",)),
    ".nc": ("netcdf", ("xarray", "h5netcdf", "h5py")),
}
"""Formats that need more than keyrecon itself does: its extra, and the packages of that."""


def check_packages(path: Path) -> None:
    """Raise KeyreconError where what a file's format needs is not installed."""
    extra, packages = PACKAGES.get(path.suffix.lower(), ("", ()))
    try:
        for package in packages:
            import_module(package)
    except ImportError as fault:
        raise KeyreconError(
            f"Writing {path.suffix} needs {', '.join(packages)}; install with: "
            f"pip install 'keyrecon[{extra}]'"
        ) from fault


def check_suffix(path: Path, more: tuple[str, ...] = ()) -> None:
    """Raise KeyreconError for a file whose suffix is neither ours nor one of `more`."""
    known, suffix = (*SUFFIXES, *more), path.suffix.lower()
    if suffix not in known:
        if not suffix:
            raise KeyreconError(
                f"{path} has no suffix, which would tell the format; add one of "
                f"{', '.join(sorted(known))}."
            )
        way = ELSEWHERE.get(suffix, f"use {', '.join(sorted(known))}")
        raise KeyreconError(f"{path}: there is no export to '{path.suffix}'; {way}.")


def export_motion(
    path: Path,
    motion: Motion,
    size: tuple[int, int] | None = None,
    first_frame: int = 0,
    further: Mapping[str, np.ndarray] | None = None,
) -> str:
    """Write `motion` in the format of the path's suffix; returns what was done to it.

    `size` is the picture's, px; `first_frame` is the video's frame that the motion begins with;
    `further` is what motion.npz holds besides (`read_further_arrays`): .npz keeps all of it, the
    others its joints in the world, and .json, whose joints are pixels, nothing of it. Raises
    KeyreconError for a suffix that is not known, an optional library that is not installed, or a
    motion that the format cannot hold.
    """
    check_suffix(path)
    suffix = path.suffix.lower()
    joints = (further or {}).get("points3d_world")
    world: World = None
    if joints is not None:
        world = WorldJoints(joints.astype(np.float64), read_origin(further or {}))
    if suffix in WRITERS:
        return WRITERS[suffix](path, motion, world)
    if suffix == ".trc":
        return write_trc(path, motion, world, first_frame)
    if suffix == ".csv":
        return write_csv(path, motion, first_frame, world)
    if suffix == ".nc":
        return write_netcdf(path, motion, world)
    if suffix == ".npz":
        write_motion(path, motion, more=further)
        return f"camera axes{WITH_WORLD if world is not None else ''}; {describe_times(motion)}"
    if size is None:
        raise KeyreconError(
            f"{path}: COCO states the size of the pictures; export from the project whose "
            "video is in place."
        )
    write_coco_motion(path, motion, size, first_frame)
    return f"pixels; {describe_times(motion)}"
