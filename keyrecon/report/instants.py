"""The instants that a reader looks for: where a hand is fastest, as in strokes, throws and swings.

A hand's speed is taken relative to the middle of the body, so that running does not count. Peaks
are told apart by their height over what is around them in their shot, not by a speed that would fit
one sport.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import gaussian_filter1d

from keyrecon.body import Skeleton
from keyrecon.io.formats.conventions import stand_on_floor, stature
from keyrecon.records import Motion
from keyrecon.report.summary import hinge_angles, hinges, stretch_times

MOST = 8
"""Instants that are shown at most, the fastest."""
APART_SECONDS = 0.8
"""Two peaks nearer than this are one: a stroke's backswing and its hit."""
STANDS_OUT = 0.5
"""Height of a peak over its surroundings as a share of the highest."""
LEAST_SPEED = 1.5
"""Speed in statures per second under which a hand merely moves along."""
SMOOTHING_SECONDS = 0.02


@dataclass(frozen=True, eq=False)
class KeyInstant:
    """A frame in which a hand is fastest."""

    frame: int
    hand: str
    speed: float
    """Of the hand relative to the body, units of the motion per second."""


def key_instants(motion: Motion) -> list[KeyInstant]:
    """The instants in the order of time; none without wrists, or where no hand is ever fast."""
    hands = [n for n in ("right_wrist", "left_wrist") if n in motion.skeleton.names]
    if not hands or len(motion.time) < 5:
        return []
    from scipy.signal import find_peaks  # which loads all of scipy.stats: half a second

    speeds = np.stack([hand_speed(motion, name) for name in hands])
    fastest = np.where(np.isfinite(speeds), speeds, 0).max(axis=0)
    least, prominence = LEAST_SPEED * stature(motion), STANDS_OUT * float(fastest.max())
    peaks: list[int] = []
    for part in motion.stretches:
        places, _ = find_peaks(np.pad(fastest[part], 1), height=least, prominence=prominence)
        peaks += _apart(part.start + places - 1, fastest, motion.time)
    chosen = sorted(sorted(peaks, key=lambda t: -fastest[t])[:MOST])
    return [
        KeyInstant(t, hands[int(np.nanargmax(speeds[:, t]))].replace("_wrist", ""), float(v))
        for t in chosen
        for v in [np.nanmax(speeds[:, t])]
    ]


def _apart(
    peaks: Int[np.ndarray, "n"], height: Float[np.ndarray, "T"], time: Float[np.ndarray, "T"]
) -> list[int]:
    """Of peaks that are too near to one another in time, the highest."""
    kept: list[int] = []
    for peak in sorted(peaks.tolist(), key=lambda t: -height[t]):
        if all(abs(time[peak] - time[other]) >= APART_SECONDS for other in kept):
            kept.append(peak)
    return kept


def hand_speed(motion: Motion, name: str) -> Float[np.ndarray, "T"]:
    """Speed of a joint relative to the middle of the body, units per second; NaN where unknown.

    Times are smoothed as the places are, so that what moves evenly stays so at uneven times.
    """
    points = motion.points3d[:, motion.skeleton.index(name)] - _middle(motion)
    speed = np.full(len(points), np.nan)
    for part in motion.stretches:
        if part.stop - part.start > 1:
            time = stretch_times(motion, part)
            sigma = max(SMOOTHING_SECONDS / float(np.median(np.diff(time))), 0.5)
            smooth = gaussian_filter1d(points[part], sigma, axis=0)
            velocity = np.gradient(smooth, gaussian_filter1d(time, sigma), axis=0)
            speed[part] = np.linalg.norm(velocity, axis=1)
    return speed


def instant_angles(motion: Motion) -> dict[str, Float[np.ndarray, "T"]]:
    """Angles that coaches ask for, degrees, by name: bends, and shoulders against hips."""
    skeleton = motion.skeleton
    bends = np.degrees(hinge_angles(motion.points3d, skeleton))
    angles = {
        skeleton.names[joint].replace("_", " "): bends[:, column]
        for column, joint in enumerate(hinges(skeleton))
    }
    turn = separation(motion)
    return angles if turn is None else angles | {"shoulders to hips": turn}


def separation(motion: Motion) -> Float[np.ndarray, "T"] | None:
    """Angle between the lines of shoulders and hips seen from above, degrees; None without them."""
    known = np.isfinite(motion.points3d).all(axis=2)
    if not _has_trunk(motion.skeleton) or not (known.all(axis=1) | ~known.any(axis=1)).all():
        return None
    points = stand_on_floor(motion, even_times=False).points
    shoulders, hips = (
        points[:, motion.skeleton.index(f"left_{part}"), :][:, [0, 2]]
        - points[:, motion.skeleton.index(f"right_{part}"), :][:, [0, 2]]
        for part in ("shoulder", "hip")
    )
    crossed = shoulders[:, 0] * hips[:, 1] - shoulders[:, 1] * hips[:, 0]
    return np.degrees(np.abs(np.arctan2(crossed, (shoulders * hips).sum(axis=1))))


def _has_trunk(skeleton: Skeleton) -> bool:
    needed = {f"{side}_{part}" for side in ("left", "right") for part in ("shoulder", "hip")}
    return needed <= set(skeleton.names)


def _middle(motion: Motion) -> Float[np.ndarray, "T 3"]:
    trunk = [
        j for j, n in enumerate(motion.skeleton.names) if n.endswith(("_shoulder", "_hip"))
    ] or [motion.skeleton.root]
    return motion.points3d[:, trunk].mean(axis=1)
