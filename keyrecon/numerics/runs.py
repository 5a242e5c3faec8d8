"""Runs of consecutive frames."""

import numpy as np
from jaxtyping import Bool


def list_runs(flags: Bool[np.ndarray, "T"], gap: int = 0) -> list[tuple[int, int]]:
    """First and last frame of each run of True; runs at most `gap` frames apart count as one."""
    frames = np.flatnonzero(flags)
    if not len(frames):
        return []
    breaks = np.flatnonzero(np.diff(frames) > gap + 1)
    firsts, lasts = frames[np.r_[0, breaks + 1]], frames[np.r_[breaks, len(frames) - 1]]
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))
