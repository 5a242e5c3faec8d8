"""What the server answers, one function per route: session and request in, an answer for JSON out.

A file of marks from another program is compared first: how many frames and marks are new, and
which contradict those in the project. Only a second request takes it in, as one edit that can be
undone; `keep` leaves marks that contradict as they are, `replace` takes the file's.
"""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Literal

from msgspec import UNSET, Meta, Struct, UnsetType, to_builtins
from starlette.responses import FileResponse, Response

from keyrecon.annotate.server.descriptions import (
    describe_changes,
    describe_job,
    describe_run,
    describe_stacks,
    describe_state,
)
from keyrecon.annotate.server.frame_cache import encode_png
from keyrecon.annotate.server.motion_stretch import motion_stretch
from keyrecon.annotate.server.page_words import in_page_words
from keyrecon.annotate.server.session import Session, describe_project
from keyrecon.annotate.store.cells import (
    Cells,
    Change,
    by_frame,
    cells_from_annotations,
    of_kind,
)
from keyrecon.annotate.store.edits import (
    EditList,
    Frame,
    Limits,
    Name,
    Place,
    Sign,
    check_frame,
)
from keyrecon.annotate.store.file_sync import picks_from_cells
from keyrecon.annotate.store.importing import compare_marks
from keyrecon.annotate.store.journal import Entry
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.annotations import read_annotations
from keyrecon.io.formats.coco import coco_text
from keyrecon.io.formats.cvat import cvat_text
from keyrecon.io.formats.dlc import dlc_text
from keyrecon.io.provenance import current_exports

Json = dict[str, Any]
REPORT_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; media-src data: blob:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; sandbox allow-scripts allow-downloads"
)
"""What the report may do: show itself."""
REPORT_HEADERS = {
    "Content-Security-Policy": REPORT_POLICY,
    "Cross-Origin-Opener-Policy": "unsafe-none",  # no browser opens a sealed page with another
}


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


class PreviewRequest(Struct, forbid_unknown_fields=True):
    """Frames to find the player on."""

    frames: Annotated[list[Frame], Meta(min_length=1, max_length=60)]


class JobOptions(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """How work is done; what is not told is as in the project, null is none of it."""

    budget: float | None = None
    coverage: float | None = None
    reach: float | None = None
    height: float | UnsetType | None = UNSET
    field_of_view: float | UnsetType | None = UNSET
    formats: Annotated[tuple[Annotated[str, Meta(max_length=8)], ...], Meta(max_length=12)] = ()
    """Suffixes of the files to be written; what follows is said for these alone."""
    first: Frame | None = None
    last: Frame | None = None
    view: Annotated[tuple[Name, ...], Meta(max_length=5)] = ()
    skeleton: Name | None = None
    slowmo: float | None = None
    size: int | None = None


class JobRequest(Struct, forbid_unknown_fields=True):
    """Work to begin."""

    kind: Name
    options: JobOptions = JobOptions()


class ShotRequest(Struct, forbid_unknown_fields=True):
    """Whether a shot is to be used."""

    number: Annotated[int, Meta(ge=1)]
    used: bool


class ImportRequest(Struct, forbid_unknown_fields=True):
    """A file of marks; without `accept` it is only compared."""

    name: Annotated[str, Meta(min_length=1, max_length=1000)]
    text: str
    accept: bool = False
    mode: Literal["keep", "replace"] = "keep"


def project(session: Session, request: ApiRequest) -> Json:
    """Video, skeleton, keyframes; their pictures are made ready."""
    described = describe_project(session)
    session.frames.prepare(row["frame"] for row in described["keyframes"])
    return described


def state(session: Session, request: ApiRequest) -> Json:
    """Everything that edits change."""
    return describe_state(session.store.state)


def edits(session: Session, request: ApiRequest) -> Json:
    """Accept edits; when this is answered they are durable."""
    body: EditList = request.body
    results, now = session.store.submit(body.edits), session.store.state
    return {"revision": now.revision, "results": results, **describe_stacks(now)}


def undo(session: Session, request: ApiRequest) -> Json:
    """Take back the last edit."""
    return _describe_turn(session, session.store.undo(request.body.id))


def redo(session: Session, request: ApiRequest) -> Json:
    """Do again what was taken back last."""
    return _describe_turn(session, session.store.redo(request.body.id))


def _describe_turn(session: Session, entry: Entry | None) -> Json:
    now = session.store.state
    return {
        "revision": now.revision,
        **describe_stacks(now),
        "edit": entry.label if entry else None,
        "changes": describe_changes(entry.changes) if entry else [],
    }


def pose_suggestion(session: Session, request: ApiRequest) -> Json:
    """Where the joints of a frame probably are."""
    suggest, frame = session.assistant.suggestion, request.path["frame"]
    check_frame(frame, session.limits)
    return suggest(session.store.annotations(), frame) if suggest else {}


def pose(session: Session, request: ApiRequest) -> Json:
    """A frame's body in space."""
    estimate, body = session.assistant.pose, request.body
    check_frame(body.frame, session.limits)
    for name in (*body.marks, *body.nearer):
        session.limits.skeleton.index(name)
    marks = {name: [float(x) for x in place] for name, place in body.marks.items()}
    signs = {name: sign for name, sign in body.nearer.items() if sign}
    return estimate(session.store.annotations(), body.frame, marks, signs) if estimate else {}


def checks(session: Session, request: ApiRequest) -> list[Json] | None:
    """Marks that look wrong; null where nothing can be checked."""
    check = session.assistant.checks
    return check(session.store.annotations()) if check else None


def next_frames(session: Session, request: ApiRequest) -> list[Json]:
    """Frames where one more annotation would help."""
    suggest, cells = session.assistant.next_frames, session.store.state.cells
    keyframes = session.keyframes.current()
    taken = {int(key[1]) for key in of_kind(cells, "own", "lock")}
    taken |= set(keyframes.frames.tolist()) if keyframes else set()
    return suggest(session.store.annotations(), frozenset(taken)) if suggest else []


def stretches(session: Session, request: ApiRequest) -> list[Json]:
    """Where the result is least sure of itself."""
    find = session.assistant.stretches
    return find(session.store.annotations()) if find else []


def run(session: Session, request: ApiRequest) -> Json:
    """Whether the motion was made from marks, keyframes and options as they are."""
    return describe_run(session.workspace, session.store.state.revision, session.motion_digest)


def swing(session: Session, request: ApiRequest) -> Json:
    """A golf swing: whether the clicks can be, and the last fit; nothing of another project."""
    describe, cells = session.assistant.swing, session.store.state.cells
    if describe is None or not session.workspace.is_golf:
        return {}
    values = (by_frame(cells, kind) for kind in ("golf", "click", "key"))
    description = describe(session.limits.size, *values)
    texts = {"wrong": description["wrong"] and in_page_words(description["wrong"])}
    return description | texts


def preview(session: Session, request: ApiRequest) -> Json:
    """Head and feet found on some frames."""
    find_player, picks = session.assistant.preview, picks_from_cells(session.store.state.cells)
    return find_player(tuple(picks), tuple(request.body.frames)) if find_player else {}


def backprojection(session: Session, request: ApiRequest) -> Response:
    """How much each pixel looks like a part, to be laid over the picture."""
    tint, picks = session.assistant.backprojection, picks_from_cells(session.store.state.cells)
    check_frame(request.path["frame"], session.limits)
    if tint is None:
        return Response(status_code=204)
    picture = tint(tuple(picks), request.path["frame"], request.query.get("part", "head"))
    return Response(encode_png(picture), media_type="image/png")


def shot(session: Session, request: ApiRequest) -> list[Json]:
    """Keep whether a shot is used in the next run."""
    choose, body = session.assistant.choose_shot, request.body
    return choose(body.number, body.used) if choose else []


def jobs(session: Session, request: ApiRequest) -> list[Json]:
    """All jobs since the start."""
    return [describe_job(job) for job in session.jobs.listed()]


def begin_job(session: Session, request: ApiRequest) -> Json:
    """Start work."""
    options = to_builtins(request.body.options)
    return {"job": describe_job(session.jobs.start(request.body.kind, options))}


def cancel_job(session: Session, request: ApiRequest) -> Json:
    """End work; what is finished of it stays."""
    return {"job": describe_job(session.jobs.cancel(request.path["job"]))}


def motion(session: Session, request: ApiRequest) -> Json:
    """A stretch of the result."""
    return motion_stretch(session.workspace.motion_file, request.query)


def report(session: Session, request: ApiRequest) -> Response:
    """The report of the last run. It is one file with scripts of its own, so it is shown apart:
    it may load nothing, and has no access to the page's server."""
    file = session.workspace.report_file
    if not file.is_file():
        raise KeyreconError("There is no report yet: make the motion first.")
    return Response(file.read_bytes(), media_type="text/html", headers=REPORT_HEADERS)


def exports(session: Session, request: ApiRequest) -> list[Json]:
    """The files that were written for other programs, the latest first."""
    workspace = session.workspace
    fitted, files = workspace.golf_results(), workspace.exported_files()
    stamps = {file: file.stat() for file in (*fitted, *files)}
    current = current_exports(workspace)
    files.sort(key=lambda file: stamps[file].st_mtime_ns, reverse=True)
    return [
        {
            "name": file.name,
            "bytes": stamps[file].st_size,
            "place": str(file.parent),
            "fitted": file in fitted,
            "current": file in current,
        }
        for file in (*fitted, *files)
    ]


def exported_file(session: Session, request: ApiRequest) -> Response:
    """One of the files that were exported, to be kept."""
    return _sent(request.path["name"], session.workspace.exported_files())


def fitted_file(session: Session, request: ApiRequest) -> Response:
    """One of the files that a golf fit wrote, to be kept."""
    return _sent(request.path["name"], session.workspace.golf_results())


def _sent(name: str, files: list[Path]) -> Response:
    for file in files:
        if file.name == name:
            return FileResponse(file, filename=name, media_type="application/octet-stream")
    raise KeyreconError(f"There is no file '{name}' among the exports.")


def import_file(session: Session, request: ApiRequest) -> Json:
    """Compare a file of marks with the project, or take it in."""
    return _import_marks(session, request.body)


def export_file(session: Session, request: ApiRequest) -> Any:
    """The marks in another program's format."""
    return _export_marks(session, request.path["format"])


WRITERS = {
    "coco": (coco_text, "annotations.json", "application/json"),
    "dlc": (dlc_text, "CollectedData_keyrecon.csv", "text/csv"),
    "cvat": (cvat_text, "annotations.xml", "application/xml"),
}


def _import_marks(session: Session, body: ImportRequest) -> Json:
    """Compare a file with the project; take it in if it is accepted."""
    imported = _read_marks(session.limits, body.name, body.text)
    comparison = compare_marks(session.store.state.cells, imported)
    if body.accept:
        session.store.apply("import", comparison.changes(replace=body.mode == "replace"))
    new = dict.fromkeys(change.key for change in comparison.new)
    return {
        "revision": session.store.state.revision,
        "frames": sorted({int(key[1]) for key in imported}),
        "new": len(of_kind(new, "mark")),
        "signs": len(of_kind(new, "nearer")),
        "conflicts": [_describe_conflict(change) for change in comparison.conflicts],
    }


def _describe_conflict(change: Change) -> Json:
    kind, frame, name = change.key
    return {"frame": frame, "kind": kind, "joint": name, "old": change.before, "new": change.after}


def _read_marks(limits: Limits, name: str, text: str) -> Cells:
    """The readers take files, so the text becomes one for a moment; its name is never a path."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "file"
        path.write_text(text, encoding="utf-8")
        try:
            marks = read_annotations(path, limits.skeleton, limits.n_frames, limits.size)
        except KeyreconError as fault:
            raise KeyreconError(str(fault).replace(str(path), name)) from fault
    return cells_from_annotations(marks)


def _export_marks(session: Session, form: str) -> Response:
    """The marks as a file to be kept."""
    if form not in WRITERS:
        raise KeyreconError(f"There is no format '{form}'; there are {', '.join(WRITERS)}.")
    write, name, kind = WRITERS[form]
    text = write(session.store.annotations(), session.limits.size)
    disposition = f'attachment; filename="{name}"'
    return Response(text, media_type=kind, headers={"Content-Disposition": disposition})
