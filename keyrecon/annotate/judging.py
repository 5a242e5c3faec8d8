"""Which edits of a page are accepted: those whose cells still hold what the page believed."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from keyrecon.annotate.cells import Cells, Change, apply_in_place, settle
from keyrecon.annotate.edits import AnyEdit, Limits, changes_of
from keyrecon.annotate.history import Role
from keyrecon.errors import KeyreconError

Result = dict[str, Any]
"""The answer to an edit: "ok", else "status" with "current" (409) or "error" (400)."""


@dataclass(frozen=True)
class Draft:
    """An entry that has no revision yet."""

    id: str
    label: str
    changes: tuple[Change, ...]
    role: Role = "edit"
    of: int | None = None


def judge(
    edits: Iterable[AnyEdit], cells: Cells, limits: Limits, knows: Callable[[str], bool]
) -> tuple[list[Draft], list[Result]]:
    """What to write into the journal, and the answer to each edit, one after the other.

    An edit whose id the journal `knows`, or that came earlier in the same batch, is accepted and
    does nothing more.
    """
    now, drafts, results = dict(cells), [], []
    for edit in edits:
        known = knows(edit.id) or edit.id in {draft.id for draft in drafts}
        result, draft = ({"ok": True}, None) if known else _judge_one(edit, now, limits)
        results.append({"id": edit.id, **result})
        if draft is not None:
            drafts.append(draft)
            apply_in_place(now, draft.changes)
    return drafts, results


def _judge_one(edit: AnyEdit, cells: Cells, limits: Limits) -> tuple[Result, Draft | None]:
    """The answer to one new edit, and what it changes if it fits and changes anything."""
    try:
        changes = changes_of(edit, limits)
    except KeyreconError as fault:
        return {"ok": False, "status": 400, "error": str(fault)}, None
    told = settle(cells, changes)
    if told is None:
        current = {str(change.key[-1]): cells.get(change.key) for change in changes}
        return {"ok": False, "status": 409, "current": current}, None
    label = type(edit).__struct_config__.tag
    return {"ok": True}, Draft(edit.id, label, told) if told else None
