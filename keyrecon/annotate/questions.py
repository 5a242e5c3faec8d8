"""What the server answers, one function per route: the project's desk and what was asked go in.

What comes out can be written as JSON. The route table itself is in server.py.
"""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from msgspec import Meta, Struct
from starlette.responses import Response

from keyrecon.annotate import moving
from keyrecon.annotate.cells import of_kind
from keyrecon.annotate.desk import (
    Desk,
    describe_changes,
    describe_job,
    describe_project,
    describe_stacks,
    describe_state,
)
from keyrecon.annotate.edits import EditList, Frame, Name, Place, Sign
from keyrecon.annotate.exchange import export_marks, import_marks
from keyrecon.annotate.files import picks_from_cells
from keyrecon.annotate.history import Entry
from keyrecon.annotate.stills import encode_png

Json = dict[str, Any]


@dataclass(frozen=True)
class Asked:
    """One request: parts of the path, the query, and the body as it was declared."""

    path: dict[str, Any]
    query: dict[str, str]
    body: Any = None


class Turn(Struct, forbid_unknown_fields=True):
    """Undo or redo; the id makes a repeated request count once."""

    id: Name


class PoseQuestion(Struct, forbid_unknown_fields=True):
    """Marks and signs of one frame, saved or not."""

    frame: Frame
    marks: dict[Name, Place]
    nearer: dict[Name, Sign]


class StripQuestion(Struct, forbid_unknown_fields=True):
    """Frames to look for the player on."""

    frames: Annotated[list[Frame], Meta(min_length=1, max_length=60)]


class JobQuestion(Struct, forbid_unknown_fields=True):
    """Work to begin."""

    kind: Name
    options: dict[Literal["budget", "coverage", "reach", "height"], float | None] = {}


class ImportQuestion(Struct, forbid_unknown_fields=True):
    """A file of marks; without `accept` it is only looked at."""

    name: Name
    text: str
    accept: bool = False
    mode: str = "keep"


def project(desk: Desk, asked: Asked) -> Json:
    """Video, skeleton, keyframes; their pictures are made ready."""
    told = describe_project(desk)
    desk.stills.prepare(row["frame"] for row in told["keyframes"])
    return told


def state(desk: Desk, asked: Asked) -> Json:
    """Everything that edits change."""
    return describe_state(desk.store.state)


def edits(desk: Desk, asked: Asked) -> Json:
    """Accept edits; when this is answered they are durable."""
    body: EditList = asked.body
    results, now = desk.store.submit(body.edits), desk.store.state
    return {"revision": now.revision, "results": results, **describe_stacks(now)}


def undo(desk: Desk, asked: Asked) -> Json:
    """Take back the last edit."""
    return _turned(desk, desk.store.undo(asked.body.id))


def redo(desk: Desk, asked: Asked) -> Json:
    """Do again what was taken back last."""
    return _turned(desk, desk.store.redo(asked.body.id))


def _turned(desk: Desk, entry: Entry | None) -> Json:
    now = desk.store.state
    return {
        "revision": now.revision,
        **describe_stacks(now),
        "edit": entry.label if entry else None,
        "changes": describe_changes(entry.changes) if entry else [],
    }


def ghost(desk: Desk, asked: Asked) -> Json:
    """Where the joints of a frame probably are."""
    ask = desk.assistant.ghost
    return ask(desk.store.annotations(), asked.path["frame"]) if ask else {}


def pose(desk: Desk, asked: Asked) -> Json:
    """A frame's body in space."""
    ask, body = desk.assistant.pose, asked.body
    marks = {name: [float(x) for x in place] for name, place in body.marks.items()}
    signs = {name: sign for name, sign in body.nearer.items() if sign}
    return ask(desk.store.annotations(), body.frame, marks, signs) if ask else {}


def checks(desk: Desk, asked: Asked) -> list[Json]:
    """Marks to look at again."""
    ask = desk.assistant.checks
    return ask(desk.store.annotations()) if ask else []


def suggestions(desk: Desk, asked: Asked) -> list[Json]:
    """Frames where one more annotation would help."""
    ask, cells = desk.assistant.suggest, desk.store.state.cells
    keyframes = desk.keyframes.current()
    taken = {int(key[1]) for key in of_kind(cells, "own", "lock")}
    taken |= set(keyframes.frames.tolist()) if keyframes else set()
    return ask(desk.store.annotations(), frozenset(taken)) if ask else []


def preview(desk: Desk, asked: Asked) -> Json:
    """Head and feet found on some frames."""
    ask, picks = desk.assistant.preview, picks_from_cells(desk.store.state.cells)
    return ask(tuple(picks), tuple(asked.body.frames)) if ask else {}


def backprojection(desk: Desk, asked: Asked) -> Response:
    """How much each pixel looks like a part, to be laid over the picture."""
    ask, picks = desk.assistant.backprojection, picks_from_cells(desk.store.state.cells)
    if ask is None:
        return Response(status_code=204)
    picture = ask(tuple(picks), asked.path["frame"], asked.query.get("part", "head"))
    return Response(encode_png(picture), media_type="image/png")


def jobs(desk: Desk, asked: Asked) -> list[Json]:
    """All jobs since the start."""
    return [describe_job(job) for job in desk.jobs.listed()]


def begin_job(desk: Desk, asked: Asked) -> Json:
    """Start work."""
    return {"job": describe_job(desk.jobs.start(asked.body.kind, asked.body.options))}


def cancel_job(desk: Desk, asked: Asked) -> Json:
    """End work; what is finished of it stays."""
    return {"job": describe_job(desk.jobs.cancel(asked.path["job"]))}


def motion(desk: Desk, asked: Asked) -> Json:
    """A stretch of the result."""
    return moving.stretch(desk.workspace.motion_file, asked.query)


def import_file(desk: Desk, asked: Asked) -> Json:
    """Look at a file of marks, or take it in."""
    body: ImportQuestion = asked.body
    return import_marks(desk, (body.name, body.text), body.mode if body.accept else None)


def export_file(desk: Desk, asked: Asked) -> Any:
    """The marks in another program's format."""
    return export_marks(desk, asked.path["format"])
