"""The few clicks that start a golf fit: joints of one frame, and what is known of the player.

The file is a small JSON, one object:

    {"keyrecon_golf_clicks": 1, "frame": 0, "size": [800, 720], "left_handed": false,
     "stature": 1.8, "focal": null, "principal": [400, 360],
     "joints": {"head_top": [421, 115], "root": [237, 360], "right_knee": [277, 505], ...}}

`root` is the middle between the hips (Section 5.1 of the CVPR 2005 paper: the root, the head, both
knees and both ankles suffice); any joint of the Leeds skeleton may be added. `size` is that of the
picture that was clicked, so that a file taken for another video is noticed.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from keyrecon.body import LSP14
from keyrecon.durable import write_durably
from keyrecon.errors import KeyreconError

FORMAT = 1
"""Version of the file."""
NEEDED = ("head_top", "root", "right_knee", "left_knee", "right_ankle", "left_ankle")
"""Without these nothing can be started; `root` may be given as both hips."""
STATURE = 1.75
"""Metres, where the file does not tell."""
SHORTEST_PLAYER = 60.0
"""px from the head to the ankles: below it neither club nor limbs can be seen."""


@dataclass(frozen=True)
class Clicks:
    """What a person clicked in one frame, and roughly knows about player and camera."""

    frame: int
    size: tuple[int, int]
    """Width and height of the pictures, px."""
    joints: Mapping[str, tuple[float, float]]
    """px by name: joints of the Leeds skeleton, and `root` between the hips."""
    left_handed: bool = False
    stature: float = STATURE
    """Metres."""
    focal: float | None = None
    """px; None where unknown."""
    principal: tuple[float, float] | None = None
    """px; None for the middle of the picture."""

    def place(self, name: str) -> Float[np.ndarray, "2"]:
        """Where a joint was clicked; `root` also from both hips."""
        if name == "root" and name not in self.joints:
            return (self.place("right_hip") + self.place("left_hip")) / 2
        return np.array(self.joints[name], float)

    @property
    def feet(self) -> Float[np.ndarray, "2"]:
        """Between the ankles."""
        return (self.place("right_ankle") + self.place("left_ankle")) / 2

    @property
    def height(self) -> float:
        """From the top of the head to between the ankles, px."""
        return float(np.linalg.norm(self.place("head_top") - self.feet))


def read_clicks(path: Path) -> Clicks:
    """Read and check a file of clicks; raises KeyreconError with what is wrong and what helps."""
    try:
        content = json.loads(path.read_text())
        version = content["keyrecon_golf_clicks"]
        if version != FORMAT:
            raise KeyreconError(
                f"{path} is a file of clicks of version {version}; this keyrecon reads {FORMAT}."
            )
        principal, focal = content.get("principal"), content.get("focal")
        clicks = Clicks(
            frame=int(content["frame"]),
            size=_pair(content["size"], int),
            joints={str(n): _pair(p, float) for n, p in content["joints"].items()},
            left_handed=bool(content.get("left_handed", False)),
            stature=float(content.get("stature") or STATURE),
            focal=None if focal is None else float(focal),
            principal=None if principal is None else _pair(principal, float),
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as fault:
        raise KeyreconError(
            f"{path} is not a file of golf clicks ({fault!r}); it is a JSON object with "
            '"keyrecon_golf_clicks", "frame", "size" and "joints".'
        ) from fault
    _check(clicks, path)
    return clicks


def write_clicks(path: Path, clicks: Clicks) -> None:
    """Write clicks as a person would: one joint to a line."""
    joints = ",\n    ".join(f'"{n}": [{x:g}, {y:g}]' for n, (x, y) in clicks.joints.items())
    head = {
        "keyrecon_golf_clicks": FORMAT,
        "frame": clicks.frame,
        "size": list(clicks.size),
        "left_handed": clicks.left_handed,
        "stature": clicks.stature,
        "focal": clicks.focal,
        "principal": clicks.principal and list(clicks.principal),
    }
    body = ",\n  ".join(f'"{name}": {json.dumps(value)}' for name, value in head.items())
    write_durably(path, f'{{\n  {body},\n  "joints": {{\n    {joints}\n  }}\n}}\n')


def check_clicks(clicks: Clicks, n_frames: int, size: tuple[int, int]) -> None:
    """Raises KeyreconError where clicks do not belong to a video of this length and size."""
    if clicks.size != size:
        raise KeyreconError(
            f"The clicks were made on pictures of {clicks.size[0]} x {clicks.size[1]} px, but this "
            f"video has {size[0]} x {size[1]}; click again in this video."
        )
    if not 0 <= clicks.frame < n_frames:
        raise KeyreconError(
            f"The clicks are on frame {clicks.frame}, but the video has frames 0 to {n_frames - 1}."
        )


def _pair(values: list, kind: type) -> tuple:
    first, second = values
    return kind(first), kind(second)


def _check(clicks: Clicks, path: Path) -> None:
    """The joints that a start needs, inside the picture, the right way up."""
    known = {*LSP14.names, "root"}
    if strange := sorted(set(clicks.joints) - known):
        raise KeyreconError(
            f"{path} clicks '{strange[0]}', which is no joint; use {', '.join(sorted(known))}."
        )
    given = set(clicks.joints) | (
        {"root"} if {"right_hip", "left_hip"} <= set(clicks.joints) else set()
    )
    if missing := [name for name in NEEDED if name not in given]:
        raise KeyreconError(f"{path} lacks a click on {' and '.join(missing)}; add it.")
    for name, (x, y) in clicks.joints.items():
        if not (0 <= x < clicks.size[0] and 0 <= y < clicks.size[1]):
            raise KeyreconError(
                f"{path}: the click on {name} at ({x:g}, {y:g}) is outside the picture of "
                f"{clicks.size[0]} x {clicks.size[1]} px."
            )
    _check_posture(clicks, path)


def _check_posture(clicks: Clicks, path: Path) -> None:
    if clicks.height < SHORTEST_PLAYER:
        raise KeyreconError(
            f"{path}: head and ankles are only {clicks.height:.0f} px apart; the player must be "
            f"at least {SHORTEST_PLAYER:.0f} px tall. Check the clicks or crop the video."
        )
    head, root, feet = clicks.place("head_top")[1], clicks.place("root")[1], clicks.feet[1]
    if not head < root < feet:
        raise KeyreconError(
            f"{path}: the head, the root and the ankles must be clicked from top to bottom, but "
            f"they are at y = {head:g}, {root:g} and {feet:g}; click the address posture again."
        )
