"""A camera fitted to the lines of one picture, and what speaks for it.

Gauss-Newton on the distances across the lines, measured anew after every step and weighed by
Cauchy's function of the residual, so that edges of players and nets are outvoted.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, UInt8

from keyrecon.world.court import CourtModel
from keyrecon.world.line_measurement import SPACING, LineSamples, choose_samples, measure_offsets
from keyrecon.world.pinhole import Pinhole, image_motion

SEARCHES = (10.0, 7.0, 5.0, 4.0, 4.0)
"""px to both sides in which a line is looked for, step after step."""
CLOSE = 1.5
"""px from its place within which a stripe, after the fit, counts as the model's line; and a tenth
of its width."""
MIN_SCALE = 0.4
"""px: how well a stripe's middle is seen at best."""
HIT, BY_CHANCE = 0.8, 0.3
"""Share of the samples of a right camera that hit, and of a wrong one. On six rendered and three
real clips the right one had .74 to .98, the best wrong ones .25 to .5 of samples on no line."""
MOST_OF_LINE, FEWEST_SAMPLES = 0.5, 8
"""A line is seen where at least so much of it hits, and so many samples of it are seen."""
FIXED_CENTRE = np.array([False, False, False, True, True, True, True])
"""Which steps of `Pinhole.moved` are free for a camera that turns and zooms in a known place."""
ALL_FREE = np.ones(7, dtype=bool)
LOOSE = np.array([30.0, 30.0, 10.0, 0.5, 0.5, 0.5, 0.7])
"""Spread of what is believed of a camera beforehand: metres, radians, log focal length."""


@dataclass(frozen=True, eq=False)
class LineFit:
    """A camera, and the lines that it was fitted to."""

    camera: Pinhole
    samples: LineSamples
    residual: Float[np.ndarray, "M"]
    """px across the line; NaN where no stripe was seen."""

    @property
    def hit(self) -> Bool[np.ndarray, "M"]:
        """Samples at which the stripe lies where the camera puts it."""
        with np.errstate(invalid="ignore"):
            return np.abs(self.residual) < CLOSE + 0.1 * self.samples.width

    @property
    def support(self) -> float:
        """Share of the samples that hit."""
        return float(self.hit.mean()) if len(self.residual) else 0.0

    @property
    def evidence(self) -> float:
        """Log likelihood ratio of the hits against stripes that lie there by chance."""
        hits = float(self.hit.sum())
        misses = len(self.residual) - hits
        return hits * np.log(HIT / BY_CHANCE) + misses * np.log((1 - HIT) / (1 - BY_CHANCE))

    def lines_seen(self, court: CourtModel) -> list[str]:
        """Names of the model's lines that are seen on most of their way through the picture."""
        support, count = self.line_support(court)
        seen = (support >= MOST_OF_LINE) & (count >= FEWEST_SAMPLES)
        return [name for name, is_seen in zip(court.names, seen, strict=True) if is_seen]

    def line_support(self, court: CourtModel) -> tuple[Float[np.ndarray, "L"], np.ndarray]:
        """Share of the samples of every line that hit, and how many samples it has."""
        count = np.bincount(self.samples.line, minlength=len(court.names))
        hits = np.bincount(self.samples.line, self.hit, minlength=len(court.names))
        return hits / np.maximum(count, 1), count


def fit_lines(
    grey: UInt8[np.ndarray, "h w"],
    camera: Pinhole,
    court: CourtModel,
    searches: tuple[float, ...] = SEARCHES,
    free: Bool[np.ndarray, "7"] = ALL_FREE,
    spread: Float[np.ndarray, "7"] = LOOSE,
    spacing: float = SPACING,
    measured_anew: bool = True,
) -> LineFit:
    """The camera near a first one that lays the model's lines on the picture's.

    `spread` says how far the camera may be from the first one, `spacing` how many px lie between
    the points that are measured. Unless lines are measured anew at the end, the residuals are those
    foretold by the last step.
    """
    first, fit = camera, None
    step = np.zeros(7)
    for search in searches:
        samples = choose_samples(camera, court, grey.shape[:2], spacing)
        offsets = measure_offsets(grey, samples, search)
        if offsets.seen.sum() < 6:
            break
        chosen = np.flatnonzero(offsets.seen)
        rows = image_motion(camera, samples.points[chosen], samples.normals[chosen])[:, free]
        change = solve_robustly(rows, offsets.offset[chosen], spread[free], step[free])
        residual = np.full(len(offsets.seen), np.nan)
        residual[chosen] = offsets.offset[chosen] - rows @ change
        step = step.copy()
        step[free] += change
        camera = first.moved(step)
        fit = LineFit(camera, samples, residual)
    if fit is None or measured_anew:
        return evaluate(grey, camera, court, spacing)
    return fit


def evaluate(
    grey: UInt8[np.ndarray, "h w"], camera: Pinhole, court: CourtModel, spacing: float = SPACING
) -> LineFit:
    """How well a camera fits a picture, as it is."""
    samples = choose_samples(camera, court, grey.shape[:2], spacing)
    offsets = measure_offsets(grey, samples, SEARCHES[-1])
    return LineFit(camera, samples, np.where(offsets.seen, offsets.offset, np.nan))


def solve_robustly(
    rows: Float[np.ndarray, "m p"],
    offsets: Float[np.ndarray, "m"],
    spread: Float[np.ndarray, "p"],
    gone: Float[np.ndarray, "p"],
) -> Float[np.ndarray, "p"]:
    """The step that takes the rows along the offsets; `gone` is how far from the first camera.

    Cauchy's weights, their scale from the median residual.
    """
    change, beforehand = np.zeros(rows.shape[1]), np.diag(1 / spread**2)
    for _ in range(3):
        residual = offsets - rows @ change
        scale = max(MIN_SCALE, 1.48 * float(np.median(np.abs(residual))))
        weighted = (rows * (1 / (scale**2 + residual**2))[:, None]).T
        right = weighted @ offsets - gone / spread**2
        change = np.linalg.solve(weighted @ rows + beforehand, right)
    return change
