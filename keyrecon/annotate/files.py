"""How the sheet looks as annotations.json and picks.json."""

from pathlib import Path

from keyrecon.annotate.cells import FILE_CELLS, Cells, of_kind, picks_of
from keyrecon.annotate.edits import Limits
from keyrecon.annotate.marks import annotations_from_cells, cells_from_annotations, written_cells
from keyrecon.annotate.mirror import FileForm
from keyrecon.formats.coco import coco_text, read_coco
from keyrecon.formats.picks import picks_text, read_picks
from keyrecon.records import Pick
from keyrecon.workspace import Workspace


def annotations_form(workspace: Workspace, limits: Limits) -> FileForm:
    """Marks and depth signs as COCO keypoints."""
    path, skeleton = workspace.annotations_file, limits.skeleton

    def read(_: Cells) -> Cells:
        return cells_from_annotations(read_coco(path, skeleton, limits.n_frames, limits.size))

    def write(cells: Cells) -> str:
        return coco_text(annotations_from_cells(cells, skeleton), limits.size)

    return FileForm(path, FILE_CELLS, written_cells, write, True, read)


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
