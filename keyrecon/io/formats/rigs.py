"""What motion-capture files hold, before it is known which point is which joint.

Which points of a motion-capture figure are the joints of our skeleton, and how large it is.

Rigs differ in names and in where they put neck and crown; a `Rig` is a row of names per joint.
The first rig whose names are all in the file is taken. A point is a joint of the file, or one
that lies beyond it: `Beyond("Head", "Head end", 2)` is twice as far from Head as its end.

Neither unit nor axes are stated in BVH and ASF files. The unit is the one in which the figure's
stature (sum of its bones from ankle to crown, divided by that share of stature) is that of a
person, 1.2-2.3 m: these ranges do not meet for metres, CMU's unit (0.45 inch as one:
metres = value * 0.0254 / 0.45), inches, centimetres and millimetres. The vertical axis is the
one along which the figure's head is above its ankles, Y or Z.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError


@dataclass(frozen=True, eq=False)
class CapturedFigure:
    """Every point of a captured figure over time, in the file's own unit and axes."""

    names: tuple[str, ...]
    """One per point; an end site is called after its joint, with ' end' behind."""
    parents: tuple[int, ...]
    """-1 at the root."""
    positions: Float[np.ndarray, "T N 3"]
    rotations: Float[np.ndarray, "T N 3 3"]
    """From each point's local axes to the file's."""
    fps: float


class Beyond(NamedTuple):
    """The point start + factor * (end - start)."""

    start: str
    end: str
    factor: float


class Local(NamedTuple):
    """A point fixed in the local axes of a joint, in the file's unit."""

    joint: str
    offset: tuple[float, float, float]


Point = str | Beyond | Local


@dataclass(frozen=True)
class Rig:
    """Where our joints are in a family of files; '{}' stands for the side."""

    sides: tuple[str, str]
    """Right, left, as they are written in names."""
    limbs: tuple[str, str, str, str, str, str]
    """Ankle, knee, hip, wrist, elbow, shoulder."""
    neck: Point
    head_top: Point
    toes: tuple[str, ...]
    """Names in order of preference; a file may have none of them."""


RIGS = (
    Rig(  # our own export
        ("right", "left"),
        ("{}_ankle", "{}_knee", "{}_hip", "{}_wrist", "{}_elbow", "{}_shoulder"),
        "neck",
        "head_top",
        ("{}_ankle end",),
    ),
    Rig(  # joints called by the joint's own name, as in optical captures of tennis strokes
        ("Right", "Left"),
        ("{}Ankle", "{}Knee", "{}Hip", "{}Wrist", "{}Elbow", "{}Shoulder"),
        "Neck",
        "Head end",
        ("{}Ankle end",),
    ),
    # CMU skeleton, retargeted by B. Hahne: Neck lies 8 cm under the shoulder line and Neck1
    # 2 cm above it; the head's bone ends at the head's middle, 10 cm under the crown.
    Rig(
        ("Right", "Left"),
        ("{}Foot", "{}Leg", "{}UpLeg", "{}Hand", "{}ForeArm", "{}Arm"),
        "Neck1",
        Beyond("Head", "Head end", 2.0),
        ("{}ToeBase",),
    ),
    Rig(  # MotionBuilder's names, also Mixamo's and most suits'
        ("Right", "Left"),
        ("{}Foot", "{}Leg", "{}UpLeg", "{}Hand", "{}ForeArm", "{}Arm"),
        "Neck",
        "Head end",
        ("{}ToeBase", "{}Foot end"),
    ),
    # DAZ figures: the head has no end; its eyes lie 8 cm above the joint, and the crown
    # .064 statures above them (Winter).
    Rig(
        ("r", "l"),
        ("{}Foot", "{}Shin", "{}Thigh", "{}Hand", "{}ForeArm", "{}Shldr"),
        "neck",
        Local("head", (0.0, 19.0, 0.0)),
        ("{}Foot end",),
    ),
    # CMU's ASF; points are the ends of bones, so that rfemur is the knee.
    Rig(
        ("r", "l"),
        ("{}tibia", "{}femur", "{}hipjoint", "{}radius", "{}humerus", "{}clavicle"),
        "lowerneck",
        Beyond("upperneck", "head", 2.0),
        ("{}foot",),
    ),
)

UNITS = {
    "metres": 1.0,
    "CMU units": 0.0254 / 0.45,
    "inches": 0.0254,
    "centimetres": 0.01,
    "millimetres": 0.001,
}
"""Metres per unit."""

MIN_RATE, MAX_RATE = 1.0, 10_000.0
"""Frames per second that a capture can have."""

PERSON = (1.2, 2.3)
"""Statures of people, metres; so chosen that no figure fits two units."""


def find_joints(
    figure: CapturedFigure,
) -> tuple[Float[np.ndarray, "T J 3"], Float[np.ndarray, "T 2 3"] | None]:
    """Joints in the order of LSP14 and toes (right, left), still in the file's unit and axes.

    Raises KeyreconError when no known rig has its names in the file.
    """
    # Mixamo and others put the figure's name before each joint's: "mixamorig:Hips".
    names = {name.split(":")[-1]: i for i, name in enumerate(figure.names)}
    for rig in RIGS:
        points = _points(rig)
        if all(word in names for point in points for word in _words(point)):
            joints = np.stack([_place(figure, names, point) for point in points], axis=1)
            return joints, _toes(figure, names, rig)
    raise KeyreconError(
        f"No known rig has joints called {', '.join(name[:40] for name in list(names)[:12])} ...; "
        "rename the joints as in the CMU, MotionBuilder or DAZ skeletons "
        "(RightUpLeg, RightLeg, RightFoot, ...)."
    )


def _points(rig: Rig) -> list[Point]:
    """The rig's points in the order of LSP14."""
    limbs = dict(
        zip(("ankle", "knee", "hip", "wrist", "elbow", "shoulder"), rig.limbs, strict=True)
    )
    points: list[Point] = []
    for name in LSP14.names:
        side, _, joint = name.partition("_")
        if joint in limbs:
            points.append(limbs[joint].format(rig.sides[side == "left"]))
        else:
            points.append(rig.neck if name == "neck" else rig.head_top)
    return points


def _words(point: Point) -> tuple[str, ...]:
    """Names that a point needs."""
    if isinstance(point, str):
        return (point,)
    return (point.start, point.end) if isinstance(point, Beyond) else (point.joint,)


def _place(figure: CapturedFigure, names: dict[str, int], point: Point) -> Float[np.ndarray, "T 3"]:
    if isinstance(point, str):
        return figure.positions[:, names[point]]
    if isinstance(point, Beyond):
        start = figure.positions[:, names[point.start]]
        return start + point.factor * (figure.positions[:, names[point.end]] - start)
    joint = names[point.joint]
    return figure.positions[:, joint] + figure.rotations[:, joint] @ np.array(point.offset)


def _toes(
    figure: CapturedFigure, names: dict[str, int], rig: Rig
) -> Float[np.ndarray, "T 2 3"] | None:
    for toe in rig.toes:
        pair = [toe.format(side) for side in rig.sides]
        if all(name in names for name in pair):
            return figure.positions[:, [names[name] for name in pair]]
    return None


def stature(joints: Float[np.ndarray, "T J 3"]) -> float:
    """Stature that the bones between ankles and crown imply, in the unit of the joints."""
    lengths, share = 0.0, 0.0
    for name in ("knee", "ankle"):
        for side in ("right", "left"):
            child = LSP14.index(f"{side}_{name}")
            bone = joints[:, child] - joints[:, LSP14.parents[child]]
            lengths += float(np.median(np.linalg.norm(bone, axis=1))) / 2
            share += LSP14.proportions[child] / 2
    hips = joints[:, [LSP14.index("right_hip"), LSP14.index("left_hip")]].mean(axis=1)
    neck, crown = joints[:, LSP14.index("neck")], joints[:, LSP14.index("head_top")]
    lengths += float(np.median(np.linalg.norm(neck - hips, axis=1)))
    lengths += float(np.median(np.linalg.norm(crown - neck, axis=1)))
    return lengths / (share + 0.300 + LSP14.proportions[LSP14.index("head_top")])


def metres_per_unit(joints: Float[np.ndarray, "T J 3"]) -> float:
    """The unit in which the figure is as tall as a person; raises KeyreconError if none is."""
    height = stature(joints)
    for metres in UNITS.values():
        if PERSON[0] <= height * metres <= PERSON[1]:
            return metres
    raise KeyreconError(
        f"The figure is {height:.4g} units tall, which is no person in {', '.join(UNITS)}; "
        "scale the file to one of these."
    )


def upright(points: Float[np.ndarray, "T N 3"], joints: Float[np.ndarray, "T J 3"]) -> np.ndarray:
    """`points` with the vertical axis turned to Y; raises KeyreconError for a lying figure."""
    ankles = joints[:, [LSP14.index("right_ankle"), LSP14.index("left_ankle")]].mean(axis=1)
    rise = np.median(joints[:, LSP14.index("head_top")] - ankles, axis=0)
    axis = int(np.abs(rise).argmax())
    if axis == 0 or rise[axis] < 0:
        raise KeyreconError(
            f"The head lies along {'-' if rise[axis] < 0 else ''}{'XYZ'[axis]} of the feet; turn "
            "the figure so that Y or Z points up."
        )
    return points if axis == 1 else np.stack([points[..., 0], points[..., 2], -points[..., 1]], -1)
