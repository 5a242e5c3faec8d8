"""Everything a person decides, as one flat sheet of cells, and what a change of it is.

A cell is named by a tuple and holds a plain value; a cell that is not there is not decided:

    ("mark", frame, joint)    [x, y, v], v = 2 visible, 1 placed though hidden, 0 absent
    ("nearer", frame, limb)   1 the child end is nearer the camera, -1 farther
    ("pick", id)              {"frame", "part", "x", "y"}, a click on a colour
    ("own", frame)            "upper", "lower" or "both": a keyframe that the person added
                              (kinds are the words of the journal on the disk, and stay)
    ("lock", frame)           True: a keyframe that no new choice may drop

and of a golf swing

    ("golf", name)            what is known before a fit: "frame" of the address, "stature" (m),
                              "left_handed" (True); "focal" and "principal" (px) of a file
    ("click", joint)          [x, y, v] on that frame, v as above; also "root"
    ("shaft", frame)          [x, y, x, y] of the club: between the hands, and its head
    ("key", name)             the frame of "start", "top", "hit" or "finish"

A change says what stood in a cell and what shall stand there. That makes three things one line
each: to apply it, to take it back, and to see that somebody else was faster.

The sheet's marks as `Annotations`, which the rest of keyrecon reads, and back.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from keyrecon.body import Skeleton
from keyrecon.errors import KeyreconError
from keyrecon.records import Annotations

Key = tuple[str | int, ...]
Value = Any
Cells = dict[Key, Value]
FILE_CELLS = ("mark", "nearer")
"""Kinds of cells that annotations.json holds."""


class Change(NamedTuple):
    """One cell before and after; None: not there."""

    key: Key
    before: Value
    after: Value


def apply_in_place(cells: Cells, changes: Iterable[Change]) -> None:
    """Carry changes out on a sheet."""
    for change in changes:
        if change.after is None:
            cells.pop(change.key, None)
        else:
            cells[change.key] = change.after


def invert_changes(changes: Iterable[Change]) -> tuple[Change, ...]:
    """What takes the changes back."""
    return tuple(Change(key, after, before) for key, before, after in reversed([*changes]))


def resolve_changes(
    cells: Mapping[Key, Value], changes: Iterable[Change]
) -> tuple[Change, ...] | None:
    """The changes one after the other, as one change for each cell that becomes another.

    None if a cell holds neither what its change expects nor what it wants: someone was faster.
    """
    now: dict[Key, Value] = {}
    for key, before, after in changes:
        if now.get(key, cells.get(key)) not in (before, after):
            return None
        now[key] = after
    resolved = (Change(key, cells.get(key), after) for key, after in now.items())
    return tuple(change for change in resolved if change.before != change.after)


def effective_changes(cells: Mapping[Key, Value], changes: Iterable[Change]) -> tuple[Change, ...]:
    """The changes that do something, with what really stood there before."""
    now = ((key, cells.get(key), after) for key, _, after in changes)
    return tuple(Change(*change) for change in now if change[1] != change[2])


def difference(before: Mapping[Key, Value], after: Mapping[Key, Value]) -> tuple[Change, ...]:
    """The changes that lead from one sheet to another."""
    keys = sorted({*before, *after}, key=repr)
    changes = (Change(key, before.get(key), after.get(key)) for key in keys)
    return tuple(change for change in changes if change.before != change.after)


def changed_keys(before: Mapping[Key, Value], after: Mapping[Key, Value]) -> set[Key]:
    """Cells that hold another object; values that no edit touched are the same object still."""
    replaced = {key for key, value in after.items() if before.get(key) is not value}
    return replaced | (before.keys() - after.keys())


def of_kind(cells: Mapping[Key, Value], *kinds: str) -> Cells:
    """The cells of some kinds."""
    return {key: value for key, value in cells.items() if key[0] in kinds}


def of_body(cells: Mapping[Key, Value], kind: str) -> dict[tuple[int, str], Value]:
    """The cells of one of the FILE_CELLS by frame and name."""
    return {(int(key[1]), str(key[2])): value for key, value in of_kind(cells, kind).items()}


def by_frame(cells: Mapping[Key, Value], kind: str) -> dict[str, Any]:
    """Cells of one kind as {frame: {name: value}} or {frame: value}, frames as text for JSON."""
    table: dict[str, Any] = {}
    for (_, frame, *name), value in of_kind(cells, kind).items():
        if name:
            table.setdefault(str(frame), {})[name[0]] = value
        else:
            table[str(frame)] = value
    return table


def picks_of(cells: Mapping[Key, Value]) -> list[dict[str, Any]]:
    """The picks with their ids, in order of frame."""
    picks = ({"id": key[1], **value} for key, value in of_kind(cells, "pick").items())
    return sorted(picks, key=lambda pick: (pick["frame"], pick["part"], pick["x"], pick["y"]))


def marked_frames(cells: Mapping[Key, Value]) -> Iterator[int]:
    """Frames on which the person decided anything about the body."""
    return (int(key[1]) for key in of_kind(cells, *FILE_CELLS))


def check_cells(cells: Mapping[Key, Value]) -> None:
    """Raise ValueError for a cell that no edit made."""
    for key, value in cells.items():
        if not _is_cell(key, value):
            raise ValueError(f"{key!r} holds {value!r}")


def _is_cell(key: Key, value: Value) -> bool:
    match (*key, value):
        case ("mark", int(), str(), [x, y, (0 | 1 | 2)]):
            return all(isinstance(n, int | float) and math.isfinite(n) for n in (x, y))
        case ("nearer", int(), str(), (1 | -1)) | ("lock", int(), True):
            return True
        case ("pick", str(), {"frame": int(), "part": str(), "x": x, "y": y}):
            return all(isinstance(n, int | float) and math.isfinite(n) for n in (x, y))
        case ("own", int(), ("upper" | "lower" | "both")):
            return True
        case ("click", str(), [x, y, (1 | 2)]):
            return all(isinstance(n, int | float) and math.isfinite(n) for n in (x, y))
        case ("shaft", int(), [_, _, _, _]):
            return all(isinstance(n, int | float) and math.isfinite(n) for n in value)
        case ("golf", str(), (int() | float() | list())):
            return True
        case ("key", str(), (int() | float())):
            return math.isfinite(value)
    return False


def check_fit(cells: Mapping[Key, Value], skeleton: Skeleton, n_frames: int) -> None:
    """Raise KeyreconError for decisions about joints or frames that the project does not have."""
    decided = of_kind(cells, *FILE_CELLS)
    unknown = sorted({str(key[2]) for key in decided} - {*skeleton.names})
    if unknown:
        raise KeyreconError(
            f"Marks of {', '.join(unknown)} were made in this project, and its skeleton has no "
            "such joint; bring the former skeleton.json back, or begin a new project."
        )
    swing = [int(key[1]) for key in of_kind(cells, "shaft")]
    swing += [int(frame) for frame in of_kind(cells, "key").values()]
    last = max([0, *swing, *(int(key[1]) for key in decided)])
    if last >= n_frames:
        raise KeyreconError(
            f"Frame {last} was marked in this project, and its video now has {n_frames} frames; "
            "bring the former video or trim back, or begin a new project."
        )


ABSENT = (0, 0, 0)
"""The mark of a joint that is absent, as a file has it."""


def annotations_from_cells(cells: Cells, skeleton: Skeleton) -> Annotations:
    """Marks and signs of all frames that have any, and the joints said to be absent."""
    placed = {
        key: value for key, value in of_kind(cells, *FILE_CELLS).items() if not is_absent(value)
    }
    frames = sorted({*marked_frames(placed)})
    row = {frame: k for k, frame in enumerate(frames)}
    limbs = [skeleton.names[child] for _, child in skeleton.bones.tolist()]
    marks = _table(of_body(placed, "mark"), row, skeleton.names, [np.nan, np.nan, 0.0])
    signs = _table(of_body(placed, "nearer"), row, limbs, [0.0])
    return Annotations(
        skeleton,
        np.array(frames, dtype=np.int64),
        marks[..., :2],
        marks[..., 2] == 2,
        signs[..., 0].astype(np.int64),
        tuple(sorted(key for key, value in of_body(cells, "mark").items() if is_absent(value))),
    )


def _table(
    cells: Mapping[tuple[int, str], Value],
    row: Mapping[int, int],
    names: Sequence[str],
    empty: list[float],
) -> Float[np.ndarray, "K N C"]:
    """Values of cells by frame and name."""
    column = {name: n for n, name in enumerate(names)}
    table = np.tile(np.array(empty, dtype=float), (len(row), len(names), 1))
    if cells:
        where = np.array([(row[frame], column[name]) for frame, name in cells])
        table[where[:, 0], where[:, 1]] = np.array([*cells.values()]).reshape(len(cells), -1)
    return table


def cells_from_annotations(annotations: Annotations) -> Cells:
    """The cells that hold these marks and signs."""
    skeleton = annotations.skeleton
    cells: Cells = {("mark", *where): [*ABSENT] for where in annotations.absent}
    marked = np.isfinite(annotations.joints).all(axis=2)
    for k, joint in np.argwhere(marked).tolist():
        x, y = annotations.joints[k, joint].tolist()
        key = ("mark", int(annotations.frames[k]), skeleton.names[joint])
        cells[key] = [x, y, 1 + int(annotations.visible[k, joint])]
    for k, bone in np.argwhere(annotations.nearer).tolist():
        name = skeleton.names[skeleton.bones[bone, 1]]
        cells["nearer", int(annotations.frames[k]), name] = int(annotations.nearer[k, bone])
    return cells


def written_cells(cells: Cells) -> Cells:
    """The cells as annotations.json holds them: without the place where an absent joint was."""
    written = of_kind(cells, *FILE_CELLS)
    return {key: [*ABSENT] if is_absent(value) else value for key, value in written.items()}


def is_absent(value: Value) -> bool:
    """Whether a cell of annotations.json says that a joint is absent."""
    return isinstance(value, list) and not value[2]
