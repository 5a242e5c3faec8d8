"""Frames of the motion, as the page plays them."""

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from keyrecon.errors import KeyreconError
from keyrecon.io.formats.conventions import stature
from keyrecon.io.formats.motion_file import read_motion
from keyrecon.records import SOURCES, Motion


def motion_stretch(file: Path, query: dict[str, str]) -> dict[str, Any]:
    """Frames from..to-1 of the motion; {} before there is one."""
    if not file.is_file():
        return {}
    motion, height = _read_motion(file, file.stat().st_mtime_ns)
    first, last = _range(query, len(motion.time))
    chosen = slice(first, last)
    return {
        "from": first,
        "to": last,
        "cuts": [] if motion.cuts is None else motion.cuts.tolist(),
        "units": motion.units,
        "stature": height,
        "points2d": np.round(motion.points2d[chosen], 1).tolist(),
        "points3d": np.round(motion.points3d[chosen], 4).tolist(),
        "confidence": np.round(motion.confidence[chosen], 2).tolist(),
        "expected_error": None
        if motion.expected_error is None
        else np.round(motion.expected_error[chosen], 1).tolist(),
        "source": motion.source[chosen].tolist(),
        "source_names": list(SOURCES),
    }


@lru_cache(maxsize=1)
def _read_motion(file: Path, changed: int) -> tuple[Motion, float]:
    """The motion, and the player's height in its units; read again when the file has changed."""
    motion = read_motion(file)
    return motion, round(stature(motion), 4)


def _range(query: dict[str, str], n_frames: int) -> tuple[int, int]:
    try:
        first, last = int(query.get("from", 0)), int(query.get("to", n_frames))
    except ValueError as fault:
        raise KeyreconError("'from' and 'to' are frame numbers.") from fault
    return max(0, first), min(last, n_frames)
