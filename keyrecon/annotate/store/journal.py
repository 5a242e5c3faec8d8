"""From the journal to the state: what stands in every cell, and what can be undone or redone.

The journal only grows. To undo is to write one more entry that takes an older one back and
names it; both stacks follow from reading the entries in order, so they outlive the program.

The journal of edits on disk: an SQLite database in WAL mode with synchronous=FULL.

Why SQLite and not a text file with fsync: a batch of edits is one transaction, so it stands
whole or not at all; every frame of the write-ahead log has a checksum, so the torn end that a
loss of power leaves is dropped at the next start; and a full disk rolls back to what was there.
With synchronous=FULL the log has reached the disk before a commit returns: what was
acknowledged survives kill -9 and a loss of power. All of it is the standard library's. The
database is held exclusively: then SQLite needs no memory shared between processes, which WAL mode
otherwise has in a mapped file that network drives do not do well.

Rows are only ever added. `notes` holds small facts beside them: which revision each file shows,
and a digest of all rows, each with that of the rows before. SQLite does not notice a flipped
byte inside a row; at opening the rows are held against the digest.
"""

import hashlib
import json
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, get_args

from keyrecon.annotate.store.cells import Cells, Change, apply_in_place
from keyrecon.errors import KeyreconError
from keyrecon.reading import reading

Role = Literal["edit", "undo", "redo", "fixed"]
Stack = tuple[int, ...]
MAX_UNDOABLE = 1000
"""Edits that can be taken back; the journal itself keeps all."""


@dataclass(frozen=True)
class Entry:
    """One line of the journal."""

    revision: int
    id: str
    """Made by the page; one id counts once."""
    role: Role
    """'undo' and 'redo' concern the entry `of`; 'fixed' cannot be undone."""
    of: int | None
    label: str
    """What kind of edit it was."""
    changes: tuple[Change, ...]


@dataclass(frozen=True)
class JournalState:
    """The sheet after an entry of the journal."""

    revision: int = 0
    cells: Cells = field(default_factory=dict)
    undoable: Stack = ()
    """Revisions that can be taken back, the last one goes first."""
    redoable: Stack = ()


def advance(state: JournalState, entries: Iterable[Entry]) -> JournalState:
    """The state after some more entries."""
    revision, cells, stacks = state.revision, dict(state.cells), (state.undoable, state.redoable)
    for entry in entries:
        apply_in_place(cells, entry.changes)
        stacks = _move(*stacks, entry)
        revision = entry.revision
    return JournalState(revision, cells, *stacks)


def _move(undoable: Stack, redoable: Stack, entry: Entry) -> tuple[Stack, Stack]:
    """Both stacks after an entry."""
    if entry.role == "edit":
        return (*undoable[-MAX_UNDOABLE:], entry.revision), ()
    if entry.of is None:
        return undoable, redoable
    if entry.role == "undo":
        return undoable[:-1], (*redoable, entry.of)
    if entry.role == "redo":
        return (*undoable, entry.of), redoable[:-1]
    return undoable, redoable


VERSION = 1
DIGEST_NOTE = "digest"
"""Under which the digest of the rows is noted, with the last revision that it covers: a keyrecon
that does not know of it adds rows behind."""
NO_ROWS = ""
REMEDY = (
    "free some space if the disk is full; if the file is damaged, move annotate.sqlite* away: the "
    "marks themselves are in annotations.json, only undo and locks are lost"
)
Row = tuple[int, str, Role, int | None, str, str]
SCHEMA = """
CREATE TABLE IF NOT EXISTS entries (
    revision INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, role TEXT NOT NULL, of INTEGER,
    label TEXT NOT NULL, changes TEXT NOT NULL, at TEXT DEFAULT CURRENT_TIMESTAMP);
CREATE TABLE IF NOT EXISTS notes (name TEXT PRIMARY KEY, value TEXT NOT NULL);
"""


class NotSaved(KeyreconError):
    """An edit that could not be made durable; the page keeps it and sends it again."""


class Journal:
    """Entries and notes in one file; callers see to it that one thread writes at a time."""

    def __init__(self, path: Path) -> None:
        """Open or begin the journal at `path`; KeyreconError for a file that is none."""
        self.path = path
        self._digest = NO_ROWS
        with reading(path, "a whole journal of edits", REMEDY), ExitStack() as held:
            self._base = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
            held.callback(self._base.close)
            self._prepare()
            self._check()
            held.pop_all()

    def _prepare(self) -> None:
        self._base.execute("PRAGMA locking_mode=EXCLUSIVE")
        self._base.execute("PRAGMA journal_mode=WAL")
        self._base.execute("PRAGMA synchronous=FULL")
        version = self._base.execute("PRAGMA user_version").fetchone()[0]
        if version not in (0, VERSION):
            raise KeyreconError(
                f"{self.path} was written by a newer keyrecon (journal version {version}); use "
                "that one."
            )
        self._base.executescript(SCHEMA + f"PRAGMA user_version={VERSION};")

    def _check(self) -> None:
        """Raise ValueError where the journal is not as it was written."""
        integrity = self._base.execute("PRAGMA integrity_check").fetchone()[0]
        if integrity != "ok":
            raise ValueError(integrity)
        digest = self.note(DIGEST_NOTE)
        covered, expected = json.loads(digest) if digest else (0, NO_ROWS)
        last = 0
        for row in self._rows():
            if row[0] != (last := last + 1):
                raise ValueError(f"edit {last} is missing")
            self._digest = _chained(self._digest, row)
            if last == covered and self._digest != expected:
                raise ValueError(f"the edits up to {covered} are not those that were noted")
            entry = _entry(*row)
            if not isinstance(entry.label, str) or entry.role not in get_args(Role):
                raise ValueError(f"edit {last} is none")
        if last < covered:
            raise ValueError(f"{covered} edits were noted, and {last} are there")

    def entries(self, up_to: int | None = None) -> Iterator[Entry]:
        """All entries in order, or those up to a revision."""
        return (_entry(*row) for row in self._rows(up_to))

    def _rows(self, up_to: int | None = None) -> Iterator[Row]:
        return self._base.execute(
            "SELECT revision, id, role, of, label, changes FROM entries "
            "WHERE revision <= ? ORDER BY revision",
            (up_to if up_to is not None else 2**62,),
        )

    def entry(self, revision: int) -> Entry:
        """One entry."""
        row = self._base.execute(
            "SELECT revision, id, role, of, label, changes FROM entries WHERE revision = ?",
            (revision,),
        ).fetchone()
        return _entry(*row)

    def knows(self, edit_id: str) -> bool:
        """Whether an edit with this id was accepted before."""
        query = "SELECT 1 FROM entries WHERE id = ?"
        return self._base.execute(query, (edit_id,)).fetchone() is not None

    def append(self, entries: Iterable[Entry], notes: Mapping[str, str]) -> None:
        """Add entries and replace notes, all or none; they are on the disk when this returns."""
        rows = [
            (e.revision, e.id, e.role, e.of, e.label, json.dumps(e.changes, allow_nan=False))
            for e in entries
        ]
        digest = self._digest
        for row in rows:
            digest = _chained(digest, row)
        noted = {DIGEST_NOTE: json.dumps([rows[-1][0], digest])} if rows else {}
        with self._transaction():
            self._base.executemany(
                "INSERT INTO entries (revision, id, role, of, label, changes) "
                "VALUES (?, ?, ?, ?, ?, ?)",
                rows,
            )
            self._base.executemany("REPLACE INTO notes VALUES (?, ?)", {**notes, **noted}.items())
        self._digest = digest

    def note(self, name: str) -> str | None:
        """A fact noted earlier."""
        row = self._base.execute("SELECT value FROM notes WHERE name = ?", (name,)).fetchone()
        return row[0] if row else None

    def close(self) -> None:
        """Fold the log into the database and let go of it."""
        self._base.close()

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        """One write that stands whole or not at all; NotSaved where the disk refuses it."""
        try:
            self._base.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._base.execute("COMMIT")
            except BaseException:
                if self._base.in_transaction:
                    self._base.execute("ROLLBACK")
                raise
        except sqlite3.Error as fault:
            raise NotSaved(
                f"{self.path} could not be written ({fault}). Free some space: the page keeps the "
                "edit and sends it again."
            ) from fault


def _chained(before: str, row: Row) -> str:
    """The digest of all rows up to this one."""
    return hashlib.sha256(f"{before}{row!r}".encode()).hexdigest()


def _entry(revision: int, id_: str, role: Role, of: int | None, label: str, changes: str) -> Entry:
    parsed = tuple(Change(tuple(key), old, new) for key, old, new in json.loads(changes))
    return Entry(revision, id_, role, of, label, parsed)
