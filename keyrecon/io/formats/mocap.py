"""Motion capture as the truth for measuring: BVH, Acclaim ASF + AMC, or C3D, told by suffix.

Whatever the file, the result is the same: LSP14's joints in metres in a right-handed world with
Y up, checked to be a person: upright, 1.2-2.3 m tall, right side on the right.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.acclaim import read_acclaim
from keyrecon.io.formats.bvh import read_bvh
from keyrecon.io.formats.c3d import read_markers
from keyrecon.io.formats.rigs import find_joints, metres_per_unit, upright
from keyrecon.reading import check_numbers, reading

SUFFIXES = (".bvh", ".amc", ".c3d")
"""Of files that hold a motion."""


@dataclass(frozen=True, eq=False)
class Capture:
    """A captured person."""

    joints: Float[np.ndarray, "T 14 3"]
    """Metres; world axes with Y up, right-handed; joints in the order of LSP14."""
    fps: float
    toes: Float[np.ndarray, "T 2 3"] | None = None
    """Right and left toe, metres; None where the file has none."""
    club: Float[np.ndarray, "T 2 3"] | None = None
    """Hand end and head of a golf club, metres; None where the file has none."""


def find_captures(paths: Iterable[Path]) -> list[Path]:
    """The files named, and those in the folders named, in order of their names."""
    files = [file for path in paths for file in (_inside(path) if path.is_dir() else [path])]
    if not files:
        raise KeyreconError("There is no capture; name .bvh, .amc or .c3d files or their folder.")
    return files


def _inside(folder: Path) -> list[Path]:
    return sorted(file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES)


def read_mocap(paths: Sequence[Path], trim: int = 0) -> tuple[Capture, ...]:
    """Read several files; ASF files among them go with their AMC files and are passed over."""
    captures = tuple(read_capture(p, trim) for p in paths if p.suffix.lower() != ".asf")
    if not captures:
        raise KeyreconError("There is no motion among the files; name .bvh, .amc or .c3d files.")
    return captures


def read_capture(path: Path, trim: int = 0) -> Capture:
    """Read one .bvh, .amc or .c3d file without `trim` frames at either end.

    The unit is found from the figure's stature (see `formats.rigs`). Raises KeyreconError for
    files that are broken, of another kind, or that hold no upright person.
    """
    path = Path(path)
    if not path.is_file():
        raise KeyreconError(f"{path} does not exist; check the path.")
    try:
        with reading(path, "motion capture of a person", "export it again"):
            capture = _read(path)
            check_numbers("a joint", capture.joints)
    except KeyreconError as fault:
        if str(path) in str(fault):
            raise
        raise KeyreconError(f"{path}: {fault}") from fault
    frames = len(capture.joints) - 2 * trim
    if frames < 1:
        raise KeyreconError(
            f"{path} has {len(capture.joints)} frames, too few to drop {trim} at either end."
        )
    kept = slice(trim, trim + frames)
    toes = None if capture.toes is None else capture.toes[kept]
    club = None if capture.club is None else capture.club[kept]
    return Capture(capture.joints[kept], capture.fps, toes, club)


def _read(path: Path) -> Capture:
    suffix = path.suffix.lower()
    toes: Float[np.ndarray, "T 2 3"] | None
    club: Float[np.ndarray, "T 2 3"] | None = None
    if suffix == ".c3d":
        markers = read_markers(path)
        joints, toes, club, fps = markers.joints, markers.toes, markers.club, markers.fps
    elif suffix in (".bvh", ".amc"):
        figure = read_bvh(path) if suffix == ".bvh" else read_acclaim(path)
        joints, toes = find_joints(figure)
        fps = figure.fps
    else:
        raise KeyreconError(f"{path}: '{suffix}' is not motion capture; use .bvh, .amc or .c3d.")
    metres = metres_per_unit(joints)
    stand = upright(joints, joints)
    toes, club = (None if p is None else metres * upright(p, joints) for p in (toes, club))
    _check_sides(metres * stand, toes)
    return Capture(metres * stand, fps, toes, club)


def _check_sides(
    joints: Float[np.ndarray, "T 14 3"], toes: Float[np.ndarray, "T 2 3"] | None
) -> None:
    """Raise KeyreconError when the right side is on the left as the toes point."""
    if toes is None:
        return
    ankles = [LSP14.index("right_ankle"), LSP14.index("left_ankle")]
    hips = [LSP14.index("right_hip"), LSP14.index("left_hip")]
    forward = (toes - joints[:, ankles]).mean(axis=1)
    across = joints[:, hips[0]] - joints[:, hips[1]]
    right = np.cross(forward, [0.0, 1.0, 0.0])
    if np.median((right * across).sum(axis=1)) < 0:
        raise KeyreconError(
            "The right hip is on the figure's left, the file is mirrored; swap the sides' names "
            "or mirror one axis."
        )
