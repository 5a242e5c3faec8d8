"""A motion in other programs' formats, told by suffix. The overlay video is the report's work."""

from collections.abc import Callable
from pathlib import Path

from keyrecon.errors import KeyreconError
from keyrecon.io.formats.bvh_motion import write_bvh
from keyrecon.io.formats.c3d import write_c3d
from keyrecon.io.formats.coco import write_coco_motion
from keyrecon.io.formats.csv_table import write_csv
from keyrecon.io.formats.glb import write_glb
from keyrecon.io.formats.motion_file import write_motion
from keyrecon.io.formats.netcdf import write_netcdf
from keyrecon.io.formats.trc import write_trc
from keyrecon.records import Motion

WRITERS: dict[str, Callable[[Path, Motion], None]] = {
    ".bvh": write_bvh,
    ".c3d": write_c3d,
    ".csv": write_csv,
    ".glb": write_glb,
    ".nc": write_netcdf,
    ".npz": write_motion,
    ".trc": write_trc,
}
"""What writes a motion, by suffix; .json (COCO) needs the picture's size besides."""

SUFFIXES = (*WRITERS, ".json")


def check_suffix(path: Path, more: tuple[str, ...] = ()) -> None:
    """Raise KeyreconError for a file whose suffix is neither ours nor one of `more`."""
    known = (*SUFFIXES, *more)
    if path.suffix.lower() not in known:
        raise KeyreconError(
            f"{path}: there is no export to '{path.suffix}'; use {', '.join(sorted(known))}."
        )


def export_motion(path: Path, motion: Motion, size: tuple[int, int] | None = None) -> None:
    """Write `motion` in the format of the path's suffix; `size` is the picture's, px.

    Raises KeyreconError for a suffix that is not known, an optional library that is not
    installed, or a motion that the format cannot hold.
    """
    check_suffix(path)
    suffix = path.suffix.lower()
    if suffix == ".json":
        if size is None:
            raise KeyreconError(
                f"{path}: COCO states the size of the pictures; export from the project whose "
                "video is in place."
            )
        write_coco_motion(path, motion, size)
    else:
        WRITERS[suffix](path, motion)
