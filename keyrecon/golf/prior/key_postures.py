"""The four key postures of a captured swing (CVPR 2005, Fig. 2).

The hands move in lobes: away from the ball, down and through, with a rest at the top. The peak of
their speed lies in the downswing; the ball is hit near it, where the club head is back at its
place at address or, in a capture without a club, shortly after the hands are back at theirs. The
upswing begins where the hands last rest before the top, the finish is their first rest after the
ball.
"""

import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import gaussian_filter1d

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError

SMOOTH = 0.02
"""Seconds of low-pass on the hands."""
REST_SPEED = 0.05
"""Speed of resting hands as a share of their peak."""
DOWNSWING = (0.12, 0.8)
"""Seconds from the top to the peak of speed, shortest and longest."""
FASTEST = (2.0, 20.0)
"""Peak speeds of hands in a swing, m/s."""


LEAD = 0.025
"""Seconds from the hands' return to the club head's: at the hit they are ahead of the ball."""


def find_key_postures(
    joints: Float[np.ndarray, "T 14 3"], club: Float[np.ndarray, "T 2 3"] | None, fps: float
) -> Int[np.ndarray, "4"]:
    """Frames of the beginning of the upswing, the top, the ball hit and the finish.

    Raises KeyreconError when the hands do not move as in a swing.
    """
    wrists = [LSP14.index("right_wrist"), LSP14.index("left_wrist")]
    hands = gaussian_filter1d(joints[:, wrists].mean(axis=1), SMOOTH * fps, axis=0)
    speed = np.linalg.norm(np.gradient(hands, 1 / fps, axis=0), axis=1)
    peak = int(speed.argmax())
    before = slice(max(0, peak - round(DOWNSWING[1] * fps)), peak - round(DOWNSWING[0] * fps))
    if not FASTEST[0] < speed[peak] < FASTEST[1] or before.stop - before.start < 3:
        raise KeyreconError(
            f"There is no swing: the hands reach {speed[peak]:.1f} m/s in frame {peak} of "
            f"{len(joints)}; give captures of whole full swings."
        )
    top = before.start + int(speed[before].argmin())
    resting = speed < REST_SPEED * speed[peak]
    start = int(np.flatnonzero(resting[: _upswing_peak(speed, top, fps)])[-1:].sum())
    reach = round(0.1 * fps)
    if club is None:
        hit = min(_return(hands, start, peak, reach) + round(LEAD * fps), len(hands) - 1)
    else:
        hit = _return(club[:, 1], start, peak, reach)
    return np.array([start, top, hit, _finish(speed, resting, hit)])


def _upswing_peak(speed: Float[np.ndarray, "T"], top: int, fps: float) -> int:
    """Frame of the fastest hands of the upswing: within a second before the top."""
    first = max(0, top - round(fps))
    return first + int(speed[first : top + 1].argmax())


def _return(points: Float[np.ndarray, "T 3"], start: int, peak: int, reach: int) -> int:
    """Frame near the peak of speed in which a point is closest to its place at address."""
    near = slice(max(0, peak - reach), peak + reach + 1)
    return near.start + int(np.linalg.norm(points[near] - points[start], axis=1).argmin())


def _finish(speed: Float[np.ndarray, "T"], resting: np.ndarray, hit: int) -> int:
    """First rest after the hit, or where the hands are slowest."""
    rests = np.flatnonzero(resting[hit:])
    return hit + int(rests[0] if len(rests) else speed[hit:].argmin())
