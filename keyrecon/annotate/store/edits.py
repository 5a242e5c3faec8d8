"""What the page sends: an edit in one of a few kinds, checked as it is parsed.

Every edit has an id that the page made, so that one sent twice counts once, and says what the
page believed to stand in each cell (`from`), so that two pages cannot overwrite each other.
"""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from msgspec import Meta, Struct, field

from keyrecon.annotate.store.cells import Change, Key, Value
from keyrecon.body import Skeleton
from keyrecon.errors import KeyreconError

Name = Annotated[str, Meta(min_length=1, max_length=64)]
Frame = Annotated[int, Meta(ge=0, le=100_000_000)]
Instant = int | float
"""A frame, or between two as files have key postures."""
Place = tuple[float, float, Literal[0, 1, 2]]
Click = tuple[float, float, Literal[1, 2]]
Shaft = tuple[float, float, float, float]
Half = Literal["upper", "lower", "both"]
Sign = Literal[1, -1]


class Edit(Struct, frozen=True, tag_field="kind", forbid_unknown_fields=True):
    """What all edits have."""

    id: Name


class MarkEdit(Edit, frozen=True, tag="mark"):
    """One joint on one frame."""

    frame: Frame
    joint: Name
    to: Place | None
    was: Place | None = field(name="from")


class MarksEdit(Edit, frozen=True, tag="marks"):
    """Several joints on one frame: a suggestion accepted, left and right swapped."""

    frame: Frame
    to: dict[Name, Place | None]
    was: dict[Name, Place | None] = field(name="from")


class NearerEdit(Edit, frozen=True, tag="nearer"):
    """Which end of some limbs is nearer the camera; None leaves it to the program."""

    frame: Frame
    to: dict[Name, Sign | None]
    was: dict[Name, Sign | None] = field(name="from")


class PickPlace(Struct, frozen=True, forbid_unknown_fields=True):
    """A click on a colour."""

    id: Name
    frame: Frame
    part: Name
    x: float
    y: float


class PickEdit(Edit, frozen=True, tag="pick"):
    """A click added, moved or taken away."""

    to: PickPlace | None
    was: PickPlace | None = field(name="from")


class OwnKeyframeEdit(Edit, frozen=True, tag="own"):
    """A keyframe that the person adds or takes away again."""

    frame: Frame
    to: Half | None
    was: Half | None = field(name="from")


class LockEdit(Edit, frozen=True, tag="lock"):
    """A keyframe that no new choice may drop."""

    frame: Frame
    to: bool
    was: bool = field(name="from")


class ClickEdit(Edit, frozen=True, tag="click"):
    """One joint of a golfer at the address."""

    joint: Name
    to: Click | None
    was: Click | None = field(name="from")


class ShaftEdit(Edit, frozen=True, tag="shaft"):
    """A golf club on one frame: between the hands, and its head."""

    frame: Frame
    to: Shaft | None
    was: Shaft | None = field(name="from")


class KeyPostureEdit(Edit, frozen=True, tag="key"):
    """The frame of one of a swing's key postures."""

    name: Literal["start", "top", "hit", "finish"]
    to: Instant | None
    was: Instant | None = field(name="from")


class GolfEdit(Edit, frozen=True, tag="golf"):
    """What is known of a swing before a fit."""

    name: Literal["frame", "stature", "left_handed"]
    to: bool | float | None
    was: bool | float | None = field(name="from")


Part = MarkEdit | MarksEdit | NearerEdit | PickEdit | OwnKeyframeEdit | LockEdit
GOLF_CELLS = ("golf", "click", "shaft", "key")
"""Kinds of cells that only a golf swing has."""
LARGEST_STATURE = 3.0
"""Metres; what is plausible is for the fit to say."""
GolfPart = ClickEdit | ShaftEdit | KeyPostureEdit | GolfEdit


class GroupEdit(Edit, frozen=True, tag="group"):
    """Several edits that stand together or not at all, and are undone as one."""

    edits: Annotated[list[Part | GolfPart], Meta(min_length=1, max_length=5000)]


AnyEdit = Part | GolfPart | GroupEdit


@dataclass(frozen=True)
class Limits:
    """What an edit can refer to."""

    skeleton: Skeleton
    n_frames: int
    size: tuple[int, int]
    """Width and height of the picture, px."""


def changes_of(edit: AnyEdit, limits: Limits) -> tuple[Change, ...]:
    """The cells that an edit wants to change.

    Raises KeyreconError for a frame, joint or limb that is not there and for a place that is
    more than a picture's width off the picture.
    """
    changes = tuple(Change(*cell) for cell in _cells(edit))
    for change in changes:
        _check(change, limits)
    return changes


def _cells(edit: AnyEdit) -> list[tuple[Key, Value, Value]]:
    match edit:
        case MarkEdit(frame=frame, joint=joint):
            return [(("mark", frame, joint), _listed(edit.was), _listed(edit.to))]
        case MarksEdit(frame=frame):
            names = {**edit.was, **edit.to}
            was, to = edit.was.get, edit.to.get
            return [(("mark", frame, n), _listed(was(n)), _listed(to(n))) for n in names]
        case NearerEdit(frame=frame):
            limbs = {**edit.was, **edit.to}
            return [(("nearer", frame, n), edit.was.get(n), edit.to.get(n)) for n in limbs]
        case PickEdit():
            return _pick_cells(edit)
        case OwnKeyframeEdit(frame=frame):
            return [(("own", frame), edit.was, edit.to)]
        case LockEdit(frame=frame):
            return [(("lock", frame), edit.was or None, edit.to or None)]
        case ClickEdit() | ShaftEdit() | KeyPostureEdit() | GolfEdit():
            return [_golf_cell(edit)]
        case GroupEdit(edits=parts):
            return [cell for part in parts for cell in _cells(part)]


def _pick_cells(edit: PickEdit) -> list[tuple[Key, Value, Value]]:
    names = dict.fromkeys(place.id for place in (edit.was, edit.to) if place)
    was, to = _pick_value(edit.was), _pick_value(edit.to)
    return [
        (
            ("pick", name),
            was if edit.was and edit.was.id == name else None,
            to if edit.to and edit.to.id == name else None,
        )
        for name in names
    ]


def _pick_value(place: PickPlace | None) -> dict[str, Any] | None:
    if place is None:
        return None
    part = " ".join(place.part.lower().split())
    return {"frame": place.frame, "part": part, "x": place.x, "y": place.y}


def _golf_cell(edit: GolfPart) -> tuple[Key, Value, Value]:
    match edit:
        case ClickEdit(joint=joint):
            return ("click", joint), _listed(edit.was), _listed(edit.to)
        case ShaftEdit(frame=frame):
            return ("shaft", frame), _listed(edit.was), _listed(edit.to)
        case KeyPostureEdit(name=name):
            return ("key", name), edit.was, edit.to
        case GolfEdit(name=name):
            return ("golf", name), _known(name, edit.was), _known(name, edit.to)


def _known(name: str, value: bool | float | None) -> bool | int | float | None:
    """A value as its cell holds it; what is not so is not told."""
    if value is None or value is False:
        return None
    return int(value) if name == "frame" else value


def _listed(place: Place | Click | Shaft | None) -> list[float | int] | None:
    return None if place is None else list(place)


def _check(change: Change, limits: Limits) -> None:
    kind, *where = change.key
    if kind in GOLF_CELLS:
        if change.after is not None:
            _check_golf(str(kind), where[0], change.after, limits)
        return
    pick = change.after if kind == "pick" else None
    frame = pick["frame"] if pick else where[0]
    if isinstance(frame, int):
        check_frame(frame, limits)
    if kind in ("mark", "nearer"):
        _check_name(str(where[1]), kind, limits.skeleton)
    if kind == "mark" and change.after is not None and change.after[2]:
        _check_place(change.after[:2], limits.size, margin=1.0)
    if pick and not pick["part"]:
        raise KeyreconError("A click needs the name of the part that it is on.")
    if pick:
        _check_place([pick["x"], pick["y"]], limits.size, margin=0.0)


def _check_golf(kind: str, name: str | int, value: Value, limits: Limits) -> None:
    """What is said of a golf swing is of a frame and place that there are."""
    match kind, name:
        case ("key", _) | ("golf", "frame"):
            check_frame(value, limits)
        case ("golf", "left_handed") if value is not True:
            raise KeyreconError("Whether a player is left-handed is true or false.")
        case ("golf", "stature") if value is True or not 0 < value < LARGEST_STATURE:
            raise KeyreconError(f"A player's height in metres cannot be {value:g}.")
        case ("click", _):
            if name != "root":
                _check_name(str(name), kind, limits.skeleton)
            _check_place(value[:2], limits.size, margin=0.0)
        case ("shaft", int()):
            check_frame(int(name), limits)
            for end in (value[:2], value[2:]):
                _check_place(end, limits.size, margin=1.0)


def check_frame(frame: int | float, limits: Limits) -> None:
    """Raise KeyreconError for a frame that the video does not have."""
    if not 0 <= frame < limits.n_frames:
        raise KeyreconError(
            f"Frame {frame} is outside the video, which has frames 0 to {limits.n_frames - 1}."
        )


def _check_name(name: str, kind: str, skeleton: Skeleton) -> None:
    if name not in skeleton.names:
        raise KeyreconError(f"The skeleton has no joint '{name}'.")
    if kind == "nearer" and skeleton.index(name) == skeleton.root:
        raise KeyreconError(f"'{name}' ends no limb; limbs are named by their outer joint.")


def _check_place(place: list[float | int], size: tuple[int, int], margin: float) -> None:
    for value, extent in zip(place, size, strict=True):
        if not -margin * extent <= value < (1 + margin) * extent:
            raise KeyreconError(
                f"({place[0]:g}, {place[1]:g}) is too far off the picture of {size[0]}x{size[1]}."
            )


class EditList(Struct, forbid_unknown_fields=True):
    """The body of a request to change something."""

    edits: Annotated[list[AnyEdit], Meta(max_length=5000)]
