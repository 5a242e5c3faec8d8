"""The damped descent against scipy's on a curve, and what it promises about costs."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import least_squares

from keyrecon.numerics.levenberg_marquardt import Damping, minimise

TIME = np.linspace(0, 2, 40)
TRUTH = np.array([2.0, 1.3, 0.5])
DAMPING = Damping(start=1e-2, increase=8.0, decrease=4.0, largest=1e8)


def curve(p):
    return p[0] * np.exp(-p[1] * TIME) + p[2]


def slopes(p):
    decay = np.exp(-p[1] * TIME)
    return np.stack([decay, -p[0] * TIME * decay, np.ones_like(TIME)], axis=1)


@dataclass(frozen=True)
class Linearised:
    cost: float
    matrix: np.ndarray
    gradient: np.ndarray


def descend(data, start, steps=200, costs=None):
    def evaluate(p):
        residual, slope = curve(p) - data, slopes(p)
        return Linearised(float(residual @ residual), slope.T @ slope, slope.T @ residual)

    def step(p, here, amount):
        damped = here.matrix + amount * np.diag(np.diag(here.matrix))
        return p - np.linalg.solve(damped, here.gradient)

    def accepts(before, after):
        if costs is not None and after < before:
            costs.append(after)
        return after < before

    def converged(before, after):
        return before - after < 1e-15 * before

    return minimise(start, evaluate, step, accepts, converged, DAMPING, steps)


@pytest.mark.parametrize("start", [[1.0, 1.0, 0.0], [5.0, 0.2, -1.0], [0.5, 4.0, 2.0]])
def test_a_noisy_decay_is_fitted_as_scipy_fits_it(start):
    data = curve(TRUTH) + np.random.default_rng(3).normal(0, 0.05, len(TIME))
    twin = least_squares(
        lambda p: curve(p) - data, start, slopes, method="lm", xtol=1e-14, ftol=1e-14, gtol=1e-14
    )
    np.testing.assert_allclose(descend(data, np.array(start)), twin.x, rtol=1e-6)


def test_every_kept_step_lowers_the_cost():
    costs = []
    descend(curve(TRUTH), np.array([5.0, 0.2, -1.0]), costs=costs)
    assert len(costs) > 3 and (np.diff(costs) < 0).all()


def test_without_steps_the_state_stays():
    start = np.array([1.0, 1.0, 0.0])
    assert descend(curve(TRUTH), start, steps=0) is start


def test_a_descent_that_cannot_improve_ends_at_the_largest_damping():
    tries = []

    def step(p, here, amount):
        tries.append(amount)
        return p + 1.0

    found = minimise(
        0.0, lambda p: Linearised(p, np.eye(1), np.ones(1)), step, lambda b, a: a < b,
        lambda b, a: False, Damping(1.0, 10.0, 5.0, 1e3), 50,
    )  # fmt: skip
    assert found == 0.0
    np.testing.assert_allclose(tries, [1.0, 10.0, 100.0, 1000.0])
