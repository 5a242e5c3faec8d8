"""Skeletons as data: joints, bones, mirrored pairs and bone lengths in statures.

The default is the 14-joint skeleton of the Leeds Sports Pose data set (Johnson and Everingham,
BMVC 2010) with COCO's joint names. Its tree is rooted at the neck, so that every bone joins two
joints that a person can mark: neck to head top, to both shoulders and to both hips, and
outwards along the limbs. A skeleton is a record of names and indices; nothing else in the
package knows which joints exist, and a user can bring another one from a JSON file.

Bone lengths are fractions of stature, all of them in `MARKED_LENGTHS` and `JOINT_CENTER_LENGTHS`
with their sources.
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.errors import KeyreconError
from keyrecon.reading import parse_json, read_text, reading, real


@dataclass(frozen=True)
class BodyLengths:
    """Lengths of the body as fractions of stature."""

    neck_to_hip: float
    """From the neck to one hip joint."""
    trunk: float
    """From the neck to the middle between the hip joints."""
    head: float
    """From the neck to the top of the head."""
    shoulder: float
    """From the neck to a shoulder joint."""
    upper_arm: float
    forearm: float
    thigh: float
    shank: float
    hip_breadth: float
    """Between the hip joints."""
    shoulder_breadth: float
    """Between the shoulder joints."""


MARKED_LENGTHS = BodyLengths(
    neck_to_hip=0.315,  # Pythagoras: trunk .300, outer half breadth .0955 (Winter)
    trunk=0.300,  # shoulder line .818 less hip line .530 (Winter), the neck .012 higher
    head=0.170,  # 1 less shoulder line .818 (Winter), the neck .012 higher
    shoulder=0.130,  # half breadth .129 (Winter), the neck .012 higher
    upper_arm=0.186,  # Winter
    forearm=0.146,  # Winter
    thigh=0.245,  # Winter
    shank=0.246,  # Winter
    # Midway between the joints' centres (.104) and the breadth over the hips (.191, Winter), since
    # people mark somewhere between.
    hip_breadth=0.145,
    shoulder_breadth=0.258,  # twice the half breadth .129 (Winter)
)
"""Between joints as people mark them, on the outline of the body as it shows in pictures.

Winter is Drillis and Contini (1966) as tabulated in his "Biomechanics and Motor Control of Human
Movement". Its breadths are outer ones, over the deltoids and the trochanters."""
JOINT_CENTER_LENGTHS = BodyLengths(
    neck_to_hip=0.312,  # Pythagoras
    trunk=0.308,  # mid-hip to mid-shoulder (de Leva), the neck .012 higher
    head=0.161,  # what is left of stature above ankle height, shank, thigh and trunk
    shoulder=0.095,  # half of what lies between the joints' centres; its source is not recorded
    upper_arm=0.162,  # de Leva
    forearm=0.155,  # de Leva
    thigh=0.243,  # de Leva
    shank=0.249,  # de Leva
    hip_breadth=0.104,  # 0.36 of the pelvis's breadth on either side (Bell), .145 statures
    shoulder_breadth=0.190,  # twice .095
)
"""Between centres of rotation, for bodies that are posed by turning their segments.

De Leva is J. Biomechanics 29, 1996, men; Bell is Bell, Pedersen and Brand, J. Biomechanics 23,
1990. Shoulder and hip joints lie well inside the outline, so the breadths are a quarter smaller
than the marked ones, and the limbs differ by where a shoulder ends and an arm begins. The two
tables stay apart: one is a prior of what is marked in pictures, the other the size of the
simulated player whose motion prior was learnt with it."""
MAX_LENGTH = 2.0
"""No bone is longer, statures."""
ANKLE_HEIGHT = 0.039
"""Ankle above the floor as a fraction of stature (Winter)."""


@dataclass(frozen=True)
class Breadth:
    """Two joints that the trunk holds at a constant distance; no bone of the tree joins them."""

    left: int
    right: int
    length: float
    """Fraction of stature."""


@dataclass(frozen=True)
class Skeleton:
    """Joints and the tree that holds them; a bone is named by its child joint."""

    names: tuple[str, ...]
    parents: tuple[int, ...]
    """Index of each joint's parent, -1 at the root."""
    mirrored: tuple[tuple[int, int], ...]
    """Pairs (left joint, right joint)."""
    proportions: tuple[float, ...]
    """Length of the bone from the parent to each joint as a fraction of stature; 0 at the root."""
    lower: tuple[int, ...]
    """Joints that belong to the lower body; all others belong to the upper body."""

    @cached_property
    def bones(self) -> Int[np.ndarray, "B 2"]:
        """(parent, child) of every bone, parents before their children."""
        order, waiting = [], [self.root]
        while waiting:
            joint = waiting.pop(0)
            children = [c for c, p in enumerate(self.parents) if p == joint]
            order += [(joint, c) for c in children]
            waiting += children
        return np.array(order, dtype=np.int64).reshape(-1, 2)

    @property
    def root(self) -> int:
        """The joint without a parent."""
        return self.parents.index(-1)

    @cached_property
    def lengths(self) -> Float[np.ndarray, "B"]:
        """Bone lengths in statures, in the order of `bones`."""
        return np.array([self.proportions[child] for _, child in self.bones])

    @cached_property
    def ancestry(self) -> Float[np.ndarray, "J B"]:
        """1 where a bone lies on the way from the root to a joint, else 0."""
        ways = np.zeros((len(self.names), len(self.bones)))
        for bone, (parent, child) in enumerate(self.bones):
            ways[child] = ways[parent]
            ways[child, bone] = 1.0
        return ways

    @cached_property
    def breadths(self) -> tuple[Breadth, ...]:
        """Hips and shoulders, where the skeleton has them."""
        pairs = (("hip", MARKED_LENGTHS.hip_breadth), ("shoulder", MARKED_LENGTHS.shoulder_breadth))
        return tuple(
            Breadth(self.index(f"left_{name}"), self.index(f"right_{name}"), length)
            for name, length in pairs
            if {f"left_{name}", f"right_{name}"} <= set(self.names)
        )

    @cached_property
    def mirror(self) -> Int[np.ndarray, "J"]:
        """Index of each joint's mirror image; a joint on the midline is its own."""
        mirror = np.arange(len(self.names))
        for left, right in self.mirrored:
            mirror[[left, right]] = right, left
        return mirror

    @cached_property
    def bone_mirror(self) -> Int[np.ndarray, "B"]:
        """Index of each bone's mirror image."""
        child_to_bone = {int(child): b for b, (_, child) in enumerate(self.bones)}
        return np.array([child_to_bone[int(self.mirror[c])] for _, c in self.bones])

    @cached_property
    def length_group(self) -> Int[np.ndarray, "B"]:
        """Which length each bone has: left and right share one."""
        first = np.minimum(np.arange(len(self.bones)), self.bone_mirror)
        return np.unique(first, return_inverse=True)[1]

    @cached_property
    def is_lower(self) -> Bool[np.ndarray, "J"]:
        """Which joints belong to the lower body."""
        return np.isin(np.arange(len(self.names)), self.lower)

    def index(self, name: str) -> int:
        """Position of a joint by name."""
        if name not in self.names:
            raise KeyreconError(
                f"The skeleton has no joint '{name}'; it has {', '.join(self.names)}."
            )
        return self.names.index(name)


_LSP = (  # name, parent, bone length in statures
    ("right_ankle", "right_knee", MARKED_LENGTHS.shank),
    ("right_knee", "right_hip", MARKED_LENGTHS.thigh),
    ("right_hip", "neck", MARKED_LENGTHS.neck_to_hip),
    ("left_hip", "neck", MARKED_LENGTHS.neck_to_hip),
    ("left_knee", "left_hip", MARKED_LENGTHS.thigh),
    ("left_ankle", "left_knee", MARKED_LENGTHS.shank),
    ("right_wrist", "right_elbow", MARKED_LENGTHS.forearm),
    ("right_elbow", "right_shoulder", MARKED_LENGTHS.upper_arm),
    ("right_shoulder", "neck", MARKED_LENGTHS.shoulder),
    ("left_shoulder", "neck", MARKED_LENGTHS.shoulder),
    ("left_elbow", "left_shoulder", MARKED_LENGTHS.upper_arm),
    ("left_wrist", "left_elbow", MARKED_LENGTHS.forearm),
    ("neck", None, 0.0),
    ("head_top", "neck", MARKED_LENGTHS.head),
)


def plain_name(name: str) -> str:
    """A joint's name in a sentence."""
    return name.replace("_", " ")


def standing_length(lengths: Float[np.ndarray, "B"], skeleton: Skeleton) -> float:
    """How tall bones of these lengths stand: the longest leg and the longest midline chain."""
    reach = skeleton.ancestry @ lengths
    midline = skeleton.mirror == np.arange(len(reach))
    lower = skeleton.is_lower
    return float(reach[lower].max(initial=0.0) + reach[midline].max(initial=0.0))


def _skeleton_from_rows(rows: list[tuple[str, str | None, float]], lower: list[str]) -> Skeleton:
    names = tuple(name for name, _, _ in rows)
    return Skeleton(
        names=names,
        parents=tuple(-1 if parent is None else names.index(parent) for _, parent, _ in rows),
        mirrored=tuple(
            (names.index(name), names.index(name.replace("left_", "right_", 1)))
            for name in names
            if name.startswith("left_")
        ),
        proportions=tuple(length for _, _, length in rows),
        lower=tuple(names.index(name) for name in lower),
    )


LSP14 = _skeleton_from_rows(
    list(_LSP), [n for n, _, _ in _LSP if n.split("_")[-1] in ("hip", "knee", "ankle")]
)
"""The default skeleton."""


def read_skeleton(path: Path | str) -> Skeleton:
    """Read a skeleton from JSON: {"joints": [{"name", "parent", "length"}...], "lower": [names]}.

    `parent` is null at the root, `length` is in statures, mirrored pairs are the names that
    differ only in left_ and right_. Raises KeyreconError when the tree is not one.
    """
    path = Path(path)
    remedy = "it needs 'joints' with name, parent and length, and 'lower' with joint names"
    with reading(path, "a skeleton file", remedy):
        data = parse_json(read_text(path))
        rows = [(j["name"], j["parent"], real(j["length"] or 0)) for j in data["joints"]]
        if strange := [name for name, _, _ in rows if not isinstance(name, str)]:
            raise ValueError(f"{strange[0]!r} is not the name of a joint")
        return check_skeleton(_skeleton_from_rows(rows, data["lower"]))


def check_skeleton(skeleton: Skeleton) -> Skeleton:
    """The skeleton; ValueError where it is not one tree of joints of a body."""
    names, count = skeleton.names, len(skeleton.names)
    if strange := [name for name in names if not isinstance(name, str) or not name.strip()]:
        raise ValueError(f"{strange[0]!r} is not the name of a joint")
    if not len(skeleton.parents) == len(skeleton.proportions) == count:
        raise ValueError("each joint needs a parent and a length")
    if not {j for pair in skeleton.mirrored for j in pair} <= {*range(count)}:
        raise ValueError("a mirrored joint is not there")
    if len(set(names)) < count:
        raise ValueError(f"the joint {max(names, key=names.count)} is there twice")
    if not all(-1 <= parent < count for parent in skeleton.parents):
        raise ValueError("a joint hangs on one that is not there")
    roots = skeleton.parents.count(-1)
    if roots != 1 or len(skeleton.bones) != count - 1:
        raise ValueError(f"the joints must form one tree; found {roots} root(s)")
    for (_, child), length in zip(skeleton.bones, skeleton.lengths, strict=True):
        if not 0 < length <= MAX_LENGTH:
            raise ValueError(f"{names[child]} cannot be {length:g} statures from its parent")
    if not 0 < len({*skeleton.lower}) < count or not {*skeleton.lower} < {*range(count)}:
        raise ValueError("'lower' must name some of the joints, and not all")
    return skeleton
