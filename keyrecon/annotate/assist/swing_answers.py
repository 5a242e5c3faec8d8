"""What the page shows of a golf swing: whether the clicks can be, and what the last fit found.

Frames go by number, places are px; key postures are not rounded.
"""

import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from keyrecon.annotate.assistant import Json
from keyrecon.errors import KeyreconError
from keyrecon.golf.click_checks import check_pose
from keyrecon.golf.clicks import NEEDED, check_joints, check_numbers, clicked_pose
from keyrecon.golf.records import KEY_POSTURES, MotionModel, RecordedSwing
from keyrecon.io.formats.clicks import clicks_from_parts
from keyrecon.io.formats.model_file import BUILT_IN_SWING_PRIOR, read_motion_model
from keyrecon.io.formats.swing_file import read_swing
from keyrecon.io.provenance import is_fitted
from keyrecon.io.workspace import Workspace
from keyrecon.report.golf_measures import measure_swing

ORIGIN = "The clicks"
"""What messages call them."""
_FRAME = re.compile(r" \(frame (\d+)\)$")


def describe_swing(
    workspace: Workspace,
    size: tuple[int, int],
    settings: Mapping[str, Any],
    clicks: Mapping[str, Sequence[int | float]],
    keys: Mapping[str, int | float],
) -> Json:
    """What is wrong with what was clicked, and the fit: key postures, club, doubts, tempo."""
    return {
        "needed": list(NEEDED),
        "wrong": _clicks_complaint(size, settings, clicks) or _keys_complaint(keys),
        **_describe_fit(workspace),
    }


def _clicks_complaint(
    size: tuple[int, int], settings: Mapping[str, Any], places: Mapping[str, Sequence[int | float]]
) -> str | None:
    """Why no golfer has these joints; None where one has, or while joints are missing."""
    if not {*NEEDED} <= {*places}:
        return None
    clicks = clicks_from_parts(settings, places, size)
    try:
        check_numbers(clicks, ORIGIN)
        check_joints(clicks, ORIGIN)
        check_pose(clicked_pose(clicks), _built_in_prior(), ORIGIN)
    except KeyreconError as fault:
        return str(fault)
    return None


@lru_cache(maxsize=1)
def _built_in_prior() -> MotionModel:
    return read_motion_model(BUILT_IN_SWING_PRIOR)


def _keys_complaint(keys: Mapping[str, int | float]) -> str | None:
    """Why the marked key postures cannot be followed."""
    marked = [(keys[name], name) for name in KEY_POSTURES if name in keys]
    for (before, first), (after, second) in pairwise(marked):
        if before >= after:
            return (
                f"The {second} is marked in frame {after:g}, and the {first}, which comes before "
                f"it, in frame {before:g}; mark one of them anew."
            )
    return None


def _describe_fit(workspace: Workspace) -> Json:
    """The last fit; nothing before there is one, or where the motion is that of keyframes."""
    file = workspace.motion_file
    if not file.is_file():
        return {}
    fit = _read_fit(file, file.stat().st_mtime_ns)
    return fit and {**fit, "fresh": is_fitted(workspace)}


@lru_cache(maxsize=1)
def _read_fit(file: Path, changed: int) -> Json:
    """The fit as JSON; read again when the file has changed."""
    try:
        swing = read_swing(file)
    except KeyreconError:
        return {}
    club = np.where(swing.fitted[:, None, None], swing.club2d, np.nan)
    return {
        "keys": {n: _number(key) for n, key in zip(KEY_POSTURES, swing.keys.tolist(), strict=True)},
        "fitted": swing.fitted.tolist(),
        "club": [_rounded(ends) for ends in club.reshape(-1, 4)],
        "seen": swing.club_seen.tolist(),
        "doubts": [_describe_doubt(doubt) for doubt in swing.doubts],
        "tempo": None if swing.doubts else _describe_tempo(swing),
    }


def _describe_doubt(text: str) -> Json:
    """A doubt with the frame to look at."""
    match = _FRAME.search(text)
    return {"text": _FRAME.sub("", text), "frame": int(match[1]) if match else None}


def _describe_tempo(swing: RecordedSwing) -> str | None:
    """Times and tempo in words."""
    measures = measure_swing(swing)
    up, down, tempo = (measures.key(name) for name in ("upswing", "downswing", "tempo"))
    if not np.isfinite([up.value, down.value, tempo.value]).all():
        return None
    return (
        f"{up.value:.2f} s up, {down.value:.2f} s down, tempo {tempo.value:.1f} : 1 "
        f"(give or take {tempo.doubt:.1f})"
    )


def _rounded(values: np.ndarray) -> list[float | None]:
    return [_number(value) for value in values.tolist()]


def _number(value: float) -> float | None:
    return round(value, 1) if np.isfinite(value) else None
