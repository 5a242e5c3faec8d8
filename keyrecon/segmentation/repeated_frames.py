"""Which frames show the picture of the one before: slow motion and conversions of frame rates.

Codecs never repeat a picture exactly. But where most frames change, one that hardly does among
frames that do shows nothing new.
"""

import numpy as np
from jaxtyping import Bool, Float, Int16

COMPARED_WIDTH = 240
"""Width of the pictures that are compared, px. The shares of `REPEATED` were measured at it."""
CHANGED = 99.7
"""Percentile of the changes of all pixels that stands for a frame's: an arm's share of a picture is
a few thousandths. The shares of `REPEATED` were measured with it."""
REPEATED = 0.3
"""A frame that changes by less than this share of what frames before and after it do repeats the
one before: .02 to .1 in clips with repeated frames, .5 and more in all others."""
NEXT = 8
"""Frames on either side of which one must change: a picture is shown seven times at most in the
clips at hand. On one side alone it would be the end of a rest."""
LEAST_CHANGE = 4.0
"""Grey levels; where frames around change by less, all are noise and none is dropped. As much as
the noise of video that a background is given (`MIN_SPREAD` of `foreground_model`)."""


def picture_change(one: Int16[np.ndarray, "h w"], other: Int16[np.ndarray, "h w"]) -> float:
    """By how much a picture differs from the one before where it does, grey levels."""
    return float(np.percentile(np.abs(one - other), CHANGED))


def find_repeats(change: Float[np.ndarray, "F"]) -> Bool[np.ndarray, "F"]:
    """Frames that show the picture of the one before, by how much each frame changes."""
    rank = np.arange(len(change))
    # Before the first frame and after the last anything may have been.
    known = np.concatenate([[np.inf], change[1:], [np.inf]])
    before = np.array([known[max(0, t - NEXT) : t + 1].max() for t in rank])
    after = np.array([known[t : t + NEXT + 1].max() for t in rank])
    around = np.minimum(before, after)
    low = (change < REPEATED * around) & (around > LEAST_CHANGE) & (rank > 0)
    # A pause is reached and left step by step, a repeated picture at once.
    for run in np.split(rank, np.flatnonzero(np.diff(low)) + 1):
        if low[run[0]]:
            beside = min(known[run[0] - 1], known[run[-1] + 1])
            low[run] = beside > LEAST_CHANGE and change[run].max() < REPEATED * beside
    return low & ~np.isinf(around)
