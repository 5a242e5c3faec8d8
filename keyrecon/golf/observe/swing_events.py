"""Swing event detection: when the hands of a fitted swing leave, turn round and come to rest.

At first the club tells the key postures (`swing_timing`). Once a swing is fitted, the picture tells
when the hands leave their rest at address and find one at the finish. A swing begins and ends where
the hands are slower than a small share of their peak speed: so it is measured in captures
(`prior.key_postures`), and so it is here. Near its ends a fitted motion hardly moves and tells
little of the time; but slow hands are tracked by optical flow to a tenth of a pixel (Lucas and
Kanade on pyramids, checked forward and backward). How much of their speed the line of sight hides,
the fitted swing tells: filmed down the line, hands leave their address towards the camera. The top
is amid the time in which its hands turn round: one player's posture of the top is another's on the
way down.

Constants were chosen on rendered swings; see benchmarks/golf.py.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from jaxtyping import Float, UInt8
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from keyrecon.golf.observe.swing_timing import order_keys
from keyrecon.golf.prior.key_postures import REST_SPEED, SMOOTH
from keyrecon.golf.records import FittedSwing, Observations
from keyrecon.io.video import Video
from keyrecon.numerics.picture_points import track_there_and_back
from keyrecon.ranges import within

FEWEST_POINTS = 3
"""Points that tell a movement, at least."""


@dataclass(frozen=True)
class SwingEventOptions:
    """How resting hands are detected; lengths in player heights, times in seconds."""

    around: Annotated[float, within(0.007, 3)] = 0.15
    """How much earlier or later than fitted the swing may begin or end."""
    hands: Annotated[float, within(0.002, 0.8)] = 0.04
    """Radius around the fitted hands in which points are tracked."""
    grid: Annotated[float, within(0.0004, 0.2)] = 0.008
    """Distance between these points."""
    player: Annotated[float, within(0.001, 0.4)] = 0.02
    """Distance from a sample of the player's mask within which a point is on the player."""
    patch: Annotated[float, within(0.002, 0.6)] = 0.03
    """Side of the patch by which a point is tracked."""
    return_error: Annotated[float, within(0.0002, 0.08)] = 0.004
    """A point that is not back within this, tracked forward and then backward, is lost."""
    direction: Annotated[float, within(0.005, 2)] = 0.1
    """Time over which the fitted hands tell how much of their speed the picture shows."""
    quiet: Annotated[float, within(0.001, 1)] = 0.2
    """Share of the peak speed that fitted hands may have where they rest: filmed along their way,
    moving hands seem to rest too."""
    least: Annotated[float, within(0.0001, 1)] = 0.01
    """Share of the peak speed below which all is rest: a player sways, a picture has noise."""


@dataclass(frozen=True, eq=False)
class _HandTracks:
    """Hands of a fitted swing, and the player around them."""

    hands: Float[np.ndarray, "T 2"]
    """px"""
    player: tuple[Float[np.ndarray, "_ 2"], ...]
    """Samples of the player's mask in every frame."""
    height: float
    """Of the player, px."""


def detect_swing_events(
    video: Video,
    observations: Observations,
    fitted: FittedSwing,
    options: SwingEventOptions = SwingEventOptions(),
) -> Float[np.ndarray, "4"]:
    """Key postures of a fitted swing, all but the hit anew."""
    fps, (start, top, hit, finish) = video.fps, fitted.keys
    height, reach, last = observations.height, round(options.around * fps), len(video) - 1
    early, late = (
        slice(max(0, round(k) - reach), min(last, round(k) + reach) + 1) for k in (start, finish)
    )
    tracks = _HandTracks(fitted.club2d[:, 0], observations.foreground, height)
    speeds = _hand_speeds(video, tracks, (early, late), options)
    step, expected = round(options.direction * fps), _fitted_speed(fitted, fps)
    top = _turning_point(expected, top, TOP_AROUND * (hit - top))
    for speed, part in zip(speeds, (early, late), strict=True):
        speed[expected[part] > options.quiet * expected.max()] = np.inf
    leaving = expected.max() * _resting_share(fitted, start, start + step, height, options)
    stopping = expected.max() * _resting_share(fitted, finish - step, finish, height, options)
    start = early.start + _last_rest(speeds[0], leaving)
    finish = late.start + _first_of_slowest(speeds[1], stopping)
    return order_keys(np.array([start, top, hit, finish], float))


TOP_AROUND = 0.5
"""Downswings around the fitted top within which the hands turn round: the model's posture of the
top comes up to .3 downswings after they do."""
TURNING_SPEED = 0.15
"""Share of their peak speed below which hands turn round. Tops of five real swings, four of them
at half the size, and four rendered ones were off by 1.1 thirtieths of a second (root mean square,
2.2 at most) by the model's posture, 1.1 (3.5) by the slowest hands, .4 (1.0) by the middle of the
time below .1 of their peak speed, .3 (.7) below .15."""


def _turning_point(speed: Float[np.ndarray, "T"], key: float, around: float) -> float:
    """Middle of the time around a key posture in which hands are slow, frames."""
    first, last = (int(np.clip(round(key + s * around), 0, len(speed) - 1)) for s in (-1, 1))
    near = speed[first : last + 1]
    slowest = int(near.argmin())
    fast = np.flatnonzero(near > max(TURNING_SPEED * float(speed.max()), float(near[slowest])))
    before, after = fast[fast < slowest], fast[fast > slowest]
    begun = before[-1] + 1 if len(before) else 0
    ended = after[0] - 1 if len(after) else len(near) - 1
    return first + float(begun + ended) / 2


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
    fitted: FittedSwing, first: float, last: float, height: float, options: SwingEventOptions
) -> float:
    """Share of the peak speed below which hands rest, as far as the picture shows it."""
    one, other = np.clip(np.round((first, last)).astype(int), 0, len(fitted.club) - 1)
    real = np.linalg.norm(fitted.club[other, 0] - fitted.club[one, 0]) / fitted.body.stature
    shown = np.linalg.norm(fitted.club2d[other, 0] - fitted.club2d[one, 0]) / height
    return max(REST_SPEED * float(shown / max(float(real), 1e-9)), options.least)


def _hand_speeds(
    video: Video, tracks: _HandTracks, parts: tuple[slice, slice], options: SwingEventOptions
) -> list[Float[np.ndarray, "_"]]:
    """Speed of the hands in the picture in parts of the video, heights per second."""
    steps = np.full((len(tracks.hands), 2), np.nan)
    wanted = sorted({t for part in parts for t in range(part.start, part.stop)})
    greys = (np.ascontiguousarray(picture) for picture in video.grey_frames(set(wanted)))
    for (t, before), (following, after) in pairwise(zip(wanted, greys, strict=True)):
        if following == t + 1:
            points = _points_on_hands(tracks, t, options)
            steps[t] = _find_step(before, after, points, tracks.height, options)
    return [_speed(steps[part.start : part.stop - 1], video.fps) for part in parts]


def _speed(steps: Float[np.ndarray, "n 2"], fps: float) -> Float[np.ndarray, "m"]:
    """Speed at every frame from the steps between them; unknown steps are fast ones."""
    between = np.nan_to_num(np.linalg.norm(steps, axis=1) * fps, nan=1.0)
    smooth = gaussian_filter1d(between, SMOOTH * fps, mode="nearest")
    return (np.append(smooth[:1], smooth) + np.append(smooth, smooth[-1:])) / 2


def _points_on_hands(
    tracks: _HandTracks, frame: int, options: SwingEventOptions
) -> Float[np.ndarray, "m 2"]:
    """Points of a grid around the hands that are on the player, px."""
    hands, player, height = tracks.hands[frame], tracks.player[frame], tracks.height
    side = np.arange(-options.hands, options.hands + options.grid / 2, options.grid)
    grid = np.stack(np.meshgrid(side, side), axis=2).reshape(-1, 2)
    points = hands + height * grid[np.linalg.norm(grid, axis=1) <= options.hands]
    return points[cKDTree(player).query(points)[0] < options.player * height]


def _find_step(
    before: UInt8[np.ndarray, "h w"],
    after: UInt8[np.ndarray, "h w"],
    points: Float[np.ndarray, "n 2"],
    height: float,
    options: SwingEventOptions,
) -> Float[np.ndarray, "2"]:
    """Median movement of points from one picture to the next, heights; NaN where they are lost."""
    if len(points) < FEWEST_POINTS:
        return np.full(2, np.nan)
    side = max(5, round(options.patch * height)) | 1
    start = points.astype(np.float32)[:, None]
    there, off, tracked = track_there_and_back(before, after, start, side)
    kept = tracked & (off < options.return_error * height)
    if kept.sum() < FEWEST_POINTS:
        return np.full(2, np.nan)
    return np.median((there - start)[kept, 0], axis=0) / height
