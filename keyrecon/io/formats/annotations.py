"""Marks from whatever program a person used, the kind of file recognised by its content; and sets
of marks added to one another or reduced to what was asked for.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from keyrecon.body import Skeleton
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.annotation_checks import MarksFile
from keyrecon.io.formats.coco import read_coco_file
from keyrecon.io.formats.cvat import read_cvat
from keyrecon.io.formats.dlc import read_dlc
from keyrecon.reading import reading
from keyrecon.records import Annotations


def read_annotations(
    path: Path | str, skeleton: Skeleton, n_frames: int, size: tuple[int, int]
) -> Annotations:
    """Read COCO keypoints JSON, a DeepLabCut CSV or CVAT XML 1.1 and check it against the video.

    `size` is the width and height of the video's pictures, px. Raises KeyreconError for files of
    another kind and for marks that do not fit the video or the skeleton.
    """
    return read_marks_file(Path(path), skeleton, n_frames, size).marks


def read_marks_file(
    path: Path, skeleton: Skeleton, n_frames: int, size: tuple[int, int]
) -> MarksFile:
    """The same, with the pictures whose names tell their frames."""
    with reading(path, "a file that can be read", "check the path"), path.open("rb") as file:
        start = file.read(4096)
    text = start.removeprefix(b"\xef\xbb\xbf").lstrip()
    if text.startswith(b"{"):
        return read_coco_file(path, skeleton, n_frames, size)
    if text.startswith(b"<"):
        return read_cvat(path, skeleton, n_frames, size)
    if text.split(b",", 1)[0] in (b"scorer", b"bodyparts"):
        return read_dlc(path, skeleton, n_frames, size)
    if text.startswith(b"\x89HDF"):
        raise KeyreconError(
            f"{path} is an HDF5 file; DeepLabCut writes a CSV of the same name beside it, use that."
        )
    raise KeyreconError(
        f"{path} holds no annotations that keyrecon knows; use COCO keypoints JSON, DeepLabCut's "
        "CollectedData CSV or CVAT XML 1.1."
    )


def _placed(annotations: Annotations) -> set[tuple[int, str]]:
    """Frames and names of marked joints."""
    marked = np.argwhere(np.isfinite(annotations.joints).all(axis=2)).tolist()
    frames, names = annotations.frames.tolist(), annotations.skeleton.names
    return {(frames[row], names[joint]) for row, joint in marked}


def merge_annotations(old: Annotations, new: Annotations) -> Annotations:
    """Old and new marks together; where both stand, the new one."""
    if old.skeleton.names != new.skeleton.names:
        raise KeyreconError("The new annotations have another skeleton than the project.")
    frames = np.union1d(old.frames, new.frames)
    merged = _spread(old, frames)
    rows = np.searchsorted(frames, new.frames)
    marked = np.isfinite(new.joints).all(axis=2)
    merged.joints[rows] = np.where(marked[..., None], new.joints, merged.joints[rows])
    merged.visible[rows] = np.where(marked, new.visible, merged.visible[rows])
    merged.nearer[rows] = np.where(new.nearer != 0, new.nearer, merged.nearer[rows])
    for frame, name in {*new.absent} & _placed(old):
        row, joint = np.searchsorted(frames, frame), old.skeleton.index(name)
        merged.joints[row, joint], merged.visible[row, joint] = np.nan, False
    absent = {*old.absent} - _placed(new) | {*new.absent}
    return replace(merged, absent=tuple(sorted(absent)))


def _spread(annotations: Annotations, frames: np.ndarray) -> Annotations:
    """A copy with a row for each of `frames`, unmarked where there was none."""
    rows = np.searchsorted(frames, annotations.frames)
    joints = np.full((len(frames), *annotations.joints.shape[1:]), np.nan)
    visible = np.zeros(joints.shape[:2], dtype=bool)
    nearer = np.zeros((len(frames), annotations.nearer.shape[1]), dtype=np.int64)
    joints[rows], visible[rows] = annotations.joints, annotations.visible
    nearer[rows] = annotations.nearer
    return replace(annotations, frames=frames, joints=joints, visible=visible, nearer=nearer)


def marks_asked_for(annotations: Annotations, upper: np.ndarray, lower: np.ndarray) -> Annotations:
    """The marks of each half of the body on the keyframes that need it, and no others."""
    frames, is_lower = annotations.frames, annotations.skeleton.is_lower
    asked = np.where(is_lower, np.isin(frames, lower)[:, None], np.isin(frames, upper)[:, None])
    rows = asked.any(axis=1)
    joints = np.where(asked[..., None], annotations.joints, np.nan)[rows]
    visible = (asked & annotations.visible)[rows]
    child = annotations.skeleton.bones[:, 1]
    nearer = np.where(asked[:, child], annotations.nearer, 0)[rows]
    return replace(annotations, frames=frames[rows], joints=joints, visible=visible, nearer=nearer)


def missing_marks(
    annotations: Annotations | None, upper: np.ndarray, lower: np.ndarray
) -> dict[int, list[str]]:
    """Halves of the body without any mark on keyframes that need them, by frame.

    A half of which the person said that no joint is to be seen lacks nothing.
    """
    missing: dict[int, list[str]] = {}
    for frames, lower_half in ((upper, False), (lower, True)):
        for frame in frames.tolist():
            wanted = _unmarked(annotations, frame, lower_half)
            if wanted:
                missing.setdefault(frame, []).extend(wanted)
    return dict(sorted(missing.items()))


def _unmarked(annotations: Annotations | None, frame: int, lower_half: bool) -> list[str]:
    half = ["lower body" if lower_half else "upper body"]
    if annotations is None:
        return half
    is_asked = annotations.skeleton.is_lower == lower_half
    names = [annotations.skeleton.names[joint] for joint in np.flatnonzero(is_asked)]
    if {(frame, name) for name in names} <= {*annotations.absent}:
        return []
    row = annotations.joints[annotations.frames == frame][:, is_asked]
    return [] if np.isfinite(row).any() else half
