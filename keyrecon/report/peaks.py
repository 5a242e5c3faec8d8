"""Peaks of a curve that stand out of what is around them.

The prominence of a peak is its height over the higher of the two lowest places to its left and
right, each sought as far as the curve is no higher than the peak. As `scipy.signal.find_peaks`,
whose import takes a quarter of a second.
"""

import numpy as np
from jaxtyping import Float, Int


def prominent_peaks(
    values: Float[np.ndarray, "n"], height: float, prominence: float
) -> Int[np.ndarray, "m"]:
    """Places of local maxima of at least some height and prominence; of flat ones the middle.

    Where the curve begins and ends is no peak.
    """
    starts = np.flatnonzero(np.diff(values, prepend=np.nan))
    stops = np.append(starts[1:], len(values))
    level = values[starts]
    rises = np.diff(level) > 0
    tops = 1 + np.flatnonzero(rises[:-1] & ~rises[1:])
    places = ((starts + stops - 1) // 2)[tops]
    high = places[values[places] >= height]
    kept = [at for at in high.tolist() if _prominence(values, at) >= prominence]
    return np.array(kept, dtype=int)


def _prominence(values: Float[np.ndarray, "n"], at: int) -> float:
    higher = np.flatnonzero(values > values[at])
    before, after = higher[higher < at], higher[higher > at]
    left = values[before[-1] + 1 if len(before) else 0 : at + 1].min()
    right = values[at : after[0] if len(after) else None].min()
    return float(values[at] - max(left, right))
