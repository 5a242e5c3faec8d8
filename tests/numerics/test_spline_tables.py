"""Splines that are evaluated together, against scipy's one by one."""

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

from keyrecon.numerics.spline_tables import SplineTables


def splines_and_places(degree):
    """Three over one grid, and points of it: knots and corners too."""
    rng = np.random.default_rng(degree)
    x, y = np.sort(rng.uniform(0, 2, 40)), np.linspace(-3, 0, 9)
    splines = [
        RectBivariateSpline(x, y, rng.normal(size=(40, 9)), kx=degree, ky=degree) for _ in range(3)
    ]
    places = rng.uniform(x[0], x[-1], 500), rng.uniform(y[0], y[-1], 500)
    places[0][:42], places[1][:2] = [*x, x[0], x[-1]], [y[0], y[-1]]
    return splines, places


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_values_are_those_of_each_spline_to_the_bit(degree):
    splines, places = splines_and_places(degree)
    values = SplineTables(splines).values(*places)
    np.testing.assert_array_equal(values, [spline.ev(*places) for spline in splines])


@pytest.mark.parametrize("degree", [2, 3])
def test_slopes_are_those_of_each_spline_to_the_bit(degree):
    splines, places = splines_and_places(degree)
    tables = SplineTables(splines)
    values, along_x, along_y = tables.values_and_slopes(*places)
    np.testing.assert_array_equal(values, tables.values(*places))
    np.testing.assert_array_equal(along_x, [spline.ev(*places, dx=1) for spline in splines])
    np.testing.assert_array_equal(along_y, [spline.ev(*places, dy=1) for spline in splines])
