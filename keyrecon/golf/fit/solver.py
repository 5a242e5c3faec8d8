"""Levenberg-Marquardt on observations that hang on the body (CVPR 2005, Section 4).

Observations are made anew at every step, since which primitive a line of sight meets changes with
the pose. The chain rule of Eq. 3-4 turns the slope of an error by a point of the body into slopes
by alpha, mu and G of one frame; normal equations are summed frame by frame and only then spread
over the unknowns, so that cost grows linearly with the number of frames.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.linalg import cho_factor, cho_solve

from keyrecon.golf.fit.parameterisation import SplineBasis, move_state
from keyrecon.golf.fit.regularisation import Rows
from keyrecon.golf.prior.kinematics import place_body, pose_rates
from keyrecon.golf.prior.motion_model import posture_at
from keyrecon.golf.records import Body, MotionModel, Residuals, RootPose, SwingState

Residual = Callable[[RootPose], Residuals]
Regulariser = Callable[[SwingState], Rows]


@dataclass(frozen=True)
class ResidualBlock:
    """One kind of observation and how it counts."""

    observe: Residual
    weight: float
    robust: float
    """Size of an error, in its unit, beyond which it counts less (Geman and McClure)."""


@dataclass(frozen=True, eq=False)
class Problem:
    """What a state is judged by."""

    model: MotionModel
    body: Body
    span: SplineBasis
    kinds: Sequence[ResidualBlock]
    expect: Regulariser


def solve(problem: Problem, start: SwingState, steps: int = 15, enough: float = 1e-3) -> SwingState:
    """The state of least cost near `start`; stops when the cost falls by less than `enough`."""
    state, damping = start, 1e-2
    cost, normal, slope = _linearise(problem, state)
    for _ in range(steps):
        step = _solve_damped(normal, slope, damping)
        trial = move_state(state, problem.span, step)
        trial_cost, trial_normal, trial_slope = _linearise(problem, trial)
        if trial_cost > cost:
            damping *= 8
            if damping > MOST_DAMPING:
                break
            continue
        fall = cost - trial_cost
        state, cost, normal, slope = trial, trial_cost, trial_normal, trial_slope
        damping = max(damping / 4, 1e-6)
        if fall < enough * cost:
            break
    return state


MOST_DAMPING = 1e5


def _solve_damped(
    normal: Float[np.ndarray, "S S"], slope: Float[np.ndarray, "S"], damping: float
) -> Float[np.ndarray, "S"]:
    scale = np.diag(normal)
    factor = cho_factor(normal + np.diag(damping * scale + 1e-9 * scale.max()))
    return -cho_solve(factor, slope)


def _linearise(
    problem: Problem, state: SwingState
) -> tuple[float, Float[np.ndarray, "S S"], Float[np.ndarray, "S"]]:
    """Cost, Gauss-Newton matrix and slope by the unknowns."""
    posture = posture_at(problem.model, state.mu, state.alpha[: problem.span.alphas])
    pose = place_body(problem.body, posture, state)
    rates = pose_rates(problem.body, posture, state, pose)
    frames, unknowns = len(state.mu), rates[0].shape[-1]
    normal, slope = np.zeros((frames, unknowns, unknowns)), np.zeros((frames, unknowns))
    cost = 0.0
    for kind in problem.kinds:
        rows = kind.observe(pose)
        share, part = robust_weights(rows, kind.robust)
        cost += kind.weight * part
        _add_rows(normal, slope, rows, chain_rule(rows, pose, rates), kind.weight * share)
    expected = problem.expect(state)
    total = expected.slopes.T @ expected.slopes
    gradient = expected.slopes.T @ expected.values
    for t in range(frames):
        spread = problem.span.frame_unknowns(t)
        total += spread.T @ normal[t] @ spread
        gradient += spread.T @ slope[t]
    return cost + float(expected.values @ expected.values), total, gradient


def chain_rule(
    rows: Residuals, pose: RootPose, rates: tuple[np.ndarray, np.ndarray]
) -> Float[np.ndarray, "n L"]:
    """Slopes of errors by alpha, mu and G of their frame."""
    place = rows.frame, rows.segment
    arm = rows.point - pose.origins[place]
    moved, turned = rates[0][place], rates[1][place]
    return np.einsum("ni,nil->nl", rows.gradient, moved) + np.einsum(
        "ni,nil->nl", np.cross(arm, rows.gradient), turned
    )


def robust_weights(rows: Residuals, robust: float) -> tuple[Float[np.ndarray, "n"], float]:
    """Weight of every row by the size of its group's error, and the robust cost of all.

    Geman and McClure: cost e^2 / (1 + e^2 / c^2), weight 1 / (1 + e^2 / c^2)^2.
    """
    if not len(rows.values):
        return rows.values, 0.0
    square = np.bincount(rows.group, rows.values**2)
    far = 1 + square / robust**2
    return (1 / far**2)[rows.group], float((square / far).sum())


def _add_rows(
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
        own = order[bounds[t] : bounds[t + 1]]
        if len(own):
            weighted = slopes[own] * weight[own, None]
            normal[t] += weighted.T @ slopes[own]
            slope[t] += weighted.T @ rows.values[own]
