"""How the sheet looks as annotations.json and picks.json."""

from pathlib import Path

from keyrecon.annotate.cells import FILE_CELLS, Cells, changed_keys, of_kind, picks_of
from keyrecon.annotate.edits import Limits
from keyrecon.annotate.marks import (
    annotations_from_cells,
    cells_from_annotations,
    is_absent,
    written_cells,
)
from keyrecon.annotate.mirror import FileForm
from keyrecon.formats.coco import Lines, coco_lines, read_coco, text_of_lines
from keyrecon.formats.picks import picks_text, read_picks
from keyrecon.records import Pick
from keyrecon.workspace import Workspace


def annotations_form(workspace: Workspace, limits: Limits) -> FileForm:
    """Marks and depth signs as COCO keypoints."""
    path, skeleton = workspace.annotations_file, limits.skeleton

    def read(_: Cells) -> Cells:
        return cells_from_annotations(read_coco(path, skeleton, limits.n_frames, limits.size))

    return FileForm(path, FILE_CELLS, written_cells, MarksWriter(limits), True, read, is_absent)


class MarksWriter:
    """Puts the text of annotations.json together; of most frames it knows the lines already.

    An edit concerns one frame, and a project can have hundreds: only frames of which a cell is
    another than the last time are written anew.
    """

    def __init__(self, limits: Limits) -> None:
        """Begin with an empty sheet."""
        self._limits = limits
        names = limits.skeleton.names
        self._places = [(kind, name) for kind in FILE_CELLS for name in names]
        self._cells: Cells = {}
        self._lines: dict[int, Lines] = {}

    def __call__(self, cells: Cells) -> str:
        """The text that shows these cells."""
        skeleton, size = self._limits.skeleton, self._limits.size
        frames = {key[1] for key in changed_keys(self._cells, cells) if key[0] in FILE_CELLS}
        keys = ((kind, frame, name) for frame in frames for kind, name in self._places)
        marks = annotations_from_cells({k: cells[k] for k in keys if k in cells}, skeleton)
        kept = {frame: told for frame, told in self._lines.items() if frame not in frames}
        self._lines = kept | coco_lines(marks, size)
        self._cells = cells
        return text_of_lines(self._lines, skeleton)


def picks_form(workspace: Workspace) -> FileForm:
    """Clicks on colours."""
    path = workspace.picks_file
    return FileForm(
        path,
        ("pick",),
        lambda cells: of_kind(cells, "pick"),
        lambda cells: picks_text(picks_from_cells(cells)),
        False,
        lambda cells: _read_picks(path, cells),
        lambda _: False,
    )


def picks_from_cells(cells: Cells) -> list[Pick]:
    """The clicks as the rest of keyrecon reads them."""
    return [Pick(p["frame"], p["part"], p["x"], p["y"]) for p in picks_of(cells)]


def _read_picks(path: Path, cells: Cells) -> Cells:
    """The file has no ids: clicks that are known keep theirs, others are named by content."""
    known = {tuple(value.values()): key for key, value in of_kind(cells, "pick").items()}
    found: Cells = {}
    for pick in read_picks(path):
        place = {"frame": pick.frame, "part": pick.part, "x": pick.x, "y": pick.y}
        name = f"{pick.part}-{pick.frame}-{pick.x:g}-{pick.y:g}"
        found[known.get(tuple(place.values()), ("pick", name))] = place
    return found
