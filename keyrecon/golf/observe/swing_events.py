"""When a filmed swing passes its key postures (CVPR 2005, Section 5.1, Fig. 7).

At first the club tells. From whatever side a swing is filmed, the hands go up, down to the ball and
up again: the hit is the lowest place between two high ones that follow one another within a second
or so. Around this triple lie the four key postures: the top is amid the time for which the hands
are highest, the hit where the club is nearest to how it lay at address, the upswing begins where
the club leaves the place where it rested before, and the finish is where it first rests after the
hit. The normalised time of every frame follows by monotone interpolation (Fritsch and Carlson's
PCHIP; a free spline overshoots at the top, where the pace changes threefold).

Once a swing is fitted, the picture tells when the hands leave their rest at address and find one at
the finish. A swing begins and ends where the hands are slower than a small share of their peak
speed: so it is measured in captures (`prior.key_postures`), and so it is here. Near its ends a
fitted motion hardly moves and tells little of the time; but slow hands are tracked by optical flow
to a tenth of a pixel (Lucas and Kanade on pyramids, checked forward and backward). How much of
their speed the line of sight hides, the fitted swing tells: filmed down the line, hands leave their
address towards the camera. The top is amid the time in which its hands turn round: one player's
posture of the top is another's on the way down.

Constants were chosen on rendered swings; see benchmarks/golf.py.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from jaxtyping import Float, UInt8
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from keyrecon.errors import KeyreconError
from keyrecon.golf.observe.club import Club
from keyrecon.golf.prior.key_postures import REST_SPEED, SMOOTH
from keyrecon.golf.records import FittedSwing, Observations
from keyrecon.io.video import Video
from keyrecon.numerics.picture_points import track_there_and_back
from keyrecon.ranges import within

LARGEST_NOISE = 0.15
"""What is farther from the address, player heights, is no noise."""
HIT_WINDOW = 0.15
"""Seconds around the lowest hands in which the ball is hit."""
FEWEST_POINTS = 3
"""Points that tell a movement, at least."""


@dataclass(frozen=True)
class TimingOptions:
    """How a swing is recognised; lengths in player heights, times in seconds."""

    upswing: Annotated[float, within(0.06, 20)] = 1.2
    """Longest time from the top to the hit, seconds.

    Slowed down threefold at most.
    """
    finish: Annotated[float, within(0.08, 30)] = 1.6
    """Longest time from the hit to the highest hands of the finish, seconds."""
    rise: Annotated[float, within(0, 3)] = 0.15
    """Height by which the hands must rise before and after the hit, player heights."""
    valley: Annotated[float, within(0, 1)] = 0.05
    """Hands no more than this below the highest ones are still at the top, player heights."""
    smooth: Annotated[float, within(0.001, 1)] = 0.03
    """How strongly the path of the hands is smoothed, seconds.

    Standard deviation of the low-pass.
    """
    address: Annotated[float, within(0, 0.6)] = 0.03
    """Movement of hands and head together from which the swing has begun, player heights."""
    rest: Annotated[float, within(0.001, 1)] = 0.1
    """Speed at which the swing is finished, as a share of its fastest.

    The club sways on behind resting hands.
    """
    pause: Annotated[float, within(0, 5)] = 0.05
    """Seconds for which it must rest there.

    Many let it sink at once.
    """


def find_key_frames(
    club: Club, height: float, fps: float, options: TimingOptions = TimingOptions()
) -> Float[np.ndarray, "4"]:
    """Frames of the four key postures, the hit between frames; `height` of the player in px.

    Raises KeyreconError where the hands do not move as in a swing.
    """
    ends = gaussian_filter1d(_fill(club.ends), options.smooth * fps, axis=0)
    hands = ends[:, 0] / height
    top, low = _find_lowest(hands[:, 1], fps, options)
    top = _middle_of_height(hands[:, 1], top, low, round(options.upswing * fps), options.valley)
    speed = np.linalg.norm(np.gradient(ends, 1 / fps, axis=0), axis=2).sum(axis=1) / height
    start = _last_at_address(ends / height, top, low, options.address)
    hit = _return_to_address(club.ends, ends[start], top, low, fps)
    resting = speed < options.rest * speed[top:].max()
    finish = _first_rest(resting, speed, round(hit), round(options.pause * fps))
    return order_keys(np.array([start, top, hit, finish], float))


def refine_key_frames(
    club: Club,
    keys: Float[np.ndarray, "4"],
    height: float,
    fps: float,
    options: TimingOptions = TimingOptions(),
) -> Float[np.ndarray, "4"]:
    """Key postures by the club, near those of a hypothesis about the swing."""
    ends = gaussian_filter1d(_fill(club.ends), options.smooth * fps, axis=0)
    hands, last = ends[:, 0] / height, len(ends) - 1
    top, hit = keys[1:3]
    down = hit - top
    early, late = (int(np.clip(round(hit - s * down), 0, last - 2)) for s in TOP_WINDOW)
    late = max(late, early + 1)
    top = early + _amid_valley(hands[early : late + 1, 1], options.valley)
    low = int(np.clip(round(hit), 1, last - 1))
    begin: float = _last_at_address(ends / height, int(top), low, options.address)
    down = hit - top
    begin = float(np.clip(begin, top - LONGEST_TEMPO * down, top - SHORTEST_TEMPO * down))
    begin = max(0.0, begin)
    back = _return_to_address(club.ends, ends[int(begin)], int(top), low, fps)
    if abs(back - hit) <= HIT_SHARE * down + 1:
        hit = back
    speed = np.linalg.norm(np.gradient(ends, 1 / fps, axis=0), axis=2).sum(axis=1) / height
    resting = speed < options.rest * speed[int(top) :].max()
    rest = _first_rest(resting, speed, round(min(hit, last - 1)), round(options.pause * fps))
    finish = float(np.clip(rest, hit + SHORTEST_FINISH * down, hit + LONGEST_FINISH * down))
    return order_keys(np.array([begin, top, hit, finish], float))


TOP_WINDOW = (1.7, 0.4)
"""The top lies so many downswings before the hit, at most and at least, whatever was supposed."""
HIT_SHARE = 0.35
"""Share of the downswing by which the club may move the hit."""
SHORTEST_TEMPO, LONGEST_TEMPO = 1.2, 6.0
"""Upswing to downswing."""
SHORTEST_FINISH, LONGEST_FINISH = 1.0, 5.0
"""Follow-through to downswing."""


def _amid_valley(y: Float[np.ndarray, "n"], valley: float) -> float:
    """Middle of the time for which the hands are highest, around their highest frame."""
    highest = int(y.argmin())
    low = np.flatnonzero(y >= y[highest] + valley)
    first = max((k for k in low if k < highest), default=-1) + 1
    last = min((k for k in low if k > highest), default=len(y)) - 1
    return (first + last) / 2


def order_keys(keys: Float[np.ndarray, "4"]) -> Float[np.ndarray, "4"]:
    """Key postures a frame apart at least, around the top."""
    start, top, hit, finish = keys
    hit = max(hit, top + 1)
    return np.array([min(start, top - 1), top, hit, max(finish, hit + 1)], float)


def interpolate_times(
    keys: Float[np.ndarray, "4"], key_times: Float[np.ndarray, "4"], frames: int
) -> Float[np.ndarray, "T"]:
    """Normalised time of every frame; constant before the first and after the last key."""
    keys = order_keys(keys)
    inside = np.clip(np.arange(frames), keys[0], keys[-1])
    return PchipInterpolator(keys, key_times)(inside)


def keep_order(phase: Float[np.ndarray, "T"]) -> Float[np.ndarray, "T"]:
    """Normalised times that rise up to the finish, and after it may only fall."""
    last = int(phase.argmax())
    rising, falling = np.maximum.accumulate(phase[:last]), np.minimum.accumulate(phase[last:])
    return np.clip(np.concatenate([rising, falling]), 0, 1)


def _fill(ends: Float[np.ndarray, "T 2 2"]) -> Float[np.ndarray, "T 2 2"]:
    """Ends of the club with those before the first and after the last one held."""
    known = np.flatnonzero(np.isfinite(ends[:, 0, 0]))
    nearest = np.abs(np.arange(len(ends))[:, None] - known).argmin(axis=1)
    return ends[known[nearest]]


def _find_lowest(y: Float[np.ndarray, "T"], fps: float, options: TimingOptions) -> tuple[int, int]:
    """Frames of the high place before and of the low place, in the deepest dip of the hands."""
    before, after = round(options.upswing * fps), round(options.finish * fps)
    best, top_and_low = 0.0, (0, 0)
    for t in range(2, len(y) - 2):
        up = max(0, t - before)
        top = up + int(y[up:t].argmin())
        dip = min(y[t] - y[top], y[t] - y[t + 1 : t + after].min())
        if dip > best:
            best, top_and_low = dip, (top, t)
    if best < options.rise:
        raise KeyreconError(
            f"There is no swing in this video: the hands dip by only {best:.2f} player heights "
            f"between two high places, a swing by {options.rise:g} or more. Give a video with a "
            "whole swing, from the address to the finish."
        )
    return top_and_low


def _middle_of_height(
    y: Float[np.ndarray, "T"], top: int, low: int, before: int, valley: float
) -> int:
    """Middle of the time for which the hands are at the top: surer than their highest frame."""
    first = max(0, low - before)
    high = first + np.flatnonzero(y[first:low] < y[top] + valley)
    return round((high[0] + high[-1]) / 2)


def _last_at_address(ends: Float[np.ndarray, "T 2 2"], top: int, low: int, address: float) -> int:
    """Last frame before the top in which the club, in heights, still lies as it rested before it.

    It rested where most frames with the hands low agree; by how much they do not is noise.
    """
    down = ends[:top, 0, 1] > (ends[top, 0, 1] + ends[low, 0, 1]) / 2
    if not down.any():
        return 0
    frames, poses = np.flatnonzero(down), ends[:top][down]
    apart = np.linalg.norm(poses[:, None] - poses, axis=3).sum(axis=2)
    rest = int((apart < address).sum(axis=1).argmax())
    noise = float(np.median(apart[rest][apart[rest] < LARGEST_NOISE]))
    return int(frames[np.flatnonzero(apart[rest] <= address + noise)[-1]])


def _first_rest(resting: np.ndarray, speed: np.ndarray, hit: int, pause: int) -> int:
    """First frame after the hit of a club that goes on resting; else its slowest."""
    run = 0
    for t in range(hit, len(resting)):
        run = run + 1 if resting[t] else 0
        if run > pause:
            return t - pause
    return hit + max(1, int(speed[hit:].argmin()))


def _return_to_address(
    ends: Float[np.ndarray, "T 2 2"],
    address: Float[np.ndarray, "2 2"],
    top: int,
    low: int,
    fps: float,
) -> float:
    """When the shaft is nearest to how it lay at address, between frames if need be."""
    first = max(top + 1, low - round(HIT_WINDOW * fps))
    last = min(len(ends) - 1, low + round(HIT_WINDOW * fps))
    best, hit = np.inf, float(low)
    target = address[1] - address[0]
    for t in range(first, last):
        one, other = (ends[k, 1] - ends[k, 0] for k in (t, t + 1))
        step = other - one
        share = float(np.clip((target - one) @ step / max(step @ step, 1e-9), 0, 1))
        apart = float(np.linalg.norm(one + share * step - target))
        hands = (1 - share) * ends[t, 0] + share * ends[t + 1, 0]
        apart += float(np.linalg.norm(hands - address[0]))
        if apart < best:
            best, hit = apart, t + share
    return hit


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
