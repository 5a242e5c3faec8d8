"""Puppets: the edge elements of annotated frames, each riding on a bone.

An element belongs to the bone it outlines: the near bone that lies on its left, where the
element's region is (a skin contour across the chest belongs to the arm in front of it, not to the
torso), and that runs along it. Seen from the bone from a to b it sits at a share of the length and
at an offset that stays as wide when the bone is foreshortened,

    e = a + along (b - a) + offset (b - a) / |b - a|,        all complex,

so its place is linear in the joints once the bone's direction is known. That turns "bring the
annotated figure onto this frame's edges" into small linear least squares.
"""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from keyrecon.matching.correspondence import list_elements, spread_choice
from keyrecon.matching.feet import Feet
from keyrecon.matching.halves import Half
from keyrecon.matching.outline import Riders, average_outline, complete_outline, seat_elements
from keyrecon.matching.window import Window
from keyrecon.records import Edges


@dataclass(frozen=True, eq=False)
class Poses:
    """Annotated joints of one half of the body, in player coordinates, complete."""

    half: Half
    frames: Int[np.ndarray, "K"]
    joints: Complex[np.ndarray, "K J"]
    known: Bool[np.ndarray, "K J"]
    """False where a joint was not marked and stands where it usually does."""


@dataclass(frozen=True, eq=False)
class Puppets:
    """Annotated figures of one half of the body and, as the last row, their average outline."""

    poses: Poses
    riders: Riders
    """Arrays of K + 1 rows and E elements."""
    share: Float[np.ndarray, "N E J"]
    """Share of every joint in the place of every element; N = K + 1."""
    listed: Int[np.ndarray, "T F"]
    """The half's own elements in every frame (rows of the index), -1 for none."""
    feet: Feet | None = None
    """For the lower body."""

    @property
    def half(self) -> Half:
        """The half of the body."""
        return self.poses.half

    @property
    def average(self) -> int:
        """Row of the average outline."""
        return len(self.riders.bone) - 1


def make_puppets(edges: tuple[Edges, ...], window: Window, poses: Poses, most: int) -> Puppets:
    """Seat the elements of annotated frames on their bones, at most `most` each."""
    half, seated = poses.half, []
    for frame, pose, known in zip(poses.frames, poses.joints, poses.known, strict=True):
        marked = np.where(known, pose, np.nan)
        riders = seat_elements(edges[frame], window, int(frame), marked, half)
        seated.append(riders.take(spread_choice(len(riders.bone), most)))
    average = average_outline(seated, half)
    seated = [complete_outline(riders, average, len(half.bones)) for riders in seated]
    return _pad([*seated, average], poses, list_elements(edges, half.name, most))


def _pad(figures: list[Riders], poses: Poses, listed: Int[np.ndarray, "T F"]) -> Puppets:
    """One array per property, filled up with elements that weigh and match nothing."""
    half, room = poses.half, max(1, *(len(riders.bone) for riders in figures))
    columns = {}
    for column in fields(Riders):
        first = getattr(figures[0], column.name)
        columns[column.name] = np.full((len(figures), room), column.name == "color", first.dtype)
        columns[column.name] *= -1
        for row, riders in enumerate(figures):
            columns[column.name][row, : len(riders.bone)] = getattr(riders, column.name)
    riders = Riders(**columns)
    share = np.zeros((*riders.bone.shape, len(half.joints)), np.float32)
    rows, places = np.indices(riders.bone.shape)
    share[rows, places, half.bones[riders.bone, 0]] = 1 - riders.along
    share[rows, places, half.bones[riders.bone, 1]] += riders.along
    return Puppets(poses, riders, share, listed)


@dataclass(frozen=True, eq=False)
class Posed:
    """Puppets in poses: element e of figure p lies at share[p, e] @ joints[p] + free[p, e]."""

    share: Float[np.ndarray, "P E J"]
    free: Complex[np.ndarray, "P E"]
    points: Complex[np.ndarray, "P E"]
    tangent: Complex[np.ndarray, "P E"]
    color: Int[np.ndarray, "P E"]
    weight: Float[np.ndarray, "P E"]


def pose_puppets(
    puppets: Puppets,
    which: Int[np.ndarray, "P"],
    joints: Complex[np.ndarray, "P J"],
    every: int = 1,
) -> Posed:
    """Each n-th element of puppets `which` with their joints at `joints`."""
    riders = puppets.riders.take(np.s_[which, ::every])
    share = puppets.share[which, ::every]
    axis = np.take_along_axis(bone_axes(puppets.half, joints), riders.bone, axis=1)
    free = riders.offset * axis
    points = (share @ joints[..., None])[..., 0] + free
    return Posed(share, free, points, riders.turn * axis, riders.color, riders.weight)


def bone_axes(half: Half, joints: Complex[np.ndarray, "P J"]) -> Complex[np.ndarray, "P B"]:
    """Unit vectors from parent to child."""
    bone = joints[:, half.bones[:, 1]] - joints[:, half.bones[:, 0]]
    return bone / np.maximum(np.abs(bone), 1e-6)
