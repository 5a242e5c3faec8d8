"""Least squares along a chain of frames.

The unknowns are the joints of all frames. Each frame has observations of its own, and the second
difference of every joint is small. The matrix has blocks on three diagonals, so the work grows with
the number of frames only.

Settle all frames at once: edges, bone shape and smooth motion in one least squares.

Every frame sees its edges, through the most similar annotated figure and through the average
outline; three frames in a row are tied by a small acceleration; the chosen proposals are followed
unless all of that speaks against them; annotated frames are held. Matches and robust weights are
renewed in each round.

Optical flow along the limbs was tried as a further tie between neighbours and made arms worse: it
sees the still background beside a thin fast arm. Contours and smoothness place them better.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int
from scipy.linalg import solveh_banded

from keyrecon.numerics.blocks import in_blocks
from keyrecon.propagation.correspondence import ElementIndex
from keyrecon.propagation.edge_template import EdgeTemplates
from keyrecon.propagation.normal_equations import (
    DAMPING,
    NormalEquations,
    add_joint_observations,
    joints_from_unknowns,
)
from keyrecon.propagation.registration import (
    FittedFigures,
    RegistrationStep,
    edge_equations,
    keep_shape,
)


@dataclass(frozen=True, eq=False)
class FrameCoupling:
    """Symmetric blocks (t, t), (t, t + 1), (t, t + 2) and right sides."""

    here: Float[np.ndarray, "T N N"]
    beside: Float[np.ndarray, "T N N"]
    beyond: Float[np.ndarray, "T N N"]
    right: Float[np.ndarray, "T N"]


def couple_frames(alone: NormalEquations, calm: Float[np.ndarray, "J"]) -> FrameCoupling:
    """Join observations of single frames and smoothness.

    `calm` is the spread of each joint's second difference, player heights.
    """
    here = alone.matrix.copy()
    beside, beyond = np.zeros_like(here), np.zeros_like(here)
    if len(here) > 2:
        weight = np.diag(np.tile(1 / calm**2, 2))
        here[:-2] += weight
        here[1:-1] += 4 * weight
        here[2:] += weight
        beside[:-2] -= 2 * weight
        beside[1:-1] -= 2 * weight
        beyond[:-2] += weight
    return FrameCoupling(here, beside, beyond, alone.right)


def solve_banded_chain(chain: FrameCoupling) -> Complex[np.ndarray, "T J"]:
    """Joints of all frames."""
    count, size = chain.right.shape
    band = np.zeros((3 * size, count * size))
    row, column = np.indices((size, size))
    first = np.arange(count)[:, None] * size
    for ahead, blocks in enumerate((chain.here, chain.beside, chain.beyond)):
        below = ahead * size + column - row
        stored = below >= 0
        place, depth = first + row[stored], np.broadcast_to(below[stored], (count, stored.sum()))
        inside = place + depth < count * size
        band[depth[inside], place[inside]] = blocks[:, stored][inside]
    band[0] += DAMPING
    found = solveh_banded(band, chain.right.ravel(), lower=True, check_finite=False)
    return joints_from_unknowns(found.reshape(count, size))


SEARCH_RADII = (0.05, 0.04, 0.03)
"""Farthest match in the first, second and later rounds, player heights."""
LOOSE = RegistrationStep(reach=0.0, length=0.03, swing=0.10)
"""How firmly bones keep the shape of the chosen proposal."""
DATA_WEIGHT = 0.06
"""Distance at which a chosen proposal loses most of its pull, player heights."""
SMOOTHNESS = 0.002
"""Spread of the second difference of a joint at the root, player heights at 50 frames/s; it
doubles with every bone outwards. Strokes of the tennis motion capture lie at half of this for
the trunk and the same for the wrist."""
HELD, MARKED = 1e5, 1e6
"""Weights of joints that are known: by the other half of the body, and by a person."""


@dataclass(frozen=True, eq=False)
class SmoothingInput:
    """Where the joints of every frame may be before they are settled."""

    joints: Complex[np.ndarray, "T J"]
    similar: Int[np.ndarray, "T"]
    """Most similar puppet of every frame."""


def smooth_trajectories(
    puppets: EdgeTemplates,
    index: ElementIndex,
    proposal: SmoothingInput,
    fps: float,
    rounds: int,
) -> Complex[np.ndarray, "T J"]:
    """Joints of all frames; those given by the other half stay where the proposal has them."""
    half, every = puppets.half, np.arange(len(proposal.similar))
    average = np.full(len(every), puppets.average)
    calm = SMOOTHNESS * 2.0**half.depth * (50 / fps) ** 2
    joints = proposal.joints
    for turn in range(rounds):
        reach = SEARCH_RADII[min(turn, len(SEARCH_RADII) - 1)]
        alone = keep_shape(puppets, joints, proposal.joints, LOOSE)
        alone = alone + _hold(puppets, proposal, joints)
        for which in (proposal.similar, average):
            figures = FittedFigures(every, which, joints)
            alone = alone + _collect_observations(puppets, index, figures, reach)
        joints = solve_banded_chain(couple_frames(alone, calm))
    return joints


def _collect_observations(
    puppets: EdgeTemplates, index: ElementIndex, figures: FittedFigures, reach: float
) -> NormalEquations:
    """The edges of all frames."""

    def see(part: slice) -> tuple[np.ndarray, np.ndarray]:
        seen = edge_equations(puppets, index, figures.take(part), reach)
        return seen.matrix, seen.right

    return NormalEquations(*in_blocks(see, len(figures.frames)))


def _hold(
    puppets: EdgeTemplates, proposal: SmoothingInput, joints: Complex[np.ndarray, "T J"]
) -> NormalEquations:
    """Follow the proposal, and hold what is known."""
    poses = puppets.poses
    away = (np.abs(joints - proposal.joints) / DATA_WEIGHT) ** 2
    weight = 1 / (DATA_WEIGHT * (1 + away)) ** 2
    weight[:, puppets.half.given] = HELD
    target = proposal.joints.copy()
    target[poses.frames] = np.where(poses.known, poses.joints, target[poses.frames])
    weight[poses.frames] = np.where(poses.known, MARKED, weight[poses.frames])
    return add_joint_observations(target, weight)
