"""Trajectory smoothing: edges, bone shape and smooth motion of all frames in one least squares.

Every frame is fitted to its edges, with the most similar template and with the average outline;
three frames in a row are tied by a small acceleration; the chosen hypotheses attract the joints
unless all of that speaks against them; annotated frames are fixed. Matches and robust weights are
renewed in each round.

Optical flow along the limbs was tried as a further tie between neighbours and made arms worse: it
measures the still background beside a thin fast arm. Contours and smoothness place them better.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.numerics.banded_least_squares import (
    add_second_differences,
    band_from_blocks,
    solve_banded,
)
from keyrecon.numerics.blocks import in_blocks
from keyrecon.propagation.correspondence import ElementIndex
from keyrecon.propagation.edge_template import EdgeTemplates
from keyrecon.propagation.registration import (
    DAMPING,
    NormalEquations,
    RegistrationStep,
    TemplateFits,
    edge_equations,
    joint_equations,
    joints_from_unknowns,
    shape_equations,
)

SEARCH_RADII = (0.05, 0.04, 0.03)
"""Farthest match in the first, second and later rounds, player heights. Chosen on rendered
sequences; see benchmarks/sensitivity.py."""
SHAPE_PRIOR = RegistrationStep(radius=0.0, length_spread=0.03, transverse_spread=0.10)
"""How firmly bones keep the shape of the chosen hypothesis."""
HYPOTHESIS_SPREAD = 0.06
"""Distance at which a chosen hypothesis loses most of its pull, player heights. Chosen on rendered
sequences; see benchmarks/sensitivity.py."""
ACCELERATION_SPREAD = 0.002
"""Standard deviation of a root joint's second difference over 1/50 s, player heights; it doubles
with every bone outwards. Strokes of the tennis motion capture lie at half of this for the trunk
and the same for the wrist."""
FIXED_WEIGHT, MARKED_WEIGHT = 1e5, 1e6
"""Weights of joints that are known: by the other half of the body, and by a person."""


@dataclass(frozen=True, eq=False)
class ChosenHypotheses:
    """Where the joints of every frame are before smoothing."""

    joints: Complex[np.ndarray, "T J"]
    template: Int[np.ndarray, "T"]
    """Row of the template most similar to each frame."""


def smooth_trajectories(
    templates: EdgeTemplates,
    index: ElementIndex,
    chosen: ChosenHypotheses,
    fps: float,
    rounds: int,
) -> Complex[np.ndarray, "T J"]:
    """Joints of all frames; those fixed by the other half stay where they are."""
    half, frames = templates.half, np.arange(len(chosen.template))
    average = np.full(len(frames), templates.average)
    spread = ACCELERATION_SPREAD * 2.0**half.depth * (50 / fps) ** 2
    joints = chosen.joints
    for turn in range(rounds):
        radius = SEARCH_RADII[min(turn, len(SEARCH_RADII) - 1)]
        equations = shape_equations(templates, joints, chosen.joints, SHAPE_PRIOR)
        equations = equations + _hypothesis_equations(templates, chosen, joints)
        for rows in (chosen.template, average):
            fits = TemplateFits(frames, rows, joints)
            equations = equations + _edge_equations(templates, index, fits, radius)
        joints = solve_smooth(equations, spread)
    return joints


def solve_smooth(
    equations: NormalEquations, spread: Float[np.ndarray, "J"]
) -> Complex[np.ndarray, "T J"]:
    """Joints of all frames from observations of single frames and smoothness.

    `spread` is the standard deviation of each joint's second difference, player heights.
    """
    count, size = equations.right.shape
    diagonals = [equations.matrix.copy(), *np.zeros((2, *equations.matrix.shape))]
    add_second_differences(diagonals, np.diag(np.tile(1 / spread**2, 2)))
    band = band_from_blocks(diagonals, 3 * size)
    band[0] += DAMPING
    solution = solve_banded(band, equations.right.ravel())
    return joints_from_unknowns(solution.reshape(count, size))


def _edge_equations(
    templates: EdgeTemplates, index: ElementIndex, fits: TemplateFits, radius: float
) -> NormalEquations:
    """The edges of all frames."""

    def observe(part: slice) -> tuple[np.ndarray, np.ndarray]:
        equations = edge_equations(templates, index, fits.take(part), radius)
        return equations.matrix, equations.right

    return NormalEquations(*in_blocks(observe, len(fits.frames)))


def _hypothesis_equations(
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
