"""One camera in one place: its centre from all views together, turned and zoomed in each.

A low camera's single frames leave focal length and distance open to each other; many views of
one centre, and the net's height, do not. Distances across the lines of all views are minimised by
Levenberg-Marquardt with Cauchy's loss, measured anew once in between. A view's rows tell of the
centre and of its own turn and zoom alone, so the normal equations are summed view by view.

What is known afterwards is told by the normal equations, where a line is not as many independent
measurements as it has pixels: neighbouring samples share the picture's blur, and a whole line is
painted a little beside its place (`PAINTED`).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.numerics.levenberg_marquardt import Damping, minimise
from keyrecon.world.court import CourtModel
from keyrecon.world.line_fit import LineFit, evaluate
from keyrecon.world.pinhole import Pinhole, image_motion

PAINTED = 0.01
"""Metres by which lines are painted beside their place (our estimate: courts are measured with a
tape; rendered ones have none)."""
SHARED = 2.0
"""Neighbouring samples that count as one: they lie 6 px apart, blur reaches twice that."""
MIN_NOISE = 0.25
"""px: distances across a line are not known better than this."""
LOSS_SCALE = 2 * MIN_NOISE
"""px at which Cauchy's loss bends."""
ROUNDS = 2
"""Times that the lines are measured."""
MOST_SAMPLES = 160
"""Samples of each view."""
DAMPING = Damping(start=1e-3, increase=8.0, decrease=10.0, largest=1e8)
STEPS, LEAST_FALL = 60, 1e-9
"""Steps at most, and the share of the cost by which the last one lowers it."""


@dataclass(frozen=True, eq=False)
class JointFit:
    """Views of one camera, and how well they are known."""

    cameras: tuple[Pinhole, ...]
    sd_centre: Float[np.ndarray, "3"]
    """Metres."""
    sd_log_focal: float
    """Of the focal length, as a share of it."""


@dataclass(frozen=True, eq=False)
class _CauchyEquations:
    """Cauchy's cost at a step, and its normal equations there."""

    cost: float
    normal: Float[np.ndarray, "n n"]
    gradient: Float[np.ndarray, "n"]


@dataclass(frozen=True, eq=False)
class _Residuals:
    """Distances across the lines in all views, as a function of one centre and every view's turn
    and zoom."""

    cameras: tuple[Pinhole, ...]
    fits: tuple[LineFit, ...]
    chosen: tuple[np.ndarray, ...]

    def moved(self, x: Float[np.ndarray, "n"]) -> tuple[Pinhole, ...]:
        """The cameras after a step."""
        steps = x[3:].reshape(-1, 4)
        return tuple(
            camera.moved(np.concatenate([x[:3], step]))
            for camera, step in zip(self.cameras, steps, strict=True)
        )

    def values(self, x: Float[np.ndarray, "n"]) -> Float[np.ndarray, "m"]:
        """px across the lines."""
        parts = []
        for camera, fit, rows in zip(self.moved(x), self.fits, self.chosen, strict=True):
            at = camera.project(fit.samples.points[rows])
            away = ((at - fit.samples.pixels[rows]) * fit.samples.normals[rows]).sum(axis=1)
            parts.append(np.nan_to_num(away - fit.residual[rows], nan=1e3))
        return np.concatenate(parts)

    def jacobian(self, x: Float[np.ndarray, "n"]) -> Float[np.ndarray, "m n"]:
        """Their derivative."""
        counts = [len(rows) for rows in self.chosen]
        jacobian = np.zeros((sum(counts), len(x)))
        start = 0
        views = zip(self.moved(x), self.fits, self.chosen, strict=True)
        for k, (camera, fit, rows) in enumerate(views):
            part = image_motion(camera, fit.samples.points[rows], fit.samples.normals[rows])
            jacobian[start : start + len(rows), :3] = part[:, :3]
            jacobian[start : start + len(rows), 3 + 4 * k : 7 + 4 * k] = part[:, 3:]
            start += len(rows)
        return jacobian

    def linearise(self, x: Float[np.ndarray, "n"]) -> _CauchyEquations:
        """Cost and normal equations; every row is weighed by the loss at its own residual."""
        residual = self.values(x) / LOSS_SCALE
        weight = 1 / (1 + residual**2)
        normal, gradient = np.zeros((len(x), len(x))), np.zeros(len(x))
        start = 0
        views = zip(self.moved(x), self.fits, self.chosen, strict=True)
        for k, (camera, fit, rows) in enumerate(views):
            here = slice(start, start + len(rows))
            part = image_motion(camera, fit.samples.points[rows], fit.samples.normals[rows])
            part = part / LOSS_SCALE
            weighted = part.T * weight[here]
            own = np.r_[0:3, 3 + 4 * k : 7 + 4 * k]
            normal[np.ix_(own, own)] += weighted @ part
            gradient[own] += weighted @ residual[here]
            start += len(rows)
        return _CauchyEquations(float(np.log1p(residual**2).sum()), normal, gradient)

    def step(
        self, x: Float[np.ndarray, "n"], here: _CauchyEquations, damping: float
    ) -> Float[np.ndarray, "n"]:
        """Where a damped step leads."""
        damped = here.normal + damping * np.diag(np.diag(here.normal) + 1e-12)
        return x - np.linalg.solve(damped, here.gradient)

    def solve(self) -> Float[np.ndarray, "n"]:
        """The step of least cost."""
        return minimise(
            np.zeros(3 + 4 * len(self.cameras)),
            self.linearise,
            self.step,
            lambda before, after: after <= before,
            lambda before, after: before - after <= LEAST_FALL * after,
            DAMPING,
            STEPS,
        )


def fit_views(
    greys: list[UInt8[np.ndarray, "h w"]], cameras: list[Pinhole], court: CourtModel
) -> JointFit:
    """Move all cameras to one centre so that lines lie on lines in every view.

    The cameras are near their places already, and their lines are seen.
    """
    middle = np.median([camera.centre for camera in cameras], axis=0)
    views = tuple(
        Pinhole(c.focal, c.principal, c.rotation, middle) if len(cameras) > 1 else c
        for c in cameras
    )
    for _ in range(ROUNDS):
        fits = tuple(
            evaluate(grey, camera, court) for grey, camera in zip(greys, views, strict=True)
        )
        problem = _Residuals(views, fits, tuple(_choose(fit) for fit in fits))
        solved = problem.solve()
        views = problem.moved(solved)
    sd_centre, sd_log_focal = _spread(problem, solved, court)
    return JointFit(views, sd_centre, sd_log_focal)


def _choose(fit: LineFit) -> np.ndarray:
    """Samples whose stripe was seen, thinned to `MOST_SAMPLES`."""
    seen = np.flatnonzero(np.isfinite(fit.residual))
    return seen[np.linspace(0, len(seen) - 1, min(len(seen), MOST_SAMPLES)).round().astype(int)]


def _spread(
    problem: _Residuals, x: Float[np.ndarray, "n"], court: CourtModel
) -> tuple[Float[np.ndarray, "3"], float]:
    """Standard deviations of the centre and of the log focal length."""
    residual, rows = problem.values(x), problem.jacobian(x)
    noise = max(MIN_NOISE, 1.48 * float(np.median(np.abs(residual))))
    weight = 1 / (noise**2 + residual**2)
    normal = (rows * weight[:, None]).T @ rows
    inverse = np.linalg.pinv(normal, rcond=1e-14, hermitian=True)
    views = list(zip(problem.fits, problem.chosen, strict=True))
    line = np.concatenate([fit.samples.line[chosen] for fit, chosen in views])
    width = np.concatenate([fit.samples.width[chosen] for fit, chosen in views])
    pixels = PAINTED * width / court.width[line]  # by which a line painted beside its place is off
    thinned = max(1.0, sum(np.isfinite(f.residual).sum() for f, _ in views) / len(line))
    middle = normal * max(1.0, SHARED / thinned)
    for number in np.unique(line):
        on_line = line == number
        pull = rows[on_line].T @ (weight[on_line] * pixels[on_line])
        middle = middle + np.outer(pull, pull)
    spread = np.sqrt(np.maximum(np.diag(inverse @ middle @ inverse), 0))
    return spread[:3], float(np.median(spread[6::4]))
