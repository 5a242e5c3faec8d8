"""The skeleton as a chain of unit directions and constant lengths.

A pose is its root, one unit vector per bone and one length per bone. Written this way bone
lengths cannot drift, and under orthography each bone has just two unknowns.
"""

import numpy as np
from jaxtyping import Float

from keyrecon.body import Skeleton


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
