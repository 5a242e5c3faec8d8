"""When a filmed swing passes its key postures, told by the club (CVPR 2005, Section 5.1, Fig. 9).

From whatever side a swing is filmed, the hands go up, down to the ball and up again: the hit is the
lowest place between two high ones that follow one another within a second or so. Around this
triple lie the four key postures: the top is where the hands turn round, the hit where the club is
nearest to how it lay at address, the upswing begins where the club last rested before the top, and
the finish is where it first rests after the hit. The normalised time of every frame follows by
monotone interpolation (Fritsch and Carlson's PCHIP; a free spline overshoots at the top, where the
pace changes threefold).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from keyrecon.errors import KeyreconError
from keyrecon.golf.club import Club


@dataclass(frozen=True)
class TimingOptions:
    """How a swing is recognised; lengths in player heights, times in seconds."""

    upswing: float = 1.2
    """Longest time from the top to the hit, slowed down threefold at most."""
    finish: float = 1.6
    """Longest time from the hit to the highest hands of the finish."""
    rise: float = 0.15
    """The hands must rise by this before and after the hit."""
    smooth: float = 0.03
    """Standard deviation of the low-pass."""
    rest: float = 0.07
    """Speed of a resting club as a share of its peak."""
    pause: float = 0.1
    """Time for which it must rest at the end."""


def find_keys(
    club: Club, height: float, fps: float, options: TimingOptions = TimingOptions()
) -> Float[np.ndarray, "4"]:
    """Frames of the four key postures, the hit between frames; `height` of the player in px.

    Raises KeyreconError where the hands do not move as in a swing.
    """
    ends = gaussian_filter1d(_fill(club.ends), options.smooth * fps, axis=0)
    hands = ends[:, 0] / height
    top, low = _find_lowest(hands[:, 1], fps, options)
    speed = np.linalg.norm(np.gradient(ends, 1 / fps, axis=0), axis=2).sum(axis=1) / height
    resting = speed < options.rest * speed[top:].max()
    start = _last_rest(resting, speed, top, round(options.pause * fps))
    hit = _return_to_address(club.ends, ends[start], (top, low), fps)
    finish = _first_rest(resting, speed, round(hit), round(options.pause * fps))
    return np.array([start, top, hit, finish], float)


def interpolate_times(
    keys: Float[np.ndarray, "4"], key_times: Float[np.ndarray, "4"], frames: int
) -> Float[np.ndarray, "T"]:
    """Normalised time of every frame; constant before the first and after the last key."""
    inside = np.clip(np.arange(frames), keys[0], keys[-1])
    return PchipInterpolator(keys, key_times)(inside)


def _fill(ends: Float[np.ndarray, "T 2 2"]) -> Float[np.ndarray, "T 2 2"]:
    """Ends of the club with those before the first and after the last one held."""
    known = np.flatnonzero(np.isfinite(ends[:, 0, 0]))
    nearest = np.abs(np.arange(len(ends))[:, None] - known).argmin(axis=1)
    return ends[known[nearest]]


def _find_lowest(y: Float[np.ndarray, "T"], fps: float, options: TimingOptions) -> tuple[int, int]:
    """Frames of the high place before and of the low place, in the deepest dip of the hands."""
    before, after = round(options.upswing * fps), round(options.finish * fps)
    best, found = 0.0, (0, 0)
    for t in range(2, len(y) - 2):
        up = max(0, t - before)
        top = up + int(y[up:t].argmin())
        dip = min(y[t] - y[top], y[t] - y[t + 1 : t + after].min())
        if dip > best:
            best, found = dip, (top, t)
    if best < options.rise:
        raise KeyreconError(
            f"There is no swing in this video: the hands dip by only {best:.2f} player heights "
            f"between two high places, a swing by {options.rise:g} or more. Give a video with a "
            "whole swing, from the address to the finish."
        )
    return found


def _last_rest(resting: np.ndarray, speed: np.ndarray, top: int, pause: int) -> int:
    """Last frame before the upswing of a club that rested for a while; else its slowest."""
    run = 0
    upswing = int(speed[: top + 1].argmax()) if top else 0
    for t in range(upswing, -1, -1):
        run = run + 1 if resting[t] else 0
        if run > pause:
            return t + pause
    return int(speed[: upswing + 1].argmin())


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
    around: tuple[int, int],
    fps: float,
) -> float:
    """When the shaft is nearest to how it lay at address, between frames if need be."""
    top, low = around
    first = max(top + 1, low - round(0.15 * fps))
    last = min(len(ends) - 1, low + round(0.15 * fps))
    best, hit = np.inf, float(low)
    target = address[1] - address[0]
    for t in range(first, last):
        one, other = (ends[k, 1] - ends[k, 0] for k in (t, t + 1))
        step = other - one
        share = float(np.clip((target - one) @ step / max(step @ step, 1e-9), 0, 1))
        apart = np.linalg.norm(one + share * step - target)
        hands = (1 - share) * ends[t, 0] + share * ends[t + 1, 0]
        apart += np.linalg.norm(hands - address[0])
        if apart < best:
            best, hit = apart, t + share
    return hit
