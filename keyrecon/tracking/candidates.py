"""Places in one frame where the head or a foot may be (Section 4.1).

Radial symmetry in maps of the player's colours: round for the head, elliptical for the shoes. A
head has the player's colours beneath it, a foot has them above it and not below, and ends of legs
count beside the shoes.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import maximum_filter1d

from keyrecon.segmentation.part_evidence import HEAD_RADIUS, SHOE_RADIUS, Evidence, mean_inside
from keyrecon.tracking.radial_symmetry import ellipse, find_peaks, gradient_field, radial_symmetry

SEARCHED_SCALES = (0.8, 1.0, 1.25)
"""Shares of a part's radius that are searched: players differ, and come nearer. Halved or doubled,
others with it: at most 0.4 points, 0.5 mm on one clip."""
SHOE_SHAPES = tuple(ellipse(2.0, np.deg2rad(angle)) for angle in (0, 45, -45))
"""Shoes from the side and pointing to or from the camera. Halved or doubled, others with it: at
most 0.4 points, 0.5 mm on one clip."""
MAX_HEADS, MAX_FEET = 8, 10
"""Candidates kept of each, per frame. Halved or doubled, others with it: at most 0.4 points, 0.1 mm
on one clip."""
MAX_LEG_ENDS = 4
"""Ends of legs kept beside the shoes, per frame. Halved or doubled, others with it: at most 0.4
points, 0.1 mm on one clip."""
MIN_LEG_SHARE = 0.3
"""Share of the player above the end of a leg, at least. Halved, others with it: at most 0.0 points,
0.1 mm on one clip."""
MAX_UNDER_SHARE = 0.2
"""Share of the player beneath the end of a leg, at most. Halved, others with it: at most 0.0
points, 0.1 mm on one clip."""
MIN_FOOT_SEPARATION = 0.07
"""Candidates nearer to one another are parts of one shoe, player heights: half its length. Halved,
others with it: at most 0.0 points, 0.1 mm on one clip."""
KNEE_DEVIATION = 0.06
"""How far a leg may bend away from the straight line from hips to foot, player heights. Halved,
others with it: at most 0.0 points, 0.1 mm on one clip."""
MIN_BODY_SHARE = 0.05
"""Share of the player's colours beneath a head, at least; a trunk fills about a third. Halved,
others with it: at most 0.0 points, 0.1 mm on one clip."""
TRUNK_WINDOWS = tuple(
    (aside - 0.1, below - 0.1, aside + 0.1, below + 0.1)
    for aside, below in ((0.0, 0.27), (-0.19, 0.19), (0.19, 0.19), (-0.27, 0.0), (0.27, 0.0))
)
"""Where the middle of a trunk may be about a head: beneath, aslant or, of who bends or dives,
beside it; player heights."""


@dataclass(frozen=True, eq=False)
class PartCandidates:
    """Candidates of one frame."""

    heads: Float[np.ndarray, "m 2"]
    head_score: Float[np.ndarray, "m"]
    feet: Float[np.ndarray, "n 2"]
    foot_score: Float[np.ndarray, "n"]
    """NaN where there is the end of a leg and no shoe."""
    trunk: Float[np.ndarray, "m"]
    """How much of a place where the trunk of each head may be has its colours, 0-1; NaN where
    nobody told them."""


def search_frame(evidence: Evidence, tall: float) -> PartCandidates:
    """Round head-coloured and elliptical shoe-coloured places, scored with their neighbourhood."""
    radii = [max(1.0, r * HEAD_RADIUS * tall) for r in SEARCHED_SCALES]
    score = radial_symmetry(gradient_field(evidence.head), radii)
    heads, strength = find_peaks(score, HEAD_RADIUS * tall, 3 * MAX_HEADS)
    body = mean_inside(evidence.inside, heads, (-0.15, 0.12, 0.15, 0.65), tall)
    strength = strength * (0.02 + body)
    order = np.argsort(-strength)[:MAX_HEADS]
    order = order[body[order] > MIN_BODY_SHARE]
    heads, strength = heads[order], strength[order]
    feet, foot_strength = _search_feet(evidence, heads[:4], tall)
    trunk = np.full(len(heads), np.nan)
    if evidence.trunk is not None:
        windows = [mean_inside(evidence.trunk, heads, window, tall) for window in TRUNK_WINDOWS]
        trunk = np.max(windows, axis=0)
    return PartCandidates(heads, strength, feet, foot_strength, trunk)


def _search_feet(
    evidence: Evidence, heads: Float[np.ndarray, "m 2"], tall: float
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n"]]:
    """Shoe-coloured ellipses with a leg above and nothing of the player below, and ends of legs."""
    below = np.zeros(evidence.foot.shape, bool)
    for x, y in heads:
        x0, x1 = max(0, round(x - 0.9 * tall)), max(0, round(x + 0.9 * tall))
        y0, y1 = max(0, round(y + 0.35 * tall)), max(0, round(y + 1.35 * tall))
        below[y0:y1, x0:x1] = True
    if not below.any():
        return np.zeros((0, 2)), np.zeros(0)
    rows, columns = np.flatnonzero(below.any(axis=1)), np.flatnonzero(below.any(axis=0))
    window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    corner = np.array([columns[0], rows[0]])
    slope = gradient_field(np.where(below, evidence.foot, 0)[window])
    radii = [max(1.0, r * SHOE_RADIUS * tall) for r in SEARCHED_SCALES]
    score = np.max([radial_symmetry(slope, radii, 1.0, form) for form in SHOE_SHAPES], axis=0)
    feet, strength = find_peaks(score, 0.8 * SHOE_RADIUS * tall, 3 * MAX_FEET, below[window])
    ends = _leg_ends(np.where(below, evidence.player, 0)[window], tall)
    feet = np.concatenate([feet, ends]) + corner
    strength = np.concatenate([strength, np.full(len(ends), np.nan)])
    leg = mean_inside(evidence.inside, feet, (-0.08, -0.2, 0.08, 0.0), tall)
    leg *= _leg_between(evidence, heads[0], feet, tall) ** 2
    under = mean_inside(evidence.inside, feet, (-0.05, 0.08, 0.05, 0.35), tall).clip(0, 1)
    strength = strength * (0.02 + leg) * (1.05 - under) ** 2
    shoes = np.argsort(-strength)[:MAX_FEET]
    shoes = shoes[np.isfinite(strength[shoes])]
    bare = np.flatnonzero(np.isnan(strength) & (leg > MIN_LEG_SHARE) & (under < MAX_UNDER_SHARE))[
        :MAX_LEG_ENDS
    ]
    order = _apart(feet, np.concatenate([shoes, bare]), MIN_FOOT_SEPARATION * tall)
    return feet[order], strength[order]


def _apart(
    places: Float[np.ndarray, "n 2"], order: Int[np.ndarray, "m"], min_distance: float
) -> Int[np.ndarray, "k"]:
    """The places of an order, but those too near an earlier one: heel and toe of one shoe."""
    kept: list[int] = []
    for place in order:
        if not kept or np.linalg.norm(places[kept] - places[place], axis=1).min() >= min_distance:
            kept.append(int(place))
    return np.array(kept, int)


def _leg_between(
    evidence: Evidence,
    head: Float[np.ndarray, "2"],
    feet: Float[np.ndarray, "n 2"],
    tall: float,
) -> Float[np.ndarray, "n"]:
    """Share of the way from the hips to each foot that the player covers, knees bent or not."""
    x0, x1 = (round(head[0] + side * 0.4 * tall) for side in (-1, 1))
    y0, y1 = (round(head[1] + share * tall) for share in (0.35, 0.55))
    rows, columns = evidence.player.shape
    band = evidence.player[max(0, y0) : max(0, y1), max(0, x0) : max(0, x1)]
    weight = band.sum(axis=0)
    middle = (weight * np.arange(len(weight))).sum() / weight.sum() if weight.sum() > 0 else None
    hips = np.array([head[0] if middle is None else max(0, x0) + middle, (y0 + y1) / 2])
    share = np.linspace(0.2, 0.85, 10)[:, None, None]
    way = hips + share * (feet - hips)
    margin = max(1, round(KNEE_DEVIATION * tall))
    wide = cv2.blur(evidence.player, (2 * margin + 1, 2 * margin + 1))
    x = np.rint(way[..., 0]).astype(int).clip(0, columns - 1)
    y = np.rint(way[..., 1]).astype(int).clip(0, rows - 1)
    # A limb a third as wide as the window covers it; the widest gaps tell, not the mean.
    cover = np.sort(np.minimum(1.0, 3 * wide[y, x]), axis=0)
    return cover[:3].mean(axis=0)


def _leg_ends(player: Float[np.ndarray, "h w"], tall: float) -> Float[np.ndarray, "n 2"]:
    """Where the outline of the player reaches down farthest, lowest first."""
    filled = cv2.GaussianBlur(player, (0, 0), max(0.8, 0.01 * tall)) > 0.4
    low = np.where(filled.any(axis=0), filled.shape[0] - 1 - filled[::-1].argmax(axis=0), -1)
    margin = max(1, round(MIN_FOOT_SEPARATION * tall))
    lowest = low == maximum_filter1d(low, 2 * margin + 1)
    x = np.flatnonzero(lowest & (low >= 0))
    # One place for each run of columns that reach equally far.
    starts = np.flatnonzero(np.diff(x, prepend=-9) > 1)
    ends = np.append(starts[1:], len(x)) - 1
    middle = (x[starts] + x[ends]) // 2 if len(x) else x
    order = np.argsort(-low[middle], kind="stable")
    # The ankle is about that far above the lowest skin.
    return np.stack([middle, low[middle] - 0.02 * tall], axis=1).astype(float)[order]
