"""What a coach would read off a motion, held against the truth: hand speeds and joint angles.

Errors in millimetres forgive what these do not: strokes that are too slow, knees that stay bent.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from keyrecon.records import Motion

STRAIGHT = 165.0
"""Degrees above which a knee of the truth counts as straight."""
STROKE = 0.6
"""A peak of a hand's speed counts above this share of the fastest (99.5th percentile)."""
APART, NEAR = 0.3, 0.08
"""Seconds on both sides within which a peak is the highest, and within which the motion may have
its own."""
LEG, ARM = ("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist")
LEAST = 20
"""Values below which no median is given."""


@dataclass(frozen=True)
class PostureScores:
    """Errors of one motion; NaN where the truth has too little of it."""

    peak: float
    """Peak speed of a hand relative to the neck over the true one, median over all peaks."""
    peak_low: float
    """The same, tenth percentile."""
    knee: float
    """Mean error of the angle, degrees; so are the next two."""
    elbow: float
    separation: float
    """Angle between hips and shoulders, seen along the trunk."""
    straight_knee: float
    """Median of the knee's angle less the true one where that is straight, degrees."""


COLUMNS = "".join(f"{name:>8}" for name in ("peak", "low", "knee", "elbow", "hip-sh.", "straight"))
"""Titles of `row`."""


def row(scores: PostureScores) -> str:
    """The scores under `COLUMNS`."""
    values = [getattr(scores, field.name) for field in fields(scores)]
    return "".join(f"{value:8.2f}" for value in values[:2]) + "".join(
        f"{value:8.1f}" for value in values[2:]
    )


def judge_posture(motion: Motion, truth: Mapping[str, np.ndarray]) -> PostureScores:
    """Scores of a motion of the truth's frames."""
    names = [str(name) for name in truth["joint_names"]]
    ours = [motion.skeleton.index(name) for name in names]
    found, known = motion.points3d[:, ours], truth["points3d"]
    knees, true_knees = (bends(points, names, LEG) for points in (found, known))
    elbows, true_elbows = (bends(points, names, ARM) for points in (found, known))
    peaks = peak_speeds(found, known, names, motion.fps)
    straight = (knees - true_knees)[true_knees > STRAIGHT]
    turned = separation(found, names) - separation(known, names)
    return PostureScores(
        peak=float(np.median(peaks)) if len(peaks) else np.nan,
        peak_low=float(np.percentile(peaks, 10)) if len(peaks) else np.nan,
        knee=float(np.abs(knees - true_knees).mean()),
        elbow=float(np.abs(elbows - true_elbows).mean()),
        separation=float(np.abs((turned + 180) % 360 - 180).mean()),
        straight_knee=float(np.median(straight)) if len(straight) >= LEAST else np.nan,
    )


def bends(points: np.ndarray, names: list[str], limb: tuple[str, str, str]) -> np.ndarray:
    """(2, T): angle at the middle joint of both limbs, degrees; 180 is straight."""
    chains = [[names.index(f"{side}_{joint}") for joint in limb] for side in ("right", "left")]
    first, middle, last = (points[:, [chain[k] for chain in chains]] for k in range(3))
    one, other = first - middle, last - middle
    length = np.linalg.norm(one, axis=-1) * np.linalg.norm(other, axis=-1)
    return np.degrees(np.arccos(np.clip((one * other).sum(axis=-1) / length, -1, 1))).T


def separation(points: np.ndarray, names: list[str]) -> np.ndarray:
    """Angle from the line of the hips to that of the shoulders about the trunk, degrees."""
    at = {name: points[:, names.index(name)] for name in names}
    hips, shoulders = (at[f"right_{pair}"] - at[f"left_{pair}"] for pair in ("hip", "shoulder"))
    up = at["neck"] - 0.5 * (at["right_hip"] + at["left_hip"])
    up = up / np.linalg.norm(up, axis=-1, keepdims=True)
    flat = [line - (line * up).sum(axis=-1, keepdims=True) * up for line in (hips, shoulders)]
    sine, cosine = (np.cross(*flat) * up).sum(axis=-1), (flat[0] * flat[1]).sum(axis=-1)
    return np.degrees(np.arctan2(sine, cosine))


def peak_speeds(found: np.ndarray, known: np.ndarray, names: list[str], fps: float) -> np.ndarray:
    """Highest speed near each true peak of either hand, relative to the neck, over the true one."""
    neck, apart, near = names.index("neck"), round(APART * fps), round(NEAR * fps)
    ratios = []
    for hand in ("right_wrist", "left_wrist"):
        ways = (points[:, names.index(hand)] - points[:, neck] for points in (found, known))
        ours, true = (np.linalg.norm(np.gradient(way, axis=0), axis=1) for way in ways)
        least = STROKE * np.percentile(true, 99.5)
        ratios += [
            ours[t - near : t + near + 1].max() / true[t]
            for t in range(apart, len(true) - apart)
            if true[t] > least and true[t] == true[t - apart : t + apart + 1].max()
        ]
    return np.array(ratios)
