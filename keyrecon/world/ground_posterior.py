"""The posterior of the camera over level ground, given the evidence.

For every focal length of a grid the other parameters are fitted to all evidence together
(`ground_evidence`), and Laplace's approximation over them gives the posterior of that focal length
(Tierney and Kadane, JASA 81, 1986). The grid is refined once around the likely values. So the
spread is right also where the focal length is uncertain by a factor of three, as it is for a player
who stays on one spot, and the spreads of tilt, height and place include that uncertainty.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from keyrecon.world.ground_evidence import (
    LEAN,
    GroundState,
    MarkedEnds,
    Stances,
    cauchy_residuals,
    lean_residuals,
    mark_residuals,
    size_residuals,
)

FOCAL_LENGTHS = (0.35, 8.0)
"""Shortest and longest, in the longer side."""
SIZE_NOISE = (0.01, 0.06)
"""Least and most that it is off from moment to moment; in between it is taken from the fit."""
SIZE_MEMORY = 3.0
"""Moments over which that lasts and counts once."""
STARTS = tuple((np.radians(tilt), np.log(high)) for tilt in (0, 12, 25, 40) for high in (1, 3, 9))
"""Tilts and heights from which the fit may begin."""
ENOUGH = {"ftol": 1e-4, "xtol": 1e-4, "gtol": 1e-4, "max_nfev": 40}
"""Where a fit ends: what is left changes the likelihood by less than a hundredth."""
COARSE, FINE, SAMPLES = 11, 11, 600
"""Focal lengths tried at first and then, and draws from what is left open."""


@dataclass(frozen=True, eq=False)
class GroundEvidence:
    """Observations and prior of a camera."""

    marks: MarkedEnds
    stances: Stances
    prior: tuple[GroundState, GroundState]
    """Mean and spread of what is known beforehand."""
    principal: Float[np.ndarray, "2"]
    click: float
    noise: float = 0.03
    """Of the player's size in one moment."""

    def residuals(self, x: Float[np.ndarray, "6"]) -> Float[np.ndarray, "m"]:
        """In standard deviations."""
        state = GroundState(*x)
        camera = state.pinhole(self.principal)
        mean, spread = (state_vector(part) for part in self.prior)
        parts = [(x - mean) / spread, mark_residuals(camera, self.marks, self.click).ravel()]
        if len(self.stances.frame):
            once = 1 / np.sqrt(SIZE_MEMORY)
            sizes = size_residuals(camera, self.stances, state.log_size) / self.noise
            leans = lean_residuals(camera, self.stances, state.lean) / LEAN
            parts += [once * cauchy_residuals(sizes), once * cauchy_residuals(leans)]
        return np.concatenate(parts)


@dataclass(frozen=True, eq=False)
class GroundPosterior:
    """A mixture of normal distributions, one for each focal length tried."""

    weight: Float[np.ndarray, "n"]
    mean: Float[np.ndarray, "n 6"]
    covariance_root: Float[np.ndarray, "n 5 5"]
    """Of the covariance of all but the focal length."""

    @property
    def best(self) -> Float[np.ndarray, "6"]:
        """The likeliest of the focal lengths tried, and what goes with it."""
        return self.mean[int(self.weight.argmax())]

    def draws(self) -> Float[np.ndarray, "s 6"]:
        """Draws, the same each time."""
        rng = np.random.default_rng(0)
        chosen = rng.choice(len(self.weight), SAMPLES, p=self.weight)
        drawn = self.mean[chosen].copy()
        drawn[:, 1:] += np.einsum(
            "sij,sj->si", self.covariance_root[chosen], rng.standard_normal((SAMPLES, 5))
        )
        return drawn


def state_vector(state: GroundState) -> Float[np.ndarray, "6"]:
    """In the order of the fields."""
    return np.array(list(vars(state).values()))


def explore_cameras(
    evidence: GroundEvidence, longer: int
) -> tuple[GroundPosterior, GroundEvidence]:
    """The posterior on a coarse grid of focal lengths, then on a fine one; and the evidence with
    the noise estimated from the fit."""
    grid = np.log(np.geomspace(*FOCAL_LENGTHS, COARSE) * longer)
    posterior = _laplace_posterior(evidence, grid)
    for _ in range(2):
        evidence = replace(evidence, noise=_size_noise(evidence, posterior.best))
        middle = float(posterior.weight @ posterior.mean[:, 0])
        spread = float(np.sqrt(posterior.weight @ (posterior.mean[:, 0] - middle) ** 2))
        step = max(spread, 0.3 * (grid[1] - grid[0]))
        low, high = max(grid[0], middle - 4 * step), min(grid[-1], middle + 4 * step)
        posterior = _laplace_posterior(evidence, np.linspace(low, high, FINE), posterior.best)
    return posterior, evidence


def _size_noise(evidence: GroundEvidence, x: Float[np.ndarray, "6"]) -> float:
    """Noise of the player's size from moment to moment."""
    if len(evidence.stances.frame) < 4:
        return evidence.noise
    state = GroundState(*x)
    off = size_residuals(state.pinhole(evidence.principal), evidence.stances, state.log_size)
    return float(np.clip(1.48 * np.median(np.abs(off - np.median(off))), *SIZE_NOISE))


def _laplace_posterior(
    evidence: GroundEvidence,
    log_focals: Float[np.ndarray, "n"],
    near: Float[np.ndarray, "6"] | None = None,
) -> GroundPosterior:
    """By Laplace's approximation at each focal length; searches start at `near` where given."""
    usual = state_vector(evidence.prior[0])[1:]
    start = usual if near is None else near[1:]
    cost, means, roots = [], [], []
    for log_focal in log_focals:

        def residuals(rest: np.ndarray, log_focal: float = float(log_focal)) -> np.ndarray:
            return evidence.residuals(np.concatenate([[log_focal], rest]))

        if near is None:  # lines of sight over the horizon pull nowhere: begin where they do
            others = (np.array([t, 0.0, h, *usual[3:]]) for t, h in STARTS)
            start = min((start, *others), key=lambda rest: float((residuals(rest) ** 2).sum()))
        spread = state_vector(evidence.prior[1])[1:]
        solved = least_squares(residuals, start, x_scale=spread, **ENOUGH)
        start = solved.x
        normal = solved.jac.T @ solved.jac
        cost.append(solved.cost + 0.5 * np.linalg.slogdet(normal)[1])
        means.append(np.concatenate([[log_focal], solved.x]))
        roots.append(np.linalg.inv(np.linalg.cholesky(normal)).T)
    weight = np.exp(np.min(cost) - np.array(cost))
    return GroundPosterior(weight / weight.sum(), np.array(means), np.array(roots))
