"""Bring an annotated figure onto the edges of another frame: articulated registration.

Elements of the posed figure look for their counterparts in the frame, and the frame's elements for
theirs in the figure; the joints then move so that elements come to lie on the contours they found
(distance along the contour's normal; sliding along it is nearly free) while bones keep their shape:
their length firmly, their direction softly. Both steps repeat, from far-reaching and stiff to near
and supple. A local translation of each joint, the paper's way, is what one step does when limbs
only shift; here limbs may turn. Looking both ways matters for arms: a bare forearm that the figure
does not cover calls for it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.propagation.correspondence import ElementIndex, match_back, match_elements
from keyrecon.propagation.edge_template import EdgeTemplates, bone_axes, pose_templates
from keyrecon.propagation.foot_evidence import foot_equations
from keyrecon.propagation.normal_equations import NormalEquations, add_observations

SLIDE = 0.15
"""Weight of sliding along a contour against leaving it."""
ELEMENT_SPREAD = 0.03
"""How far a contour tells where an element is, player heights. Neighbours on one contour err
together, which is why it is more than a contour's own noise of about .01."""


@dataclass(frozen=True)
class RegistrationStep:
    """One round of matching and moving."""

    reach: float
    """Farthest match, player heights."""
    length: float
    """Spread of a bone's length, player heights."""
    swing: float
    """Spread of a bone's end square to it, player heights."""
    every: int = 1
    """Only each n-th element is looked up: enough while the figure is far off."""


FAR_TO_NEAR = (
    RegistrationStep(0.12, 0.010, 0.015, every=2),
    RegistrationStep(0.12, 0.015, 0.04, every=2),
    RegistrationStep(0.10, 0.020, 0.08, every=2),
    RegistrationStep(0.05, 0.020, 0.08),
)
"""From the whole figure shifting to limbs turning by up to half a right angle."""


@dataclass(frozen=True, eq=False)
class FittedFigures:
    """P figures: which puppet takes which pose in which frame."""

    frames: Int[np.ndarray, "P"]
    which: Int[np.ndarray, "P"]
    joints: Complex[np.ndarray, "P J"]

    def take(self, part: slice) -> "FittedFigures":
        """Some of them."""
        return FittedFigures(self.frames[part], self.which[part], self.joints[part])

    def moved(self, joints: Complex[np.ndarray, "P J"]) -> "FittedFigures":
        """The same in other poses."""
        return FittedFigures(self.frames, self.which, joints)


def register_templates(
    puppets: EdgeTemplates,
    index: ElementIndex,
    start: FittedFigures,
    schedule: tuple[RegistrationStep, ...] = FAR_TO_NEAR,
    extra: NormalEquations | None = None,
) -> FittedFigures:
    """Fit figures to their frames; `extra` observations count in every step."""
    figures = start
    for step in schedule:
        seen = edge_equations(puppets, index, figures, step.reach, step.every)
        seen = seen + keep_shape(puppets, figures.joints, start.joints, step)
        figures = figures.moved((seen + extra if extra else seen).solve())
    return figures


def edge_equations(
    puppets: EdgeTemplates,
    index: ElementIndex,
    figures: FittedFigures,
    reach: float,
    every: int = 1,
) -> NormalEquations:
    """Observations of the joints by corresponding elements, both ways, and by tracked feet.

    Only each n-th element is used.
    """
    posed = pose_templates(puppets, figures.which, figures.joints, every)
    row, found = match_elements(index, figures.frames, posed, reach)
    there = _pull(index, row, posed.points, found * posed.weight, reach)
    there = add_observations(posed.share, index.points[row] - posed.free, *there)
    listed = puppets.listed[figures.frames, ::every]
    hit, found = match_back(index, listed, posed, reach)
    points, free, weight = (
        np.take_along_axis(values, hit, axis=1)
        for values in (posed.points, posed.free, posed.weight)
    )
    share = np.take_along_axis(posed.share, hit[..., None], axis=1)
    back = _pull(index, listed, points, found * weight, reach)
    seen = there + add_observations(share, index.points[listed] - free, *back)
    seen = NormalEquations(every * seen.matrix, every * seen.right)
    if puppets.feet is None:
        return seen
    return seen + foot_equations(puppets.feet, figures.frames, figures.joints)


def _pull(
    index: ElementIndex,
    row: Int[np.ndarray, "P R"],
    points: Complex[np.ndarray, "P R"],
    weight: Float[np.ndarray, "P R"],
    reach: float,
) -> tuple[Complex[np.ndarray, "P R"], Float[np.ndarray, "P R"], Float[np.ndarray, "P R"]]:
    """(normal, weight along it, weight along the contour); far matches count less."""
    normal = 1j * index.tangent[row]
    away = np.abs(((index.points[row] - points) * np.conj(normal)).real)
    across = weight / (1 + (2 * away / reach) ** 2) ** 2 / ELEMENT_SPREAD**2
    return normal, across, SLIDE * across


def keep_shape(
    puppets: EdgeTemplates,
    joints: Complex[np.ndarray, "P J"],
    model: Complex[np.ndarray, "P J"],
    step: RegistrationStep,
) -> NormalEquations:
    """Bones keep the length and, softly, the direction that they have in the model."""
    bones = puppets.half.bones
    mixture = np.zeros((len(joints), len(bones), joints.shape[1]))
    rows = np.arange(len(bones))
    mixture[:, rows, bones[:, 1]] = 1
    mixture[:, rows, bones[:, 0]] -= 1
    axis = bone_axes(puppets.half, joints)
    wanted = model[:, bones[:, 1]] - model[:, bones[:, 0]]
    # along the present direction the length is set right, across it the direction
    target = axis * (np.abs(wanted) + 1j * (wanted * np.conj(axis)).imag)
    ones = np.ones(axis.shape)
    return add_observations(mixture, target, axis, ones / step.length**2, ones / step.swing**2)
