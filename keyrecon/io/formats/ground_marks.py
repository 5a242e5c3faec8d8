"""ground_marks.json: {"field_of_view", "marks": [{"kind", "frame", "ends", "metres"}, ...]}.

What a person told `keyrecon ground`: upright things, lengths on the ground and the horizon by both
ends, [[x, y], [x, y]], px of the video, and the field of view, degrees across the picture. `metres`
and `field_of_view` are null where they are not known.
"""

import json
from pathlib import Path
from typing import Any

from keyrecon.io.durable import write_durably
from keyrecon.reading import parse_json, read_text, reading, real, whole
from keyrecon.world.records import KINDS, GroundMark, GroundMarks, Kind


def read_ground_marks(path: Path) -> GroundMarks:
    """Read marks; raises KeyreconError for a file that does not hold them."""
    with reading(path, "a file of marks on the ground", "move it away and mark them again"):
        data = parse_json(read_text(path))
        angle = data["field_of_view"]
        marks = tuple(_mark(row) for row in data["marks"])
        return GroundMarks(marks, None if angle is None else real(angle))


def _mark(row: dict[str, Any]) -> GroundMark:
    start, end = ((real(x), real(y)) for x, y in row["ends"])
    metres = None if row["metres"] is None else real(row["metres"])
    return GroundMark(_kind(row["kind"]), whole(row["frame"]), start, end, metres)


def _kind(name: object) -> Kind:
    for kind in KINDS:
        if name == kind:
            return kind
    raise ValueError(f"{name!r} is no kind of mark")


def write_ground_marks(path: Path, marks: GroundMarks) -> None:
    """Write marks durably, one to a line."""
    rows = [
        {"kind": m.kind, "frame": m.frame, "ends": [m.start, m.end], "metres": m.metres}
        for m in marks.marks
    ]
    body = ",\n  ".join(json.dumps(row) for row in rows)
    angle = json.dumps(marks.field_of_view)
    write_durably(path, f'{{"field_of_view": {angle}, "marks": [\n  {body}\n]}}\n')


def merge_marks(
    old: GroundMarks, added: GroundMarks, dropped: GroundMarks = GroundMarks()
) -> GroundMarks:
    """Old marks without those that are dropped, and new ones; a new field of view replaces it."""
    left = [mark for mark in old.marks if mark not in dropped.marks]
    angle = None if old.field_of_view == dropped.field_of_view else old.field_of_view
    if added.field_of_view is not None:
        angle = added.field_of_view
    return GroundMarks(tuple(dict.fromkeys((*left, *added.marks))), angle)
