"""The sheet's marks as `Annotations`, which the rest of keyrecon reads, and back."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from keyrecon.annotate.cells import FILE_CELLS, Cells, Value, of_kind
from keyrecon.body import Skeleton
from keyrecon.records import Annotations

ABSENT = (0, 0, 0)
"""The mark of a joint that is absent, as a file tells it."""


def annotations_from_cells(cells: Cells, skeleton: Skeleton) -> Annotations:
    """Marks and signs of all frames that have any, and the joints said to be absent."""
    told = {
        key: value for key, value in of_kind(cells, *FILE_CELLS).items() if not is_absent(value)
    }
    frames = sorted({key[1] for key in told})
    row = {frame: k for k, frame in enumerate(frames)}
    limbs = [skeleton.names[child] for _, child in skeleton.bones.tolist()]
    marks = _table(of_kind(told, "mark"), row, skeleton.names, [np.nan, np.nan, 0.0])
    signs = _table(of_kind(told, "nearer"), row, limbs, [0.0])
    return Annotations(
        skeleton,
        np.array(frames, dtype=np.int64),
        marks[..., :2],
        marks[..., 2] == 2,
        signs[..., 0].astype(np.int64),
        tuple(sorted(key[1:] for key, value in of_kind(cells, "mark").items() if is_absent(value))),
    )


def _table(
    cells: Cells, row: Mapping[int, int], names: Sequence[str], empty: list[float]
) -> Float[np.ndarray, "K N C"]:
    """Values of cells by frame and name."""
    column = {name: n for n, name in enumerate(names)}
    table = np.tile(np.array(empty, dtype=float), (len(row), len(names), 1))
    if cells:
        where = np.array([(row[key[1]], column[key[2]]) for key in cells])
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
    found = of_kind(cells, *FILE_CELLS)
    return {key: [*ABSENT] if is_absent(value) else value for key, value in found.items()}


def is_absent(value: Value) -> bool:
    """Whether a cell of annotations.json says that a joint is absent."""
    return isinstance(value, list) and not value[2]
