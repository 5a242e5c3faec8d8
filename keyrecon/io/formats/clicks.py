"""golf_clicks.json: the few clicks that start a golf fit, one JSON object.

    {"keyrecon_golf_clicks": 1, "frame": 0, "size": [800, 720], "hidden": ["left_knee"],
     "left_handed": false, "stature": 1.8, "focal": null, "principal": [400, 360],
     "joints": {"head_top": [421, 115], "root": [237, 360], "right_knee": [277, 505], ...}}

`size` is that of the picture that was clicked, so that a file taken for another video is noticed;
`hidden` joints were clicked where they must be behind something.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from keyrecon.errors import KeyreconError
from keyrecon.golf.clicks import STATURE, GolfClicks, check_joints, check_numbers
from keyrecon.io.durable import write_durably
from keyrecon.reading import parse_json, read_text, reading, real, whole

__all__ = [
    "GolfClicks",
    "clicks_from_parts",
    "clicks_text",
    "parts_of_clicks",
    "read_clicks",
    "read_some_clicks",
    "write_clicks",
]
Number = TypeVar("Number", int, float)
FORMAT = 1
"""Version of the file."""


def read_clicks(path: Path) -> GolfClicks:
    """Read and check a file of clicks; raises KeyreconError with what is wrong and what helps."""
    clicks = read_some_clicks(path)
    check_numbers(clicks, str(path))
    check_joints(clicks, str(path))
    return clicks


def read_some_clicks(path: Path) -> GolfClicks:
    """The same of a file in which joints may still be missing."""
    remedy = 'it is a JSON object with "keyrecon_golf_clicks", "frame", "size" and "joints"'
    with reading(path, "a file of golf clicks", remedy):
        content = parse_json(read_text(path))
        version = content["keyrecon_golf_clicks"]
        if version != FORMAT:
            raise KeyreconError(
                f"{path} is a file of clicks of version {version}; this keyrecon reads {FORMAT}."
            )
        principal, focal = content.get("principal"), content.get("focal")
        stature, left_handed = content.get("stature"), content.get("left_handed", False)
        if not isinstance(left_handed, bool):
            raise KeyreconError(
                f"{path}: 'left_handed' is {left_handed!r}; it must be true or false."
            )
        return GolfClicks(
            frame=whole(content["frame"]),
            size=_pair(content["size"], whole),
            joints={n: _pair(p, real) for n, p in content["joints"].items()},
            hidden=tuple(str(n) for n in content.get("hidden", ())),
            left_handed=left_handed,
            stature=STATURE if stature is None else real(stature),
            focal=None if focal is None else real(focal),
            principal=None if principal is None else _pair(principal, real),
        )


def write_clicks(path: Path, clicks: GolfClicks) -> None:
    """Write a file of clicks."""
    write_durably(path, clicks_text(clicks))


def clicks_text(clicks: GolfClicks) -> str:
    """Clicks as a person would write them: one joint to a line."""
    joints = ",\n    ".join(f'"{n}": [{x:g}, {y:g}]' for n, (x, y) in clicks.joints.items())
    head = {
        "keyrecon_golf_clicks": FORMAT,
        "frame": clicks.frame,
        "size": list(clicks.size),
        "hidden": list(clicks.hidden),
        "left_handed": clicks.left_handed,
        "stature": clicks.stature,
        "focal": clicks.focal,
        "principal": clicks.principal and list(clicks.principal),
    }
    body = ",\n  ".join(f'"{name}": {json.dumps(value)}' for name, value in head.items())
    return f'{{\n  {body},\n  "joints": {{\n    {joints}\n  }}\n}}\n'


def clicks_from_parts(
    settings: Mapping[str, Any], places: Mapping[str, Sequence[int | float]], size: tuple[int, int]
) -> GolfClicks:
    """Clicks from what was told by name, and from x, y (px) and 2 (visible) or 1 of each joint."""
    principal = settings.get("principal")
    return GolfClicks(
        frame=settings.get("frame", 0),
        size=size,
        joints={name: (float(x), float(y)) for name, (x, y, _) in places.items()},
        hidden=tuple(name for name, (*_, visible) in places.items() if visible == 1),
        left_handed=settings.get("left_handed", False),
        stature=float(settings.get("stature", STATURE)),
        focal=settings.get("focal"),
        principal=principal and (float(principal[0]), float(principal[1])),
    )


def parts_of_clicks(clicks: GolfClicks) -> tuple[dict[str, Any], dict[str, list[int | float]]]:
    """What `clicks_from_parts` makes them from, without what is as it is for everybody."""
    settings = {
        "frame": clicks.frame,
        "stature": clicks.stature if clicks.stature != STATURE else None,
        "left_handed": clicks.left_handed or None,
        "focal": clicks.focal,
        "principal": None if clicks.principal is None else [*clicks.principal],
    }
    return {name: value for name, value in settings.items() if value is not None}, {
        name: [x, y, 1 if name in clicks.hidden else 2] for name, (x, y) in clicks.joints.items()
    }


def _pair(values: list, kind: Callable[[Any], Number]) -> tuple[Number, Number]:
    first, second = values
    return kind(first), kind(second)
