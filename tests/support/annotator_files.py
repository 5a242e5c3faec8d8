"""The files that show the state: read back, and changed by other programs."""

import numpy as np

from keyrecon.annotate.store.cells import cells_from_annotations
from keyrecon.annotate.store.edits import Limits
from keyrecon.body import LSP14
from keyrecon.io.formats.annotations import merge_annotations
from keyrecon.io.formats.coco import read_coco, write_coco
from keyrecon.records import Annotations

LIMITS = Limits(LSP14, 100, (128, 64))
NECK = ("mark", 3, "neck")


def read_marks(folder):
    return read_coco(folder / "annotations.json", LSP14, 100, (128, 64))


def one_mark():
    """A neck at (10, 20) on frame 3, and the size of its picture."""
    joints = np.full((1, 14, 2), np.nan)
    joints[0, LSP14.index("neck")] = 10, 20
    seen = np.isfinite(joints).all(axis=2)
    return Annotations(LSP14, np.array([3]), joints, seen, np.zeros((1, 13), int)), (128, 64)


def on_file(folder):
    """The cells that annotations.json holds."""
    if not (folder / "annotations.json").exists():
        return {}
    return cells_from_annotations(read_marks(folder))


def add_mark(folder, frame, joint, x, y):
    """What `keyrecon import` does: read, add, write."""
    joints = np.full((1, 14, 2), np.nan)
    joints[0, LSP14.index(joint)] = x, y
    old = read_marks(folder)
    new = type(old)(
        skeleton=LSP14,
        frames=np.array([frame]),
        joints=joints,
        visible=np.isfinite(joints).all(axis=2),
        nearer=np.zeros((1, 13), dtype=np.int64),
    )
    write_coco(folder / "annotations.json", merge_annotations(old, new), (128, 64))
