"""From single marks, as every annotation format holds them, to checked `Annotations`.

Readers of COCO, DeepLabCut and CVAT files only take their format apart; what a mark must be is
said here once, and every complaint names the file, the frame and the joint.

Marks that look wrong: not refused, but worth another look. Every line names frame and limb.
"""

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from keyrecon.body import Skeleton
from keyrecon.errors import KeyreconError
from keyrecon.records import Annotations

SAME_PX = 0.01
"""Two marks of one joint on one frame closer than this on both axes are one, px."""


@dataclass(frozen=True)
class Mark:
    """One joint on one frame."""

    frame: int
    joint: str
    """As the file spells it."""
    x: float
    y: float
    visible: bool
    picture: str = ""
    """Name of the picture, where only that tells the frame."""


@dataclass(frozen=True, eq=False)
class MarksFile:
    """What a file of marks holds."""

    marks: Annotations
    pictures: Mapping[int, str]
    """Of frames that only the pictures' names tell, these names."""


@dataclass(frozen=True)
class MarkSheet:
    """What marks are made on: the file they come from, the joints and the video."""

    path: Path
    skeleton: Skeleton
    n_frames: int
    size: tuple[int, int]
    """Width and height of the picture, px."""

    def check_frame(self, frame: int, picture: str = "") -> None:
        """Raise KeyreconError for a frame that the video does not have; a `picture` told it."""
        if not 0 <= frame < self.n_frames:
            source = f" (so says '{picture[:60]}')" if picture else ""
            raise KeyreconError(
                f"{self.path}: frame {frame}{source} is outside the video, which has frames 0 to "
                f"{self.n_frames - 1}; check that the marks belong to this video and its trim."
            )

    def check_size(self, width: int, height: int) -> None:
        """Raise KeyreconError when the marks were made on pictures of another size; 0: unknown."""
        if width and height and (width, height) != self.size:
            raise KeyreconError(
                f"{self.path} was made on pictures of {width}x{height}, the video has "
                f"{self.size[0]}x{self.size[1]}; mark the joints on the video's own pictures."
            )

    def joint(self, name: str, frame: int) -> int:
        """Index of the joint that a file calls `name`; raises KeyreconError if there is none."""
        known = canonical_name(name)
        if known not in self.skeleton.names:
            raise KeyreconError(
                f"{self.path}, frame {frame}: the joint '{name[:40]}' is not in the skeleton, "
                f"which has {', '.join(self.skeleton.names)}; rename it or leave it out."
            )
        return self.skeleton.names.index(known)


def canonical_name(name: str) -> str:
    """A joint's name in COCO's spelling: 'RKnee', 'knee_right', 'Right Knee' are right_knee."""
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=^[RL])(?=[A-Z][a-z])", "_", name.strip())
    parts = [part for part in re.split(r"[\W_]+", words.lower()) if part]
    sides = {"r": "right", "l": "left", "right": "right", "left": "left"}
    side = [sides[part] for part in parts if part in sides]
    return "_".join(side + [part for part in parts if part not in sides])


def frame_of_picture(name: str, path: Path) -> int:
    """The frame number with which a picture's name ends: 'img0123.png' is frame 123.

    Where the name has it as keyframes' pictures do, frame_000123, that counts, whatever a person
    or a program put behind it, but for a number with more digits: 'frame2_000123.png' is of
    another count. Roboflow puts '_png.rf.' and a hash there.
    """
    stem = re.sub(r"([._](png|jpe?g|bmp|tiff?|webp))?(\.rf\.\w+)?\.\w+$", "", _last_part(name))
    forms = (r"(?<![a-z])frame[_ -]?(\d+)", r"(\d+)$")
    numbers = [found[1] for form in forms if (found := re.search(form, stem, re.I))]
    if not numbers:
        raise KeyreconError(
            f"{path}: the picture '{name[:60]}' does not say which frame it shows; its name must "
            "end in the frame number, as in frame_000123.png."
        )
    return int(max(numbers, key=len))


def _last_part(name: str) -> str:
    return re.split(r"[/\\]", name)[-1]


def checked_marks(
    marks: Iterable[Mark],
    sheet: MarkSheet,
    nearer: Mapping[int, Int[np.ndarray, "B"]] | None = None,
    absent: Collection[tuple[int, str]] = (),
) -> MarksFile:
    """Marks in frame order; `nearer` holds the signs of the frames that have them.

    Joints said to be `absent` on a frame (in the skeleton's spelling) are so where not marked.
    Raises KeyreconError for frames outside the video, joints that the skeleton does not have,
    coordinates that are not numbers or a whole picture off, two pictures
    whose names tell one frame, and two different marks of one joint.
    """
    marks = list(marks)
    pictures = _pictures(marks, sheet)
    placed: dict[tuple[int, int], Mark] = {}
    for mark in marks:
        sheet.check_frame(mark.frame)
        joint = sheet.joint(mark.joint, mark.frame)
        _check_place(mark, sheet)
        other = placed.setdefault((mark.frame, joint), mark)
        if max(abs(mark.x - other.x), abs(mark.y - other.y)) > SAME_PX:
            raise KeyreconError(
                f"{sheet.path}, frame {mark.frame}: {mark.joint} is marked twice, at "
                f"({other.x:g}, {other.y:g}) and ({mark.x:g}, {mark.y:g}); keep one athlete."
            )
    signs = {frame: row for frame, row in (nearer or {}).items() if row.any()}
    frames = np.array(sorted({frame for frame, _ in placed} | signs.keys()), dtype=np.int64)
    joints = np.full((len(frames), len(sheet.skeleton.names), 2), np.nan)
    visible = np.zeros(joints.shape[:2], dtype=bool)
    for (frame, joint), mark in placed.items():
        row = np.searchsorted(frames, frame)
        joints[row, joint] = mark.x, mark.y
        visible[row, joint] = mark.visible
    unknown = np.zeros(len(sheet.skeleton.bones), dtype=np.int64)
    rows = [signs.get(frame, unknown) for frame in frames.tolist()]
    stacked = np.array(rows, dtype=np.int64).reshape(len(frames), len(unknown))
    open_ = {*absent} - {(frame, sheet.skeleton.names[joint]) for frame, joint in placed}
    read = Annotations(sheet.skeleton, frames, joints, visible, stacked, tuple(sorted(open_)))
    return MarksFile(read, pictures)


def _pictures(marks: Iterable[Mark], sheet: MarkSheet) -> dict[int, str]:
    """Names of pictures by the frame that only they tell; KeyreconError where two tell the same."""
    pictures: dict[int, str] = {}
    for mark in marks:
        if not mark.picture:
            continue
        sheet.check_frame(mark.frame, mark.picture)
        name = _last_part(mark.picture)
        other = pictures.setdefault(mark.frame, name)
        if other != name:
            raise KeyreconError(
                f"{sheet.path}: the pictures '{other[:60]}' and '{name[:60]}' both say frame "
                f"{mark.frame} by their names; name each by its frame, as in frame_000123.png."
            )
    return pictures


def _check_place(mark: Mark, sheet: MarkSheet) -> None:
    where = f"{sheet.path}, frame {mark.frame}: {mark.joint}"
    if not (np.isfinite(mark.x) and np.isfinite(mark.y)):
        raise KeyreconError(
            f"{where} is at ({mark.x}, {mark.y}), which is no place; mark it again."
        )
    width, height = sheet.size
    if not (-width <= mark.x < 2 * width and -height <= mark.y < 2 * height):
        raise KeyreconError(
            f"{where} is at ({mark.x:g}, {mark.y:g}), far outside the picture of "
            f"{width}x{height}; check that the marks belong to this video."
        )


STRETCH = 1.5
"""A bone may look this much longer than the body's scale allows: people's proportions differ
from the table by up to a third, and clicks are off by a few per cent of a bone."""
CLICK_PX = 2.0
"""And this much longer besides: both ends are off by a pixel, which is a ninth of the head of a
player who is 100 px tall. Of the six bones of such a boy's 23 marked frames that are longer than
without, five are right and the one that is not stays."""
NEIGHBOURS = 9
"""Annotated frames whose scales are compared: a player grows and shrinks slowly."""


def implausible_bones(annotations: Annotations, stretch: float = STRETCH) -> list[str]:
    """Bones that look longer than they are: under scaled orthography none can (Taylor 2000).

    A frame's scale in px per stature is at least every |bone| / length. Its third largest value
    stands for it, since one misplaced joint spoils two bones, and the median over neighbouring
    annotated frames for poses in which all limbs point at the camera.
    """
    skeleton = annotations.skeleton
    parent, child = skeleton.bones.T
    lengths = np.linalg.norm(annotations.joints[:, child] - annotations.joints[:, parent], axis=2)
    scale = lengths / skeleton.lengths
    allowed = stretch * _scale_nearby(scale)[:, None] * skeleton.lengths + CLICK_PX
    warnings = []
    for row, bone in np.argwhere(lengths > allowed):
        limb = " to ".join(skeleton.names[j] for j in skeleton.bones[bone])
        warnings.append(
            f"frame {annotations.frames[row]}: {limb} is {lengths[row, bone]:.1f} px long, more "
            f"than the {allowed[row, bone]:.1f} px that the body's size allows; check both joints."
        )
    return warnings


def _scale_nearby(scale: Float[np.ndarray, "K B"]) -> Float[np.ndarray, "K"]:
    """Third largest scale of each frame, median over the neighbouring ones; NaN if unknown."""
    ranked = np.sort(np.where(np.isfinite(scale), scale, -np.inf), axis=1)
    sizes = np.where(np.isfinite(ranked[:, -3]), ranked[:, -3], np.nan)
    known = np.flatnonzero(np.isfinite(sizes))
    nearby = np.full(len(sizes), np.nan)
    for row in known:
        closest = known[np.argsort(np.abs(known - row), kind="stable")[:NEIGHBOURS]]
        nearby[row] = np.median(sizes[closest])
    return nearby


def joints_outside(
    annotations: Annotations, size: tuple[int, int], margin: float = 0.02
) -> list[str]:
    """Joints outside the picture by more than `margin` of its width."""
    beyond = _beyond(annotations, size)
    return [
        f"frame {annotations.frames[row]}: {annotations.skeleton.names[joint]} is "
        f"{beyond[row, joint]:.0f} px outside the picture."
        for row, joint in np.argwhere(beyond > margin * size[0])
    ]


def far_outside(annotations: Annotations, size: tuple[int, int]) -> list[int]:
    """Frames with a joint more than a body height outside the picture: no player is half there."""
    skeleton = annotations.skeleton
    parent, child = skeleton.bones.T
    lengths = np.linalg.norm(annotations.joints[:, child] - annotations.joints[:, parent], axis=2)
    far = _beyond(annotations, size) > _scale_nearby(lengths / skeleton.lengths)[:, None]
    return annotations.frames[far.any(axis=1)].tolist()


def _beyond(annotations: Annotations, size: tuple[int, int]) -> Float[np.ndarray, "K J"]:
    """How far joints lie outside the picture, px; negative within."""
    edge = np.array(size) - 1
    return np.maximum(-annotations.joints, annotations.joints - edge).max(axis=2)
