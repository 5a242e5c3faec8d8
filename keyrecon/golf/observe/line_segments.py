"""Line segments in a picture: straight thin bars that may be a part of the club's shaft.

The two sides of a shaft are close parallel edges of opposite direction, whether it is darker or
brighter than what is behind it (Lepetit, Shahrokni and Fua, CVPR 2003). Line segments come from
the Line Segment Detector (Grompone von Gioi et al., PAMI 32, 2010), which orients every segment by
its gradient; only those on the foreground are paired. Where a shaft is as bright as what is behind
it, lines of faint foreground stand in (Hough transform). Segments in one line are joined where the
foreground continues between them, as a shaft does that crosses the player or a bright cloud.

Constants were chosen on rendered swings where no source is named; see benchmarks/golf.py.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from scipy.spatial import cKDTree
from skimage.transform import probabilistic_hough_line

from keyrecon.golf.observe.foreground import FrameForeground
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.numerics.picture_points import sample_picture
from keyrecon.ranges import within

PARALLEL = np.deg2rad(6.0)
"""Two sides of a shaft differ by no more."""
COLLINEAR = np.deg2rad(3.0)
"""Two segments of a shaft differ by no more: a forearm may be nearly in line with it."""
LEAST_OVERLAP = 0.5
"""Share of the shorter side that lies beside the longer one."""
SAMPLES_ALONG = 9
"""Places along a segment or a gap where the foreground is sampled."""
SIDE_SHARE = 0.4
"""Probability of foreground at the side of a shaft, against its middle."""
FAINT_FOREGROUND = 40
"""Probability of foreground, of 255, that a line may consist of."""
FREE_DISTANCE, FREE_SHARE = 0.02, 0.5
"""How far beside such a line, in player heights, its foreground must have fallen to this share:
where the scene is known badly, all of it is faint foreground."""
HOUGH_VOTES, HOUGH_LENGTH, HOUGH_GAP = 0.05, 0.08, 0.02
"""Pixels on such a line, its length and its gaps, player heights."""
HOUGH_ANGLES = np.arange(-90.0, 90.0, 0.5) * np.pi / 180
"""Directions in which lines are sought."""
MOST_LINES = 24
"""Lines of a frame that are kept, the longest first."""
DETECTED_HEIGHT = 330.0
"""Height of the player in pictures in which segments are detected, px: the shaft is three wide, and
time goes with the square. Three real swings with players of 457 to 497 px took .20, .20 and .23 s
of one core per frame for all of a fit instead of .24, .24 and .28; joints within a fifth of the
trunk went from .92, .94 and .95 to .94, .95 and .95, clubs within 5 degrees stayed as they were."""
END_PART = 10
"""The beginning and the end of a video are this part of it."""
SAME_ENDS = 0.02
"""Distance between the ends of two segments that are one, player heights."""
STATIC_SHARE = 0.3
"""Share of the active frames in which a static segment is detected: players hide it at times."""
DETECTION_ERROR, MEASURED_HEIGHT = 2.0, 480.0
"""Distance by which pieces of one shaft may lie beside one another, px, of a player so tall at
most; of taller ones, whose segments are found in pictures reduced further, as much more. With 2 px
of `DETECTED_HEIGHT` golf_dtl_tee had clubs within 5 degrees in 87 instead of 91 % of the frames."""
COLLINEAR_OFFSET = 0.008
"""The same in addition, lengths of the segment: one that is turned by half a degree."""


@dataclass(frozen=True)
class LineSegmentOptions:
    """What may be a part of a shaft; lengths in player heights."""

    thinnest: Annotated[float, within(8e-05, 0.03)] = 0.0015
    """Least width of the shaft."""
    thickest: Annotated[float, within(0.001, 0.5)] = 0.024
    """Greatest width of the shaft, with the blur of motion."""
    shortest: Annotated[float, within(0.002, 0.6)] = 0.03
    """Least length of a side."""
    moving: Annotated[float, within(0, 1)] = 0.12
    """Least mean probability of foreground along a segment: a club at rest hardly differs from a
    scene that was learnt while it lay there, but the scene itself differs by nothing."""
    bridge: Annotated[float, within(0, 3)] = 0.3
    """Longest gap between two segments of one shaft."""


@dataclass(frozen=True, eq=False)
class LineSegments:
    """Those of one frame."""

    ends: Float[np.ndarray, "n 2 2"]
    """px of the video"""
    support: Float[np.ndarray, "n"]
    """Length over which both sides were detected, px."""


def detect_line_segments(
    grey: UInt8[np.ndarray, "h w"],
    foreground: FrameForeground,
    options: LineSegmentOptions = LineSegmentOptions(),
) -> LineSegments:
    """Segments of a full picture, in px."""
    height = foreground.height
    shrink = min(1.0, DETECTED_HEIGHT / height)
    size = tuple(max(1, round(shrink * n)) for n in grey.shape[::-1])
    small = grey if shrink == 1 else cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    sides = (_find_segments(small) + 0.5) * np.array(grey.shape[::-1]) / size - 0.5
    long = np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1) > options.shortest * height
    sides = sides[long]
    sides = sides[_foreground_along(foreground, sides) > SIDE_SHARE * options.moving]
    paired = _pair(sides, options.thinnest * height, options.thickest * height)
    paired = paired[_foreground_along(foreground, paired) > options.moving]
    return _join(np.concatenate([paired, _thin_lines(foreground)]), foreground, options)


def _find_segments(picture: UInt8[np.ndarray, "h w"]) -> Float[np.ndarray, "n 2 2"]:
    """Line segments, the darker side always on the same hand."""
    detected = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD, 0.8).detect(picture)[0]
    return np.zeros((0, 2, 2)) if detected is None else detected.reshape(-1, 2, 2).astype(float)


def _thin_lines(foreground: FrameForeground) -> Float[np.ndarray, "n 2 2"]:
    """Lines of faint foreground beside the player: a shaft as pale as the sky behind it."""
    height = foreground.height * foreground.shrink
    player = cv2.dilate(foreground.body().astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    thin = (foreground.likely > FAINT_FOREGROUND) & ~player & foreground.known
    hough = probabilistic_hough_line(
        thin, threshold=round(HOUGH_VOTES * height), line_length=round(HOUGH_LENGTH * height),
        line_gap=round(HOUGH_GAP * height), theta=HOUGH_ANGLES, rng=foreground.frame,
    )  # fmt: skip
    lines = np.array(hough, float).reshape(-1, 2, 2)
    lines = lines[_stand_alone(foreground.likely, lines, FREE_DISTANCE * height)]
    longest = np.argsort(-np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1))[:MOST_LINES]
    return foreground.to_video(lines[longest])


def _stand_alone(
    likely: UInt8[np.ndarray, "h w"], lines: Float[np.ndarray, "n 2 2"], beside: float
) -> Bool[np.ndarray, "n"]:
    """Whether there is far less foreground on either side of lines than along them."""
    if not len(lines):
        return np.zeros(0, bool)
    share = np.linspace(0, 1, SAMPLES_ALONG)[:, None]
    points = lines[:, None, 0] * (1 - share) + lines[:, None, 1] * share
    way = lines[:, 1] - lines[:, 0]
    across = np.stack([-way[:, 1], way[:, 0]], axis=1)
    across *= beside / np.linalg.norm(across, axis=1, keepdims=True)
    along, one, other = (
        sample_picture(likely, points + k * across[:, None]).astype(float).mean(axis=1)
        for k in (0, -1, 1)
    )  # fmt: skip
    return np.maximum(one, other) < FREE_SHARE * along


def drop_static_segments(
    segments: Sequence[LineSegments], height: float, active: Int[np.ndarray, "n"] | None = None
) -> list[LineSegments]:
    """Segments without those that are there both in the beginning and in the end.

    A club that lies still at address is somewhere else at the finish; a rope is not. Nor does a
    club stay in one place in frames in which the player is `active`, as edges behind him do.
    """
    part = max(1, len(segments) // END_PART)
    begun, ended = (_ends_tree(few) for few in (segments[:part], segments[-part:]))
    during = [] if active is None else [_ends_tree([segments[t]]) for t in active.tolist()]
    kept = []
    for of_frame in segments:
        flat = of_frame.ends.reshape(-1, 4)
        near = np.array([_is_there(tree, flat, height) for tree in (begun, ended, *during)])
        static = near[0] & near[1]
        if during:
            static |= near[2:].mean(axis=0) > STATIC_SHARE
        kept.append(LineSegments(of_frame.ends[~static], of_frame.support[~static]))
    return kept


def _ends_tree(segments: Sequence[LineSegments]) -> cKDTree:
    return cKDTree(np.concatenate([s.ends for s in segments]).reshape(-1, 4))


def _is_there(
    tree: cKDTree, ends: Float[np.ndarray, "n 4"], height: float
) -> Bool[np.ndarray, "n"]:
    """Whether segments are among those of other frames."""
    if not len(ends) or not tree.n:
        return np.zeros(len(ends), bool)
    there: Bool[np.ndarray, "n"] = tree.query(ends)[0] <= SAME_ENDS * height
    return there


def _foreground_along(
    foreground: FrameForeground, lines: Float[np.ndarray, "n 2 2"]
) -> Float[np.ndarray, "n"]:
    """Mean probability of foreground along lines; a pixel beside them counts too."""
    share = np.linspace(0, 1, SAMPLES_ALONG)[:, None]
    points = lines[:, None, 0] * (1 - share) + lines[:, None, 1] * share
    return foreground.sample(points).mean(axis=1)


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
    good &= shared > LEAST_OVERLAP * np.minimum(length[i], length[j])
    center = middle[i] + normal * gap[:, None] / 2
    ends = np.stack([low.min(axis=0), high.max(axis=0)], axis=1)[..., None]
    return (center[:, None] + ends * axis[:, None])[good]


def _join(
    segments: Float[np.ndarray, "m 2 2"],
    foreground: FrameForeground,
    options: LineSegmentOptions,
) -> LineSegments:
    """Segments, and what several of them in one line make together, the longest first."""
    length = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    segments, length = segments[np.argsort(-length)], np.sort(length)[::-1]
    ends, support = list(segments), list(length)
    taken = np.zeros(len(segments), bool)
    for k in range(len(segments)):
        if taken[k]:
            continue
        members = _grow(k, segments, foreground, options)
        taken |= members
        if members.sum() > 1:
            fitted = _fit_line(segments[members], length[members])
            ends.append(fitted)
            support.append(_covered(fitted, segments[members]))
    return LineSegments(np.array(ends).reshape(-1, 2, 2), np.array(support, float))


def _grow(
    start: int,
    segments: Float[np.ndarray, "m 2 2"],
    foreground: FrameForeground,
    options: LineSegmentOptions,
) -> Bool[np.ndarray, "m"]:
    """The segments in the line of one, which grows by the nearest ones first."""
    whole, members = segments[start], np.arange(len(segments)) == start
    limit = options.bridge * foreground.height
    beside = DETECTION_ERROR * max(1.0, foreground.height / MEASURED_HEIGHT)
    while True:
        length = float(np.linalg.norm(whole[1] - whole[0]))
        axis = (whole[1] - whole[0]) / length
        normal = np.array([-axis[1], axis[0]])
        place = np.sort((segments - whole[0]) @ axis, axis=1)
        gap = np.maximum(place[:, 0] - length, -place[:, 1])
        turn = segments[:, 1] - segments[:, 0]
        turn = np.abs(turn @ normal) / np.linalg.norm(turn, axis=1)
        off = np.abs((segments - whole[0]) @ normal).max(axis=1)
        near = off < beside + COLLINEAR_OFFSET * (length + np.maximum(gap, 0))
        near &= turn < np.sin(COLLINEAR)
        near &= ~members & (gap < limit)
        inside = near & (place[:, 0] > 0) & (place[:, 1] < length)
        members = members | inside
        near &= ~inside
        if not near.any():
            return members
        chosen = int(np.where(near, gap, np.inf).argmin())
        members = members | (np.arange(len(segments)) == chosen)
        both = np.concatenate([whole, segments[chosen]])
        along = (both - whole[0]) @ axis
        joined = both[[along.argmin(), along.argmax()]]
        if _is_open(whole, segments[chosen], foreground):
            continue
        whole = joined


def _fit_line(
    segments: Float[np.ndarray, "m 2 2"], length: Float[np.ndarray, "m"]
) -> Float[np.ndarray, "2 2"]:
    """The line nearest to all segments, as far as they reach; long ones count more."""
    middle = np.average(segments.mean(axis=1), axis=0, weights=length)
    off = (segments - middle).reshape(-1, 2)
    axis = np.linalg.eigh((off * np.repeat(length, 2)[:, None]).T @ off)[1][:, 1]
    along = off @ axis
    return middle + np.array([along.min(), along.max()])[:, None] * axis


def _covered(whole: Float[np.ndarray, "2 2"], segments: Float[np.ndarray, "m 2 2"]) -> float:
    """Length of a shaft over which segments were detected, however many."""
    axis = (whole[1] - whole[0]) / np.linalg.norm(whole[1] - whole[0])
    covered, reached = 0.0, -np.inf
    for start, end in sorted(np.sort((segments - whole[0]) @ axis, axis=1).tolist()):
        covered += max(0.0, end - max(start, reached))
        reached = max(reached, end)
    return covered


def _is_open(
    whole: Float[np.ndarray, "2 2"], other: Float[np.ndarray, "2 2"], foreground: FrameForeground
) -> bool:
    """Whether scenery shows between two segments."""
    apart = np.linalg.norm(whole[:, None] - other[None], axis=2)
    i, j = np.unravel_index(apart.argmin(), apart.shape)
    return bool(_foreground_along(foreground, np.stack([whole[i], other[j]])[None])[0] < 0.5)
