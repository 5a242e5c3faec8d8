"""Knees that bend forwards: poses that no body takes, and where telling depths would mend them.

Expected errors (`uncertainty.py`) are of the picture. A limb may lie on the body there and yet be
turned round in depth, which mostly nothing shows. Where it bends a knee the wrong way, it does.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float, Int

from keyrecon.body import Skeleton
from keyrecon.lifting.priors.anatomy import anatomy_of, trunk_axes
from keyrecon.numerics.bone_directions import bone_vectors
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.numerics.runs import list_runs
from keyrecon.records import HalfName, Motion
from keyrecon.uncertainty import LEAST_SECONDS, MERGED_SECONDS

MAX_HYPEREXTENSION = 20.0
"""Degrees that a knee may be bent forwards. In 38 captures of tennis, a dance, kicks and jumps, as
joints that a person would mark, none is by more than 16; healthy knees are by about 10."""
SIDES = ("right", "left")


@dataclass(frozen=True)
class HyperextendedStretch:
    """Frames in which a knee bends forwards in space."""

    first: int
    last: int
    side: str
    """'right' or 'left'."""
    angle: float
    """The largest of the stretch, degrees."""
    frame: int
    """Where it is; depth signs told there would help most."""
    half: ClassVar[HalfName] = "lower"
    """Half of the body to mark there."""

    @property
    def text(self) -> str:
        """One line for a person."""
        one = self.first == self.last
        where = f"Frame {self.first}" if one else f"Frames {self.first}-{self.last}"
        return (
            f"{where}: the {self.side} knee bends forwards in space, by up to {self.angle:.0f} "
            f"degrees; marking the legs of frame {self.frame}, and which ends of their bones are "
            "nearer, would help most."
        )


def knee_hyperextension(
    points3d: Float[np.ndarray, "T J 3"], skeleton: Skeleton
) -> Float[np.ndarray, "T 2"]:
    """How far the right and the left knee are bent forwards about the line of the hips, degrees.

    Negative where they bend as knees do; NaN where nobody is seen or the skeleton has no such legs.
    """
    angles = np.full((len(points3d), len(SIDES)), np.nan)
    anatomy = anatomy_of(skeleton)
    if not anatomy.trunk:
        return angles
    vectors = bone_vectors(points3d, skeleton)
    hips, _, _ = trunk_axes(vectors[:, list(anatomy.trunk)])
    for leg in (limb for limb in anatomy.limbs if limb.kind == "leg"):
        thigh, shank = (unit_vectors(vectors[:, bone], 1e-9) for bone in leg.bones)
        bend = (np.cross(thigh, shank) * hips).sum(axis=-1)
        angles[:, 0 if leg.side > 0 else 1] = np.degrees(np.arcsin(np.clip(bend, -1, 1)))
    return angles


def hyperextended_stretches(
    motion: Motion, marked: Int[np.ndarray, "n"] | None = None, count: int = 3
) -> list[HyperextendedStretch]:
    """The stretches in which knees bend forwards most, in the order of time.

    Those in which a frame of `marked` lies that the motion was made without are left out: they were
    helped already.
    """
    done = np.setdiff1d(np.array([] if marked is None else marked, int), motion.keyframes)
    angles = np.nan_to_num(knee_hyperextension(motion.points3d, motion.skeleton), nan=-np.inf)
    gap, least = round(MERGED_SECONDS * motion.fps), LEAST_SECONDS * motion.fps
    stretches = []
    for shot in motion.stretches:
        for side, angle in zip(SIDES, angles[shot].T, strict=True):
            for first, last in list_runs(angle > MAX_HYPEREXTENSION, gap):
                worst = first + int(angle[first : last + 1].argmax())
                first, last, frame = first + shot.start, last + shot.start, worst + shot.start
                helped = ((done >= first) & (done <= last)).any()
                if last - first + 1 >= least and not helped:
                    largest = float(angle[worst])
                    stretches.append(HyperextendedStretch(first, last, side, largest, frame))
    most = sorted(stretches, key=lambda one: one.angle * (one.first - one.last - 1))[:count]
    return sorted(most, key=lambda one: one.first)
