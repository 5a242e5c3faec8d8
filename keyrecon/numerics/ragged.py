"""Lists of unequal length kept end to end in one array."""

import numpy as np
from jaxtyping import Int


def ranges(start: Int[np.ndarray, "E"], count: Int[np.ndarray, "E"]) -> Int[np.ndarray, "P"]:
    """start[0], start[0] + 1, ... (count[0] numbers), then the same of the next, and so on."""
    before = np.cumsum(count) - count
    return np.arange(count.sum()) + np.repeat(start - before, count)
