"""The banded solver against dense linear algebra and finite differences."""

import numpy as np

from keyrecon.body import LSP14
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.world import motion_solver as solver
from keyrecon.world import world_terms as terms

FRAMES, JOINTS = 5, len(LSP14.names)
SIZES = 1 + LSP14.length_group.max() + 1


def scene():
    rng = np.random.default_rng(3)
    directions = unit_vectors(rng.standard_normal((FRAMES, 13, 3)))
    axes = np.linalg.qr(rng.standard_normal((FRAMES, 3, 3)))[0]
    figure = solver.Figure(LSP14, LSP14.ancestry * LSP14.lengths * 1.8, axes)
    sizes = 0.05 * rng.standard_normal(SIZES)
    state = solver.WorldState(rng.standard_normal((FRAMES, 3)), directions, sizes)
    before = unit_vectors(directions + 0.1 * rng.standard_normal(directions.shape))
    prior = solver.DirectionPrior(before, rng.uniform(1, 5, (13, 3)), 1.3)
    masses = terms.joint_masses(LSP14.names)
    recipe = [
        terms.breadth(2, 3, 0.3, 0.02, JOINTS),
        terms.linear(
            {0: np.eye(JOINTS * 3).reshape(1, -1, JOINTS, 3)[:, :3].repeat(FRAMES, 0)},
            rng.standard_normal((FRAMES, 3)),
        ),
        terms.slip([0, 5], rng.uniform(1, 3, (FRAMES, 2, 3)), JOINTS),
        terms.foot_height([0, 5], 0.09, rng.uniform(1, 3, (FRAMES, 2)), JOINTS),
        terms.body_acceleration(
            masses, rng.standard_normal((FRAMES, 3)), rng.uniform(0, 1, (FRAMES, 3)), 3.0
        ),
    ]
    return state, figure, recipe, prior


def residuals(state, figure, recipe, prior, size_spread):
    points = state.points(figure)
    made = [t(points, state.log_size).residual.ravel() for t in recipe]
    off = state.directions - prior.before
    root = np.sqrt(prior.weight)
    made += [(root * off).ravel(), (prior.memory**2 * root * np.diff(off, 2, axis=0)).ravel()]
    return np.concatenate([*made, state.log_sizes / size_spread])


def test_a_step_is_that_of_dense_least_squares():
    state, figure, recipe, prior = scene()
    spread = np.linspace(0.1, 0.3, SIZES)
    count, eps = FRAMES * 29 + SIZES, 1e-6

    def moved(step):
        return solver._moved(state, step[:-SIZES].reshape(FRAMES, 29), step[-SIZES:])

    def at(step):
        return residuals(moved(step), figure, recipe, prior, spread)

    slope = np.stack(
        [(at(eps * unit) - at(-eps * unit)) / (2 * eps) for unit in np.eye(count)], axis=1
    )
    now = at(np.zeros(count))
    normal = slope.T @ slope + 1e-9 * np.eye(count)
    dense = -np.linalg.solve(normal, slope.T @ now)
    points = state.points(figure)
    rows = [t(points, state.log_size) for t in recipe]
    step, growth = solver._step(state, figure, rows, prior, spread, 0.0)
    np.testing.assert_allclose(step.ravel(), dense[:-SIZES], atol=2e-4)
    np.testing.assert_allclose(growth, dense[-SIZES:], atol=1e-4)


def test_the_mass_of_the_body_is_shared_out():
    masses = terms.joint_masses(LSP14.names)
    assert abs(masses.sum() - 1) < 1e-12
    assert masses[LSP14.index("right_knee")] == masses[LSP14.index("left_knee")]
    height = dict(zip(LSP14.names, masses, strict=True))
    assert height["neck"] > height["head_top"]
