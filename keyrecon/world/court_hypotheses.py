"""Which lines of the picture are which lines of the court: guesses, and how well they fit.

Two lines of the picture are taken for lines along the court and two for lines across it; together
with any two and two lines of the model they give a homography (Farin et al. 2004, section 3.3).
Most combinations are rejected before a pixel is looked at: the ground must lie below its horizon,
the horizon must be nearly level, and there must be a focal length with which length and width of
the court are at right angles and in proportion. What is left is scored by the pixels along the
model's lines: a line pixel of the right direction speaks for the guess, a missing one against it,
and so does a line that goes on where the court has none.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.world.court import HALF_DOUBLES, HALF_SINGLES, CourtModel
from keyrecon.world.line_pixels import DIRECTIONS, ImageLine, LinePixels
from keyrecon.world.pinhole import Pinhole, pinhole_from_homography

FOCAL_RANGE = (0.45, 12.0)
"""Focal lengths that cameras have, in widths of the picture: 96 degrees wide to a long lens."""
MAX_ROLL = np.radians(20.0)
"""How far the horizon may be from level."""
MAX_SKEW = 0.12
"""How far length and width of the court may be from right angles (cosine), and from their
proportion: four lines known to 1 px leave about .05 in a low view."""
HIGHEST = 60.0
"""Metres above the ground at which a camera can be; and 0.3 at least."""
HIT, MISS = 0.75, 0.25
"""Share of a painted line that is seen as such: players, net and shade cover the rest."""
POINT_SPACING = 9.0
"""px of a painted line that count as one piece of evidence: closer pixels are not independent."""
MIN_APART = 10.0
"""px between two lines from which on each has pixels of its own."""
FARTHEST = 80.0
"""Metres from the middle of the court at which a camera can be."""
MOST_WEIGHT = 6.0
"""A point does not speak for more than so many point spacings of line."""
COARSE = 6
"""Every so-manieth point of the model is looked at to find the best guesses."""
MOST_GUESSES = 400_000
"""Guesses of one picture that are looked at together."""


@dataclass(frozen=True, eq=False)
class CameraHypothesis:
    """A camera for one picture, and how much speaks for it."""

    camera: Pinhole
    score: float
    """Log likelihood ratio against line pixels lying anywhere."""


def find_camera_hypotheses(
    lines: list[ImageLine],
    pixels: LinePixels,
    court: CourtModel,
    shape: tuple[int, int],
    count: int,
) -> list[CameraHypothesis]:
    """The `count` best guesses that differ, best first."""
    if len(lines) < 4:
        return []
    principal = (np.array(shape[::-1]) - 1) / 2
    quads = _quadrangles(lines, principal, float(shape[1]))
    if not len(quads):
        return []
    homographies, focal = _match(quads, court, principal, float(shape[1]))
    scores = score_homographies(homographies, pixels, court, COARSE)
    order = np.argsort(-scores)[: 12 * count]
    finer = score_homographies(homographies[order], pixels, court, 2)
    order = order[np.argsort(-finer)]
    guesses: list[CameraHypothesis] = []
    for k, score in zip(order, -np.sort(-finer), strict=True):
        camera = pinhole_from_homography(homographies[k], principal, float(focal[k]))
        away = float(np.linalg.norm(camera.centre[:2]))
        if not (0.3 < camera.centre[2] < HIGHEST and away < FARTHEST):
            continue
        if all(views_differ(camera, other.camera, shape) for other in guesses):
            guesses.append(CameraHypothesis(camera, float(score)))
        if len(guesses) == count:
            break
    return guesses


def views_differ(one: Pinhole, other: Pinhole, shape: tuple[int, int], share: float = 0.01) -> bool:
    """Whether two cameras see the court in places that differ by a share of the picture's width.

    The court looks the same from both ends; so turned by half a turn it is the same court.
    """
    corners = np.array([(x, y, 0.0) for x in (-4.1, 0, 4.1) for y in (-11.9, -6.4, 6.4, 11.9)])
    height, width = shape
    here = one.project(corners)
    inside = (np.abs(here - one.principal) < np.array([width, height])).all(axis=1)
    for turn in (1.0, -1.0):
        there = other.project(corners * [turn, turn, 1.0])
        apart = np.linalg.norm(here - there, axis=1)[inside]
        if len(apart) and np.all(apart < share * width):
            return False
    return True


def _quadrangles(
    lines: list[ImageLine], principal: Float[np.ndarray, "2"], width: float
) -> Float[np.ndarray, "Q 4 2"]:
    """Corners of two lines along and two lines across the court, relative to the principal point.

    Order: (left, near), (right, near), (right, far), (left, far), which is counter-clockwise from
    above. Only those in which a level camera can see a rectangle on the ground.
    """
    rows = np.array([(*line.normal, line.rho - line.normal @ principal) for line in lines])
    middles = np.array([line.ends.mean(axis=0) for line in lines]) - principal
    ends = np.array([line.ends for line in lines]) - principal
    pairs = np.array(list(combinations(range(len(lines)), 2)))
    meet = _cross(rows[pairs[:, 0]], rows[pairs[:, 1]])
    first, second = (a.ravel() for a in np.meshgrid(*[np.arange(len(pairs))] * 2, indexing="ij"))
    disjoint = (pairs[first][:, :, None] != pairs[second][:, None, :]).all(axis=(1, 2))
    horizon = np.cross(meet[first], meet[second])
    size = np.hypot(horizon[:, 0], horizon[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        horizon = horizon / np.where(horizon[:, 1] < 0, -size, size)[:, None]
    level = disjoint & (np.abs(horizon[:, 0]) < np.sin(MAX_ROLL))
    first, second, horizon = first[level], second[level], horizon[level]
    four = np.concatenate([pairs[first], pairs[second]], axis=1)
    # y points down: what lies below the horizon has a positive distance from it.
    below = np.einsum("qij,qj->qi", ends[four].reshape(len(four), 8, 2), horizon[:, :2])
    keep = (below + horizon[:, 2:] > 0.002 * width).all(axis=1)
    first, second, four = first[keep], second[keep], four[keep]
    return _ordered(rows, middles, four)


def _cross(a: Float[np.ndarray, "n 3"], b: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Points where lines n . p = rho meet, homogeneous."""
    sign = np.array([1.0, 1.0, -1.0])
    return np.cross(a * sign, b * sign)


def _ordered(
    rows: Float[np.ndarray, "n 3"], middles: Float[np.ndarray, "n 2"], four: np.ndarray
) -> Float[np.ndarray, "Q 4 2"]:
    """Corners in the order of the model's, turned so that the court is seen from above."""
    sign = np.array([1.0, 1.0, -1.0])
    corners = []
    for along, across in ((0, 2), (1, 2), (1, 3), (0, 3)):
        point = np.cross(rows[four[:, along]] * sign, rows[four[:, across]] * sign)
        with np.errstate(divide="ignore", invalid="ignore"):
            corners.append(point[:, :2] / point[:, 2:])
    quads = np.stack(corners, axis=1)
    quads = quads[np.isfinite(quads).all(axis=(1, 2)) & (np.abs(quads) < 1e5).all(axis=(1, 2))]
    edge = np.roll(quads, -1, axis=1) - quads
    turn = edge[..., 0] * np.roll(edge, -1, axis=1)[..., 1]
    turn = turn - edge[..., 1] * np.roll(edge, -1, axis=1)[..., 0]
    convex = (turn > 0).all(axis=1) | (turn < 0).all(axis=1)
    quads, turn = quads[convex], turn[convex]
    # Seen from above they run counter-clockwise; in pixels, where y points down, the turn is less.
    flipped = turn[:, 0] > 0
    quads[flipped] = quads[flipped][:, [1, 0, 3, 2]]
    return quads


def _unit_homographies(quads: Float[np.ndarray, "Q 4 2"]) -> Float[np.ndarray, "Q 3 3"]:
    """Homographies from the unit square to quadrangles (Heckbert, 1989, section 2.2.3)."""
    p0, p1, p2, p3 = quads.transpose(1, 0, 2)
    d1, d2, s = p1 - p2, p3 - p2, p0 - p1 + p2 - p3
    with np.errstate(divide="ignore", invalid="ignore"):
        down = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
        g = (s[:, 0] * d2[:, 1] - s[:, 1] * d2[:, 0]) / down
        h = (d1[:, 0] * s[:, 1] - d1[:, 1] * s[:, 0]) / down
    homographies = np.empty((len(quads), 3, 3))
    homographies[:, :2, 0] = p1 - p0 + g[:, None] * p1
    homographies[:, :2, 1] = p3 - p0 + h[:, None] * p3
    homographies[:, :2, 2] = p0
    homographies[:, 2] = np.column_stack([g, h, np.ones(len(g))])
    return homographies


def _match(
    quads: Float[np.ndarray, "Q 4 2"],
    court: CourtModel,
    principal: Float[np.ndarray, "2"],
    width: float,
) -> tuple[Float[np.ndarray, "H 3 3"], Float[np.ndarray, "H"]]:
    """Homographies from metres to pixels of all assignments that a camera can have, and its focal
    length."""
    unit = _unit_homographies(quads)
    kept, lengths = [], []
    for to_unit in _model_rectangles(court):
        plane = unit @ to_unit
        focal, fits = _focal_lengths(plane, width)
        kept.append(plane[fits])
        lengths.append(focal[fits])
    planes, focal = np.concatenate(kept)[:MOST_GUESSES], np.concatenate(lengths)[:MOST_GUESSES]
    planes[:, :2] += principal[:, None] * planes[:, 2:]
    return planes, focal


def _model_rectangles(court: CourtModel) -> list[Float[np.ndarray, "3 3"]]:
    """Maps to the unit square of all rectangles between lines along and across the court."""
    ground = court.ends[(court.ends[..., 2] == 0).all(axis=1)]
    along = sorted({float(e[0, 0]) for e in ground if e[0, 0] == e[1, 0]})
    across = sorted({float(e[0, 1]) for e in ground if e[0, 1] == e[1, 1]})
    return [
        np.array([[1 / (x1 - x0), 0, -x0 / (x1 - x0)], [0, 1 / (y1 - y0), -y0 / (y1 - y0)],
                  [0, 0, 1.0]])
        for x0, x1 in combinations(along, 2)
        for y0, y1 in combinations(across, 2)
    ]  # fmt: skip


def _focal_lengths(
    plane: Float[np.ndarray, "Q 3 3"], width: float
) -> tuple[Float[np.ndarray, "Q"], Bool[np.ndarray, "Q"]]:
    """Focal length with which both axes of the ground are square and of one length, and whether
    there is one."""
    p1, p2 = plane[:, :2, 0], plane[:, :2, 1]
    c1, c2 = plane[:, 2, 0], plane[:, 2, 1]
    a = np.stack([(p1 * p2).sum(1), ((p1**2).sum(1) - (p2**2).sum(1)) / 2])
    b = np.stack([c1 * c2, (c1**2 - c2**2) / 2])
    low, high = (1 / (share * width) ** 2 for share in FOCAL_RANGE[::-1])
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.clip(-(a * b).sum(0) / (a * a).sum(0), low, high)
        n1 = np.sqrt((p1**2).sum(1) * u + c1**2)
        n2 = np.sqrt((p2**2).sum(1) * u + c2**2)
        skew = np.abs(a[0] * u + b[0]) / (n1 * n2)
        ratio = np.abs(np.log(n1 / n2))
    return 1 / np.sqrt(u), (skew < MAX_SKEW) & (ratio < MAX_SKEW)


def score_homographies(
    homographies: Float[np.ndarray, "H 3 3"], pixels: LinePixels, court: CourtModel, step: int
) -> Float[np.ndarray, "H"]:
    """Log likelihood ratio of line pixels along the model's ground lines, every `step`-th point."""
    ground = court.points[:, 2] == 0
    on_ground = _Probe(
        court.points[ground][::step], court.direction[ground][::step], court.line[ground][::step]
    )
    way = court.empty[:, 1] - court.empty[:, 0]
    way = way / np.linalg.norm(way, axis=1, keepdims=True)
    beyond = _Probe(
        np.concatenate([np.linspace(a, b, 5) for a, b in court.empty]),
        np.repeat(way, 5, axis=0),
        np.repeat(np.arange(len(way)), 5),
    )
    chance = min(max(pixels.density, 0.003), 0.2)
    on = np.log(np.array([MISS / (1 - chance), HIT / chance]))
    off = np.log(np.array([1.0, chance]))  # a line where none can be: as rare as by chance
    scores = np.empty(len(homographies))
    for start in range(0, len(homographies), 4096):
        part = homographies[start : start + 4096]
        hit, weight = _look_up(part, on_ground, pixels)
        score = (on[hit] * weight).sum(axis=1)
        hit, weight = _look_up(part, beyond, pixels)
        scores[start : start + 4096] = score + (off[hit] * weight).sum(axis=1)
    return scores


@dataclass(frozen=True, eq=False)
class _Probe:
    """Points of the ground at which line pixels are looked for."""

    points: Float[np.ndarray, "N 3"]
    direction: Float[np.ndarray, "N 3"]
    """Of the line there."""
    line: Int[np.ndarray, "N"]
    """Points of one line follow one another."""

    @property
    def gap(self) -> Float[np.ndarray, "N"]:
        """Metres to the nearest line beside it, about."""
        return np.where(self.direction[:, 1] != 0, HALF_DOUBLES - HALF_SINGLES, 5.4)


def _look_up(
    homographies: Float[np.ndarray, "H 3 3"], probe: _Probe, pixels: LinePixels
) -> tuple[np.ndarray, Float[np.ndarray, "H N"]]:
    """Whether a line pixel of the right direction lies at each point, and how much that counts.

    Points count by the length of picture that they stand for, and less where lines lie so close
    together in the picture that the same pixels would speak for several.
    """
    height, width = pixels.near.shape
    flat = np.column_stack([probe.points[:, :2], np.ones(len(probe.points))]).astype(np.float32)
    way = np.column_stack([probe.direction[:, :2], np.zeros(len(flat))]).astype(np.float32)
    turn = np.linalg.det(homographies).astype(np.float32)[:, None]
    # In pixels, where y points down, ground seen from above has a negative determinant.
    low = homographies.astype(np.float32) * -np.sign(turn)[..., None]
    place, slope = low @ flat.T, low @ way.T  # (H, 3, N)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        depth = place[:, 2]
        x, y = place[:, 0] / depth, place[:, 1] / depth
        dx, dy = (slope[:, 0] - x * slope[:, 2]) / depth, (slope[:, 1] - y * slope[:, 2]) / depth
        apart = np.abs(turn) / np.abs(depth) ** 3 / np.hypot(dx, dy) * probe.gap
        seen = (depth > 0) & (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
        seen &= np.isfinite(apart)
        step = np.hypot(np.diff(x, axis=1), np.diff(y, axis=1))
    column, row = (np.where(seen, a, 0).astype(np.int32) for a in (x, y))
    angle = np.where(seen, np.arctan2(dx, -dy), 0)  # of the normal
    bins = np.floor(angle / np.pi * DIRECTIONS).astype(np.int32) % DIRECTIONS
    hit = (pixels.near[row, column] >> bins) & 1
    step = np.where(probe.line[1:] == probe.line[:-1], step, np.inf)
    step = np.concatenate([step, np.full_like(step[:, :1], np.inf)], axis=1)
    step = np.fmin(step, np.roll(step, 1, axis=1))
    weight = np.minimum(step / POINT_SPACING, MOST_WEIGHT) * np.minimum(apart / MIN_APART, 1)
    return hit, np.where(seen & np.isfinite(weight), weight, 0)
