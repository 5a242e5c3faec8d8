"""From the journal to the state: what stands in every cell, and what can be undone or redone.

The journal only grows. To undo is to write one more entry that takes an older one back and
names it; both stacks follow from reading the entries in order, so they outlive the program.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

from keyrecon.annotate.cells import Cells, Change, apply_in_place

Role = Literal["edit", "undo", "redo", "fixed"]
Stack = tuple[int, ...]
MOST_UNDOABLE = 1000
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
class State:
    """The sheet after an entry of the journal."""

    revision: int = 0
    cells: Cells = field(default_factory=dict)
    undoable: Stack = ()
    """Revisions that can be taken back, the last one goes first."""
    redoable: Stack = ()


def advance(state: State, entries: Iterable[Entry]) -> State:
    """The state after some more entries."""
    revision, cells, stacks = state.revision, dict(state.cells), (state.undoable, state.redoable)
    for entry in entries:
        apply_in_place(cells, entry.changes)
        stacks = _move(*stacks, entry)
        revision = entry.revision
    return State(revision, cells, *stacks)


def _move(undoable: Stack, redoable: Stack, entry: Entry) -> tuple[Stack, Stack]:
    """Both stacks after an entry."""
    if entry.role == "edit":
        return (*undoable[-MOST_UNDOABLE:], entry.revision), ()
    if entry.role == "undo":
        return undoable[:-1], (*redoable, entry.of)
    if entry.role == "redo":
        return (*undoable, entry.of), redoable[:-1]
    return undoable, redoable
