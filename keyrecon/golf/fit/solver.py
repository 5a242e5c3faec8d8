"""The least-squares problem of a swing, linearised frame by frame (CVPR 2005, Section 4).

The chain rule (IC/2004/90, Eq. 3-4) turns the slope of a residual by a point of the body into
slopes by coefficients, phase and root pose G of one frame. Normal equations are summed segment by
segment, then frame by frame, and only then spread over the unknowns, so that cost grows linearly
with the number of frames and hardly with that of residuals.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float
from scipy.linalg import cho_factor, cho_solve

from keyrecon.golf.fit.parameterisation import SplineBasis, move_state
from keyrecon.golf.fit.regularisation import Rows
from keyrecon.golf.prior.kinematics import PoseRates, place_body, pose_rates
from keyrecon.golf.prior.motion_model import posture_at, turn_posture
from keyrecon.golf.records import Body, MotionModel, Residuals, RootPose, SwingState
from keyrecon.numerics.levenberg_marquardt import Damping, minimise

Residual = Callable[[RootPose], Residuals]
Regulariser = Callable[[SwingState], Rows]


@dataclass(frozen=True)
class ResidualBlock:
    """One type of observation and how it counts."""

    residuals: Residual
    weight: float
    robust: float
    """Size of a residual, in its unit, beyond which it counts less (Geman and McClure)."""


@dataclass(frozen=True, eq=False)
class Problem:
    """What is minimised: residuals of a body's pose and the regularisation of its state."""

    model: MotionModel
    body: Body
    basis: SplineBasis
    blocks: Sequence[ResidualBlock]
    regulariser: Regulariser


@dataclass(frozen=True, eq=False)
class LinearisedProblem:
    """A problem linearised at a state."""

    cost: float
    matrix: Float[np.ndarray, "S S"]
    """Gauss and Newton's J^T W J."""
    gradient: Float[np.ndarray, "S"]


DAMPING = Damping(start=1e-2, increase=8.0, decrease=4.0, largest=1e5)
"""Chosen on rendered swings; see benchmarks/golf.py."""
LEAST_FALL = 1e-3
"""Share of the cost by which the last step lowers it: costs of whole swings are 200 to 500, so that
it stops at a fall of less than a standard deviation. Valleys are long, though: 4e-3 and 1e-2 saved
5 % of the time, and moved joints within a fifth of the trunk of a real swing from .94 to .93 and
.92; 1e-2 for the coarse levels alone those of another from .92 to .91."""


def solve(problem: Problem, start: SwingState, steps: int = 15) -> SwingState:
    """The state of least cost near `start`; stops when the cost hardly falls."""

    def step(state: SwingState, here: LinearisedProblem, damping: float) -> SwingState:
        return move_state(state, problem.basis, _solve_damped(here, damping))

    def accepts(before: float, after: float) -> bool:
        return after <= before

    def converged(before: float, after: float) -> bool:
        return before - after < LEAST_FALL * after

    return minimise(start, partial(_linearise, problem), step, accepts, converged, DAMPING, steps)


def _solve_damped(here: LinearisedProblem, damping: float) -> Float[np.ndarray, "S"]:
    scale = np.diag(here.matrix)
    factor = cho_factor(here.matrix + np.diag(damping * scale + 1e-9 * scale.max()))
    return -cho_solve(factor, here.gradient)


def _linearise(problem: Problem, state: SwingState) -> LinearisedProblem:
    """Residuals are made anew at every state: which primitive a line of sight meets changes."""
    coefficients = state.coefficients[: problem.basis.n_coefficients]
    posture = posture_at(problem.model, state.phase, coefficients)
    if state.deviation is not None:
        posture = turn_posture(posture, state.deviation)
    pose = place_body(problem.body, posture, state)
    equations, cost = sum_blocks(problem.blocks, pose)
    rates = pose_rates(problem.body, posture, state, pose)
    expected = problem.regulariser(state)
    matrix, gradient = problem.basis.gather(*equations.by_unknowns(rates))
    matrix += expected.slopes.T @ expected.slopes
    gradient += expected.slopes.T @ expected.values
    return LinearisedProblem(cost + float(expected.values @ expected.values), matrix, gradient)


def sum_blocks(
    blocks: Sequence[ResidualBlock], pose: RootPose, share: float = 1.0
) -> tuple["SegmentEquations", float]:
    """Equations of all residuals of a pose, and their cost; each counts by a `share`."""
    equations, cost = SegmentEquations.none(pose), 0.0
    for block in blocks:
        rows = block.residuals(pose)
        robust = robust_weights(rows, block.robust)
        weight = share * block.weight
        cost += weight * robust.cost
        equations.add(rows, pose, weight * robust.weights)
    return equations, cost


TWIST = 6
"""Unknowns of a segment: the velocity of its origin, then its rotation velocity."""


@dataclass(frozen=True, eq=False)
class SegmentEquations:
    """Normal equations by how every segment moves, summed over all residuals that hang on it.

    A residual's slope by the unknowns is its slope by the twist of its segment times the twist's by
    the unknowns, so what a segment's residuals tell is 6 x 6 numbers, however many they are.
    """

    normal: Float[np.ndarray, "T P 6 6"]
    slope: Float[np.ndarray, "T P 6"]

    @classmethod
    def none(cls, pose: RootPose) -> "SegmentEquations":
        """Those of no residuals."""
        places = pose.origins.shape[:2]
        return cls(np.zeros((*places, TWIST, TWIST)), np.zeros((*places, TWIST)))

    def add(self, rows: Residuals, pose: RootPose, weight: Float[np.ndarray, "n"]) -> None:
        """Add residuals with their weights."""
        if not len(rows.values):
            return
        frames, segments = self.slope.shape[:2]
        place = rows.frame * segments + rows.segment
        arm = rows.point - pose.origins[rows.frame, rows.segment]
        slopes = np.concatenate([rows.gradient, np.cross(arm, rows.gradient)], axis=1).T

        def total(values: Float[np.ndarray, "n"]) -> Float[np.ndarray, "T P"]:
            return np.bincount(place, values, frames * segments).reshape(frames, segments)

        for i, weighted in enumerate(slopes * weight):
            self.slope[..., i] += total(weighted * rows.values)
            for j in range(i + 1):
                product = total(weighted * slopes[j])
                self.normal[..., i, j] += product
                if i != j:
                    self.normal[..., j, i] += product

    def by_unknowns(
        self, rates: PoseRates
    ) -> tuple[Float[np.ndarray, "T L L"], Float[np.ndarray, "T L"]]:
        """The same by coefficients, phase and G of every frame."""
        frames, segments = self.slope.shape[:2]
        twists = np.concatenate([rates.origins, rates.rotations], axis=2)
        flat = twists.reshape(frames, segments * TWIST, -1).swapaxes(1, 2)
        weighted = (self.normal @ twists).reshape(frames, segments * TWIST, -1)
        slope = flat @ self.slope.reshape(frames, -1, 1)
        return flat @ weighted, slope[..., 0]


@dataclass(frozen=True, eq=False)
class RobustWeights:
    """How much each row counts, and the robust cost of all."""

    weights: Float[np.ndarray, "n"]
    cost: float


def robust_weights(rows: Residuals, robust: float) -> RobustWeights:
    """Weight of every row by the size of its group's residual.

    Geman and McClure: cost e^2 / (1 + e^2 / c^2), weight 1 / (1 + e^2 / c^2)^2.
    """
    if not len(rows.values):
        return RobustWeights(rows.values, 0.0)
    square = np.bincount(rows.group, rows.values**2)
    far = 1 + square / robust**2
    return RobustWeights((1 / far**2)[rows.group], float((square / far).sum()))
