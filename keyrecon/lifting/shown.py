"""How long a bone looks whose direction is unknown, and how deep it then reaches.

A bone of length l under scaled orthography shows |dp| = s l r. With its direction equally
likely everywhere, its depth share c = |dz| / l is uniform on [0, 1] and r = sqrt(1 - c^2) is
crowded towards 1. Marking noise blurs r. This module tabulates, over the shown length
q = |dp| / (s l) and its relative noise nu, the density of log q and the expected depth share
E[c | q]; the latter replaces Taylor's sqrt(1 - q^2), whose slope is infinite at q = 1 and
which has no value beyond (Taylor, CVIU 80, 2000).
"""

from functools import cache

import numpy as np
from jaxtyping import Float
from scipy.interpolate import RectBivariateSpline

_SLIPS = 0.03
"""Density of gross errors over log q: one shown length in thirty says nothing."""
_LONGEST, _FINEST, _COARSEST = 2.0, 0.005, 0.8


@cache
def _tables() -> tuple[RectBivariateSpline, ...]:
    shown = np.linspace(0.0, _LONGEST, 401)
    noise = np.geomspace(_FINEST, _COARSEST, 24)
    share = (np.arange(600) + 0.5) / 600
    gap = (shown[:, None, None] - np.sqrt(1 - share**2)) / noise[:, None]
    exponent = -0.5 * gap**2
    peak = exponent.max(axis=-1)
    kernel = np.exp(exponent - peak[..., None])
    density = kernel.mean(axis=-1) * np.exp(peak) / (noise * np.sqrt(2 * np.pi))
    mean_share = (kernel * share).mean(axis=-1) / kernel.mean(axis=-1)
    variance = (kernel * share**2).mean(axis=-1) / kernel.mean(axis=-1) - mean_share**2
    return (
        RectBivariateSpline(
            shown, np.log(noise), np.log(shown[:, None] * density + _SLIPS), kx=2, ky=1
        ),
        RectBivariateSpline(shown, np.log(noise), mean_share, kx=1, ky=1),
        RectBivariateSpline(shown, np.log(noise), np.sqrt(np.maximum(variance, 0.0)), kx=1, ky=1),
    )


def log_density(
    shown: Float[np.ndarray, "*n"], noise: Float[np.ndarray, "*n"]
) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
    """Logarithm of the density of log q, and its derivative by q."""
    table, _, _ = _tables()
    at = _grid(shown, noise)
    return table.ev(*at), table.ev(*at, dx=1)


def depth_share(
    shown: Float[np.ndarray, "*n"], noise: Float[np.ndarray, "*n"]
) -> Float[np.ndarray, "*n"]:
    """Expected |dz| / l of a bone that shows the share `shown` of its length."""
    _, mean, _ = _tables()
    return mean.ev(*_grid(shown, noise))


def depth_doubt(
    shown: Float[np.ndarray, "*n"], noise: Float[np.ndarray, "*n"]
) -> Float[np.ndarray, "*n"]:
    """Standard deviation of |dz| / l about `depth_share`."""
    _, _, deviation = _tables()
    return deviation.ev(*_grid(shown, noise))


def _grid(
    shown: Float[np.ndarray, "*n"], noise: Float[np.ndarray, "*n"]
) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
    return np.clip(shown, 0.0, _LONGEST), np.log(np.clip(noise, _FINEST, _COARSEST))
