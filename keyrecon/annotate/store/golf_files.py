"""golf_clicks.json and golf_marks.json show what a person decided of a golf swing.

What `keyrecon golf fit` reads of a project's cells: the clicks that it begins with, and the marks
that it must hold: joints, the club and the frames of key postures (`io.formats.golf_marks`). Marked
joints stand in annotations.json too, with whether they are hidden, which only that file tells.
"""

import numpy as np

from keyrecon.annotate.store.cells import Cells, is_absent, of_body, of_kind
from keyrecon.annotate.store.edits import Limits
from keyrecon.annotate.store.file_sync import FileForm
from keyrecon.body import LSP14
from keyrecon.io.formats.clicks import (
    GolfClicks,
    clicks_from_parts,
    clicks_text,
    parts_of_clicks,
    read_some_clicks,
)
from keyrecon.io.formats.golf_marks import (
    KEY_POSTURES,
    SwingMarks,
    golf_marks_text,
    read_golf_marks,
)
from keyrecon.io.workspace import Workspace

CLICK_CELLS, MARK_CELLS = ("golf", "click"), ("mark", "shaft", "key")
"""Kinds of cells that either file shows."""


def clicks_form(workspace: Workspace, limits: Limits) -> FileForm:
    """Six joints of one frame, and what is known of the player."""
    path = workspace.golf_clicks_file

    def read(_: Cells) -> Cells:
        return _cells_from_clicks(read_some_clicks(path))

    return FileForm(
        path,
        CLICK_CELLS,
        lambda cells: of_kind(cells, *CLICK_CELLS),
        lambda cells: clicks_text(clicks_from_cells(cells, limits.size)),
        True,
        read,
        lambda _: False,
    )


def clicks_from_cells(cells: Cells, size: tuple[int, int]) -> GolfClicks:
    """The clicks as the fit reads them; joints may be missing."""
    settings, places = (
        {str(key[1]): value for key, value in of_kind(cells, kind).items()} for kind in CLICK_CELLS
    )
    return clicks_from_parts(settings, places, size)


def _cells_from_clicks(clicks: GolfClicks) -> Cells:
    """The cells that hold these clicks."""
    return {
        (kind, name): value
        for kind, part in zip(CLICK_CELLS, parts_of_clicks(clicks), strict=True)
        for name, value in part.items()
    }


def marks_form(workspace: Workspace, limits: Limits) -> FileForm:
    """Joints, club and key postures that a person put right."""
    path = workspace.golf_marks_file

    def pick_out(cells: Cells) -> Cells:
        marks = of_kind(cells, *MARK_CELLS)
        return {key: value for key, value in marks.items() if not _is_absent_joint(key, value)}

    def write(cells: Cells) -> str:
        return golf_marks_text(_marks_from_cells(pick_out(cells)), limits.size)

    def read(cells: Cells) -> Cells:
        return _cells_from_marks(read_golf_marks(path, limits.n_frames, limits.size), cells)

    return FileForm(path, MARK_CELLS, pick_out, write, True, read, lambda _: False)


def _is_absent_joint(key: tuple[str | int, ...], value: object) -> bool:
    return key[0] == "mark" and is_absent(value)


def _marks_from_cells(cells: Cells) -> SwingMarks:
    """The marks as the fit reads them."""
    frames = sorted({int(key[1]) for key in of_kind(cells, "mark", "shaft")})
    row = {frame: k for k, frame in enumerate(frames)}
    joints, shafts = (np.full((len(frames), n, 2), np.nan) for n in (len(LSP14.names), 2))
    for (frame, joint), (x, y, _) in of_body(cells, "mark").items():
        joints[row[frame], LSP14.index(joint)] = x, y
    for key, ends in of_kind(cells, "shaft").items():
        shafts[row[int(key[1])]] = np.reshape(ends, (2, 2))
    keys = np.array([cells.get(("key", name), np.nan) for name in KEY_POSTURES], float)
    return SwingMarks(np.array(frames, np.int64), joints, shafts, keys)


def _cells_from_marks(marks: SwingMarks, cells: Cells) -> Cells:
    """The cells that hold these marks; whether a joint is hidden is left as it was."""
    marked_cells: Cells = {}
    for frame, joints, ends in zip(marks.frames.tolist(), marks.joints, marks.shafts, strict=True):
        for j in np.flatnonzero(np.isfinite(joints).all(axis=1)).tolist():
            key, place = ("mark", frame, LSP14.names[j]), joints[j].tolist()
            before = cells.get(key, [None, None, 2])
            marked_cells[key] = [*place, before[2] if place == before[:2] else 2]
        if np.isfinite(ends).all():
            marked_cells["shaft", frame] = ends.ravel().tolist()
    for name, key_frame in zip(KEY_POSTURES, marks.keys.tolist(), strict=True):
        if np.isfinite(key_frame):
            marked_cells["key", name] = key_frame
    return marked_cells
