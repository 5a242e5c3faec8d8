"""Residuals of a body's pose in the picture (CVPR 2005, Section 4), and the body's surface.

The body is made of volumetric primitives, tapered capsules on the segments (Fig. 1). Radii are
those of an adult in clothes and scale with stature; breadths of chest and pelvis are made of two
capsules side by side.

Joints and club (Section 4.2). The distance of a projected joint to where it was tracked is taken as
two coordinates: the same square, and smooth at zero. The club pulls by its two ends, each across
and along the shaft: where the shaft lies is surer than where it ends.

The surface (Sections 4.1 and 4.3) consists of points a + q d with radius r(q), q from 0 to 1. A
line of sight through the camera's centre with unit direction v passes them at the distance

    e(q) - r(q),        e(q) = |P (a + q d)|,        P = I - v v',

least where its slope by q vanishes or at an end. There it does not change with q to first order,
so its slope by the pose is that of a point fixed to the axis (envelope theorem). The foreground
pulls the nearest capsule over every pixel of the mask that no capsule covers; the reverse, a part
of the body outside of the mask, pulls by the mask's distance transform. Matched points of two
frames move with the surface that the first one lies on.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from keyrecon.golf.prior.kinematics import find_club, find_joints
from keyrecon.golf.prior.skeleton import CLUB, LENGTHS, NAMES, REST
from keyrecon.golf.records import (
    Body,
    Camera,
    Capsules,
    Observations,
    Residuals,
    RootPose,
)
from keyrecon.io.frame_reader import side_by_side
from keyrecon.numerics.geometry import unit_vectors

# segment, start and end (x, along, z in statures; along: share of the segment), radii in statures,
# by eye on the figures of captured swings and of benchmarks/golf.py
_TRUNK = (
    ("trunk", (0.045, 0.30, 0.0), (0.070, 0.86, 0.0), (0.070, 0.066)),
    ("trunk", (-0.045, 0.30, 0.0), (-0.070, 0.86, 0.0), (0.070, 0.066)),
    ("pelvis", (0.045, 0.0, 0.0), (0.042, 0.30, 0.0), (0.078, 0.070)),
    ("pelvis", (-0.045, 0.0, 0.0), (-0.042, 0.30, 0.0), (0.078, 0.070)),
    ("head", (0.0, 0.0, 0.0), (0.0, 0.35, 0.0), (0.034, 0.034)),
    ("head", (0.0, 0.42, -0.012), (0.0, 0.70, -0.008), (0.044, 0.050)),
)
_LIMBS = (
    ("upper_arm", (0.032, 0.026)), ("forearm", (0.026, 0.019)), ("thigh", (0.056, 0.036)),
    ("shank", (0.035, 0.022)),
)  # fmt: skip
_HAND = ((0.0, 0.055), (0.022, 0.024))
"""Beyond the wrist along the forearm, and radii; statures."""
_FOOT = ((-0.025, 0.095), (0.026, 0.022))
"""Behind and before the ankle along the foot, and radii; statures."""


def build_capsules(body: Body) -> Capsules:
    """Capsules of a body in metres."""
    rows = [(name, _trunk_point(name, a), _trunk_point(name, b), radii)
            for name, a, b, radii in _TRUNK]  # fmt: skip
    for side in ("right", "left"):
        for part, radii in _LIMBS:
            name = f"{side}_{part}"
            rest = REST[NAMES.index(name)]
            rows.append((name, 0 * rest, LENGTHS[part] * rest, radii))
        forearm, foot = f"{side}_forearm", f"{side}_foot"
        rest = REST[NAMES.index(forearm)]
        hand = [(LENGTHS["forearm"] + along) * rest for along in _HAND[0]]
        rows.append((forearm, *hand, _HAND[1]))
        sole = [along * REST[NAMES.index(foot)] for along in _FOOT[0]]
        rows.append((foot, *sole, _FOOT[1]))
    names, starts, ends, radii = zip(*rows, strict=True)
    return Capsules(
        np.array([NAMES.index(name) for name in names]), body.stature * np.array(starts),
        body.stature * np.array(ends), body.stature * np.array(radii),
    )  # fmt: skip


def _trunk_point(name: str, point: tuple[float, float, float]) -> np.ndarray:
    """A point of pelvis, trunk or head in statures; `along` counts from the segment's origin."""
    length = LENGTHS["trunk" if name == "pelvis" else name]
    return np.array([point[0], point[1] * length, point[2]])


MODEL_ERROR = 0.03
"""Metres by which joints of the model miss the player's even at best: his proportions and what is
called a joint differ. Added to the tracker's error, it keeps the fit from explaining them away.
Chosen on rendered swings; see benchmarks/golf.py."""
MARK_SPREAD = 3.0
"""Standard deviation of a person's mark, px: two people who mark the same joint differ by that."""
NEAREST = 0.1
"""Metres before the camera within which nothing is filmed."""
AXIS_PLACES = (0.1, 0.5, 0.9)
"""Places along a capsule's axis that should lie in the mask: both ends, off the joints where
capsules overlap, and the middle."""
SILHOUETTE_STEP = 4
"""Pixels of the video per pixel of the distance transforms: a distance changes by no more than its
step, so a coarse grid read between its pixels loses nothing of note."""

LINES_AT_ONCE = 8192
"""Lines of sight that a core passes by all capsules at a time: a millisecond or two of work."""

Vectors = Float[np.ndarray, "n 3"]


def joint_residuals(observations: Observations, body: Body, pose: RootPose) -> Residuals:
    """Projected minus tracked joints, in standard deviations of the track."""
    frame, joint = np.nonzero(np.isfinite(observations.joints).all(axis=2))
    points = find_joints(body, pose)[frame, joint]
    pixels, slope = project(points, observations.camera)
    spread = _total_spread(observations.spread[frame, joint], slope)
    values = (pixels - observations.joints[frame, joint]) / spread[:, None]
    return pair_rows(values, slope / spread[:, None, None], points,
                     frame, body.joint_segment[joint])  # fmt: skip


def mark_residuals(observations: Observations, body: Body, pose: RootPose) -> Residuals:
    """Projected joints minus those that a person marked, in standard deviations.

    Limbs of the model's proportions cannot meet all marks: drawn to them without `MODEL_ERROR`,
    joints of a rendered swing down the line were 2 mm worse. `marks.hold_joints` closes the rest.
    """
    marks = observations.marks
    row, joint = np.nonzero(np.isfinite(marks.joints).all(axis=2))
    frame = marks.frames[row]
    points = find_joints(body, pose)[frame, joint]
    pixels, slope = project(points, observations.camera)
    spread = _total_spread(np.full(len(row), MARK_SPREAD), slope)
    values = (pixels - marks.joints[row, joint]) / spread[:, None]
    return pair_rows(values, slope / spread[:, None, None], points,
                     frame, body.joint_segment[joint])  # fmt: skip


def club_residuals(observations: Observations, body: Body, pose: RootPose) -> Residuals:
    """Projected minus observed ends of the club, in standard deviations across and along it."""
    frame = np.flatnonzero(np.isfinite(observations.club).all(axis=(1, 2)))
    points = find_club(body, pose)[frame].reshape(-1, 3)
    ends = observations.club[frame]
    pixels, slope = project(points, observations.camera)
    along = unit_vectors(ends[:, 1] - ends[:, 0], 1e-9)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    axes = np.repeat(np.stack([across, along], axis=1), 2, axis=0)
    spreads = np.repeat(observations.club_spread[frame], 2), observations.club_along[frame].ravel()
    total = np.stack([_total_spread(spread, slope) for spread in spreads], axis=1)
    axes = axes / total[..., None]
    values = np.einsum("nij,nj->ni", axes, pixels - ends.reshape(-1, 2))
    return pair_rows(values, axes @ slope, points, np.repeat(frame, 2),
                     np.full(len(points), CLUB))  # fmt: skip


def shaft_mark_residuals(observations: Observations, body: Body, pose: RootPose) -> Residuals:
    """The same of the club in the frames in which a person marked its shaft."""
    club = np.full_like(observations.club, np.nan)
    club[observations.marks.frames] = observations.marks.shafts
    return club_residuals(replace(observations, club=club), body, pose)


def _total_spread(
    tracked: Float[np.ndarray, "n"], slope: Float[np.ndarray, "n 2 3"]
) -> Float[np.ndarray, "n"]:
    """Standard deviation of tracker and model together, px."""
    return np.hypot(tracked, MODEL_ERROR * slope[:, 0, 0])


def project(
    points: Float[np.ndarray, "n 3"], camera: Camera
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n 2 3"]]:
    """Pixels of points in camera axes, and their change by the points."""
    depth = np.maximum(points[:, 2], NEAREST)
    flat = points[:, :2] / depth[:, None]
    slope = np.zeros((len(points), 2, 3))
    slope[:, 0, 0] = slope[:, 1, 1] = camera.focal / depth
    slope[:, :, 2] = -camera.focal * flat / depth[:, None]
    return camera.focal * flat + camera.principal, slope


def pair_rows(
    values: Float[np.ndarray, "n 2"],
    gradient: Float[np.ndarray, "n 2 3"],
    points: Float[np.ndarray, "n 3"],
    frame: Int[np.ndarray, "n"],
    segment: Int[np.ndarray, "n"],
) -> Residuals:
    """Two rows for every error with two coordinates."""
    return Residuals(
        values.ravel(), np.repeat(frame, 2), np.repeat(segment, 2), np.repeat(points, 2, axis=0),
        gradient.reshape(-1, 3), np.repeat(np.arange(len(values)), 2),
    )  # fmt: skip


def foreground_residuals(
    observations: Observations, capsules: Capsules, pose: RootPose
) -> Residuals:
    """Distance from lines of sight through the mask to the body, metres; only those that miss."""
    frame = np.repeat(np.arange(len(pose.origins)), [len(f) for f in observations.foreground])
    pixels = np.concatenate([*observations.foreground, np.zeros((0, 2))])
    lines = SightLines(sight_directions(pixels, observations.camera), frame)
    axes = place_capsules(capsules, pose)
    passing = find_closest_points(lines, axes)
    nearest = passing.distance.argmin(axis=1)
    rows = np.flatnonzero(passing.distance.min(axis=1) > 0)
    frame, nearest = frame[rows], nearest[rows]
    share = passing.place[rows, nearest].astype(float)[:, None]
    point = (1 - share) * axes.starts[frame, nearest] + share * axes.ends[frame, nearest]
    across = _reject(point, lines.directions[rows])
    radii = (1 - share[:, 0]) * axes.radii[nearest, 0] + share[:, 0] * axes.radii[nearest, 1]
    return Residuals(
        np.linalg.norm(across, axis=1) - radii, frame, capsules.segment[nearest], point,
        unit_vectors(across, 0.0), np.arange(len(rows)),
    )  # fmt: skip


def silhouette_residuals(
    observations: Observations, capsules: Capsules, pose: RootPose
) -> Residuals:
    """How far axes of the capsules project from the mask, px; only those outside of it."""
    if not len(observations.silhouette_distance):
        return _no_residuals()
    axes = place_capsules(capsules, pose)
    share = np.array(AXIS_PLACES)[:, None]
    points = (1 - share) * axes.starts[:, :, None] + share * axes.ends[:, :, None]
    frames, number = points.shape[0], points.shape[1] * len(AXIS_PLACES)
    frame = np.repeat(np.arange(frames), number)
    segment = np.tile(np.repeat(capsules.segment, len(AXIS_PLACES)), frames)
    points = points.reshape(-1, 3)
    pixels, slope = project(points, observations.camera)
    values, gradient = sample_distance(
        observations.silhouette_distance, pixels.reshape(frames, number, 2)
    )
    rows = np.flatnonzero(values > 0)
    return Residuals(
        values[rows], frame[rows], segment[rows], points[rows],
        np.einsum("ni,nij->nj", gradient[rows], slope[rows]), np.arange(len(rows)),
    )  # fmt: skip


def match_residuals(observations: Observations, capsules: Capsules, pose: RootPose) -> Residuals:
    """Where a matched point moves with the surface minus where it was matched, px.

    The point on the surface counts as constant while the pose changes.
    """
    matches = observations.matches
    axes, at = place_capsules(capsules, pose), matches.frame
    lines = SightLines(sight_directions(matches.start, observations.camera), at)
    hits = _first_hits(find_closest_points(lines, axes), axes.radii)
    rows = np.flatnonzero(np.isfinite(hits.depth))
    at, segment = at[rows], capsules.segment[hits.capsule[rows]]
    surface = hits.depth[rows, None] * lines.directions[rows] - pose.origins[at, segment]
    local = np.einsum("nji,nj->ni", pose.rotations[at, segment], surface)
    moved = np.einsum("nij,nj->ni", pose.rotations[at + 1, segment], local)
    points = pose.origins[at + 1, segment] + moved
    pixels, slope = project(points, observations.camera)
    return pair_rows(pixels - matches.end[rows], slope, points, at + 1, segment)


@dataclass(frozen=True, eq=False)
class SightLines:
    """Lines of sight from the camera's centre, in the order of their frames."""

    directions: Vectors
    frame: Int[np.ndarray, "n"]


@dataclass(frozen=True, eq=False)
class CapsuleAxes:
    """All capsules in camera axes."""

    starts: Float[np.ndarray, "T Q 3"]
    ends: Float[np.ndarray, "T Q 3"]
    radii: Float[np.ndarray, "Q 2"]


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """Where lines of sight pass capsules."""

    place: Float[np.ndarray, "n Q"]
    """q: share of the way along each axis at which the surface is nearest."""
    distance: Float[np.ndarray, "n Q"]
    """From there to the surface, metres; negative inside."""
    start: Float[np.ndarray, "n Q"]
    """How far along the line of sight each axis begins, metres."""
    way: Float[np.ndarray, "n Q"]
    """How far along it the axis leads from there, metres."""


@dataclass(frozen=True, eq=False)
class _Hits:
    """What lines of sight meet first."""

    capsule: Int[np.ndarray, "n"]
    depth: Float[np.ndarray, "n"]
    """Along the line, metres; infinite where it meets nothing."""


def sight_directions(pixels: Float[np.ndarray, "n 2"], camera: Camera) -> Vectors:
    """Unit directions from the camera's centre through pixels."""
    ways = np.concatenate(
        [(pixels - camera.principal) / camera.focal, np.ones((len(pixels), 1))], axis=1
    )
    return unit_vectors(ways)


def place_capsules(capsules: Capsules, pose: RootPose) -> CapsuleAxes:
    """Both ends of all capsules of a pose."""
    origin, turn = pose.origins[:, capsules.segment], pose.rotations[:, capsules.segment]
    return CapsuleAxes(
        origin + (turn @ capsules.start[..., None])[..., 0],
        origin + (turn @ capsules.end[..., None])[..., 0],
        capsules.radii,
    )


def find_closest_points(lines: SightLines, axes: CapsuleAxes) -> ClosestPoints:
    """Where along each axis a line of sight is nearest to the surface, and how near it is there.

    With e^2 = h^2 + g u^2, u counted from where the axis is nearest to the line, the slope of e - r
    vanishes at u = k h / sqrt(g (g - k^2)), k the change of the radius along the axis. All squares
    follow from how far both vectors go along the line.
    """
    starts, radii = axes.starts, axes.radii
    ways = axes.ends - starts
    first, along = _along(lines, starts), _along(lines, ways)
    long, both, away = _dot(ways, ways), _dot(starts, ways), _dot(starts, starts)
    radius, k = (values.astype(np.float32) for values in (radii[:, 0], np.diff(radii)[:, 0]))

    def pass_some(some: slice) -> tuple[np.ndarray, np.ndarray]:
        frame = lines.frame[some]
        # Differences of squares need doubles, their roots to a tenth of a millimetre do not.
        g = np.maximum(long[frame] - along[some] ** 2, 1e-12).astype(np.float32)
        slope = (both[frame] - first[some] * along[some]).astype(np.float32)
        square = (away[frame] - first[some] ** 2).astype(np.float32)
        h = np.sqrt(np.maximum(square - slope**2 / g, 0.0))
        slant = k * h / np.sqrt(g * np.maximum(g - k**2, np.float32(1e-12)))
        q = np.clip(slant - slope / g, 0.0, 1.0)
        reach = np.sqrt(np.maximum(square + q * (2 * slope + q * g), 0.0))
        return q, reach - (radius + q * k)

    parts = [slice(a, a + LINES_AT_ONCE) for a in range(0, max(1, len(first)), LINES_AT_ONCE)]
    done = list(side_by_side(pass_some, parts) if len(parts) > 1 else map(pass_some, parts))
    place, distance = (np.concatenate(of_parts) for of_parts in zip(*done, strict=True))
    return ClosestPoints(place, distance, first, along)


def _along(lines: SightLines, vectors: Float[np.ndarray, "T Q 3"]) -> Float[np.ndarray, "n Q"]:
    """How far the vectors of each line's frame go along it."""
    bounds = np.searchsorted(lines.frame, np.arange(len(vectors) + 1))
    parts = [
        lines.directions[a:b] @ of_frame.T
        for a, b, of_frame in zip(bounds, bounds[1:], vectors, strict=False)
    ]
    return np.concatenate(parts)


def _dot(
    one: Float[np.ndarray, "T Q 3"], other: Float[np.ndarray, "T Q 3"]
) -> Float[np.ndarray, "T Q"]:
    return np.einsum("tqi,tqi->tq", one, other)


def _first_hits(passing: ClosestPoints, radii: Float[np.ndarray, "Q 2"]) -> _Hits:
    """The capsule that each line of sight meets first."""
    q, distance = passing.place, passing.distance
    radius = radii[:, 0] + q * (radii[:, 1] - radii[:, 0])
    inside = np.sqrt(np.maximum(radius**2 - (distance + radius) ** 2, 0.0))
    depth = np.where(distance < 0, passing.start + q * passing.way - inside, np.inf)
    first = depth.argmin(axis=1)
    return _Hits(first, depth[np.arange(len(depth)), first])


def _reject(vectors: Vectors, ways: Vectors) -> Vectors:
    """The part of vectors square to directions."""
    return vectors - np.einsum("ni,ni->n", vectors, ways)[:, None] * ways


def sample_distance(
    stack: Float[np.ndarray, "T h w"], pixels: Float[np.ndarray, "T n 2"]
) -> tuple[Float[np.ndarray, "m"], Float[np.ndarray, "m 2"]]:
    """Values of each frame's distance picture between its pixels, and their slopes."""
    last = np.array(stack.shape[:0:-1]) - 1.0
    at = np.clip((pixels - (SILHOUETTE_STEP - 1) / 2) / SILHOUETTE_STEP, 0.0, last)
    low = np.minimum(at, last - 1).astype(int)
    (x, y), (fx, fy) = np.moveaxis(low, 2, 0), np.moveaxis(at - low, 2, 0)
    frame = np.arange(len(stack))[:, None]
    (a, b), (c, d) = [[stack[frame, y + j, x + i].astype(float) for i in (0, 1)] for j in (0, 1)]
    value = (1 - fy) * ((1 - fx) * a + fx * b) + fy * ((1 - fx) * c + fx * d)
    slope = np.stack([(1 - fy) * (b - a) + fy * (d - c), (1 - fx) * (c - a) + fx * (d - b)], axis=2)
    return value.ravel(), slope.reshape(-1, 2) / SILHOUETTE_STEP


def _no_residuals() -> Residuals:
    nothing, no_rows = np.zeros(0), np.zeros((0, 3))
    none = np.zeros(0, int)
    return Residuals(nothing, none, none, no_rows, no_rows, none)
