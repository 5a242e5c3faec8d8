"""DeepLabCut's CollectedData CSV: one row per labelled picture, x and y per body part.

The heading has rows `scorer`, `individuals` (multi-animal projects only), `bodyparts` and
`coords`. A row begins with the picture (labeled-data, folder and name in three columns, or as
one path), whose name ends in the frame number, or in predictions with that number itself. An
empty place is a joint that was not labelled. The format does not know hidden joints: every mark
counts as visible.
"""

import csv
import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from keyrecon.body import Skeleton
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.annotation_checks import (
    Mark,
    MarksFile,
    MarkSheet,
    checked_marks,
    frame_of_picture,
)
from keyrecon.reading import read_text, reading
from keyrecon.records import Annotations

SURE = 0.6
"""Predictions below this likelihood are not marks (DeepLabCut's default pcutoff)."""

Columns = dict[str, dict[str, int]]
"""Column of every coordinate of every body part."""


def read_dlc(
    path: Path | str, skeleton: Skeleton, n_frames: int, size: tuple[int, int]
) -> MarksFile:
    """Read and check marks; raises KeyreconError for a broken file, naming frame and joint."""
    path = Path(path)
    sheet = MarkSheet(path, skeleton, n_frames, size)
    remedy = (
        "its heading has the rows scorer, bodyparts and coords, and every row a picture and numbers"
    )
    with reading(path, "a DeepLabCut file", remedy):
        rows = [row for row in csv.reader(io.StringIO(read_text(path))) if any(row)]
        head = _heading(rows, path)
        columns = _columns(head)
        first = min(column for part in columns.values() for column in part.values())
        body = rows[len(head) :]
        marks = [mark for row in body for mark in _marks(row, first, columns, path)]
        return checked_marks(marks, sheet)


def _heading(rows: list[list[str]], path: Path) -> dict[str, list[str]]:
    """The heading's rows by their first word."""
    head = {}
    for row in rows[:4]:
        if row[0] not in ("scorer", "individuals", "bodyparts", "coords"):
            break
        head[row[0]] = row
    if missing := {"bodyparts", "coords"} - head.keys():
        raise ValueError(f"no row {sorted(missing)[0]}")
    animals = {name for name in head.get("individuals", [""])[1:] if name and name != "single"}
    if len(animals) > 1:
        raise KeyreconError(
            f"{path} has {len(animals)} individuals ({', '.join(sorted(animals))}); keep the "
            "columns of one athlete."
        )
    return head


def _columns(head: dict[str, list[str]]) -> Columns:
    columns: Columns = {}
    pairs = zip(head["bodyparts"], head["coords"], strict=True)
    for column, (part, coordinate) in enumerate(pairs):
        if column and part and coordinate in ("x", "y", "likelihood"):
            columns.setdefault(part, {})[coordinate] = column
    if not columns or any(not {"x", "y"} <= part.keys() for part in columns.values()):
        raise ValueError("a body part lacks its column x or y")
    return columns


def _marks(row: list[str], first: int, columns: Columns, path: Path) -> Iterator[Mark]:
    """The joints labelled in one row."""
    name = next((word for word in reversed(row[:first]) if word), None)
    if name is None:
        raise ValueError(f"the row {','.join(row)} names no picture")
    picture = "" if name.isdecimal() else name
    frame = frame_of_picture(picture, path) if picture else int(name)
    for part, column in columns.items():
        x, y = row[column["x"]].strip(), row[column["y"]].strip()
        sure = float(row[column["likelihood"]] or 0) if "likelihood" in column else 1.0
        if (x and y and x.lower() != "nan" and y.lower() != "nan") and sure >= SURE:
            yield Mark(frame, part, float(x), float(y), True, picture)


def dlc_text(annotations: Annotations, _: tuple[int, int]) -> str:
    """Marks as the text of a CollectedData CSV; pictures are named by their frame."""
    names, blank = annotations.skeleton.names, ["", ""]
    heading = [
        ["scorer", *blank, *["keyrecon"] * (2 * len(names))],
        ["bodyparts", *blank, *(name for name in names for _ in "xy")],
        ["coords", *blank, *["x", "y"] * len(names)],
    ]
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerows(heading)
    for frame, joints in zip(annotations.frames.tolist(), annotations.joints, strict=True):
        if np.isfinite(joints).any():
            places = ["" if np.isnan(n) else f"{n:.4f}" for n in joints.ravel()]
            writer.writerow(["labeled-data", "keyframes", f"frame_{frame:06d}.png", *places])
    return file.getvalue()
