"""Frame times of an even rate, where a container has rounded them.

Matroska and Flash count milliseconds, old QuickTime files 600ths of a second: 24 frames per second
are 41 and 42 ms apart then. The median spacing is then off by up to half a unit, 5 % at 240 frames
per second, and the frames look unevenly spaced.
"""

import numpy as np
from jaxtyping import Float, Int


def even_out(stamps: Int[np.ndarray, "T"]) -> Float[np.ndarray, "T"]:
    """Ticks since the first frame, without the rounding of an even rate.

    The unit of the rounding is the largest that all spacings are multiples of; also files that were
    copied into a container with a finer clock keep it. The rate is even where all times lie within
    a unit of the even grid from the first to the last: an end and the frame between may each be
    half a unit off, or a whole one to one side where times were cut off. A unit must be less than
    half a frame, which one missing frame strays at least from that grid. All other times, those
    that are even already among them, are returned as they are.
    """
    ticks = (stamps - stamps[0]).astype(float)
    steps = np.diff(stamps)
    if not len(steps) or np.ptp(steps) == 0:
        return ticks
    unit = int(np.gcd.reduce(steps))
    even = np.linspace(0.0, ticks[-1], len(ticks))
    if unit < even[1] / 2 and np.abs(ticks - even).max() <= unit:
        return even
    return ticks
