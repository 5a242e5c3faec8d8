"""The two halves of the body that are matched apart, with their own joints and bones."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.body import Skeleton
from keyrecon.records import HalfName


@dataclass(frozen=True, eq=False)
class BodyHalf:
    """The joints and bones of one half of the body, numbered on their own."""

    name: HalfName
    joints: Int[np.ndarray, "J"]
    """Joints of the skeleton."""
    bones: Int[np.ndarray, "B 2"]
    """(parent, child): positions in `joints`."""
    given: Bool[np.ndarray, "J"]
    """Joints that the other half has settled already."""
    mirror: Int[np.ndarray, "J"]
    """Position of each joint's mirror image."""
    bone_mirror: Int[np.ndarray, "B"]
    """Each bone's mirror image; a bone between mirrored joints is its own."""
    depth: Float[np.ndarray, "J"]
    """Bones between each joint and the root of the skeleton."""
    sides: tuple[tuple[int, ...], tuple[int, ...]]
    """Own joints of the one side of the body, and their mirror images in the same order."""

    @cached_property
    def limb(self) -> Int[np.ndarray, "B"]:
        """Which part each bone belongs to: 0 the trunk, 1 and 2 the sides."""
        child = self.bones[:, 1]
        hanging = self.bone_mirror != np.arange(len(self.bones))
        return hanging * (np.isin(child, self.sides[0]) + 2 * np.isin(child, self.sides[1]))

    @property
    def middle(self) -> tuple[int, ...]:
        """Own joints that belong to neither side."""
        return tuple(p for p in self.own.tolist() if p not in self.sides[0] + self.sides[1])

    @property
    def own(self) -> Int[np.ndarray, "O"]:
        """Positions of the joints that this half settles."""
        return np.flatnonzero(~self.given)


def split_body(skeleton: Skeleton) -> tuple[BodyHalf, BodyHalf]:
    """(lower, upper); the upper half is given the joints where the two meet.

    The joints of the lower half that hang from the upper one (the hips) are tied in pairs by a
    bar, which carries the outline of the pelvis.
    """
    parent, child = skeleton.bones.T
    crossing = child[skeleton.is_lower[child] & ~skeleton.is_lower[parent]]
    lower = np.flatnonzero(skeleton.is_lower)
    upper = np.concatenate([np.flatnonzero(~skeleton.is_lower), crossing])
    bars = [pair for pair in skeleton.mirrored if np.isin(pair, crossing).all()]
    return (
        _half(skeleton, "lower", lower, bars, np.zeros(0, int)),
        _half(skeleton, "upper", upper, [], crossing),
    )


def _half(
    skeleton: Skeleton,
    name: HalfName,
    joints: Int[np.ndarray, "J"],
    bars: list[tuple[int, int]],
    given: Int[np.ndarray, "G"],
) -> BodyHalf:
    place = {int(joint): at for at, joint in enumerate(joints)}
    inside = [b for b in skeleton.bones.tolist() if b[0] in place and b[1] in place]
    bones = np.array([[place[a], place[b]] for a, b in [*inside, *bars]], int).reshape(-1, 2)
    mirror = np.array([place[int(skeleton.mirror[j])] for j in joints])
    row = {(a, b): at for at, (a, b) in enumerate(bones.tolist())}
    twins = [row.get((mirror[a], mirror[b]), at) for (a, b), at in row.items()]
    depth = np.array([_depth(skeleton, int(joint)) for joint in joints], float)
    lefts = {left for left, _ in skeleton.mirrored}
    one = tuple(p for p, j in enumerate(joints) if j in lefts and j not in given)
    sides = one, tuple(int(mirror[p]) for p in one)
    return BodyHalf(
        name, joints, bones, np.isin(joints, given), mirror, np.array(twins), depth, sides
    )


def _depth(skeleton: Skeleton, joint: int) -> int:
    parent = skeleton.parents[joint]
    return 0 if parent < 0 else 1 + _depth(skeleton, parent)
