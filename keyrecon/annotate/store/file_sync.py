"""Files that always show the state: annotations.json (COCO) and picks.json.

The journal is what is true; the files are what other programs read and may change. Before each
edit, and once a second, a file that is not as we left it is read and its difference from what we
had written is taken in as one more edit, so that `keyrecon import` and an editor count like
another page. Which version we had written is noted in the same transaction as the edits: the
`wanted` one, and the one that was `written` until then. A kill between the two leaves the older
file, which is known by its digest and simply brought up to date.
"""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from keyrecon.annotate.store.cells import (
    FILE_CELLS,
    Cells,
    Change,
    Value,
    annotations_from_cells,
    cells_from_annotations,
    changed_keys,
    difference,
    is_absent,
    of_kind,
    picks_of,
    written_cells,
)
from keyrecon.annotate.store.edits import Limits
from keyrecon.annotate.store.journal import NotSaved
from keyrecon.errors import KeyreconError, explain
from keyrecon.io.durable import write_durably
from keyrecon.io.formats.coco import Lines, coco_lines, read_coco, text_of_lines
from keyrecon.io.formats.picks import picks_text, read_picks
from keyrecon.io.workspace import Workspace
from keyrecon.records import Pick

Version = tuple[int, str]
"""Revision that a file shows, and the digest of its text."""
Signature = tuple[int, int, int] | None
UNKNOWN: Version = (0, "")


@dataclass(frozen=True)
class FileForm:
    """How some cells look as a file."""

    path: Path
    kinds: tuple[str, ...]
    """Kinds of cells that concern the file."""
    pick_out: Callable[[Cells], Cells]
    """The cells of the sheet that the file holds."""
    write: Callable[[Cells], str]
    """The sheet as text."""
    may_hold_more: bool
    """Whether other programs may keep things there that the sheet does not know."""
    read: Callable[[Cells], Cells]
    """What the file holds; of equal values the keys of the cells given are used."""
    survives: Callable[[Value], bool]
    """Whether a value stays though another program left it out, because few programs know it."""


@dataclass(frozen=True)
class SyncPlan:
    """A version of a file that is still to be written."""

    version: Version
    text: str


class FileSync:
    """One file, what we last wrote into it, and what it should show next."""

    def __init__(self, form: FileForm, note: str | None) -> None:
        """Begin with what the journal noted about the file."""
        self.form = form
        noted = json.loads(note) if note else {}
        self.written: Version = tuple(noted.get("shown", UNKNOWN))
        self.wanted: Version = tuple(noted.get("wanted", UNKNOWN))
        self._text: str | None = None
        self._signature: Signature = None
        self._outside: tuple[str, Cells] | None = None

    @property
    def name(self) -> str:
        """The file's name."""
        return self.form.path.name

    @property
    def is_new(self) -> bool:
        """Whether the journal has never written this file."""
        return self.wanted == UNKNOWN

    def is_written(self) -> bool:
        """Whether the file already is what it should be, to the letter."""
        return _digest(self.form.path.read_bytes()) == self.wanted[1]

    def outside_changes(self, current: Cells, at: Callable[[int], Cells]) -> tuple[Change, ...]:
        """What another program changed in the file since we wrote it; `at` recalls a revision.

        Raises NotSaved for a file that cannot be read: nothing is written over it.
        """
        try:
            signature = _signature(self.form.path)
            if signature is None or signature == self._signature:
                return ()
            digest = _digest(self.form.path.read_bytes())
        except OSError as fault:
            raise NotSaved(
                f"{self.name} cannot be read ({explain(fault)}). {self._remedy}"
            ) from fault
        ours = {version[1]: version for version in (self.written, self.wanted)}
        changes: tuple[Change, ...] = ()
        if digest in ours:
            self.written = ours[digest]
        else:
            changes = self._read(digest, current, at)
        self._signature = signature
        return changes

    def _read(self, digest: str, current: Cells, at: Callable[[int], Cells]) -> tuple[Change, ...]:
        try:
            cells = self.form.read(current)
        except KeyreconError as fault:
            raise NotSaved(f"{self.name} cannot be read ({fault}). {self._remedy}") from fault
        ours = [version for version in (self.wanted, self.written) if version != UNKNOWN]
        revisions = {revision for revision, _ in ours} or {0}
        bases = [self.form.pick_out(at(revision)) for revision in revisions]
        self.written, self._outside = UNKNOWN, (digest, cells)
        changes = min((difference(base, cells) for base in bases), key=len)
        return tuple(c for c in changes if c.after is not None or not self.form.survives(c.before))

    def accept(self, cells: Cells) -> None:
        """Leave the file as another program wrote it if it says the same as the sheet."""
        if self._outside is not None and self._outside[1] == self.form.pick_out(cells):
            self.written = self.wanted = (self.wanted[0], self._outside[0])
        self._outside = None

    @property
    def _remedy(self) -> str:
        if self.is_new:
            return "Mend the file, or move it away to begin without it."
        return (
            "Another program changed it: mend the file, or move it away to have it written anew "
            "with all that was marked on the page."
        )

    def plan(self, cells: Cells, revision: int) -> SyncPlan | None:
        """What the file shall show after an edit; None while there is nothing to write."""
        if self.is_new and not self.form.pick_out(cells):
            return None
        text = self.form.write(cells)
        return SyncPlan((revision, _digest(text.encode())), text)

    def note(self, plan: SyncPlan) -> str:
        """What the journal shall know once the plan is accepted."""
        return json.dumps({"shown": self.written, "wanted": plan.version})

    def adopt(self, plan: SyncPlan) -> None:
        """The plan is in the journal; `catch_up` carries it out."""
        self.wanted, self._text = plan.version, plan.text

    def catch_up(self, cells: Cells) -> None:
        """Write the file where it does not show what it should; NotSaved if that fails."""
        if self.is_new or (self.written[1] == self.wanted[1] and self.form.path.exists()):
            return
        try:
            write_durably(self.form.path, self._text or self.form.write(cells))
        except KeyreconError as fault:
            raise NotSaved(str(fault)) from fault
        self.written, self._text = self.wanted, None
        self._signature = _signature(self.form.path)


def _signature(path: Path) -> Signature:
    try:
        status = path.stat()
    except FileNotFoundError:
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


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
        kept = {frame: lines for frame, lines in self._lines.items() if frame not in frames}
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
    cells_read: Cells = {}
    for pick in read_picks(path):
        place = {"frame": pick.frame, "part": pick.part, "x": pick.x, "y": pick.y}
        name = f"{pick.part}-{pick.frame}-{pick.x:g}-{pick.y:g}"
        cells_read[known.get(tuple(place.values()), ("pick", name))] = place
    return cells_read
