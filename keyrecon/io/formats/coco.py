"""COCO keypoints JSON, the format of annotations.json.

`images[]` carry id, file_name, width, height and `frame`, the frame number (where another
program left it out, the number in the file name). `annotations[]` carry `keypoints`,
x, y, v for every joint of the category (v = 0 not labelled, 1 placed though hidden, 2 visible),
and `attributes.nearer`, one number per limb of the category's skeleton (1-based pairs of joints,
parent first): 1 the child end is nearer the camera, -1 farther, 0 unknown. `attributes.absent`,
where there is any, lists by name the joints that a person looked for and that are not to be
seen; to readers that do not know it these are joints not labelled. A joint that is placed is not
absent, whatever the list says.

COCO keypoints JSON of every frame: the refined 2D joints, for 2D tools and evaluations.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from keyrecon.body import Skeleton
from keyrecon.errors import KeyreconError
from keyrecon.io.durable import write_durably
from keyrecon.io.formats.annotation_checks import (
    Mark,
    MarksFile,
    MarkSheet,
    canonical_name,
    checked_marks,
    frame_of_picture,
)
from keyrecon.reading import parse_json, read_text, reading, real, whole
from keyrecon.records import SOURCES, Annotations, Motion

Json = dict[str, Any]
Lines = tuple[str, str]
"""A frame's line in images and its line in annotations."""
INFO = {"description": "2D joints for keyrecon; frame = 0-based frame of the video"}


def read_coco(
    path: Path | str, skeleton: Skeleton, n_frames: int, size: tuple[int, int]
) -> Annotations:
    """Read and check marks; `size` is the width and height of the video's pictures, px.

    Joints are matched by name, and only joints that are marked need to be in the skeleton.
    Raises KeyreconError for a file that does not parse or does not fit the video, naming the
    frame and the joint.
    """
    return read_coco_file(Path(path), skeleton, n_frames, size).marks


def read_coco_file(
    path: Path, skeleton: Skeleton, n_frames: int, size: tuple[int, int]
) -> MarksFile:
    """The same, with the pictures whose names tell their frames."""
    sheet = MarkSheet(path, skeleton, n_frames, size)
    remedy = "it needs images, annotations with keypoints, and categories with the joints' names"
    with reading(path, "a COCO keypoints file", remedy):
        data = parse_json(read_text(path))
        images = {image["id"]: image for image in data["images"]}
        categories = {c["id"]: c for c in data["categories"] if c.get("keypoints")}
        marks: list[Mark] = []
        nearer: dict[int, Int[np.ndarray, "B"]] = {}
        absent: set[tuple[int, str]] = set()
        for annotation in data["annotations"]:
            if annotation.get("category_id") in categories and "keypoints" in annotation:
                category = categories[annotation["category_id"]]
                frame, picture = _frame(annotation, images, sheet)
                marks += _marks(annotation, category, frame, picture, sheet)
                signs = _nearer(annotation, category, frame, sheet)
                nearer[frame] = np.where(signs, signs, nearer.get(frame, 0))
                absent |= _absent(annotation, frame, sheet)
        return checked_marks(marks, sheet, nearer, absent)


def _frame(annotation: Json, images: dict[Any, Json], sheet: MarkSheet) -> tuple[int, str]:
    """The frame that an annotation belongs to, checked; with the picture if only that tells it."""
    if annotation["image_id"] not in images:
        raise KeyreconError(
            f"{sheet.path}: annotation {annotation.get('id')} belongs to image "
            f"{annotation['image_id']}, which is not in the list of images."
        )
    image = images[annotation["image_id"]]
    sheet.check_size(whole(image.get("width") or 0), whole(image.get("height") or 0))
    frame = image.get("frame")
    picture = image["file_name"] if frame is None else ""
    if frame is None:
        frame = frame_of_picture(picture, sheet.path)
    if not isinstance(frame, int) or isinstance(frame, bool):
        raise KeyreconError(f"{sheet.path}: {frame!r} is not a frame number.")
    sheet.check_frame(frame, picture)
    return frame, picture


def _marks(
    annotation: Json, category: Json, frame: int, picture: str, sheet: MarkSheet
) -> Iterator[Mark]:
    """The labelled joints of one annotation."""
    names, values = category["keypoints"], annotation["keypoints"]
    if len(values) != 3 * len(names):
        raise KeyreconError(
            f"{sheet.path}, frame {frame}: {len(values)} numbers in keypoints, but {len(names)} "
            f"joints need {3 * len(names)} (x, y, v each)."
        )
    for name, x, y, v in zip(names, values[0::3], values[1::3], values[2::3], strict=True):
        if v not in (0, 1, 2):
            raise KeyreconError(
                f"{sheet.path}, frame {frame}: {name} has visibility {v}; it must be 0 (not "
                "labelled), 1 (hidden) or 2 (visible)."
            )
        if v:
            yield Mark(frame, name, real(x), real(y), v == 2, picture)


def _absent(annotation: Json, frame: int, sheet: MarkSheet) -> set[tuple[int, str]]:
    """Joints that a person said are not to be seen."""
    names = (annotation.get("attributes") or {}).get("absent") or []
    return {(frame, sheet.skeleton.names[sheet.joint(name, frame)]) for name in names}


def _nearer(annotation: Json, category: Json, frame: int, sheet: MarkSheet) -> np.ndarray:
    """Signs in the order of our bones, whatever the order and direction of the file's limbs."""
    signs = np.zeros(len(sheet.skeleton.bones), dtype=np.int64)
    attributes = annotation.get("attributes") or {}
    values = attributes.get("nearer") or []
    limbs = category.get("skeleton") or []
    if values and len(values) != len(limbs):
        raise KeyreconError(
            f"{sheet.path}, frame {frame}: {len(values)} numbers in nearer, but the skeleton has "
            f"{len(limbs)} limbs."
        )
    bones = {tuple(bone): b for b, bone in enumerate(sheet.skeleton.bones.tolist())}
    names = [canonical_name(name) for name in category["keypoints"]]
    index = [sheet.skeleton.names.index(n) if n in sheet.skeleton.names else -1 for n in names]
    for (parent, child), value in zip(limbs, values or [0] * len(limbs), strict=True):
        if not (0 < parent <= len(names) and 0 < child <= len(names)):
            raise KeyreconError(
                f"{sheet.path}: the limb {parent}-{child} names joints that are not there; limbs "
                "are pairs of joint numbers counted from 1."
            )
        if value not in (-1, 0, 1):
            raise KeyreconError(
                f"{sheet.path}, frame {frame}: nearer of {names[parent - 1]} - {names[child - 1]} "
                f"is {value}; it must be 1, -1 or 0."
            )
        limb = (index[parent - 1], index[child - 1])
        if limb in bones:
            signs[bones[limb]] = value
        elif limb[::-1] in bones:
            signs[bones[limb[::-1]]] = -value
    return signs


def annotations_to_coco(annotations: Annotations, size: tuple[int, int]) -> Json:
    """Marks as a COCO keypoints structure; `size` is the picture's width and height, px."""
    rows = [*_frame_rows(annotations, size).values()]
    return {
        "info": INFO,
        "images": [image for image, _ in rows],
        "annotations": [annotation for _, annotation in rows],
        "categories": [_category(annotations.skeleton)],
    }


def _category(skeleton: Skeleton) -> Json:
    return {
        "id": 1,
        "name": "person",
        "keypoints": list(skeleton.names),
        "skeleton": (skeleton.bones + 1).tolist(),
    }


def _frame_rows(annotations: Annotations, size: tuple[int, int]) -> dict[int, tuple[Json, Json]]:
    """What images and annotations hold of each frame."""
    skeleton, joints = annotations.skeleton, np.nan_to_num(annotations.joints)
    v = np.where(np.isfinite(annotations.joints).all(axis=2), 1 + annotations.visible, 0)
    places = np.concatenate([joints, v[..., None]], axis=2)
    nothing = np.zeros((len(skeleton.names), 3)), np.zeros(len(skeleton.bones), dtype=np.int64)
    pairs = zip(places, annotations.nearer, strict=True)
    marked: dict[int, tuple[np.ndarray, np.ndarray]] = dict(
        zip(annotations.frames.tolist(), pairs, strict=True)
    )
    absent: dict[int, list[str]] = {}
    for frame, name in annotations.absent:
        absent.setdefault(frame, []).append(name)
    return {
        frame: (
            _image(frame, size),
            _annotation(frame, *marked.get(frame, nothing), absent.get(frame, [])),
        )
        for frame in sorted({*marked, *absent})
    }


def _image(frame: int, size: tuple[int, int]) -> Json:
    return {
        "id": frame,
        "file_name": f"frame_{frame:06d}.png",
        "width": size[0],
        "height": size[1],
        "frame": frame,
    }


def _annotation(
    frame: int, places: Float[np.ndarray, "J 3"], nearer: Int[np.ndarray, "B"], absent: list[str]
) -> Json:
    is_marked = places[:, 2] > 0
    marked = places[is_marked, :2] if is_marked.any() else np.zeros((1, 2))
    left, top = marked.min(axis=0).tolist()
    width, height = np.ptp(marked, axis=0).tolist()
    return {
        "id": frame,
        "image_id": frame,
        "category_id": 1,
        "keypoints": [n for x, y, v in places.tolist() for n in (x, y, int(v))],
        "num_keypoints": int(is_marked.sum()),
        "bbox": [left, top, width, height],
        "area": width * height,
        "iscrowd": 0,
        "attributes": {"nearer": nearer.tolist()} | ({"absent": absent} if absent else {}),
    }


def coco_lines(annotations: Annotations, size: tuple[int, int]) -> dict[int, Lines]:
    """The lines of each frame, to be put together by `text_of_lines`."""
    rows = _frame_rows(annotations, size)
    return {frame: (_line(image), _line(body)) for frame, (image, body) in rows.items()}


def text_of_lines(lines: Mapping[int, Lines], skeleton: Skeleton) -> str:
    """The text of a COCO file, one annotation to a line."""
    entries = [lines[frame] for frame in sorted(lines)]
    parts = {
        "images": [image for image, _ in entries],
        "annotations": [annotation for _, annotation in entries],
        "categories": [_line(_category(skeleton))],
    }
    lists = [f' "{key}": [\n  ' + ",\n  ".join(rows) + "\n ]" for key, rows in parts.items()]
    return "{\n" + ",\n".join([f' "info": {_line(INFO)}', *lists]) + "\n}\n"


def _line(row: Json) -> str:
    return json.dumps(row, allow_nan=False)


def coco_text(annotations: Annotations, size: tuple[int, int]) -> str:
    """Marks as the text of a COCO file."""
    return text_of_lines(coco_lines(annotations, size), annotations.skeleton)


def write_coco(path: Path, annotations: Annotations, size: tuple[int, int]) -> None:
    """Write marks durably."""
    write_durably(path, coco_text(annotations, size))


def write_coco_motion(
    path: Path, motion: Motion, size: tuple[int, int], first_frame: int = 0
) -> None:
    """Write the joints of all frames, px; `size` is the picture's width and height.

    `first_frame` is the video's frame that the motion begins with.

    v is 2 where a joint was seen (annotated or propagated) and 1 where it was computed from
    others; confidence and source of every joint stand in `attributes`.
    """
    seen = np.isin(motion.source, [SOURCES.index("annotated"), SOURCES.index("propagated")])
    frames = first_frame + np.arange(len(motion.time))
    signs = np.zeros((len(frames), len(motion.skeleton.bones)), dtype=np.int64)
    data = annotations_to_coco(
        Annotations(motion.skeleton, frames, motion.points2d, seen, signs), size
    )
    for frame, row in enumerate(data["annotations"]):
        row["keypoints"] = [round(number, 2) for number in row["keypoints"]]
        row["attributes"] = {
            "confidence": motion.confidence[frame].round(4).tolist(),
            "source": [SOURCES[s] for s in motion.source[frame]],
        }
    write_durably(path, json.dumps(data, allow_nan=False))


def is_coco_motion(path: Path) -> bool:
    """Whether a file is one of `write_coco_motion`; a mark has no `source`."""
    try:
        annotations = parse_json(read_text(path))["annotations"]
        return bool(annotations) and all("source" in row["attributes"] for row in annotations)
    except (ValueError, KeyError, TypeError):
        return False
