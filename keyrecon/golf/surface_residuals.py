"""Errors of the body's surface in the picture (CVPR 2005, Sections 4.1 and 4.3).

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

from keyrecon.golf.point_residuals import pair_rows, project
from keyrecon.golf.records import Camera, Capsules, Observations, Pose, Residuals

Rows = Float[np.ndarray, "n 3"]
AXIS = (0.1, 0.5, 0.9)
"""Places along a capsule's axis that should lie in the mask."""
AWAY_SCALE = 4
"""Pixels of the video per pixel of the distance transforms."""


def foreground_residuals(observations: Observations, capsules: Capsules, pose: Pose) -> Residuals:
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
        across / np.linalg.norm(across, axis=1, keepdims=True), np.arange(len(rows)),
    )  # fmt: skip


def away_residuals(observations: Observations, capsules: Capsules, pose: Pose) -> Residuals:
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


def match_residuals(observations: Observations, capsules: Capsules, pose: Pose) -> Residuals:
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
    return ways / np.linalg.norm(ways, axis=1, keepdims=True)


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
    capsules: Capsules, pose: Pose
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
    at = np.clip((pixels - (AWAY_SCALE - 1) / 2) / AWAY_SCALE, 0.0, last)
    low = np.minimum(at, last - 1).astype(int)
    (x, y), (fx, fy) = np.moveaxis(low, 2, 0), np.moveaxis(at - low, 2, 0)
    frame = np.arange(len(stack))[:, None]
    (a, b), (c, d) = [[stack[frame, y + j, x + i] for i in (0, 1)] for j in (0, 1)]
    value = (1 - fy) * ((1 - fx) * a + fx * b) + fy * ((1 - fx) * c + fx * d)
    slope = np.stack([(1 - fy) * (b - a) + fy * (d - c), (1 - fx) * (c - a) + fx * (d - b)], axis=2)
    return value.ravel(), slope.reshape(-1, 2) / AWAY_SCALE


def _no_residuals() -> Residuals:
    nothing, no_rows = np.zeros(0), np.zeros((0, 3))
    none = np.zeros(0, int)
    return Residuals(nothing, none, none, no_rows, no_rows, none)
