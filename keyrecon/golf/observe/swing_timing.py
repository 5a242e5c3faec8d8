"""When a filmed swing passes its key postures (CVPR 2005, Section 5.1, Fig. 7), as the club tells.

From whatever side a swing is filmed, the hands go up, down to the ball and up again: the hit is the
lowest place between two high ones that follow one another within a second or so. Around this triple
lie the four key postures: the top is amid the time for which the hands are highest, the hit where
the club is nearest to how it lay at address, the upswing begins where the club leaves the place
where it rested before, and the finish is where it first rests after the hit. The normalised time of
every frame follows by monotone interpolation (Fritsch and Carlson's PCHIP; a free spline overshoots
at the top, where the pace changes threefold).

Once a swing is fitted, resting hands tell when it begins and ends (`swing_events`).

Constants were chosen on rendered swings; see benchmarks/golf.py.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from keyrecon.errors import KeyreconError
from keyrecon.golf.observe.club import Club
from keyrecon.ranges import within

LARGEST_NOISE = 0.15
"""What is farther from the address, player heights, is no noise."""
HIT_WINDOW = 0.15
"""Seconds around the lowest hands in which the ball is hit."""


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
    """Key postures by the club, near those of a hypothesis about the swing.

    Where the club was hardly detected on the way to the hit, they are those of the hypothesis.
    """
    on_the_way = club.detected[max(0, round(keys[0])) : max(0, round(keys[2])) + 1]
    if not len(on_the_way) or on_the_way.mean() < LEAST_DETECTED:
        return order_keys(keys)
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


LEAST_DETECTED = 0.25
"""Share of the frames from start to hit in which the club was detected, at least, for it to tell
the key postures, and for a fit not to be doubted: .47 to .96 in ten real swings. In one with .14,
thirtyfold slow motion of 374 lines, shafts that were none moved the top by three tenths of the
downswing and the finish from frame 787 to 500; joints within a fifth of the trunk rose from .41 to
.68 without them."""
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
    # One row of distances at a time: somebody may stand at address for minutes.
    rest = int(np.argmax([(_distances(poses, pose) < address).sum() for pose in poses]))
    apart = _distances(poses, poses[rest])
    noise = float(np.median(apart[apart < LARGEST_NOISE]))
    return int(frames[np.flatnonzero(apart <= address + noise)[-1]])


def _distances(
    poses: Float[np.ndarray, "N 2 2"], pose: Float[np.ndarray, "2 2"]
) -> Float[np.ndarray, "N"]:
    return np.linalg.norm(poses - pose, axis=2).sum(axis=1)


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
