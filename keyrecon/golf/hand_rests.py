"""When the hands leave their rest at address and find one at the finish, told by the picture.

A swing begins and ends where the hands are slower than a small share of their peak speed: so it is
measured in captures (`keyposes`), and so it is here. Near its ends a fitted motion hardly moves and
tells little of the time; but slow hands are followed by optical flow to a tenth of a pixel (Lucas
and Kanade on pyramids, checked forward and backward). How much of their speed the line of sight
hides, the fitted swing tells: seen down the line, hands leave their address towards the camera.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from keyrecon.golf.keyposes import REST, SMOOTH
from keyrecon.golf.records import FittedSwing
from keyrecon.video import Video

FEWEST = 3
"""Points that tell a movement, at least."""


@dataclass(frozen=True)
class RestOptions:
    """How resting hands are told; lengths in player heights, times in seconds."""

    around: float = 0.15
    """How much earlier or later than fitted the swing may begin or end."""
    hands: float = 0.04
    """Radius around the fitted hands in which points are followed."""
    grid: float = 0.008
    """Distance between these points."""
    player: float = 0.02
    """Distance from a sample of the player's mask within which a point is on the player."""
    patch: float = 0.03
    """Side of the patch by which a point is found again."""
    slip: float = 0.004
    """A point that is not back within this, found forward and then backward, is lost."""
    direction: float = 0.1
    """Time over which the fitted hands tell how much of their speed is seen."""
    quiet: float = 0.2
    """Share of the peak speed that fitted hands may have where they rest: seen along their way,
    moving hands seem to rest too."""
    least: float = 0.01
    """Share of the peak speed below which all is rest: a player sways, a picture has noise."""


def time_rests(
    video: Video,
    player: tuple[Float[np.ndarray, "_ 2"], ...],
    fitted: FittedSwing,
    height: float,
    options: RestOptions = RestOptions(),
) -> Float[np.ndarray, "4"]:
    """Key postures of a fitted swing, the first and the last one anew.

    `player` are samples of the player's mask in every frame; `height` is that of the player in px.
    """
    fps, (start, top, hit, finish) = video.fps, fitted.keys
    reach, last = round(options.around * fps), len(video) - 1
    spans = [(max(0, round(k) - reach), min(last, round(k) + reach)) for k in (start, finish)]
    speeds = _hand_speeds(video, player, fitted.club_seen[:, 0] / height, (spans, height), options)
    span, expected = round(options.direction * fps), _fitted_speed(fitted, fps)
    for speed, (low, high) in zip(speeds, spans, strict=True):
        speed[expected[low : high + 1] > options.quiet * expected.max()] = np.inf
    ways = (start, start + span), (finish - span, finish)
    limits = [expected.max() * _resting_share(fitted, way, height, options) for way in ways]
    start = spans[0][0] + _last_rest(speeds[0], limits[0])
    finish = spans[1][0] + _first_of_slowest(speeds[1], limits[1])
    return np.array([min(start, top - 1), top, hit, max(finish, hit + 1)], float)


def _last_rest(speed: Float[np.ndarray, "n"], limit: float) -> int:
    """Last frame in which hands rest; the slowest where they never do."""
    resting = np.flatnonzero(speed < limit)
    return int(resting[-1] if len(resting) else speed.argmin())


def _first_of_slowest(speed: Float[np.ndarray, "n"], limit: float) -> int:
    """First frame of the rest in which hands are slowest."""
    slowest = int(speed.argmin())
    moving = np.flatnonzero(speed[:slowest] >= limit)
    return int(moving[-1]) + 1 if len(moving) else 0


def _fitted_speed(fitted: FittedSwing, fps: float) -> Float[np.ndarray, "T"]:
    """Speed of the fitted hands in space, heights per second."""
    hands = gaussian_filter1d(fitted.club[:, 0], SMOOTH * fps, axis=0) / fitted.body.stature
    return np.linalg.norm(np.gradient(hands, 1 / fps, axis=0), axis=1)


def _resting_share(
    fitted: FittedSwing, way: tuple[float, float], height: float, options: RestOptions
) -> float:
    """Share of the peak speed below which hands rest, as far as it is seen between two frames."""
    one, other = np.clip(np.round(way).astype(int), 0, len(fitted.club) - 1)
    real = np.linalg.norm(fitted.club[other, 0] - fitted.club[one, 0]) / fitted.body.stature
    seen = np.linalg.norm(fitted.club_seen[other, 0] - fitted.club_seen[one, 0]) / height
    return max(REST * float(seen / max(real, 1e-9)), options.least)


def _hand_speeds(
    video: Video,
    player: tuple[Float[np.ndarray, "_ 2"], ...],
    hands: Float[np.ndarray, "T 2"],
    where: tuple[list[tuple[int, int]], float],
    options: RestOptions,
) -> list[Float[np.ndarray, "_"]]:
    """Speed of the hands in the picture in spans of frames, heights per second."""
    spans, height = where
    steps = np.full((len(hands), 2), np.nan)
    before: UInt8[np.ndarray, "h w"] | None = None
    for t, picture in enumerate(video.grey_frames()):
        after = np.ascontiguousarray(picture)
        if before is not None and any(low < t <= high for low, high in spans):
            points = _points_on_hands(hands[t - 1] * height, player[t - 1], height, options)
            steps[t - 1] = _find_step(before, after, points, height, options)
        before = after
    return [_speed(steps[low:high], video.fps) for low, high in spans]


def _speed(steps: Float[np.ndarray, "n 2"], fps: float) -> Float[np.ndarray, "m"]:
    """Speed at every frame from the steps between them; unknown steps are fast ones."""
    between = np.nan_to_num(np.linalg.norm(steps, axis=1) * fps, nan=1.0)
    smooth = gaussian_filter1d(between, SMOOTH * fps, mode="nearest")
    return (np.append(smooth[:1], smooth) + np.append(smooth, smooth[-1:])) / 2


def _points_on_hands(
    hands: Float[np.ndarray, "2"],
    player: Float[np.ndarray, "n 2"],
    height: float,
    options: RestOptions,
) -> Float[np.ndarray, "m 2"]:
    """Points of a grid around the hands that are on the player, px."""
    side = np.arange(-options.hands, options.hands + options.grid / 2, options.grid)
    grid = np.stack(np.meshgrid(side, side), axis=2).reshape(-1, 2)
    points = hands + height * grid[np.linalg.norm(grid, axis=1) <= options.hands]
    return points[cKDTree(player).query(points)[0] < options.player * height]


def _find_step(
    before: UInt8[np.ndarray, "h w"],
    after: UInt8[np.ndarray, "h w"],
    points: Float[np.ndarray, "n 2"],
    height: float,
    options: RestOptions,
) -> Float[np.ndarray, "2"]:
    """Median movement of points from one picture to the next, heights; NaN where they are lost."""
    if len(points) < FEWEST:
        return np.full(2, np.nan)
    side = max(5, round(options.patch * height)) | 1
    start = points.astype(np.float32)[:, None]
    there, found, _ = cv2.calcOpticalFlowPyrLK(before, after, start, None, winSize=(side, side))
    back, again, _ = cv2.calcOpticalFlowPyrLK(after, before, there, None, winSize=(side, side))
    kept = (found.ravel() > 0) & (again.ravel() > 0)
    kept &= np.linalg.norm(back - start, axis=2).ravel() < options.slip * height
    if kept.sum() < FEWEST:
        return np.full(2, np.nan)
    return np.median((there - start)[kept, 0], axis=0) / height
