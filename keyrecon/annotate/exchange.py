"""Marks from and for other programs, through the page.

A file is looked at first: how many frames and marks are new, and which differ from those in the
project. Only a second request takes it in, as one edit that can be undone; `keep` leaves marks
that differ as they are, `replace` takes the file's.
"""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from starlette.responses import Response

from keyrecon.annotate.cells import Cells, Change, of_kind
from keyrecon.annotate.desk import Desk
from keyrecon.annotate.marks import cells_from_annotations, is_absent
from keyrecon.errors import KeyreconError
from keyrecon.formats.annotations import read_annotations
from keyrecon.formats.coco import coco_text
from keyrecon.formats.cvat import cvat_text
from keyrecon.formats.dlc import dlc_text
from keyrecon.merging import SAME_PX

WRITERS = {
    "coco": (coco_text, "annotations.json", "application/json"),
    "dlc": (dlc_text, "CollectedData_keyrecon.csv", "text/csv"),
    "cvat": (cvat_text, "annotations.xml", "application/xml"),
}


@dataclass(frozen=True)
class Compared:
    """What a file would change."""

    new: tuple[Change, ...]
    """Marks and signs where there were none."""
    differing: tuple[Change, ...]
    """Marks and signs that contradict those in the project."""


def import_marks(desk: Desk, file: tuple[str, str], mode: str | None) -> dict[str, Any]:
    """Compare a file (name, text) with the project; take it in if a mode is given."""
    if mode not in (None, "keep", "replace"):
        raise KeyreconError(f"The mode is 'keep' or 'replace', not '{mode}'.")
    found = _read(desk, *file)
    compared = compare(desk.store.state.cells, found)
    if mode:
        taken = compared.new + (compared.differing if mode == "replace" else ())
        desk.store.apply("import", taken)
    return {
        "revision": desk.store.state.revision,
        "frames": sorted({int(key[1]) for key in found}),
        "new": len(of_kind(dict.fromkeys(c.key for c in compared.new), "mark")),
        "signs": len(of_kind(dict.fromkeys(c.key for c in compared.new), "nearer")),
        "conflicts": [_conflict(change) for change in compared.differing],
    }


def compare(cells: Cells, found: Cells) -> Compared:
    """Sort what a file holds into new and differing."""
    changes = [Change(key, cells.get(key), value) for key, value in sorted(found.items())]
    return Compared(
        tuple(c for c in changes if c.before is None),
        tuple(c for c in changes if c.before is not None and not _same(c)),
    )


def _same(change: Change) -> bool:
    """Whether two values are one, rounded by some format that may not know hidden joints."""
    if change.key[0] == "nearer":
        return change.before == change.after
    if is_absent(change.before) or is_absent(change.after):
        return is_absent(change.before) and is_absent(change.after)
    pairs = zip(change.before[:2], change.after[:2], strict=True)
    return all(abs(a - b) <= SAME_PX for a, b in pairs)


def _conflict(change: Change) -> dict[str, Any]:
    kind, frame, name = change.key
    return {"frame": frame, "kind": kind, "joint": name, "old": change.before, "new": change.after}


def _read(desk: Desk, name: str, text: str) -> Cells:
    """The readers take files, so the text becomes one for a moment; its name is never a path."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "file"
        path.write_text(text, encoding="utf-8")
        try:
            limits = desk.limits
            found = read_annotations(path, limits.skeleton, limits.n_frames, limits.size)
        except KeyreconError as fault:
            raise KeyreconError(str(fault).replace(str(path), name)) from fault
    return cells_from_annotations(found)


def export_marks(desk: Desk, form: str) -> Response:
    """The marks as a file to be kept."""
    if form not in WRITERS:
        raise KeyreconError(f"There is no format '{form}'; there are {', '.join(WRITERS)}.")
    write, name, kind = WRITERS[form]
    text = write(desk.store.annotations(), desk.limits.size)
    disposition = f'attachment; filename="{name}"'
    return Response(text, media_type=kind, headers={"Content-Disposition": disposition})
