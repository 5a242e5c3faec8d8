"""Views of one camera, fitted together."""

import numpy as np
from painted_court import camera_at, paint
from scipy.optimize import least_squares

from keyrecon.world.court import tennis_court
from keyrecon.world.joint_fit import LOSS_SCALE, _choose, _Residuals
from keyrecon.world.line_fit import evaluate


def test_the_joint_fit_is_where_the_general_solver_ends():
    court = tennis_court()
    truth = [camera_at((-4, -24, 4), (-2 + k, -5, 0), 1.25 + 0.05 * k) for k in range(3)]
    rng = np.random.default_rng(4)
    begun = tuple(
        c.moved(np.concatenate([[0.1, 0.2, 0.03], rng.normal(0, 5e-4, 3), [0.004]])) for c in truth
    )
    fits = tuple(
        evaluate(paint(c, seed=k), b, court)
        for k, (c, b) in enumerate(zip(truth, begun, strict=True))
    )
    problem = _Residuals(begun, fits, tuple(_choose(fit) for fit in fits))
    slow = least_squares(
        problem.values, np.zeros(15), loss="cauchy", f_scale=LOSS_SCALE, x_scale="jac",
        xtol=1e-12, ftol=1e-12, gtol=1e-12,
    )  # fmt: skip
    found = problem.solve()
    assert problem.linearise(found).cost <= problem.linearise(slow.x).cost * (1 + 1e-6)
    np.testing.assert_allclose(found[:3], slow.x[:3], atol=1e-3)  # metres
    np.testing.assert_allclose(found[3:], slow.x[3:], atol=1e-5)  # radians, shares
