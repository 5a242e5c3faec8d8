"""The skeleton as a chain of unit directions and constant lengths.

A pose is its root, one unit vector per bone and one length per bone. Written this way bone
lengths cannot drift, and under orthography each bone has just two unknowns.
"""

import numpy as np
from jaxtyping import Float

from keyrecon.body import HIP_BREADTH, SHOULDER_BREADTH, Skeleton

_BREADTHS = (
    ("left_hip", "right_hip", HIP_BREADTH),
    ("left_shoulder", "right_shoulder", SHOULDER_BREADTH),
)


def ancestry(skeleton: Skeleton) -> Float[np.ndarray, "J B"]:
    """1 where a bone lies on the way from the root to a joint, else 0."""
    ways = np.zeros((len(skeleton.names), len(skeleton.bones)))
    for bone, (parent, child) in enumerate(skeleton.bones):
        ways[child] = ways[parent]
        ways[child, bone] = 1.0
    return ways


def pose_from_directions(
    directions: Float[np.ndarray, "T B 3"],
    lengths: Float[np.ndarray, "B"],
    skeleton: Skeleton,
) -> Float[np.ndarray, "T J 3"]:
    """Joints relative to the root, in the unit of `lengths`."""
    points = np.zeros((len(directions), len(skeleton.names), 3))
    for bone, (parent, child) in enumerate(skeleton.bones):
        points[:, child] = points[:, parent] + lengths[bone] * directions[:, bone]
    return points


def bone_vectors(
    points: Float[np.ndarray, "T J D"], skeleton: Skeleton
) -> Float[np.ndarray, "T B D"]:
    """From the parent to the child end of every bone."""
    return points[:, skeleton.bones[:, 1]] - points[:, skeleton.bones[:, 0]]


def breadths(skeleton: Skeleton) -> tuple[tuple[int, int, float], ...]:
    """Pairs of joints that the trunk holds at a constant distance: (left, right, statures).

    Hips and shoulders, where the skeleton has them; they are no bones of the tree.
    """
    return tuple(
        (skeleton.index(left), skeleton.index(right), breadth)
        for left, right, breadth in _BREADTHS
        if left in skeleton.names and right in skeleton.names
    )
