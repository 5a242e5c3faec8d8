"""Skeletons as data: joints, bones, mirrored pairs and bone lengths in statures.

The default is the 14-joint skeleton of the Leeds Sports Pose data set (Johnson and Everingham,
BMVC 2010) with COCO's joint names. Its tree is rooted at the neck, so that every bone joins two
joints that a person can mark: neck to head top, to both shoulders and to both hips, and
outwards along the limbs. A skeleton is a record of names and indices; nothing else in the
package knows which joints exist, and a user can bring another one from a JSON file.

Bone lengths are fractions of stature after Drillis and Contini (1966) as tabulated by Winter,
"Biomechanics and Motor Control of Human Movement" (upper arm .186, forearm .146, thigh .245,
shank .246, shoulder half breadth .129, hip half breadth .0955, hip line .530, shoulder line
.818), with the neck placed .012 above the shoulder line.
"""

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.errors import KeyreconError, explain


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
    ("right_ankle", "right_knee", 0.246),
    ("right_knee", "right_hip", 0.245),
    ("right_hip", "neck", 0.315),
    ("left_hip", "neck", 0.315),
    ("left_knee", "left_hip", 0.245),
    ("left_ankle", "left_knee", 0.246),
    ("right_wrist", "right_elbow", 0.146),
    ("right_elbow", "right_shoulder", 0.186),
    ("right_shoulder", "neck", 0.130),
    ("left_shoulder", "neck", 0.130),
    ("left_elbow", "left_shoulder", 0.186),
    ("left_wrist", "left_elbow", 0.146),
    ("neck", None, 0.0),
    ("head_top", "neck", 0.170),
)


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

HIP_BREADTH = 0.145
"""Distance between marked hips as a fraction of stature: midway between the joints' centres (.10,
Bell, Pedersen and Brand, J. Biomechanics 23, 1990) and the breadth over the hips (.191, Winter),
since people mark somewhere between."""
SHOULDER_BREADTH = 0.258
"""Distance between the shoulder joints as a fraction of stature (Winter)."""


def read_skeleton(path: Path) -> Skeleton:
    """Read a skeleton from JSON: {"joints": [{"name", "parent", "length"}...], "lower": [names]}.

    `parent` is null at the root, `length` is in statures, mirrored pairs are the names that
    differ only in left_ and right_. Raises KeyreconError when the tree is not one.
    """
    try:
        data = json.loads(path.read_text())
        rows = [(j["name"], j["parent"], float(j["length"] or 0)) for j in data["joints"]]
        skeleton = _skeleton_from_rows(rows, data["lower"])
    except (OSError, ValueError, KeyError, TypeError) as fault:
        raise KeyreconError(
            f"{path} is not a skeleton file ({explain(fault)}); it needs 'joints' with name, "
            "parent and length, and 'lower' with joint names."
        ) from fault
    roots = skeleton.parents.count(-1)
    if roots != 1 or len(skeleton.bones) != len(skeleton.names) - 1:
        raise KeyreconError(f"{path}: the joints must form one tree; found {roots} root(s).")
    return skeleton
