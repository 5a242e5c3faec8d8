"""Trajectory smoothing: edges, bone shape and smooth motion of all frames in one least squares.

Every frame is fitted to its edges, with the most similar template and with the average outline;
three frames in a row are tied by a small acceleration; the chosen hypotheses attract the joints
unless all of that speaks against them; annotated frames are fixed. Matches and robust weights are
renewed in each round.

Optical flow along the limbs was tried as a further tie between neighbours and made arms worse: it
measures the still background beside a thin fast arm. Contours and smoothness place them better.
"""

import numpy as np
from jaxtyping import Complex, Float

from keyrecon.numerics.banded_least_squares import (
    add_second_differences,
    band_from_blocks,
    solve_banded,
)
from keyrecon.propagation.correspondence import ElementIndex, TemplateFits
from keyrecon.propagation.edge_template import EdgeTemplates
from keyrecon.propagation.registration import (
    DAMPING,
    ChosenHypotheses,
    NormalEquations,
    RegistrationStep,
    edge_equations_of_all,
    hypothesis_equations,
    joints_from_unknowns,
    length_equations,
    shape_equations,
)
from keyrecon.records import Shots

SEARCH_RADII = (0.05, 0.04, 0.03)
"""Farthest match in the first, second and later rounds, player heights. Halved or doubled, others
with it: at most 0.4 points, 0.5 mm on one clip."""
SHAPE_PRIOR = RegistrationStep(radius=0.0, length_spread=0.03, transverse_spread=0.10)
"""How firmly bones keep the shape of the chosen hypothesis. Halved or doubled, others with it: at
most 0.3 points, 0.5 mm on one clip."""
ACCELERATION_SPREAD = 0.002
"""Standard deviation of a root joint's second difference over 1/50 s, player heights; it doubles
with every bone outwards. Strokes of the tennis motion capture lie at half of this for the trunk and
the same for the wrist. Halved or doubled, others with it: at most 0.1 points, 0.5 mm on one
clip."""


def smooth_trajectories(
    templates: EdgeTemplates,
    index: ElementIndex,
    chosen: ChosenHypotheses,
    shots: Shots,
    fps: float,
    rounds: int,
) -> Complex[np.ndarray, "T J"]:
    """Joints of all frames, smooth in each shot; those fixed by the other half stay in place."""
    half, frames = templates.half, np.arange(len(chosen.template))
    average = np.full(len(frames), templates.average)
    spread = ACCELERATION_SPREAD * 2.0**half.depth * (50 / fps) ** 2
    joints = chosen.joints
    for turn in range(rounds):
        radius = SEARCH_RADII[min(turn, len(SEARCH_RADII) - 1)]
        equations = shape_equations(templates, joints, chosen.joints, SHAPE_PRIOR)
        equations = equations + hypothesis_equations(templates, chosen, joints)
        equations = equations + length_equations(templates, joints)
        for rows in (chosen.template, average):
            fits = TemplateFits(frames, rows, joints)
            equations = equations + edge_equations_of_all(templates, index, fits, radius)
        joints = shots.in_each(
            lambda matrix, right: solve_smooth(NormalEquations(matrix, right), spread),
            equations.matrix,
            equations.right,
        )
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
