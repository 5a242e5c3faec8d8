"""Values and slopes of tensor-product B-splines over one grid, all at the same points.

The formula is de Boor's, the sums are those of FITPACK (Dierckx, Curve and Surface Fitting with
Splines, 1993) in its order, so the bits are those of `RectBivariateSpline.ev`. FITPACK finds the
interval of each point by going through the knots one by one, anew for every spline and slope; here
it is found once, by bisection: a likelihood of seven tables takes a fifth of the time.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from scipy.interpolate import RectBivariateSpline


@dataclass(frozen=True, eq=False)
class _Places:
    """Where points lie along one axis."""

    first: Int[np.ndarray, "n"]
    """Of the coefficients that count there."""
    bases: list[Float[np.ndarray, "_ n"]]
    """B-splines of degree 0, 1, ... that are not 0 there."""


@dataclass(frozen=True, eq=False)
class _Surfaces:
    """Splines of one degree along each axis, over the same knots."""

    degrees: tuple[int, int]
    coefficients: Float[np.ndarray, "x y k"]

    def at(self, x: _Places, y: _Places) -> Float[np.ndarray, "k n"]:
        """Their values."""
        total = np.zeros((len(x.first), self.coefficients.shape[2]))
        for i, along_x in enumerate(x.bases[self.degrees[0]]):
            for j, along_y in enumerate(y.bases[self.degrees[1]]):
                part = self.coefficients[x.first + i, y.first + j]
                total += part * along_x[:, None] * along_y[:, None]
        return np.ascontiguousarray(total.T)


class SplineTables:
    """Some splines over one grid, to be evaluated together."""

    def __init__(self, splines: Sequence[RectBivariateSpline]) -> None:
        """All of the same degrees."""
        self._knots = splines[0].get_knots()
        self._degrees = splines[0].degrees
        self._surfaces = _gather(splines)
        self._splines = splines

    def values(
        self, x: Float[np.ndarray, "n"], y: Float[np.ndarray, "n"]
    ) -> Float[np.ndarray, "k n"]:
        """Of every spline, at points within the grid."""
        return self._surfaces.at(*self._locate(x, y))

    def values_and_slopes(
        self, x: Float[np.ndarray, "n"], y: Float[np.ndarray, "n"]
    ) -> tuple[Float[np.ndarray, "k n"], Float[np.ndarray, "k n"], Float[np.ndarray, "k n"]]:
        """The values, and the slopes along x and along y; of degree 2 and more."""
        where = self._locate(x, y)
        along_x, along_y = (slopes.at(*where) for slopes in self._slopes)
        return self._surfaces.at(*where), along_x, along_y

    @cached_property
    def _slopes(self) -> list[_Surfaces]:
        orders = (1, 0), (0, 1)
        return [_gather([s.partial_derivative(*order) for s in self._splines]) for order in orders]

    def _locate(self, x: Float[np.ndarray, "n"], y: Float[np.ndarray, "n"]) -> list[_Places]:
        found = []
        for knots, degree, places in zip(self._knots, self._degrees, (x, y), strict=True):
            last = len(knots) - degree - 2
            interval = np.clip(np.searchsorted(knots, places, side="right") - 1, degree, last)
            bases = _bases(knots, interval, places, degree)
            found.append(_Places(interval - degree, bases))
        return found


def _gather(splines: Sequence[Any]) -> _Surfaces:
    """Coefficients of several splines, one table behind the other."""
    shape = [
        len(knots) - degree - 1
        for knots, degree in zip(splines[0].get_knots(), splines[0].degrees, strict=True)
    ]
    tables = [spline.get_coeffs().reshape(shape) for spline in splines]
    return _Surfaces(tuple(splines[0].degrees), np.stack(tables, axis=-1))


def _bases(
    knots: Float[np.ndarray, "q"],
    interval: Int[np.ndarray, "n"],
    places: Float[np.ndarray, "n"],
    degree: int,
) -> list[Float[np.ndarray, "_ n"]]:
    """The B-splines of degree 0, 1, ... that are not 0 at each place (Cox and de Boor)."""
    bases = [np.ones((1, len(places)))]
    for order in range(1, degree + 1):
        raised = np.zeros((order + 1, len(places)))
        for i, lower in enumerate(bases[-1]):
            high, low = knots[interval + i + 1], knots[interval + i + 1 - order]
            share = lower / (high - low)
            raised[i] += share * (high - places)
            raised[i + 1] = share * (places - low)
        bases.append(raised)
    return bases
