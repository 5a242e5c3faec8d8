"""The two halves of the body that are matched apart, with their own joints and bones."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.body import Skeleton
from keyrecon.records import HalfName


@dataclass(frozen=True, eq=False)
class BodyHalf:
    """The joints and bones of one half of the body, numbered apart from the skeleton's."""

    name: HalfName
    joints: Int[np.ndarray, "J"]
    """Joints of the skeleton."""
    bones: Int[np.ndarray, "B 2"]
    """(parent, child): positions in `joints`."""
    fixed: Bool[np.ndarray, "J"]
    """Joints that the other half has estimated already."""
    mirror: Int[np.ndarray, "J"]
    """Position of each joint's mirror image."""
    bone_mirror: Int[np.ndarray, "B"]
    """Each bone's mirror image; a bone between mirrored joints is its own."""
    depth: Float[np.ndarray, "J"]
    """Bones between each joint and the root of the skeleton."""
    sides: tuple[tuple[int, ...], tuple[int, ...]]
    """Free joints of the one side of the body, and their mirror images in the same order."""

    @cached_property
    def limb(self) -> Int[np.ndarray, "B"]:
        """Which part each bone belongs to: 0 the trunk, 1 and 2 the sides."""
        child = self.bones[:, 1]
        paired = self.bone_mirror != np.arange(len(self.bones))
        return paired * (np.isin(child, self.sides[0]) + 2 * np.isin(child, self.sides[1]))

    def limb_bones(self, side: tuple[int, ...]) -> tuple[int, int] | None:
        """Rows of the first two bones of a limb; None where it has no two end to end."""
        bones = [tuple(bone) for bone in self.bones.tolist()]
        pairs = [*pairwise(side[:3])]
        if len(pairs) < 2 or not all(pair in bones for pair in pairs):
            return None
        return bones.index(pairs[0]), bones.index(pairs[1])

    @property
    def middle(self) -> tuple[int, ...]:
        """Free joints that belong to neither side."""
        return tuple(p for p in self.free.tolist() if p not in self.sides[0] + self.sides[1])

    @property
    def free(self) -> Int[np.ndarray, "O"]:
        """Positions of the joints that this half estimates."""
        return np.flatnonzero(~self.fixed)


def split_body(skeleton: Skeleton) -> tuple[BodyHalf, BodyHalf]:
    """(lower, upper); the upper half takes the joints where the two meet as fixed.

    The joints of the lower half that hang from the upper one (the hips) are joined in pairs by a
    bone across, to which the outline of the pelvis belongs.
    """
    parent, child = skeleton.bones.T
    crossing = child[skeleton.is_lower[child] & ~skeleton.is_lower[parent]]
    lower = np.flatnonzero(skeleton.is_lower)
    upper = np.concatenate([np.flatnonzero(~skeleton.is_lower), crossing])
    across = [pair for pair in skeleton.mirrored if np.isin(pair, crossing).all()]
    return (
        _half(skeleton, "lower", lower, across, np.zeros(0, int)),
        _half(skeleton, "upper", upper, [], crossing),
    )


def _half(
    skeleton: Skeleton,
    name: HalfName,
    joints: Int[np.ndarray, "J"],
    across: list[tuple[int, int]],
    fixed: Int[np.ndarray, "G"],
) -> BodyHalf:
    place = {int(joint): at for at, joint in enumerate(joints)}
    inside = [b for b in skeleton.bones.tolist() if b[0] in place and b[1] in place]
    bones = np.array([[place[a], place[b]] for a, b in [*inside, *across]], int).reshape(-1, 2)
    mirror = np.array([place[int(skeleton.mirror[j])] for j in joints])
    row = {(a, b): at for at, (a, b) in enumerate(bones.tolist())}
    bone_mirror = [row.get((mirror[a], mirror[b]), at) for (a, b), at in row.items()]
    depth = np.array([_depth(skeleton, int(joint)) for joint in joints], float)
    lefts = {left for left, _ in skeleton.mirrored}
    one = tuple(p for p, j in enumerate(joints) if j in lefts and j not in fixed)
    sides = one, tuple(int(mirror[p]) for p in one)
    return BodyHalf(
        name, joints, bones, np.isin(joints, fixed), mirror, np.array(bone_mirror), depth, sides
    )


def _depth(skeleton: Skeleton, joint: int) -> int:
    parent = skeleton.parents[joint]
    return 0 if parent < 0 else 1 + _depth(skeleton, parent)
