"""Marks on the ground: what they are called, and those that cannot be."""

from collections.abc import Sequence

import numpy as np

from keyrecon.errors import KeyreconError
from keyrecon.world.records import KINDS, GroundMark, GroundMarks

SHORTEST = 4.0
"""px between the ends of a mark."""
FOV = "fov"
"""What --forget calls the field of view."""


def check_mark(mark: GroundMark, frames: int, size: tuple[int, int]) -> None:
    """Raise KeyreconError for a mark outside the video, or of no length."""
    if not 0 <= mark.frame < frames:
        raise KeyreconError(
            f"Frame {mark.frame} is outside the video, which has frames 0 to {frames - 1}."
        )
    for x, y in (mark.start, mark.end):
        if not (0 <= x < size[0] and 0 <= y < size[1]):
            raise KeyreconError(
                f"The end of the {mark.kind} at {x:g},{y:g} in frame {mark.frame} is outside the "
                f"picture of {size[0]}x{size[1]}."
            )
    if np.hypot(mark.end[0] - mark.start[0], mark.end[1] - mark.start[1]) < SHORTEST:
        raise KeyreconError(
            f"Both ends of the {mark.kind} in frame {mark.frame} are in one place; mark the two "
            "ends of something long."
        )
    if mark.metres is not None and not 0.01 <= mark.metres <= 1000:
        raise KeyreconError(
            f"A {mark.kind} of {mark.metres:g} m cannot be; give its length in metres."
        )


def check_field_of_view(degrees: float) -> None:
    """Raise KeyreconError for one that no camera has."""
    if not 3 < degrees < 150:
        raise KeyreconError(
            "--fov is the angle across the width of the picture in degrees, 40 to 75 for phones; "
            f"{degrees:g} cannot be."
        )


def mark_names(marks: Sequence[GroundMark]) -> list[str]:
    """vertical-1, vertical-2, length-1, ..."""
    counts = dict.fromkeys(KINDS, 0)
    names = []
    for mark in marks:
        counts[mark.kind] += 1
        names.append(f"{mark.kind}-{counts[mark.kind]}")
    return names


def named_marks(kept: GroundMarks, names: Sequence[str]) -> GroundMarks:
    """The marks that are named; "all" names every one.

    Raises KeyreconError for a name that none has.
    """
    there = mark_names(kept.marks)
    known = [*there, *([FOV] if kept.field_of_view is not None else [])]
    if unknown := sorted(set(names) - {*known, "all"}):
        has = f"it has {', '.join(known)}" if known else "it has none"
        raise KeyreconError(f"The project has no mark {unknown[0]} to forget; {has}.")
    if "all" in names:
        return kept
    marks = tuple(m for name, m in zip(there, kept.marks, strict=True) if name in names)
    return GroundMarks(marks, kept.field_of_view if FOV in names else None)
