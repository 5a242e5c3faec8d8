"""The sheet's marks as `Annotations`, which the rest of keyrecon reads, and back."""

import numpy as np

from keyrecon.annotate.cells import FILE_CELLS, Cells, of_kind
from keyrecon.body import Skeleton
from keyrecon.records import Annotations


def annotations_from_cells(cells: Cells, skeleton: Skeleton) -> Annotations:
    """Marks and signs of all frames that have any; joints said to be absent count as unmarked."""
    told = written_cells(cells)
    frames = np.array(sorted({int(key[1]) for key in told}), dtype=np.int64)
    row = {frame: k for k, frame in enumerate(frames.tolist())}
    limb = {skeleton.names[child]: b for b, (_, child) in enumerate(skeleton.bones.tolist())}
    joints = np.full((len(frames), len(skeleton.names), 2), np.nan)
    visible = np.zeros(joints.shape[:2], dtype=bool)
    nearer = np.zeros((len(frames), len(skeleton.bones)), dtype=np.int64)
    for (kind, frame, name), value in told.items():
        if kind == "mark":
            joints[row[frame], skeleton.index(name)] = value[:2]
            visible[row[frame], skeleton.index(name)] = value[2] == 2
        else:
            nearer[row[frame], limb[name]] = value
    return Annotations(skeleton, frames, joints, visible, nearer)


def cells_from_annotations(annotations: Annotations) -> Cells:
    """The cells that hold these marks and signs."""
    skeleton, cells = annotations.skeleton, {}
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
    """The cells that annotations.json can hold: all but joints said to be absent."""
    found = of_kind(cells, *FILE_CELLS)
    return {k: value for k, value in found.items() if k[0] == "nearer" or value[2]}
