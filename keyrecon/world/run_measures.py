"""What a coach asks of a player's way over the court: how far, how fast, and where.

Velocity is that of the root, averaged over `STEADY` seconds: swaying is not running. It is that
within a shot: where the next one shows the player, he did not run there. How far the numbers are
off is told by rendered sequences whose truth is known (`python benchmarks/way.py`), not
by the fit: a root that drifts by 10 cm fits as well.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from keyrecon.records import Motion
from keyrecon.world.court import HALF_LENGTH
from keyrecon.world.records import WorldMotion

STEADY = 0.25
"""Seconds over which velocity is averaged, as a standard deviation. On seven rendered sequences the
way's length came out .86 to 1.22 times the true one, with .15 s .85 to 1.28, before the pose was
refined on the ground."""
LENGTH_ERROR, SPEED_ERROR, ACCELERATION_ERROR = 0.18, 0.14, 0.22
"""Shares by which the way's length, top speed and top acceleration are off, root mean square over
eight rendered sequences of 36 s, twelve seconds at a time: .68 to .99, .69 to 1.02 and .55 to 1.07
times the true ones, short rather than long (true top speeds .4 to .9 m/s: walks, short steps).
What is short is the way along the line of sight, which a picture hardly tells, so that the least
error shrinks it: of captured motions with the noise of a lifting it came out .86 times the true
one, across the line of sight 1.00 times (`benchmarks/world_captured.py`)."""
TOP = 99.0
"""Percentile that stands for the top: one frame's is a mistake more often than not."""
ON_BASELINE = 0.5
"""Metres to both sides of the baseline within which a player is on it: a step, and more than the
root's place is off (.1 to .16 m in the median)."""
ZONES = ("behind the baseline", "on it", "inside the court")


@dataclass(frozen=True)
class Measured:
    """A number, and its standard deviation."""

    value: float
    sd: float


@dataclass(frozen=True, eq=False)
class RunMeasures:
    """The way over the court in numbers; NaN in frames without a place."""

    speed: Float[np.ndarray, "T"]
    """m/s"""
    acceleration: Float[np.ndarray, "T"]
    """Of the averaged velocity, any direction, m/s^2."""
    length: Measured
    """m"""
    top_speed: Measured
    top_acceleration: Measured
    seconds: tuple[float, float, float]
    """Spent in each of `ZONES`."""

    @property
    def known_seconds(self) -> float:
        """Seconds with a place on the court."""
        return sum(self.seconds)


def measure_run(world: WorldMotion, motion: Motion) -> RunMeasures | None:
    """The measures of a way; None where no frame has a place."""
    velocity = run_velocity(world, motion)
    speed = np.linalg.norm(velocity, axis=1)
    known = np.isfinite(speed)
    if known.sum() < 2:
        return None
    acceleration = np.linalg.norm(_rate(velocity, motion), axis=1)
    duration = frame_seconds(motion)
    beyond = np.abs(world.root[:, 1]) - HALF_LENGTH
    with np.errstate(invalid="ignore"):
        zones = (beyond > ON_BASELINE, np.abs(beyond) <= ON_BASELINE, beyond < -ON_BASELINE)
    behind, on, inside = (float(duration[known & zone].sum()) for zone in zones)
    length = float((speed * duration)[known].sum())
    fastest = float(np.percentile(speed[known], TOP))
    certain = np.isfinite(acceleration)
    top = float(np.percentile(acceleration[certain], TOP)) if certain.any() else 0.0
    return RunMeasures(
        speed,
        acceleration,
        Measured(length, LENGTH_ERROR * length),
        Measured(fastest, SPEED_ERROR * fastest),
        Measured(top, ACCELERATION_ERROR * top),
        (behind, on, inside),
    )


def run_velocity(world: WorldMotion, motion: Motion) -> Float[np.ndarray, "T 2"]:
    """Velocity of the root over the ground, averaged over `STEADY` seconds; NaN where unknown."""
    velocity, spread = _rate(world.root[:, :2], motion), STEADY * motion.fps
    mean = np.full_like(velocity, np.nan)
    for part in motion.stretches:
        known = np.isfinite(velocity[part]).all(axis=1)
        share = gaussian_filter1d(known.astype(float), spread, mode="constant")
        filled = np.where(known[:, None], velocity[part], 0.0)
        total = gaussian_filter1d(filled, spread, axis=0, mode="constant")
        averaged = total / np.maximum(share, 1e-9)[:, None]
        mean[part] = np.where(known[:, None], averaged, np.nan)
    return mean


def frame_seconds(motion: Motion) -> Float[np.ndarray, "T"]:
    """Seconds that each frame stands for within its stretch; 0 where there is no motion."""
    seconds = np.zeros(len(motion.time))
    for part in motion.stretches:
        alone = part.stop - part.start == 1
        seconds[part] = 1 / motion.fps if alone else np.gradient(motion.time[part])
    return seconds


def _rate(values: Float[np.ndarray, "T 2"], motion: Motion) -> Float[np.ndarray, "T 2"]:
    """Change per second within each stretch; NaN in those of one frame."""
    rate = np.full_like(values, np.nan)
    for part in motion.stretches:
        if part.stop - part.start > 1:
            rate[part] = np.gradient(values[part], motion.time[part], axis=0)
    return rate
