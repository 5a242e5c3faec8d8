"""The one place where a person's decisions are kept, changed, undone and never lost.

An edit is accepted only if the cells still hold what the page believed; then it goes into the
journal (see journal.py), then the files that show the state are replaced, and only then is it
acknowledged. A failure on the way raises NotSaved: the page keeps the edit and sends it again,
and its id makes sure that it counts once. Listeners hear of every accepted entry.
"""

import uuid
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from threading import RLock
from typing import Any

from filelock import FileLock, Timeout

from keyrecon.annotate.cells import Cells, Change, check_fit, effective, invert_changes
from keyrecon.annotate.edits import AnyEdit, Limits
from keyrecon.annotate.files import annotations_form, picks_form
from keyrecon.annotate.history import Entry, Role, State, advance
from keyrecon.annotate.journal import Journal
from keyrecon.annotate.judging import Draft, judge
from keyrecon.annotate.marks import annotations_from_cells
from keyrecon.annotate.mirror import Mirror
from keyrecon.durable import hold_lock
from keyrecon.errors import KeyreconError
from keyrecon.records import Annotations
from keyrecon.workspace import Workspace

Listener = Callable[[Sequence[Entry]], None]


class Store:
    """The state of one project; every method may be called from any thread."""

    def __init__(self, workspace: Workspace, limits: Limits) -> None:
        """Open the project's journal and take in what other programs wrote since.

        Raises KeyreconError when the project is being annotated already, or when a file that a
        person made cannot be read.
        """
        self._workspace, self._limits = workspace, limits
        self._listeners: list[Listener] = []
        self._lock = RLock()
        with ExitStack() as held:
            held.callback(_hold(workspace).release)
            self._journal = Journal(workspace.folder / "annotate.sqlite")
            held.callback(self._journal.close)
            self.state = advance(State(), self._journal.entries())
            check_fit(self.state.cells, limits.skeleton, limits.n_frames)
            forms = (annotations_form(workspace, limits), picks_form(workspace))
            self._mirrors = [Mirror(form, self._journal.note(form.path.name)) for form in forms]
            self.refresh()
            self._held = held.pop_all()

    def annotations(self) -> Annotations:
        """The marks as the rest of keyrecon reads them."""
        return annotations_from_cells(self.state.cells, self._limits.skeleton)

    def listen(self, listener: Listener) -> None:
        """Call `listener` with the entries of every change, from the thread that made it."""
        self._listeners.append(listener)

    def refresh(self) -> None:
        """Take in what other programs changed, and write files that lag behind."""
        self._change(lambda _: ())

    def submit(self, edits: Iterable[AnyEdit]) -> list[dict[str, Any]]:
        """Accept what fits; tells for each edit whether it was accepted, or what stands there."""
        results: list[dict[str, Any]] = []
        listed = [*edits]

        def draft(state: State) -> list[Draft]:
            drafts, results[:] = judge(listed, state.cells, self._limits, self._journal.knows)
            return drafts

        self._change(draft)
        return results

    def apply(
        self,
        label: str,
        changes: Iterable[Change],
        role: Role = "edit",
        notes: Mapping[str, str] | None = None,
    ) -> None:
        """Change cells as one edit, whatever stood there, and note facts along with it."""
        listed = [*changes]

        def draft(state: State) -> list[Draft]:
            told = effective(state.cells, listed)
            return [Draft(f"{label}-{uuid.uuid4().hex}", label, told, role)] if told else []

        self._change(draft, notes)

    def note(self, name: str) -> str | None:
        """A fact noted earlier."""
        with self._lock:
            return self._journal.note(name)

    def undo(self, edit_id: str) -> Entry | None:
        """Take back the last edit; None when there is none. An id that was used does nothing."""
        return self._turn(edit_id, "undo")

    def redo(self, edit_id: str) -> Entry | None:
        """Do again what was taken back last."""
        return self._turn(edit_id, "redo")

    def _turn(self, edit_id: str, role: Role) -> Entry | None:
        def draft(state: State) -> list[Draft]:
            stack = state.undoable if role == "undo" else state.redoable
            if not stack or self._journal.knows(edit_id):
                return []
            entry = self._journal.entry(stack[-1])
            wanted = invert_changes(entry.changes) if role == "undo" else entry.changes
            ours = [c for c in wanted if state.cells.get(c.key) == c.before]
            return [Draft(edit_id, entry.label, tuple(ours), role, entry.revision)]

        return next(iter(self._change(draft)), None)

    def _change(
        self,
        draft: Callable[[State], Iterable[Draft]],
        notes: Mapping[str, str] | None = None,
    ) -> list[Entry]:
        """Everything that changes the state goes through here, one at a time."""
        told: list[Entry] = []
        with self._lock, self._workspace.exclusive():
            before = self.state.revision
            try:
                for mirror in self._mirrors:
                    self._take_in(mirror)
                told = self._commit(draft(self.state), notes)
                for mirror in self._mirrors:
                    mirror.catch_up(self.state.cells)
            finally:
                self._tell(before)
        return told

    def _take_in(self, mirror: Mirror) -> None:
        first = mirror.is_new
        changes = effective(
            self.state.cells, mirror.outside_changes(self.state.cells, self._cells_at)
        )
        if changes:
            role: Role = "fixed" if first else "edit"
            self._commit([Draft(f"file-{uuid.uuid4().hex}", "file", changes, role)])
        if changes and first and mirror.form.may_hold_more and not mirror.is_shown():
            self._workspace.put_aside(mirror.form.path)
        mirror.accept(self.state.cells)

    def _commit(
        self, drafts: Iterable[Draft], notes: Mapping[str, str] | None = None
    ) -> list[Entry]:
        """Make drafts durable, all or none."""
        first = self.state.revision + 1
        entries = [
            Entry(first + n, d.id, d.role, d.of, d.label, d.changes) for n, d in enumerate(drafts)
        ]
        if not entries and not notes:
            return []
        state = advance(self.state, entries)
        touched = {c.key[0] for entry in entries for c in entry.changes}
        concerned = [m for m in self._mirrors if touched & {*m.form.kinds}]
        plans = [(m, plan) for m in concerned if (plan := m.plan(state.cells, state.revision))]
        shown = {mirror.name: mirror.note(plan) for mirror, plan in plans}
        self._journal.append(entries, {**shown, **(notes or {})})
        self.state = state
        for mirror, plan in plans:
            mirror.adopt(plan)
        return entries

    def _cells_at(self, revision: int) -> Cells:
        if revision == self.state.revision:
            return self.state.cells
        return advance(State(), self._journal.entries(revision)).cells

    def _tell(self, since: int) -> None:
        if self.state.revision > since:
            new = [self._journal.entry(n) for n in range(since + 1, self.state.revision + 1)]
            for listener in self._listeners:
                listener(new)

    def close(self) -> None:
        """Let go of the project."""
        with self._lock:
            self._held.close()


def _hold(workspace: Workspace) -> FileLock:
    """The lock that only one server of a project can have; gone when its process ends."""
    try:
        return hold_lock(workspace.folder / ".annotate.lock", seconds=0.0)
    except Timeout as fault:
        raise KeyreconError(
            f"{workspace.folder} is being annotated already; use the page that is open, or "
            "stop that keyrecon annotate first."
        ) from fault
