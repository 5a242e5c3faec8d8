"""CVAT XML 1.1: skeletons on the frames of a video (tracks) or on single pictures.

Of a track only the frames count that a person touched (keyframe = 1); CVAT fills the others by
straight lines. `outside` joints are absent, `occluded` ones hidden. On a task of pictures the
number at the end of the picture's name is the frame. Documents with a DTD are refused.
"""

from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from defusedxml.ElementTree import fromstring

from keyrecon.body import Skeleton
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.annotation_checks import (
    Mark,
    MarksFile,
    MarkSheet,
    checked_marks,
    frame_of_picture,
)
from keyrecon.reading import reading
from keyrecon.records import Annotations


def read_cvat(
    path: Path | str, skeleton: Skeleton, n_frames: int, size: tuple[int, int]
) -> MarksFile:
    """Read and check marks; raises KeyreconError for a broken file, naming frame and joint."""
    path = Path(path)
    sheet = MarkSheet(path, skeleton, n_frames, size)
    remedy = "export the task as 'CVAT for video' or 'CVAT for images' 1.1"
    with reading(path, "a CVAT XML 1.1 file", remedy):
        root = fromstring(path.read_bytes(), forbid_dtd=True)
        if root.tag != "annotations":
            raise ValueError(f"it holds <{root.tag}> and not <annotations>")
        marks = [*_from_tracks(root, sheet), *_from_images(root, sheet)]
        if not marks:
            raise KeyreconError(
                f"{path} has no skeletons with marked joints; annotate with a skeleton label."
            )
        return checked_marks(marks, sheet)


def _from_tracks(root: Element, sheet: MarkSheet) -> Iterator[Mark]:
    for measure in root.iter("original_size"):
        width, height = measure.findtext("width"), measure.findtext("height")
        sheet.check_size(int(width or 0), int(height or 0))
    for track in root.iter("track"):
        for figure in track.iter("skeleton"):
            touched = [figure.get("keyframe", "1"), *(p.get("keyframe") for p in figure)]
            if "1" in touched and figure.get("outside", "0") != "1":
                yield from _marks(figure, int(figure.attrib["frame"]), sheet)


def _from_images(root: Element, sheet: MarkSheet) -> Iterator[Mark]:
    for image in root.iter("image"):
        sheet.check_size(int(image.get("width", 0)), int(image.get("height", 0)))
        for figure in image.iter("skeleton"):
            name = image.attrib["name"]
            yield from _marks(figure, frame_of_picture(name, sheet.path), sheet, name)


def _marks(figure: Element, frame: int, sheet: MarkSheet, picture: str = "") -> Iterator[Mark]:
    for point in figure.iter("points"):
        if point.get("outside", "0") == "1":
            continue
        x, comma, y = point.attrib["points"].partition(",")
        if not comma:
            raise KeyreconError(
                f"{sheet.path}, frame {frame}: {point.attrib['label']} is at "
                f"'{point.attrib['points']}', which is not x,y."
            )
        hidden = point.get("occluded", "0") == "1"
        yield Mark(frame, point.attrib["label"], float(x), float(y), not hidden, picture)


def cvat_text(annotations: Annotations, size: tuple[int, int]) -> str:
    """Marks as the text of a 'CVAT for images 1.1' file; pictures are named by their frame."""
    root = Element("annotations")
    SubElement(root, "version").text = "1.1"
    for row, frame in enumerate(annotations.frames.tolist()):
        attributes = {"id": str(row), "name": f"frame_{frame:06d}.png"}
        attributes |= {"width": str(size[0]), "height": str(size[1])}
        image = SubElement(root, "image", attributes)
        _add_points(SubElement(image, "skeleton", {"label": "person"}), annotations, row)
    indent(root)
    return tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _add_points(figure: Element, annotations: Annotations, row: int) -> None:
    for joint, name in enumerate(annotations.skeleton.names):
        place = annotations.joints[row, joint]
        absent, hidden = bool(np.isnan(place).any()), not annotations.visible[row, joint]
        x, y = np.nan_to_num(place).tolist()
        attributes = {"label": name, "outside": str(int(absent)), "occluded": str(int(hidden))}
        SubElement(figure, "points", {**attributes, "points": f"{x:.2f},{y:.2f}"})
