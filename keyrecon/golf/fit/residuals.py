"""The body as volumetric primitives: tapered capsules on the segments (CVPR 2005, Fig. 1).

Radii are those of an adult in clothes and scale with stature; breadths of chest and pelvis are made
of two capsules side by side.

Errors of joints and of the club in the picture (CVPR 2005, Section 4.2).

The distance of a projected joint to where it was tracked is taken as two coordinates: the same
square, and smooth at zero. The club pulls by its two ends, each across and along the shaft: where
the shaft lies is surer than where it ends.

Errors of the body's surface in the picture (CVPR 2005, Sections 4.1 and 4.3).

The surface is that of tapered capsules, points a + q d with radius r(q), q from 0 to 1. A line of
sight through the camera's centre with unit direction v passes them at the distance

    e(q) - r(q),        e(q) = |P (a + q d)|,        P = I - v v',

least where its slope by q vanishes or at an end. There it does not change with q to first order,
so its slope by the pose is that of a point fixed to the axis (envelope theorem). The foreground
pulls the nearest capsule over every pixel of the mask that no capsule covers; the reverse, a part
of the body outside of the mask, pulls by the mask's distance transform. Matched points of two
frames are carried by the surface that the first one lies on.
"""

import numpy as np
from jaxtyping import Float, Int

from keyrecon.body import LSP14
from keyrecon.golf.prior.kinematics import find_club, find_joints
from keyrecon.golf.prior.skeleton import CLUB, LENGTHS, NAMES, REST
from keyrecon.golf.records import (
    Body,
    Camera,
    Capsules,
    Observations,
    Residuals,
    RootPose,
    SwingMarks,
)
from keyrecon.numerics.geometry import unit_vectors

# segment, start and end (x, along, z in statures; along: share of the segment), radii in statures
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
called a joint differ. Added to the tracker's error, it keeps the fit from explaining them away."""


MARK = 3.0
"""Standard deviation of a person's mark, px."""


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
    """Projected joints minus those that a person marked, in standard deviations."""
    marks = observations.marks
    if marks is None:
        marks = SwingMarks(np.zeros(0, np.int64), np.zeros((0, len(LSP14.names), 2)))
    row, joint = np.nonzero(np.isfinite(marks.joints).all(axis=2))
    frame = marks.frames[row]
    points = find_joints(body, pose)[frame, joint]
    pixels, slope = project(points, observations.camera)
    spread = _total_spread(np.full(len(row), MARK), slope)
    values = (pixels - marks.joints[row, joint]) / spread[:, None]
    return pair_rows(values, slope / spread[:, None, None], points,
                     frame, body.joint_segment[joint])  # fmt: skip


def club_residuals(observations: Observations, body: Body, pose: RootPose) -> Residuals:
    """Projected minus seen ends of the club, across and along the shaft, standard deviations."""
    frame = np.flatnonzero(np.isfinite(observations.club).all(axis=(1, 2)))
    points = find_club(body, pose)[frame].reshape(-1, 3)
    seen = observations.club[frame]
    pixels, slope = project(points, observations.camera)
    along = unit_vectors(seen[:, 1] - seen[:, 0], 1e-9)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    axes = np.repeat(np.stack([across, along], axis=1), 2, axis=0)
    spreads = np.repeat(observations.club_spread[frame], 2), observations.club_along[frame].ravel()
    total = np.stack([_total_spread(spread, slope) for spread in spreads], axis=1)
    axes = axes / total[..., None]
    values = np.einsum("nij,nj->ni", axes, pixels - seen.reshape(-1, 2))
    return pair_rows(values, axes @ slope, points, np.repeat(frame, 2),
                     np.full(len(points), CLUB))  # fmt: skip


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


NEAREST = 0.1
"""Metres before the camera within which nothing is filmed."""


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


Rows = Float[np.ndarray, "n 3"]
AXIS = (0.1, 0.5, 0.9)
"""Places along a capsule's axis that should lie in the mask."""
SILHOUETTE_SCALE = 4
"""Pixels of the video per pixel of the distance transforms."""


def foreground_residuals(
    observations: Observations, capsules: Capsules, pose: RootPose
) -> Residuals:
    """Distance from lines of sight through the mask to the body, metres; only those that miss."""
    frame = np.repeat(np.arange(len(pose.origins)), [len(f) for f in observations.foreground])
    pixels = np.concatenate([*observations.foreground, np.zeros((0, 2))])
    starts, ends = _place_capsules(capsules, pose)
    ways = sight_lines(pixels, observations.camera)
    q, distance = pass_capsules((ways, frame), starts, ends, capsules.radii)
    nearest = distance.argmin(axis=1)
    rows = np.flatnonzero(distance.min(axis=1) > 0)
    frame, nearest = frame[rows], nearest[rows]
    share = q[rows, nearest][:, None]
    point = (1 - share) * starts[frame, nearest] + share * ends[frame, nearest]
    across = _reject(point, ways[rows])
    return Residuals(
        distance[rows, nearest], frame, capsules.segment[nearest], point,
        unit_vectors(across, 0.0), np.arange(len(rows)),
    )  # fmt: skip


def silhouette_distance_residuals(
    observations: Observations, capsules: Capsules, pose: RootPose
) -> Residuals:
    """How far axes of the capsules project from the mask, px; only those outside of it."""
    if not observations.away:
        return _no_residuals()
    starts, ends = _place_capsules(capsules, pose)
    share = np.array(AXIS)[:, None]
    points = (1 - share) * starts[:, :, None] + share * ends[:, :, None]
    frames, number = points.shape[0], points.shape[1] * len(AXIS)
    frame = np.repeat(np.arange(frames), number)
    segment = np.tile(np.repeat(capsules.segment, len(AXIS)), frames)
    points = points.reshape(-1, 3)
    pixels, slope = project(points, observations.camera)
    values, gradient = _look_up(observations.away, pixels.reshape(frames, number, 2))
    rows = np.flatnonzero(values > 0)
    return Residuals(
        values[rows], frame[rows], segment[rows], points[rows],
        np.einsum("ni,nij->nj", gradient[rows], slope[rows]), np.arange(len(rows)),
    )  # fmt: skip


def match_residuals(observations: Observations, capsules: Capsules, pose: RootPose) -> Residuals:
    """Where the surface carries a matched point minus where it was found, px.

    The point on the surface counts as constant while the pose changes.
    """
    matches = observations.matches
    starts, ends = _place_capsules(capsules, pose)
    ways = sight_lines(matches.start, observations.camera)
    at = matches.frame
    q, distance = pass_capsules((ways, at), starts, ends, capsules.radii)
    hit, depth = _first_hit((ways, at), (starts, ends), q, distance, capsules.radii)
    rows = np.flatnonzero(np.isfinite(depth))
    at, segment = at[rows], capsules.segment[hit[rows]]
    surface = depth[rows, None] * ways[rows] - pose.origins[at, segment]
    local = np.einsum("nji,nj->ni", pose.rotations[at, segment], surface)
    carried = np.einsum("nij,nj->ni", pose.rotations[at + 1, segment], local)
    points = pose.origins[at + 1, segment] + carried
    pixels, slope = project(points, observations.camera)
    return pair_rows(pixels - matches.end[rows], slope, points, at + 1, segment)


def sight_lines(pixels: Float[np.ndarray, "n 2"], camera: Camera) -> Rows:
    """Unit directions from the camera's centre through pixels."""
    ways = np.concatenate(
        [(pixels - camera.principal) / camera.focal, np.ones((len(pixels), 1))], axis=1
    )
    return unit_vectors(ways)


def pass_capsules(
    lines: tuple[Rows, Int[np.ndarray, "n"]],
    starts: Float[np.ndarray, "T Q 3"],
    ends: Float[np.ndarray, "T Q 3"],
    radii: Float[np.ndarray, "Q 2"],
) -> tuple[Float[np.ndarray, "n Q"], Float[np.ndarray, "n Q"]]:
    """Where along each axis a line of sight is nearest to the surface, and how near it is there.

    `lines` are directions and their frames, in order. With e^2 = h^2 + g u^2, u counted from where
    the axis is nearest to the line, the slope of e - r vanishes at u = k h / sqrt(g (g - k^2)), k
    the change of the radius along the axis. All squares follow from how far both vectors go along
    the line.
    """
    frame, axes = lines[1], ends - starts
    first, along = _along(lines, starts), _along(lines, axes)
    g = np.maximum(_dot(axes, axes)[frame] - along**2, 1e-12)
    slope = _dot(starts, axes)[frame] - first * along
    square = _dot(starts, starts)[frame] - first**2
    h = np.sqrt(np.maximum(square - slope**2 / g, 0.0))
    k = radii[:, 1] - radii[:, 0]
    slant = k * h / np.sqrt(g * np.maximum(g - k**2, 1e-12))
    q = np.clip(slant - slope / g, 0.0, 1.0)
    reach = np.sqrt(np.maximum(square + q * (2 * slope + q * g), 0.0))
    return q, reach - (radii[:, 0] + q * k)


def _along(
    lines: tuple[Rows, Int[np.ndarray, "n"]], vectors: Float[np.ndarray, "T Q 3"]
) -> Float[np.ndarray, "n Q"]:
    """How far the vectors of each line's frame go along it."""
    ways, frame = lines
    bounds = np.searchsorted(frame, np.arange(len(vectors) + 1))
    parts = [ways[a:b] @ own.T for a, b, own in zip(bounds, bounds[1:], vectors, strict=False)]
    return np.concatenate(parts)


def _dot(
    one: Float[np.ndarray, "T Q 3"], other: Float[np.ndarray, "T Q 3"]
) -> Float[np.ndarray, "T Q"]:
    return np.einsum("tqi,tqi->tq", one, other)


def _first_hit(
    lines: tuple[Rows, Int[np.ndarray, "n"]],
    axes: tuple[Float[np.ndarray, "T Q 3"], Float[np.ndarray, "T Q 3"]],
    q: Float[np.ndarray, "n Q"],
    distance: Float[np.ndarray, "n Q"],
    radii: Float[np.ndarray, "Q 2"],
) -> tuple[Int[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """The capsule that a line of sight meets first and how far away; infinite where none."""
    radius = radii[:, 0] + q * (radii[:, 1] - radii[:, 0])
    inside = np.sqrt(np.maximum(radius**2 - (distance + radius) ** 2, 0.0))
    depth = (1 - q) * _along(lines, axes[0]) + q * _along(lines, axes[1]) - inside
    depth = np.where(distance < 0, depth, np.inf)
    first = depth.argmin(axis=1)
    return first, depth[np.arange(len(depth)), first]


def _place_capsules(
    capsules: Capsules, pose: RootPose
) -> tuple[Float[np.ndarray, "T Q 3"], Float[np.ndarray, "T Q 3"]]:
    """Ends of all axes in camera axes."""
    origin, turn = pose.origins[:, capsules.segment], pose.rotations[:, capsules.segment]
    return (
        origin + (turn @ capsules.start[..., None])[..., 0],
        origin + (turn @ capsules.end[..., None])[..., 0],
    )


def _reject(vectors: Rows, ways: Rows) -> Rows:
    """The part of vectors square to directions."""
    return vectors - np.einsum("ni,ni->n", vectors, ways)[:, None] * ways


def _look_up(
    pictures: tuple[Float[np.ndarray, "h w"], ...], pixels: Float[np.ndarray, "T n 2"]
) -> tuple[Float[np.ndarray, "m"], Float[np.ndarray, "m 2"]]:
    """Values of each frame's distance picture at its pixels, between its own, and their slopes."""
    stack = np.stack(pictures)
    last = np.array(stack.shape[:0:-1]) - 1.0
    at = np.clip((pixels - (SILHOUETTE_SCALE - 1) / 2) / SILHOUETTE_SCALE, 0.0, last)
    low = np.minimum(at, last - 1).astype(int)
    (x, y), (fx, fy) = np.moveaxis(low, 2, 0), np.moveaxis(at - low, 2, 0)
    frame = np.arange(len(stack))[:, None]
    (a, b), (c, d) = [[stack[frame, y + j, x + i] for i in (0, 1)] for j in (0, 1)]
    value = (1 - fy) * ((1 - fx) * a + fx * b) + fy * ((1 - fx) * c + fx * d)
    slope = np.stack([(1 - fy) * (b - a) + fy * (d - c), (1 - fx) * (c - a) + fx * (d - b)], axis=2)
    return value.ravel(), slope.reshape(-1, 2) / SILHOUETTE_SCALE


def _no_residuals() -> Residuals:
    nothing, no_rows = np.zeros(0), np.zeros((0, 3))
    none = np.zeros(0, int)
    return Residuals(nothing, none, none, no_rows, no_rows, none)
