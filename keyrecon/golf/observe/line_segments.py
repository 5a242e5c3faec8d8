"""Straight thin bars in a picture: what may be a part of the club's shaft.

The two sides of a shaft are close parallel edges of opposite direction, whether it is darker or
brighter than what is behind it (Lepetit, Shahrokni and Fua, CVPR 2003). Line segments come from
the Line Segment Detector (Grompone von Gioi et al., PAMI 32, 2010), which orients every segment by
its gradient; only those on the foreground are paired. Where a shaft is as bright as what is behind
it, lines of faint foreground stand in (Hough transform). Bars in one line are joined where the
foreground continues between them, as a shaft does that crosses the player or a bright cloud.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8
from scipy.spatial import cKDTree
from skimage.transform import probabilistic_hough_line

from keyrecon.golf.observe.foreground import Foreground
from keyrecon.numerics.geometry import unit_vectors

PARALLEL = np.deg2rad(6.0)
"""Two sides of a bar differ by no more."""
COLLINEAR = np.deg2rad(3.0)
"""Two bars of a shaft differ by no more: a forearm may be nearly in line with it."""
OVERLAP = 0.5
"""Share of the shorter side that lies beside the longer one."""
STEPS = 9
"""Places along a segment or a gap where the foreground is asked."""
EDGE = 0.4
"""Probability of foreground at the side of a bar, against its middle."""
FAINT = 40
"""Probability of foreground, of 255, that a line may consist of."""
BESIDE, ALONE = 0.02, 0.5
"""How far beside such a line, in player heights, its foreground must have fallen to this share:
where the scene is known badly, all of it is faint foreground."""
VOTES, LINE, LINE_GAP = 0.05, 0.08, 0.02
"""Pixels on such a line, its length and its gaps, player heights."""
ANGLES = np.arange(-90.0, 90.0, 0.5) * np.pi / 180
"""Directions in which lines are sought."""
MOST_LINES = 24
"""Lines of a frame that are looked at, the longest first."""
END_PART = 10
"""The beginning and the end of a video are this part of it."""
SAME = 0.02
"""Distance between the ends of two bars that are one, player heights."""
SPREAD = 0.008
"""Distance from their common line at which two bars still are one shaft, lengths of the bar."""


@dataclass(frozen=True)
class LineSegmentOptions:
    """What counts as a bar; lengths in player heights."""

    thinnest: float = 0.0015
    """Least width of the shaft."""
    thickest: float = 0.024
    """Greatest width of the shaft, with the blur of motion."""
    shortest: float = 0.03
    """Least length of a side."""
    moving: float = 0.12
    """Least mean probability of foreground along a bar: a club at rest hardly differs from a
    scene that was learnt while it lay there, but the scene itself differs by nothing."""
    bridge: float = 0.3
    """Longest gap between two bars of one shaft."""


@dataclass(frozen=True, eq=False)
class LineSegments:
    """Bars of one frame."""

    ends: Float[np.ndarray, "n 2 2"]
    """px of the video"""
    support: Float[np.ndarray, "n"]
    """Length over which both sides were seen, px."""


def detect_line_segments(
    grey: UInt8[np.ndarray, "h w"],
    foreground: Foreground,
    frame: int,
    options: LineSegmentOptions = LineSegmentOptions(),
) -> LineSegments:
    """Bars of a full picture, in px; `frame` is its number."""
    height = foreground.height
    sides = _find_segments(grey)
    long = np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1) > options.shortest * height
    sides = sides[long]
    sides = sides[_along(foreground, frame, sides) > EDGE * options.moving]
    bars = _pair(sides, options.thinnest * height, options.thickest * height)
    bars = bars[_along(foreground, frame, bars) > options.moving]
    both = np.concatenate([bars, _thin_lines(foreground, frame)])
    return _join(both, foreground, frame, options)


def _find_segments(picture: UInt8[np.ndarray, "h w"]) -> Float[np.ndarray, "n 2 2"]:
    """Line segments, the darker side always on the same hand."""
    found = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD, 0.8).detect(picture)[0]
    return np.zeros((0, 2, 2)) if found is None else found.reshape(-1, 2, 2).astype(float)


def _thin_lines(foreground: Foreground, frame: int) -> Float[np.ndarray, "n 2 2"]:
    """Lines of faint foreground beside the player: a shaft as pale as the sky behind it."""
    height = foreground.height * foreground.shrink
    player = cv2.dilate(foreground.body(frame).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    thin = (foreground.likely[frame] > FAINT) & ~player & foreground.known
    found = probabilistic_hough_line(
        thin, threshold=round(VOTES * height), line_length=round(LINE * height),
        line_gap=round(LINE_GAP * height), theta=ANGLES, rng=frame,
    )  # fmt: skip
    lines = np.array(found, float).reshape(-1, 2, 2)
    lines = lines[_stand_alone(foreground.likely[frame], lines, BESIDE * height)]
    longest = np.argsort(-np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1))[:MOST_LINES]
    return (lines[longest] - (foreground.shrink - 1) / 2) / foreground.shrink


def _stand_alone(
    likely: UInt8[np.ndarray, "h w"], lines: Float[np.ndarray, "n 2 2"], beside: float
) -> Bool[np.ndarray, "n"]:
    """Whether there is far less foreground on either side of lines than along them."""
    if not len(lines):
        return np.zeros(0, bool)
    share = np.linspace(0, 1, STEPS)[:, None]
    points = lines[:, None, 0] * (1 - share) + lines[:, None, 1] * share
    way = lines[:, 1] - lines[:, 0]
    across = np.stack([-way[:, 1], way[:, 0]], axis=1)
    across *= beside / np.linalg.norm(across, axis=1, keepdims=True)
    along, one, other = (
        cv2.remap(likely, (points + k * across[:, None]).astype(np.float32), None, cv2.INTER_LINEAR)
        .astype(float).mean(axis=1)
        for k in (0, -1, 1)
    )  # fmt: skip
    return np.maximum(one, other) < ALONE * along


def drop_static_segments(bars: Sequence[LineSegments], height: float) -> list[LineSegments]:
    """Bars without those that are there both in the beginning and in the end.

    A club that lies still at address is somewhere else at the finish; a rope is not.
    """
    part = max(1, len(bars) // END_PART)
    known = [
        cKDTree(np.concatenate([b.ends for b in few]).reshape(-1, 4))
        for few in (bars[:part], bars[-part:])
    ]
    kept = []
    for own in bars:
        apart = [tree.query(own.ends.reshape(-1, 4))[0] for tree in known]
        strange = np.max(apart, axis=0) > SAME * height
        kept.append(LineSegments(own.ends[strange], own.support[strange]))
    return kept


def _along(
    foreground: Foreground, frame: int, lines: Float[np.ndarray, "n 2 2"]
) -> Float[np.ndarray, "n"]:
    """Mean probability of foreground along lines; a pixel beside them counts too."""
    share = np.linspace(0, 1, STEPS)[:, None]
    points = lines[:, None, 0] * (1 - share) + lines[:, None, 1] * share
    return foreground.sample(frame, points).mean(axis=1)


def _pair(
    sides: Float[np.ndarray, "n 2 2"], thinnest: float, thickest: float
) -> Float[np.ndarray, "m 2 2"]:
    """Middle lines of close, overlapping sides of opposite direction."""
    length = np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1)
    unit = (sides[:, 1] - sides[:, 0]) / length[:, None]
    i, j = np.nonzero(np.triu(unit @ unit.T < -np.cos(PARALLEL), 1))
    axis = unit_vectors(unit[i] * length[i, None] - unit[j] * length[j, None], 0.0)
    normal = np.stack([-axis[:, 1], axis[:, 0]], axis=1)
    middle = sides.mean(axis=1)
    gap = np.einsum("nk,nk->n", middle[j] - middle[i], normal)
    one = np.einsum("nek,nk->ne", sides[i] - middle[i, None], axis)
    other = np.einsum("nek,nk->ne", sides[j] - middle[i, None], axis)
    low = np.stack([one.min(axis=1), other.min(axis=1)])
    high = np.stack([one.max(axis=1), other.max(axis=1)])
    shared = high.min(axis=0) - low.max(axis=0)
    good = (np.abs(gap) > thinnest) & (np.abs(gap) < thickest)
    good &= shared > OVERLAP * np.minimum(length[i], length[j])
    center = middle[i] + normal * gap[:, None] / 2
    ends = np.stack([low.min(axis=0), high.max(axis=0)], axis=1)[..., None]
    return (center[:, None] + ends * axis[:, None])[good]


def _join(
    bars: Float[np.ndarray, "m 2 2"],
    foreground: Foreground,
    frame: int,
    options: LineSegmentOptions,
) -> LineSegments:
    """Bars, and what several of them in one line make together, the longest first."""
    length = np.linalg.norm(bars[:, 1] - bars[:, 0], axis=1)
    bars, length = bars[np.argsort(-length)], np.sort(length)[::-1]
    ends, support = list(bars), list(length)
    taken = np.zeros(len(bars), bool)
    for k in range(len(bars)):
        if taken[k]:
            continue
        members = _grow(k, bars, (foreground, frame), options)
        taken |= members
        if members.sum() > 1:
            fitted = _fit_line(bars[members], length[members])
            ends.append(fitted)
            support.append(_covered(fitted, bars[members]))
    return LineSegments(np.array(ends).reshape(-1, 2, 2), np.array(support, float))


def _grow(
    start: int,
    bars: Float[np.ndarray, "m 2 2"],
    seen: tuple[Foreground, int],
    options: LineSegmentOptions,
) -> Bool[np.ndarray, "m"]:
    """The bars in the line of one, which grows by the nearest ones first."""
    whole, members = bars[start], np.arange(len(bars)) == start
    limit = options.bridge * seen[0].height
    while True:
        length = float(np.linalg.norm(whole[1] - whole[0]))
        axis = (whole[1] - whole[0]) / length
        normal = np.array([-axis[1], axis[0]])
        place = np.sort((bars - whole[0]) @ axis, axis=1)
        gap = np.maximum(place[:, 0] - length, -place[:, 1])
        turn = bars[:, 1] - bars[:, 0]
        turn = np.abs(turn @ normal) / np.linalg.norm(turn, axis=1)
        off = np.abs((bars - whole[0]) @ normal).max(axis=1)
        near = (off < 2.0 + SPREAD * (length + np.maximum(gap, 0))) & (turn < np.sin(COLLINEAR))
        near &= ~members & (gap < limit)
        inside = near & (place[:, 0] > 0) & (place[:, 1] < length)
        members = members | inside
        near &= ~inside
        if not near.any():
            return members
        chosen = int(np.where(near, gap, np.inf).argmin())
        members = members | (np.arange(len(bars)) == chosen)
        both = np.concatenate([whole, bars[chosen]])
        along = (both - whole[0]) @ axis
        joined = both[[along.argmin(), along.argmax()]]
        if _is_open(whole, bars[chosen], seen):
            continue
        whole = joined


def _fit_line(
    bars: Float[np.ndarray, "m 2 2"], length: Float[np.ndarray, "m"]
) -> Float[np.ndarray, "2 2"]:
    """The line nearest to all bars, as far as they reach; long ones count more."""
    middle = np.average(bars.mean(axis=1), axis=0, weights=length)
    off = (bars - middle).reshape(-1, 2)
    axis = np.linalg.eigh((off * np.repeat(length, 2)[:, None]).T @ off)[1][:, 1]
    along = off @ axis
    return middle + np.array([along.min(), along.max()])[:, None] * axis


def _covered(whole: Float[np.ndarray, "2 2"], bars: Float[np.ndarray, "m 2 2"]) -> float:
    """Length of a shaft over which bars were seen, however many."""
    axis = (whole[1] - whole[0]) / np.linalg.norm(whole[1] - whole[0])
    covered, reached = 0.0, -np.inf
    for start, end in sorted(np.sort((bars - whole[0]) @ axis, axis=1).tolist()):
        covered += max(0.0, end - max(start, reached))
        reached = max(reached, end)
    return covered


def _is_open(
    whole: Float[np.ndarray, "2 2"], other: Float[np.ndarray, "2 2"], seen: tuple[Foreground, int]
) -> bool:
    """Whether scenery shows between two bars."""
    apart = np.linalg.norm(whole[:, None] - other[None], axis=2)
    i, j = np.unravel_index(apart.argmin(), apart.shape)
    return bool(_along(*seen, np.stack([whole[i], other[j]])[None])[0] < 0.5)
