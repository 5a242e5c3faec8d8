"""What a coach asks of a swing: tempo, how far shoulders and hips turn, where the hands go.

Turns are angles of the line between both shoulders (hips) about the vertical, counted from the
beginning of the upswing, positive away from the target; the X-factor is the shoulders' turn less
the hips' (McLean, Golf Magazine, 1992). The vertical is that of the fitted swing.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from keyrecon.golf.records import FittedSwing, Observations
from keyrecon.records import Motion


@dataclass(frozen=True, eq=False)
class SwingMeasures:
    """Numbers of one swing; angles in degrees."""

    upswing: float
    """Seconds from the beginning of the upswing to the top."""
    downswing: float
    """Seconds from the top to the hit."""
    shoulders: Float[np.ndarray, "T"]
    """Turn of the shoulders from the beginning of the upswing."""
    hips: Float[np.ndarray, "T"]
    club_found: float
    """Share of the frames in which the club was detected."""

    @property
    def tempo(self) -> float:
        """Upswing : downswing."""
        return self.upswing / self.downswing if self.downswing > 0 else float("nan")

    @property
    def x_factor(self) -> Float[np.ndarray, "T"]:
        """Shoulders against hips."""
        return self.shoulders - self.hips


def measure_swing(fitted: FittedSwing, observations: Observations) -> SwingMeasures:
    """The numbers of a fitted swing."""
    motion = fitted.motion
    start, top, hit, _ = fitted.keys
    times = np.interp([start, top, hit], np.arange(len(motion.time)), motion.time)
    up = fitted.state.rotation[..., 1] * ([-1, 1, 1] if observations.left_handed else [1, 1, 1])
    sign = -1.0 if observations.left_handed else 1.0
    shoulders, hips = (
        sign * _turn(motion.points3d, _pair(motion, part), up, round(start))
        for part in ("shoulder", "hip")
    )
    detected = float(np.isfinite(observations.club[:, 0, 0]).mean())
    return SwingMeasures(times[1] - times[0], times[2] - times[1], shoulders, hips, detected)


def _pair(motion: Motion, part: str) -> tuple[int, int]:
    names = motion.skeleton.names
    return names.index(f"left_{part}"), names.index(f"right_{part}")


def _turn(
    points: Float[np.ndarray, "T J 3"],
    pair: tuple[int, int],
    up: Float[np.ndarray, "T 3"],
    start: int,
) -> Float[np.ndarray, "T"]:
    """Angle of a line about the vertical since a frame, degrees."""
    line = points[:, pair[1]] - points[:, pair[0]]
    vertical = up.mean(axis=0) / np.linalg.norm(up.mean(axis=0))
    flat = line - (line @ vertical)[:, None] * vertical
    east = flat[start] / np.linalg.norm(flat[start])
    north = np.cross(vertical, east)
    angle = np.unwrap(np.arctan2(flat @ north, flat @ east))
    return -np.degrees(angle - angle[start])
