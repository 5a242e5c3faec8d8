"""How far a fitted downswing runs ahead of the picture, or behind it.

A fit is drawn to masks, club and tracks, and where these fail (arms of the scene's colour, a club
that nobody sees) nothing that it was drawn to can tell that it is early or late. What changes from
one picture to the next can: in the downswing that is the arms and the club. Where they are
expected to change it is drawn for every time around a frame; the time at which this agrees best
with what did change, over all frames from the top to the hit, tells the shift (normalised
cross-correlation, as template matching has it, with the time for the only unknown). Forearms are
compared alone, and with the club: that which is farther off counts.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int

from keyrecon.body import LSP14
from keyrecon.golf.records import FittedSwing
from keyrecon.io.frame_reader import reduce_picture
from keyrecon.io.video import Video

PLAYER_PIXELS = 100.0
"""Height of the player in the pictures that are compared, px: a hand is four pixels wide."""
NOISE, MOST_CHANGE = 6.0, 30.0
"""Grey levels by which pixels change where nothing moves, and beyond which a change is just that:
a shirt before a hedge is no surer than one before a lawn."""
SOFT = 2.0
"""Standard deviation by which changes are smoothed, px of these pictures: half a hand."""
ARM, CLUB = 5, 3
"""Widths of drawn forearms and clubs, px of these pictures."""
SUBFRAMES = 5
"""Times at which what moves between two frames is drawn."""
AFTER = 0.1
"""How far beyond the hit the comparison goes, downswings: arms and club are fastest there."""
REACH = 0.6
"""Shifts that are tried either way, downswings."""
FINEST = 16
"""Shifts in a downswing at least: of few frames parts are tried."""
LEAST_DRAWN = 0.02
"""Share of a drawn pixel from which on a place may be one of arms or club."""
FEWEST = 4
"""Frames that tell a shift, at least."""
SIDES = ("left", "right")
CHAINS = [[LSP14.index(f"{side}_{joint}") for joint in ("elbow", "wrist")] for side in SIDES]


@dataclass(frozen=True)
class TimeShift:
    """How far a fitted downswing is off in time."""

    frames: float
    """By which the fit runs ahead of the pictures; negative where it is behind."""
    downswings: float
    """The same in lengths of the downswing."""
    agreement: float
    """Correlation of what changes in the pictures with what the fit has change, NaN if unknown."""
    best: float
    """The same after the shift."""


UNKNOWN_SHIFT = TimeShift(0.0, 0.0, np.nan, np.nan)
"""Where nothing tells the shift."""


def measure_time_shift(video: Video, fitted: FittedSwing, height: float) -> TimeShift:
    """The shift at which a fitted downswing agrees best with what changes in the pictures.

    `height` is that of the player, px. Unknown where the film has fewer than `FEWEST` frames of it.
    """
    _, top, hit, _ = fitted.keys
    down = float(hit - top)
    if not np.isfinite(down) or down <= 0:
        return UNKNOWN_SHIFT
    last = min(len(video) - 2, int(np.floor(hit + AFTER * down)))
    frames = np.arange(max(0, int(np.ceil(top))), last + 1)
    if len(frames) < FEWEST:
        return UNKNOWN_SHIFT
    shrink = min(1.0, PLAYER_PIXELS / height)
    observed = _observe_changes(video, frames, max(16, round(video.width * shrink)))
    parts = max(1, int(np.ceil(FINEST / down)))
    reach = round(REACH * down * parts)
    times = np.arange(frames[0] * parts - reach, frames[-1] * parts + reach + 1) / parts
    drawn = [
        _draw_change(fitted, time, observed.shape[2] / video.width, observed.shape[1:])
        for time in times
    ]
    shifts = (
        _best_shift(observed, np.stack(of_part), parts, reach)
        for of_part in zip(*drawn, strict=True)
    )
    ahead, before, best = max(shifts, key=lambda found: abs(found[0]))
    return TimeShift(ahead, ahead / down, before, best)


def _best_shift(
    observed: Float[np.ndarray, "n h w"],
    expected: Float[np.ndarray, "m h w"],
    parts: int,
    reach: int,
) -> tuple[float, float, float]:
    """Frames by which expected changes come too early, and correlations before and after a shift.

    The expected ones are `parts` times as many per frame, and begin `reach` earlier.
    """
    inside = expected.max(axis=0) > LEAST_DRAWN
    ours, theirs = (_normalise(pictures[:, inside]) for pictures in (observed, expected))
    place = reach + parts * np.arange(len(observed))
    shifts = np.arange(-reach, reach + 1)
    agreement = np.array([(ours * theirs[place + k]).sum(axis=1).mean() for k in shifts])
    best = int(agreement.argmax())
    # Pictures that show what the fit has later are those that the fit is behind.
    return -float(shifts[best]) / parts, float(agreement[reach]), float(agreement[best])


def _observe_changes(
    video: Video, frames: Int[np.ndarray, "n"], width: int
) -> Float[np.ndarray, "n h w"]:
    """By how much reduced pictures change from each of some frames to the next."""
    wanted = set(range(int(frames[0]), int(frames[-1]) + 2))
    small = np.stack([
        cv2.GaussianBlur(reduce_picture(np.ascontiguousarray(grey), width), (0, 0), SOFT / 2)
        for grey in video.grey_frames(wanted)
    ]).astype(np.float32)  # fmt: skip
    change = np.clip(np.abs(np.diff(small, axis=0)) - NOISE, 0.0, MOST_CHANGE)
    return np.stack([cv2.GaussianBlur(picture, (0, 0), SOFT) for picture in change])


def _draw_change(
    fitted: FittedSwing, time: float, shrink: float, shape: tuple[int, int]
) -> tuple[Float[np.ndarray, "h w"], Float[np.ndarray, "h w"]]:
    """Forearms of a fit on their way from a time to a frame later; and these with the club."""
    arms, both = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    for at in np.linspace(time, time + 1, SUBFRAMES):
        joints = _between(fitted.motion.points2d, at)
        for chain in CHAINS:
            _draw_line(arms, joints[chain], shrink, ARM)
        _draw_line(both, _between(fitted.club2d, at), shrink, CLUB)
    both = np.maximum(both, arms)
    return cv2.GaussianBlur(arms, (0, 0), SOFT), cv2.GaussianBlur(both, (0, 0), SOFT)


def _between(points: Float[np.ndarray, "T n 2"], time: float) -> Float[np.ndarray, "n 2"]:
    """Points at a time between frames."""
    inside = min(max(time, 0.0), len(points) - 1.0)
    low = min(int(inside), len(points) - 2)
    share = inside - low
    return (1 - share) * points[low] + share * points[low + 1]


def _draw_line(
    picture: Float[np.ndarray, "h w"], ends: Float[np.ndarray, "2 2"], shrink: float, width: int
) -> None:
    """A line between two places of the video, to an eighth of a pixel."""
    places = np.rint(8 * ((ends + 0.5) * shrink - 0.5)).astype(int).tolist()
    cv2.line(picture, tuple(places[0]), tuple(places[1]), 1.0, width, cv2.LINE_8, 3)


def _normalise(pictures: Float[np.ndarray, "n p"]) -> Float[np.ndarray, "n p"]:
    """Pictures of mean 0 and length 1."""
    centred = pictures - pictures.mean(axis=1, keepdims=True)
    return centred / np.maximum(np.linalg.norm(centred, axis=1, keepdims=True), 1e-6)
