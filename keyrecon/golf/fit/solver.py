"""The least-squares problem of a swing, linearised frame by frame (CVPR 2005, Section 4).

The chain rule (IC/2004/90, Eq. 3-4) turns the slope of a residual by a point of the body into
slopes by coefficients, phase and root pose G of one frame; normal equations are summed frame by
frame and only then spread over the unknowns, so that cost grows linearly with the number of frames.
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
"""Share of the cost by which the last step lowers it. Chosen on rendered swings; see
benchmarks/golf.py."""


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
    rates = pose_rates(problem.body, posture, state, pose)
    frames, unknowns = len(state.phase), rates.origins.shape[-1]
    normal, slope = (
        np.zeros((frames, unknowns, unknowns)),
        np.zeros((frames, unknowns)),
    )
    cost = 0.0
    for block in problem.blocks:
        rows = block.residuals(pose)
        robust = robust_weights(rows, block.robust)
        cost += block.weight * robust.cost
        add_rows(normal, slope, rows, chain_rule(rows, pose, rates), block.weight * robust.weights)
    expected = problem.regulariser(state)
    matrix = expected.slopes.T @ expected.slopes
    gradient = expected.slopes.T @ expected.values
    for t in range(frames):
        spread = problem.basis.frame_unknowns(t)
        matrix += spread.T @ normal[t] @ spread
        gradient += spread.T @ slope[t]
    return LinearisedProblem(cost + float(expected.values @ expected.values), matrix, gradient)


def chain_rule(rows: Residuals, pose: RootPose, rates: PoseRates) -> Float[np.ndarray, "n L"]:
    """Slopes of residuals by coefficients, phase and G of their frame."""
    place = rows.frame, rows.segment
    arm = rows.point - pose.origins[place]
    moved, turned = rates.origins[place], rates.rotations[place]
    return np.einsum("ni,nil->nl", rows.gradient, moved) + np.einsum(
        "ni,nil->nl", np.cross(arm, rows.gradient), turned
    )


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


def add_rows(
    normal: Float[np.ndarray, "T L L"],
    slope: Float[np.ndarray, "T L"],
    rows: Residuals,
    slopes: Float[np.ndarray, "n L"],
    weight: Float[np.ndarray, "n"],
) -> None:
    """Add rows to the normal equations of their frames."""
    order = np.argsort(rows.frame, kind="stable")
    bounds = np.searchsorted(rows.frame[order], np.arange(len(normal) + 1))
    for t in range(len(normal)):
        of_frame = order[bounds[t] : bounds[t + 1]]
        if len(of_frame):
            weighted = slopes[of_frame] * weight[of_frame, None]
            normal[t] += weighted.T @ slopes[of_frame]
            slope[t] += weighted.T @ rows.values[of_frame]
