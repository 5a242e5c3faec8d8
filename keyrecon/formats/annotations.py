"""Marks from whatever program a person used; the kind of file is told by its content."""

from pathlib import Path

from keyrecon.body import Skeleton
from keyrecon.errors import KeyreconError
from keyrecon.formats.coco import read_coco
from keyrecon.formats.cvat import read_cvat
from keyrecon.formats.dlc import read_dlc
from keyrecon.records import Annotations


def read_annotations(
    path: Path, skeleton: Skeleton, n_frames: int, size: tuple[int, int]
) -> Annotations:
    """Read COCO keypoints JSON, a DeepLabCut CSV or CVAT XML 1.1 and check it against the video.

    `size` is the width and height of the video's pictures, px. Raises KeyreconError for files of
    another kind and for marks that do not fit the video or the skeleton.
    """
    try:
        with path.open("rb") as file:
            start = file.read(4096)
    except OSError as fault:
        raise KeyreconError(f"{path} cannot be read ({fault.strerror}); check the path.") from fault
    text = start.removeprefix(b"\xef\xbb\xbf").lstrip()
    if text.startswith(b"{"):
        return read_coco(path, skeleton, n_frames, size)
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
