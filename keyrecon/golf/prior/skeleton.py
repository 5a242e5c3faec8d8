"""The golfer as rigid segments: turns from captured joints, and joints from turns.

Sixteen segments hang on one another by ball joints, pelvis first; the club hangs on the left
forearm. A segment's axes are those of its parent at rest, where every bone points along `rest`.
Pelvis and trunk get their axes from two lines each (hips and spine, shoulders and spine). Of any
other bone only the direction is captured, so it turns from rest by the shortest way: no twist is
made up, and the only undefined direction is opposite to rest, where no limb can go.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from keyrecon.body import JOINT_CENTER_LENGTHS, LSP14
from keyrecon.golf.records import Body, Swing
from keyrecon.numerics.geometry import unit_vectors

AHEAD_AND_DOWN = (0.0, -0.7071067811865476, -0.7071067811865476)


@dataclass(frozen=True)
class Segment:
    """One rigid part; `end` is the joint at its far end, '' where it has none."""

    name: str
    parent: int
    rest: tuple[float, float, float]
    """Direction of the bone in its own axes; of the parent's at rest."""
    end: str = ""


def _limbs() -> list[Segment]:
    """Arms and legs, right before left."""
    rows = [Segment("pelvis", -1, (0.0, 1.0, 0.0)), Segment("trunk", 0, (0.0, 1.0, 0.0), "neck"),
            Segment("head", 1, (0.0, 1.0, 0.0), "head_top")]  # fmt: skip
    chains = (
        ("clavicle", 1, None, "shoulder"), ("upper_arm", 3, AHEAD_AND_DOWN, "elbow"),
        ("forearm", 5, AHEAD_AND_DOWN, "wrist"), ("thigh", 0, (0.0, -1.0, 0.0), "knee"),
        ("shank", 9, (0.0, -1.0, 0.0), "ankle"), ("foot", 11, (0.0, 0.0, -1.0), ""),
    )  # fmt: skip
    for name, parent, rest, end in chains:
        for index, side in enumerate(("right", "left")):
            outwards = (1.0, 0.0, 0.0) if index == 0 else (-1.0, 0.0, 0.0)
            above = parent if parent < 2 else parent + index
            rows.append(Segment(f"{side}_{name}", above, rest or outwards, end and f"{side}_{end}"))
    return [*rows, Segment("club", 8, AHEAD_AND_DOWN)]


SEGMENTS = tuple(_limbs())
"""Parents before children."""
NAMES = tuple(segment.name for segment in SEGMENTS)
PARENTS = tuple(segment.parent for segment in SEGMENTS)
REST = np.array([segment.rest for segment in SEGMENTS])
CLUB = NAMES.index("club")

LENGTHS = {
    "trunk": JOINT_CENTER_LENGTHS.trunk,
    "head": JOINT_CENTER_LENGTHS.head,
    "clavicle": JOINT_CENTER_LENGTHS.shoulder,
    "upper_arm": JOINT_CENTER_LENGTHS.upper_arm,
    "forearm": JOINT_CENTER_LENGTHS.forearm,
    "thigh": JOINT_CENTER_LENGTHS.thigh,
    "shank": JOINT_CENTER_LENGTHS.shank,
}
"""Of the segments, in statures."""
HALF_HIPS = JOINT_CENTER_LENGTHS.hip_breadth / 2
"""From the middle to a hip joint in statures."""
GRIP = 0.045
"""From the left wrist along the forearm to between the hands, as a fraction of stature."""
NECK_MARK = 0.018
"""How far above the end of the model's trunk people see the neck, statures: midway between the
notch of the breastbone and the seventh vertebra, .3055 and .3465 above the hips (de Leva, J.
Biomechanics 29, 1996, men), where the trunk ends at .308. On five real swings necks were off those
marked by eye by .127, .063, .163, .133 and .173 trunk lengths without it, with it by .101, .082,
.118, .122 and .120."""
CLUB_LENGTH = 0.93
"""Metres from between the hands to the end of a mid iron's head."""
Vectors = Float[np.ndarray, "*n 3"]


def size_body(stature: float, club: float = CLUB_LENGTH) -> Body:
    """A player with average proportions of a given height in metres."""
    offsets = np.zeros((len(SEGMENTS), 3))
    for index, segment in enumerate(SEGMENTS[1:], start=1):
        above = SEGMENTS[segment.parent]
        if above.end:
            offsets[index] = _length(above) * np.array(above.rest)
        elif segment.name.endswith("thigh"):
            offsets[index, 0] = HALF_HIPS if segment.name.startswith("right") else -HALF_HIPS
    offsets[CLUB] += GRIP * REST[NAMES.index("left_forearm")]
    ends = {s.end: i for i, s in enumerate(SEGMENTS) if s.end}
    segments_of_joints = np.array([ends.get(name, 0) for name in LSP14.names])
    places = np.array([_length(SEGMENTS[c]) * REST[c] for c in segments_of_joints])
    for side, sign in (("right", 1), ("left", -1)):
        places[LSP14.index(f"{side}_hip")] = [sign * HALF_HIPS, 0, 0]
    return Body(stature, stature * offsets, segments_of_joints, stature * places, club)


def mark_neck(body: Body) -> Body:
    """A body whose neck is where people mark it; all that hangs on the trunk stays."""
    places = body.joint_place.copy()
    places[LSP14.index("neck")] += [0.0, NECK_MARK * body.stature, 0.0]
    return replace(body, joint_place=places)


def _length(segment: Segment) -> float:
    """Length of a segment in statures; 0 for the pelvis."""
    return LENGTHS.get(segment.name.split("_", 1)[-1], 0.0)


def turns_from_swing(swing: Swing) -> tuple[Float[np.ndarray, "T P 3 3"], Vectors]:
    """Turn of every segment relative to its parent, and the pelvis's place in statures."""

    def joint(name: str) -> Vectors:
        return swing.joints[:, LSP14.index(name)]

    pelvis = (joint("right_hip") + joint("left_hip")) / 2
    spine = joint("neck") - pelvis
    world = np.empty((len(swing.joints), len(SEGMENTS), 3, 3))
    world[:, 0] = _axes(joint("right_hip") - joint("left_hip"), spine, along_second=False)
    world[:, 1] = _axes(joint("right_shoulder") - joint("left_shoulder"), spine, along_second=True)
    turns = world.copy()
    turns[:, 1] = np.swapaxes(world[:, 0], 1, 2) @ world[:, 1]
    ways = _bone_directions(swing)
    for index, segment in enumerate(SEGMENTS[2:], start=2):
        above = world[:, segment.parent]
        local = np.einsum("tji,tj->ti", above, ways[segment.name])
        turns[:, index] = shortest_turn(np.array(segment.rest), local)
        world[:, index] = above @ turns[:, index]
    return turns, pelvis / swing.stature


def _bone_directions(swing: Swing) -> dict[str, Vectors]:
    """From the near to the far end of each segment behind the trunk."""
    ends = {segment.name: segment.end for segment in SEGMENTS}
    ways = {"club": swing.club[:, 1] - swing.club[:, 0]}
    for segment in SEGMENTS[2:-1]:
        side, _, part = segment.name.partition("_")
        if part == "foot":
            ankle = swing.joints[:, LSP14.index(f"{side}_ankle")]
            ways[segment.name] = swing.toes[:, ("right", "left").index(side)] - ankle
            continue
        start = f"{side}_hip" if part == "thigh" else ends[NAMES[segment.parent]]
        end = swing.joints[:, LSP14.index(segment.end)]
        ways[segment.name] = end - swing.joints[:, LSP14.index(start)]
    return ways


def _axes(across: Vectors, up: Vectors, along_second: bool) -> Float[np.ndarray, "T 3 3"]:
    """Axes x, y, z as columns from two lines; one is kept, the other made square to it."""
    back = unit_vectors(np.cross(across, up), 1e-12)
    if along_second:
        y = unit_vectors(up, 1e-12)
        x = np.cross(y, back)
    else:
        x = unit_vectors(across, 1e-12)
        y = np.cross(back, x)
    return np.stack([x, y, back], axis=2)


def shortest_turn(rest: Float[np.ndarray, "3"], to: Vectors) -> Float[np.ndarray, "n 3 3"]:
    """The rotation without twist that brings `rest` to the directions `to`."""
    way = unit_vectors(to, 1e-12)
    axis = np.cross(rest, way)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(sine[:, 0], way @ rest)
    return Rotation.from_rotvec(axis / np.maximum(sine, 1e-12) * angle[:, None]).as_matrix()


def chain_turns(turns: Float[np.ndarray, "T P 3 3"]) -> Float[np.ndarray, "T P 3 3"]:
    """Turns of every segment relative to the swing axes."""
    chained = turns.copy()
    for p, parent in enumerate(PARENTS[1:], start=1):
        chained[:, p] = chained[:, parent] @ turns[:, p]
    return chained
