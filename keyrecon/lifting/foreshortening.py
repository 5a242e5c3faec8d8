"""Foreshortening: the length in the picture of a bone of unknown direction, and its depth.

A bone of length l under scaled orthography has the length |dp| = s l r in the picture. With its
direction equally likely everywhere, its depth share c = |dz| / l is uniform on [0, 1] and
r = sqrt(1 - c^2) is crowded towards 1. Marking noise blurs r. This module tabulates, over the
foreshortening q = |dp| / (s l) and its relative noise nu, the density of log q and the expected
depth share E[c | q]; the latter replaces Taylor's sqrt(1 - q^2), whose slope is infinite at q = 1
and which has no value beyond (Taylor, CVIU 80, 2000).
"""

from collections.abc import Sequence
from functools import cache

import numpy as np
from jaxtyping import Float
from scipy.interpolate import NdBSpline, RectBivariateSpline

_OUTLIER_SHARE = 0.03
"""Density of gross errors over log q: one observed length in thirty says nothing. Chosen on
rendered sequences; see benchmarks/sensitivity.py."""
_MAX_FORESHORTENING, _MIN_NOISE, _MAX_NOISE = 2.0, 0.005, 0.8
"""Range of the tables. A quarter more or less of the first: no change on eight clips, halved: 42.8
mm; of the others, more with them: at most 2.8 mm."""


INCLINATIONS = (-1.0, 0.0, 1.0, 2.0, 4.0, 8.0, 16.0)
"""How a bone may prefer some directions: towards the image (negative) or the line of sight. A grid,
over which the video tells how likely each is for each length. A quarter more of all costs 4.9 mm on
one rendered clip of 6 s, on which a hundredth of other numbers costs 2.4; on another it gains
2.3."""


def _inclination_weight(
    share: Float[np.ndarray, "n"], inclination: float
) -> Float[np.ndarray, "n"]:
    """Density of the depth share: c^k for an inclination k > 0, (1 - c)^|k| for k < 0."""
    power = abs(inclination)
    return (power + 1) * (share if inclination > 0 else 1 - share) ** power


@cache
def _kernel() -> tuple[Float[np.ndarray, "..."], ...]:
    """Blurred densities of the foreshortening for single depth shares on the grid."""
    foreshortening = np.linspace(0.0, _MAX_FORESHORTENING, 301)
    noise = np.geomspace(_MIN_NOISE, _MAX_NOISE, 20)
    share = (np.arange(400) + 0.5) / 400
    gap = (foreshortening[:, None, None] - np.sqrt(1 - share**2)) / noise[:, None]
    exponent = -0.5 * gap**2
    peak = exponent.max(axis=-1)
    return foreshortening, noise, share, peak, np.exp(exponent - peak[..., None])


@cache
def _densities() -> NdBSpline:
    """One table for each of `INCLINATIONS`."""
    foreshortening, noise, share, peak, kernel = _kernel()
    tables = []
    for inclination in INCLINATIONS:
        weight = _inclination_weight(share, inclination)
        density = (kernel @ weight) / len(share) * np.exp(peak) / (noise * np.sqrt(2 * np.pi))
        tables.append(np.log(foreshortening[:, None] * density + _OUTLIER_SHARE))
    return _interpolated(tables, 2)


@cache
def _moments() -> NdBSpline:
    """Mean and standard deviation of the depth share."""
    _, _, share, _, kernel = _kernel()
    total = kernel.sum(axis=-1)
    mean = kernel @ share / total
    variance = np.maximum(kernel @ share**2 / total - mean**2, 0.0)
    return _interpolated([mean, np.sqrt(variance)], 1)


def _interpolated(tables: Sequence[Float[np.ndarray, "q s"]], degree: int) -> NdBSpline:
    """Splines through tables over foreshortening and the logarithm of noise, evaluated together."""
    foreshortening, noise = _kernel()[:2]
    grid = (foreshortening, np.log(noise))
    splines = [RectBivariateSpline(*grid, table, kx=degree, ky=degree) for table in tables]
    knots = splines[0].get_knots()
    shape = [len(along) - degree - 1 for along in knots]
    coefficients = [spline.get_coeffs().reshape(shape) for spline in splines]
    return NdBSpline(knots, np.stack(coefficients, axis=-1), degree)


def log_densities(
    foreshortening: Float[np.ndarray, "n"], noise: Float[np.ndarray, "n"]
) -> tuple[Float[np.ndarray, "k n"], Float[np.ndarray, "k n"]]:
    """Logarithms of the density of log q, and what they lose per unit of the log full length.

    One row for each of `INCLINATIONS`. A longer bone makes both the foreshortening and the relative
    noise smaller.
    """
    at, tables = _grid(foreshortening, noise), _densities()
    value, by_q, by_noise = (tables(at, nu=nu).T for nu in ((0, 0), (1, 0), (0, 1)))
    by_q = np.where(foreshortening < _MAX_FORESHORTENING, by_q, 0.0)
    tabulated = (noise > _MIN_NOISE) & (noise < _MAX_NOISE)
    return value, by_q * at[:, 0] + np.where(tabulated, by_noise, 0.0)


def depth_share(
    foreshortening: Float[np.ndarray, "*n"], noise: Float[np.ndarray, "*n"]
) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
    """Expected |dz| / l of a bone of which the picture shows the share `foreshortening`, and its
    standard deviation."""
    mean, deviation = np.moveaxis(_moments()(_grid(foreshortening, noise)), -1, 0)
    return mean, deviation


def _grid(
    foreshortening: Float[np.ndarray, "*n"], noise: Float[np.ndarray, "*n"]
) -> Float[np.ndarray, "*n 2"]:
    """Where in the tables to look."""
    q = np.clip(foreshortening, 0.0, _MAX_FORESHORTENING)
    return np.stack([q, np.log(np.clip(noise, _MIN_NOISE, _MAX_NOISE))], axis=-1)
