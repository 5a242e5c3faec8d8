"""Bring an edge template onto another frame: articulated registration.

Elements of the posed template are matched with the frame's elements, and the frame's with the
template's; the joints then move so that elements come to lie on the matched contours (distance
along the contour's normal; sliding along it is nearly free) while bones keep their shape: their
length firmly, their direction softly. Both steps repeat, from far-reaching and stiff to near and
supple. A local translation of each joint, the paper's way, is what one step does when limbs only
shift; here limbs may turn. Matching both ways matters for arms: a bare forearm that the template
does not cover pulls it over.

Each step is linear least squares over the joints, many poses at once. Every observation is a row
that says where a weighted sum of joints should be, with a 2x2 weight: strong along a normal and
weak along the contour for an edge element, strong along the bone and weaker across it for a limb's
shape. Unknowns of one pose are x of all joints, then y.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.propagation.correspondence import (
    HYPOTHESIS_SPREAD,
    ElementIndex,
    MatchedElements,
    TemplateFits,
    match_both_ways,
)
from keyrecon.propagation.edge_template import (
    FOOT_MATCH_DISTANCE,
    EdgeTemplates,
    FootEvidence,
    order_feet,
)

TANGENTIAL_WEIGHT = 0.15
"""Weight of sliding along a contour against leaving it. Halved or doubled, others with it: at most
0.6 points, 0.6 mm on one clip."""
CONTOUR_SPREAD = 0.03
"""How far a contour tells where an element is, player heights. Neighbours on one contour err
together, which is why it is more than a contour's own noise of about .01. A quarter more or
less: at most 0.8 mm on three of four clips, 3.4 on one, which other clicks change as much."""
DAMPING = 1e-9
"""Keeps a joint that nothing observes from making the equations singular."""
FIXED_WEIGHT, MARKED_WEIGHT = 1e5, 1e6
"""Weights of joints that are known: by the other half of the body, and by a person. Halved or
doubled, others with it: at most 0.1 points, 0.2 mm on one clip."""

BOUND_SPREAD = 0.002
"""How firmly a bone that is too long comes to its bound, player heights: more than anything else
but marks. A quarter more or less, others with it: at most 1.5 points, 2.1 mm on nine clips."""


@dataclass(frozen=True)
class RegistrationStep:
    """One round of matching and moving."""

    radius: float
    """Farthest match, player heights."""
    length_spread: float
    """Standard deviation of a bone's length, player heights."""
    transverse_spread: float
    """Standard deviation of a bone's end square to it, player heights."""
    stride: int = 1
    """Only each n-th element is matched: enough while the template is far off."""


COARSE_TO_FINE = (
    RegistrationStep(0.12, 0.010, 0.015, stride=2),
    RegistrationStep(0.12, 0.015, 0.04, stride=2),
    RegistrationStep(0.10, 0.020, 0.08, stride=2),
    RegistrationStep(0.05, 0.020, 0.08),
)
"""From the whole template shifting to limbs turning by up to half a right angle. A quarter more or
less of the spreads of length: at most 0.7 mm on three of four clips, 3.0 on one, which other clicks
change as much."""


@dataclass(frozen=True, eq=False)
class ChosenHypotheses:
    """Where the joints of every frame are before smoothing."""

    joints: Complex[np.ndarray, "T J"]
    template: Int[np.ndarray, "T"]
    """Row of the template most similar to each frame."""


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Normal equations of P poses: `matrix` x = `right`."""

    matrix: Float[np.ndarray, "P N N"]
    right: Float[np.ndarray, "P N"]

    def __add__(self, other: "NormalEquations") -> "NormalEquations":
        """Both sets of observations."""
        return NormalEquations(self.matrix + other.matrix, self.right + other.right)

    def solve(self) -> Complex[np.ndarray, "P J"]:
        """Joints that fit best."""
        matrix = self.matrix + DAMPING * np.eye(self.right.shape[1])
        return joints_from_unknowns(np.linalg.solve(matrix, self.right[..., None])[..., 0])


def joints_from_unknowns(unknowns: Float[np.ndarray, "P N"]) -> Complex[np.ndarray, "P J"]:
    """x + iy of every joint."""
    half = unknowns.shape[1] // 2
    return unknowns[:, :half] + 1j * unknowns[:, half:]


def point_equations(
    joint_weights: Float[np.ndarray, "P R J"],
    target: Complex[np.ndarray, "P R"],
    axis: Complex[np.ndarray, "P R"],
    along: Float[np.ndarray, "P R"],
    across: Float[np.ndarray, "P R"],
) -> NormalEquations:
    """Rows joint_weights @ joints = target, weighted `along` the unit `axis` and `across` it."""
    cosine, sine = axis.real, axis.imag
    xx = along * cosine**2 + across * sine**2
    yy = along * sine**2 + across * cosine**2
    xy = (along - across) * cosine * sine
    weights, transposed = joint_weights, joint_weights.transpose(0, 2, 1)
    if weights.dtype != float:  # every product would convert them anew
        weights, transposed = weights.astype(float), transposed.astype(float, order="C")
    block_xx = transposed @ (xx[..., None] * weights)
    block_xy = transposed @ (xy[..., None] * weights)
    block_yy = transposed @ (yy[..., None] * weights)
    matrix = np.block([[block_xx, block_xy], [block_xy, block_yy]])
    right_x = (transposed @ (xx * target.real + xy * target.imag)[..., None])[..., 0]
    right_y = (transposed @ (xy * target.real + yy * target.imag)[..., None])[..., 0]
    return NormalEquations(matrix, np.concatenate([right_x, right_y], axis=1))


def joint_equations(
    target: Complex[np.ndarray, "P J"], weight: Float[np.ndarray, "P J"]
) -> NormalEquations:
    """Joints themselves, weighted alike in all directions."""
    count = target.shape[1]
    matrix = np.zeros((len(target), 2 * count, 2 * count))
    at = np.arange(count)
    matrix[:, at, at] = matrix[:, at + count, at + count] = weight
    return NormalEquations(
        matrix, np.concatenate([weight * target.real, weight * target.imag], axis=1)
    )


def register_templates(
    templates: EdgeTemplates,
    index: ElementIndex,
    start: TemplateFits,
    schedule: tuple[RegistrationStep, ...] = COARSE_TO_FINE,
    prior: NormalEquations | None = None,
) -> TemplateFits:
    """Fit templates to their frames; `prior` counts in every step."""
    fits = start
    for step in schedule:
        shape = shape_equations(templates, fits.joints, start.joints, step)
        equations = shape + edge_equations(templates, index, fits, step.radius, step.stride)
        fits = fits.moved((equations + prior if prior else equations).solve())
    return fits


def edge_equations(
    templates: EdgeTemplates,
    index: ElementIndex,
    fits: TemplateFits,
    radius: float,
    stride: int = 1,
) -> NormalEquations:
    """Observations of the joints by corresponding elements, both ways, and by tracked feet.

    Only each n-th element is used.
    """
    forward, backward = (
        _element_equations(index, matched, radius)
        for matched in match_both_ways(templates, index, fits, radius, stride)
    )
    both = forward + backward
    both = NormalEquations(stride * both.matrix, stride * both.right)
    if templates.feet is None:
        return both
    return both + foot_equations(templates.feet, fits.frames, fits.joints)


def _element_equations(
    index: ElementIndex, matched: MatchedElements, radius: float
) -> NormalEquations:
    """Elements lie on their counterparts' contours; far matches count less (Geman and McClure)."""
    normal = 1j * index.tangent[matched.row]
    distance = np.abs(((index.points[matched.row] - matched.points) * np.conj(normal)).real)
    weight = matched.weight / (1 + (2 * distance / radius) ** 2) ** 2 / CONTOUR_SPREAD**2
    return point_equations(
        matched.joint_weights,
        index.points[matched.row] - matched.offset,
        normal,
        weight,
        TANGENTIAL_WEIGHT * weight,
    )


def edge_equations_of_all(
    templates: EdgeTemplates, index: ElementIndex, fits: TemplateFits, radius: float
) -> NormalEquations:
    """Observations of many fits, a block at a time."""

    def observe(part: TemplateFits) -> tuple[np.ndarray, np.ndarray]:
        equations = edge_equations(templates, index, part, radius)
        return equations.matrix, equations.right

    return NormalEquations(*fits.in_blocks(observe))


def foot_equations(
    feet: FootEvidence, frames: Int[np.ndarray, "P"], joints: Complex[np.ndarray, "P J"]
) -> NormalEquations:
    """Observations of the ends of the legs, where the feet were seen.

    Weighed by the track's confidence, four rendered clips of 12 s came out .3 points of PCK worse
    to .3 better and .6 mm worse to .8 better: it tells no more.
    """
    target, weight = np.zeros(joints.shape, complex), np.zeros(joints.shape)
    target[:, feet.ends] = order_feet(feet.points[frames], joints[:, feet.ends])
    distance = np.abs(target[:, feet.ends] - joints[:, feet.ends])
    pull = 1 / (feet.spread * (1 + (distance / FOOT_MATCH_DISTANCE) ** 2)) ** 2
    weight[:, feet.ends] = feet.seen[frames, None] * pull
    return joint_equations(target, weight)


def shape_equations(
    templates: EdgeTemplates,
    joints: Complex[np.ndarray, "P J"],
    model: Complex[np.ndarray, "P J"],
    step: RegistrationStep,
) -> NormalEquations:
    """Bones keep the length and, softly, the direction that they have in the model."""
    bones = templates.half.bones
    weights, _, axis = _bone_rows(bones, joints)
    bone = model[:, bones[:, 1]] - model[:, bones[:, 0]]
    # along the present direction the length is set right, across it the direction
    target = axis * (np.abs(bone) + 1j * (bone * np.conj(axis)).imag)
    ones = np.ones(axis.shape)
    along, across = ones / step.length_spread**2, ones / step.transverse_spread**2
    return point_equations(weights, target, axis, along, across)


def length_equations(
    templates: EdgeTemplates, joints: Complex[np.ndarray, "T J"]
) -> NormalEquations:
    """Bones that are longer than they can be come to the length that they can have."""
    bones, longest = templates.half.bones, templates.poses.longest
    weights, present, axis = _bone_rows(bones, joints)
    over = np.abs(present) > longest
    weight = over / BOUND_SPREAD**2
    target = axis * np.where(over, longest, 0)
    return point_equations(weights, target, axis, weight, np.zeros(weight.shape))


def _bone_rows(
    bones: Int[np.ndarray, "B 2"], joints: Complex[np.ndarray, "P J"]
) -> tuple[Float[np.ndarray, "P B J"], Complex[np.ndarray, "P B"], Complex[np.ndarray, "P B"]]:
    """Weights of all joints that give the way from parent to child, that way, its direction."""
    weights = np.zeros((len(joints), len(bones), joints.shape[1]))
    rows = np.arange(len(bones))
    weights[:, rows, bones[:, 1]] = 1
    weights[:, rows, bones[:, 0]] -= 1
    present = joints[:, bones[:, 1]] - joints[:, bones[:, 0]]
    return weights, present, present / np.maximum(np.abs(present), 1e-6)


def hypothesis_equations(
    templates: EdgeTemplates, chosen: ChosenHypotheses, joints: Complex[np.ndarray, "T J"]
) -> NormalEquations:
    """Attract joints to the chosen hypotheses, and fix what is known."""
    poses = templates.poses
    distance = (np.abs(joints - chosen.joints) / HYPOTHESIS_SPREAD) ** 2
    weight = 1 / (HYPOTHESIS_SPREAD * (1 + distance)) ** 2
    weight[:, templates.half.fixed] = FIXED_WEIGHT
    target = chosen.joints.copy()
    target[poses.frames] = np.where(poses.known, poses.joints, target[poses.frames])
    weight[poses.frames] = np.where(poses.known, MARKED_WEIGHT, weight[poses.frames])
    return joint_equations(target, weight)
