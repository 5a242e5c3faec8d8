"""A stretch of motion.npz for the player on the page."""

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from keyrecon.errors import KeyreconError
from keyrecon.formats.npz import read_motion
from keyrecon.records import SOURCES, Motion


def stretch(file: Path, query: dict[str, str]) -> dict[str, Any]:
    """Frames from..to-1 of the motion; {} before there is one."""
    if not file.is_file():
        return {}
    motion = _read(file, file.stat().st_mtime_ns)
    first, last = _range(query, len(motion.time))
    chosen = slice(first, last)
    return {
        "from": first,
        "to": last,
        "units": motion.units,
        "points2d": np.round(motion.points2d[chosen], 1).tolist(),
        "points3d": np.round(motion.points3d[chosen], 4).tolist(),
        "confidence": np.round(motion.confidence[chosen], 2).tolist(),
        "source": motion.source[chosen].tolist(),
        "source_names": list(SOURCES),
    }


@lru_cache(maxsize=1)
def _read(file: Path, changed: int) -> Motion:
    """The motion; read again when the file has changed."""
    return read_motion(file)


def _range(query: dict[str, str], n_frames: int) -> tuple[int, int]:
    try:
        first, last = int(query.get("from", 0)), int(query.get("to", n_frames))
    except ValueError as fault:
        raise KeyreconError("'from' and 'to' are frame numbers.") from fault
    return max(0, first), min(last, n_frames)
