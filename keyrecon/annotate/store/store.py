"""The one place where a person's decisions are kept, changed, undone and never lost.

An edit is accepted only if the cells still hold what the page believed; then it goes into the
journal (see journal.py), then the files that show the state are replaced, and only then is it
acknowledged. A failure on the way raises NotSaved: the page keeps the edit and sends it again,
and its id makes sure that it counts once. Listeners are called with every accepted entry.
"""

import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from threading import RLock
from typing import Any

from keyrecon.annotate.store.cells import (
    Cells,
    Change,
    annotations_from_cells,
    apply_in_place,
    check_cells,
    check_fit,
    effective_changes,
    invert_changes,
    resolve_changes,
)
from keyrecon.annotate.store.edits import AnyEdit, Limits, changes_of
from keyrecon.annotate.store.file_sync import FileForm, FileSync, annotations_form, picks_form
from keyrecon.annotate.store.golf_files import clicks_form, marks_form
from keyrecon.annotate.store.journal import (
    REMEDY,
    Entry,
    Journal,
    JournalState,
    NotSaved,
    Role,
    advance,
)
from keyrecon.errors import KeyreconError
from keyrecon.io.durable import put_aside
from keyrecon.io.work_lock import lock_annotation
from keyrecon.io.workspace import Workspace
from keyrecon.reading import reading
from keyrecon.records import Annotations

OTHER_PAGE = "use the page that is open, or stop that keyrecon annotate first"
"""What helps whose project is open already."""
Result = dict[str, Any]
"""The answer to an edit: "ok", else "status" with "current" (409) or "error" (400)."""
KNOWN: Result = {"ok": True, "known": True}
"""The answer to an edit that was accepted before; others may have changed its cells since."""


@dataclass(frozen=True)
class Draft:
    """An entry that has no revision yet."""

    id: str
    label: str
    changes: tuple[Change, ...]
    role: Role = "edit"
    of: int | None = None


def accept_edits(
    edits: Iterable[AnyEdit], cells: Cells, limits: Limits, knows: Callable[[str], bool]
) -> tuple[list[Draft], list[Result]]:
    """What to write into the journal, and the answer to each edit, one after the other.

    An edit whose id the journal `knows`, or that came earlier in the same batch, is accepted and
    does nothing more.
    """
    now = dict(cells)
    drafts: list[Draft] = []
    results: list[Result] = []
    for edit in edits:
        known = knows(edit.id) or edit.id in {draft.id for draft in drafts}
        result, draft = (KNOWN, None) if known else _accept_one(edit, now, limits)
        results.append({"id": edit.id, **result})
        if draft is not None:
            drafts.append(draft)
            apply_in_place(now, draft.changes)
    return drafts, results


def _accept_one(edit: AnyEdit, cells: Cells, limits: Limits) -> tuple[Result, Draft | None]:
    """The answer to one new edit, and what it changes if it fits and changes anything."""
    try:
        changes = changes_of(edit, limits)
    except KeyreconError as fault:
        return {"ok": False, "status": 400, "error": str(fault)}, None
    resolved = resolve_changes(cells, changes)
    if resolved is None:
        current = {str(change.key[-1]): cells.get(change.key) for change in changes}
        return {"ok": False, "status": 409, "current": current}, None
    label = str(type(edit).__struct_config__.tag)
    return {"ok": True}, Draft(edit.id, label, resolved) if resolved else None


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
            held.callback(lock_annotation(workspace.folder, OTHER_PAGE).release)
            self._journal = Journal(workspace.folder / "annotate.sqlite")
            held.callback(self._journal.close)
            with reading(self._journal.path, "a whole journal of edits", REMEDY):
                self.state = advance(JournalState(), self._journal.entries())
                check_cells(self.state.cells)
                check_fit(self.state.cells, limits.skeleton, limits.n_frames)
                self._files: list[FileSync] = []
                self._show(annotations_form(workspace, limits), picks_form(workspace))
                self._show_swing()
            self.refresh()
            self._held = held.pop_all()

    def _show(self, *forms: FileForm) -> None:
        """Have files show the state from now on."""
        shown = {file.name for file in self._files}
        self._files += [
            FileSync(form, self._journal.note(form.path.name))
            for form in forms
            if form.path.name not in shown
        ]

    def _show_swing(self) -> None:
        """The files of a golf swing, from the moment on at which the project is one.

        A project.toml that somebody is just changing holds up no edit.
        """
        with suppress(KeyreconError):
            if self._workspace.is_golf:
                forms = (form(self._workspace, self._limits) for form in (clicks_form, marks_form))
                self._show(*forms)

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
        """Accept what fits; for each edit whether it was accepted, or what stands there."""
        results: list[dict[str, Any]] = []
        listed = [*edits]

        def draft(state: JournalState) -> list[Draft]:
            drafts, results[:] = accept_edits(
                listed, state.cells, self._limits, self._journal.knows
            )
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

        def draft(state: JournalState) -> list[Draft]:
            effective = effective_changes(state.cells, listed)
            draft_id = f"{label}-{uuid.uuid4().hex}"
            return [Draft(draft_id, label, effective, role)] if effective else []

        self._change(draft, notes)

    def note(self, name: str) -> str | None:
        """A fact noted earlier."""
        with self._lock:
            return self._journal.note(name)

    def undo(self, edit_id: str) -> Entry | None:
        """Take back the last edit; None when there is none. An id that was used does nothing."""
        return self._step(edit_id, "undo")

    def redo(self, edit_id: str) -> Entry | None:
        """Do again what was taken back last."""
        return self._step(edit_id, "redo")

    def _step(self, edit_id: str, role: Role) -> Entry | None:
        def draft(state: JournalState) -> list[Draft]:
            stack = state.undoable if role == "undo" else state.redoable
            if not stack or self._journal.knows(edit_id):
                return []
            entry = self._journal.entry(stack[-1])
            wanted = invert_changes(entry.changes) if role == "undo" else entry.changes
            possible = [c for c in wanted if state.cells.get(c.key) == c.before]
            return [Draft(edit_id, entry.label, tuple(possible), role, entry.revision)]

        return next(iter(self._change(draft)), None)

    def _change(
        self,
        draft: Callable[[JournalState], Iterable[Draft]],
        notes: Mapping[str, str] | None = None,
    ) -> list[Entry]:
        """Everything that changes the state goes through here, one at a time."""
        entries: list[Entry] = []
        with self._lock, self._alone():
            before = self.state.revision
            try:
                self._show_swing()
                for file in self._files:
                    self._take_in(file)
                entries = self._commit(draft(self.state), notes)
                for file in self._files:
                    file.catch_up(self.state.cells)
            finally:
                self._notify(before)
        return entries

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Hold the project's files; NotSaved where its lock cannot be taken."""
        with ExitStack() as held:
            try:
                held.enter_context(self._workspace.exclusive())
            except KeyreconError as fault:
                raise NotSaved(str(fault)) from fault
            yield

    def _take_in(self, file: FileSync) -> None:
        """Accept what another program changed in a file as one more edit."""
        first = file.is_new
        outside = file.outside_changes(self.state.cells, self._cells_at)
        changes = effective_changes(self.state.cells, outside)
        if changes:
            role: Role = "fixed" if first else "edit"
            self._commit([Draft(f"file-{uuid.uuid4().hex}", "file", changes, role)])
        if changes and first and file.form.may_hold_more and not file.is_written():
            put_aside(file.form.path)
        file.accept(self.state.cells)

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
        concerned = [f for f in self._files if touched & {*f.form.kinds}]
        plans = [(f, plan) for f in concerned if (plan := f.plan(state.cells, state.revision))]
        file_notes = {file.name: file.note(plan) for file, plan in plans}
        self._journal.append(entries, {**file_notes, **(notes or {})})
        self.state = state
        for file, plan in plans:
            file.adopt(plan)
        return entries

    def _cells_at(self, revision: int) -> Cells:
        if revision == self.state.revision:
            return self.state.cells
        return advance(JournalState(), self._journal.entries(revision)).cells

    def _notify(self, since: int) -> None:
        if self.state.revision > since:
            new = [self._journal.entry(n) for n in range(since + 1, self.state.revision + 1)]
            for listener in self._listeners:
                listener(new)

    def close(self) -> None:
        """Let go of the project."""
        with self._lock:
            self._held.close()
