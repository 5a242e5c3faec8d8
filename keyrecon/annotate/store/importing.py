"""Marks from a file against those of the project: what is new, and what contradicts.

`keyrecon import` and the page both take files in this way. Nothing is overwritten unasked: marks
that contradict stay as they are until a person says that the file's are to replace them.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from keyrecon.annotate.store.cells import Change, Key, Value, is_absent

SAME_PX = 0.51
"""Marks closer than this on both axes are the same mark, rounded by some format, px."""


@dataclass(frozen=True)
class MarkComparison:
    """What a file would change."""

    new: tuple[Change, ...]
    """Marks and signs where there were none."""
    conflicts: tuple[Change, ...]
    """Marks and signs that contradict those in the project."""

    def changes(self, replace: bool) -> tuple[Change, ...]:
        """What is taken in; with `replace` the file's marks also where they contradict."""
        return self.new + (self.conflicts if replace else ())


def compare_marks(current: Mapping[Key, Value], imported: Mapping[Key, Value]) -> MarkComparison:
    """Sort a file's marks; those that the project has already, as far as formats can tell, are
    left out."""
    changes = [Change(key, current.get(key), value) for key, value in sorted(imported.items())]
    return MarkComparison(
        new=tuple(change for change in changes if change.before is None),
        conflicts=tuple(c for c in changes if c.before is not None and not _same(c)),
    )


def _same(change: Change) -> bool:
    """Whether two values are one. Some formats round places, and some know no hidden joints: only
    a file that says hidden contradicts a visible mark at the same place."""
    before, after = change.before, change.after
    if change.key[0] == "nearer":
        return before == after
    if is_absent(before) or is_absent(after):
        return is_absent(before) and is_absent(after)
    near = all(abs(a - b) <= SAME_PX for a, b in zip(before[:2], after[:2], strict=True))
    return near and after[2] >= before[2]


def name_conflicts(comparison: MarkComparison) -> list[str]:
    """The conflicts as 'frame 12 left_knee'; signs as 'frame 12 depth of left_knee'."""
    words = {"mark": "", "nearer": "depth of "}
    return [
        f"frame {frame} {words[str(kind)]}{name}"
        for (kind, frame, name), _, _ in comparison.conflicts
    ]
