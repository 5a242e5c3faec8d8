"""What the server answers, one function per route: the project's desk and what was asked go in.

What comes out can be written as JSON. The route table itself is in server.py.

A stretch of motion.npz for the player on the page.

Marks from and for other programs, through the page.

A file is looked at first: how many frames and marks are new, and which differ from those in the
project. Only a second request takes it in, as one edit that can be undone; `keep` leaves marks
that differ as they are, `replace` takes the file's.
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta, Struct
from starlette.responses import Response

from keyrecon.annotate.server.frame_cache import encode_png
from keyrecon.annotate.server.session import (
    Session,
    describe_changes,
    describe_job,
    describe_project,
    describe_stacks,
    describe_state,
)
from keyrecon.annotate.store.cells import Cells, Change, cells_from_annotations, is_absent, of_kind
from keyrecon.annotate.store.edits import EditList, Frame, Name, Place, Sign
from keyrecon.annotate.store.file_sync import picks_from_cells
from keyrecon.annotate.store.journal import Entry
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.annotations import SAME_PX, read_annotations
from keyrecon.io.formats.coco import coco_text
from keyrecon.io.formats.cvat import cvat_text
from keyrecon.io.formats.dlc import dlc_text
from keyrecon.io.formats.motion_file import read_motion
from keyrecon.records import SOURCES, Motion

Json = dict[str, Any]


@dataclass(frozen=True)
class ApiRequest:
    """One request: parts of the path, the query, and the body as it was declared."""

    path: dict[str, Any]
    query: dict[str, str]
    body: Any = None


class HistoryRequest(Struct, forbid_unknown_fields=True):
    """Undo or redo; the id makes a repeated request count once."""

    id: Name


class PoseRequest(Struct, forbid_unknown_fields=True):
    """Marks and signs of one frame, saved or not."""

    frame: Frame
    marks: dict[Name, Place]
    nearer: dict[Name, Sign]


class StripRequest(Struct, forbid_unknown_fields=True):
    """Frames to look for the player on."""

    frames: Annotated[list[Frame], Meta(min_length=1, max_length=60)]


class JobRequest(Struct, forbid_unknown_fields=True):
    """Work to begin."""

    kind: Name
    options: dict[Literal["budget", "coverage", "reach", "height"], float | None] = {}


class ImportRequest(Struct, forbid_unknown_fields=True):
    """A file of marks; without `accept` it is only looked at."""

    name: Name
    text: str
    accept: bool = False
    mode: str = "keep"


def project(desk: Session, asked: ApiRequest) -> Json:
    """Video, skeleton, keyframes; their pictures are made ready."""
    told = describe_project(desk)
    desk.stills.prepare(row["frame"] for row in told["keyframes"])
    return told


def state(desk: Session, asked: ApiRequest) -> Json:
    """Everything that edits change."""
    return describe_state(desk.store.state)


def edits(desk: Session, asked: ApiRequest) -> Json:
    """Accept edits; when this is answered they are durable."""
    body: EditList = asked.body
    results, now = desk.store.submit(body.edits), desk.store.state
    return {"revision": now.revision, "results": results, **describe_stacks(now)}


def undo(desk: Session, asked: ApiRequest) -> Json:
    """Take back the last edit."""
    return _turned(desk, desk.store.undo(asked.body.id))


def redo(desk: Session, asked: ApiRequest) -> Json:
    """Do again what was taken back last."""
    return _turned(desk, desk.store.redo(asked.body.id))


def _turned(desk: Session, entry: Entry | None) -> Json:
    now = desk.store.state
    return {
        "revision": now.revision,
        **describe_stacks(now),
        "edit": entry.label if entry else None,
        "changes": describe_changes(entry.changes) if entry else [],
    }


def pose_suggestion(desk: Session, asked: ApiRequest) -> Json:
    """Where the joints of a frame probably are."""
    ask = desk.assistant.ghost
    return ask(desk.store.annotations(), asked.path["frame"]) if ask else {}


def pose(desk: Session, asked: ApiRequest) -> Json:
    """A frame's body in space."""
    ask, body = desk.assistant.pose, asked.body
    marks = {name: [float(x) for x in place] for name, place in body.marks.items()}
    signs = {name: sign for name, sign in body.nearer.items() if sign}
    return ask(desk.store.annotations(), body.frame, marks, signs) if ask else {}


def checks(desk: Session, asked: ApiRequest) -> list[Json]:
    """Marks to look at again."""
    ask = desk.assistant.checks
    return ask(desk.store.annotations()) if ask else []


def suggestions(desk: Session, asked: ApiRequest) -> list[Json]:
    """Frames where one more annotation would help."""
    ask, cells = desk.assistant.suggest, desk.store.state.cells
    keyframes = desk.keyframes.current()
    taken = {int(key[1]) for key in of_kind(cells, "own", "lock")}
    taken |= set(keyframes.frames.tolist()) if keyframes else set()
    return ask(desk.store.annotations(), frozenset(taken)) if ask else []


def preview(desk: Session, asked: ApiRequest) -> Json:
    """Head and feet found on some frames."""
    ask, picks = desk.assistant.preview, picks_from_cells(desk.store.state.cells)
    return ask(tuple(picks), tuple(asked.body.frames)) if ask else {}


def backprojection(desk: Session, asked: ApiRequest) -> Response:
    """How much each pixel looks like a part, to be laid over the picture."""
    ask, picks = desk.assistant.backprojection, picks_from_cells(desk.store.state.cells)
    if ask is None:
        return Response(status_code=204)
    picture = ask(tuple(picks), asked.path["frame"], asked.query.get("part", "head"))
    return Response(encode_png(picture), media_type="image/png")


def jobs(desk: Session, asked: ApiRequest) -> list[Json]:
    """All jobs since the start."""
    return [describe_job(job) for job in desk.jobs.listed()]


def begin_job(desk: Session, asked: ApiRequest) -> Json:
    """Start work."""
    return {"job": describe_job(desk.jobs.start(asked.body.kind, asked.body.options))}


def cancel_job(desk: Session, asked: ApiRequest) -> Json:
    """End work; what is finished of it stays."""
    return {"job": describe_job(desk.jobs.cancel(asked.path["job"]))}


def motion(desk: Session, asked: ApiRequest) -> Json:
    """A stretch of the result."""
    return motion_stretch(desk.workspace.motion_file, asked.query)


def import_file(desk: Session, asked: ApiRequest) -> Json:
    """Look at a file of marks, or take it in."""
    body: ImportRequest = asked.body
    return import_marks(desk, (body.name, body.text), body.mode if body.accept else None)


def export_file(desk: Session, asked: ApiRequest) -> Any:
    """The marks in another program's format."""
    return export_marks(desk, asked.path["format"])


def motion_stretch(file: Path, query: dict[str, str]) -> dict[str, Any]:
    """Frames from..to-1 of the motion; {} before there is one."""
    if not file.is_file():
        return {}
    motion = _read_motion(file, file.stat().st_mtime_ns)
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
def _read_motion(file: Path, changed: int) -> Motion:
    """The motion; read again when the file has changed."""
    return read_motion(file)


def _range(query: dict[str, str], n_frames: int) -> tuple[int, int]:
    try:
        first, last = int(query.get("from", 0)), int(query.get("to", n_frames))
    except ValueError as fault:
        raise KeyreconError("'from' and 'to' are frame numbers.") from fault
    return max(0, first), min(last, n_frames)


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


def import_marks(desk: Session, file: tuple[str, str], mode: str | None) -> dict[str, Any]:
    """Compare a file (name, text) with the project; take it in if a mode is given."""
    if mode not in (None, "keep", "replace"):
        raise KeyreconError(f"The mode is 'keep' or 'replace', not '{mode}'.")
    found = _read_marks(desk, *file)
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


def _read_marks(desk: Session, name: str, text: str) -> Cells:
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


def export_marks(desk: Session, form: str) -> Response:
    """The marks as a file to be kept."""
    if form not in WRITERS:
        raise KeyreconError(f"There is no format '{form}'; there are {', '.join(WRITERS)}.")
    write, name, kind = WRITERS[form]
    text = write(desk.store.annotations(), desk.limits.size)
    disposition = f'attachment; filename="{name}"'
    return Response(text, media_type=kind, headers={"Content-Disposition": disposition})
