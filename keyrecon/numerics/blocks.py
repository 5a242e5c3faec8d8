"""Work on many figures in blocks, a few at a time."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

BLOCK = 128
"""Figures in work at a time: few enough for the processor's cache."""
WORKERS = 2
"""Blocks in work at the same time; look-ups and matrix products run beside one another."""


def in_blocks(
    work: Callable[[slice], tuple[np.ndarray, ...]], count: int
) -> tuple[np.ndarray, ...]:
    """Results of `work` on slices of `count` figures, in order and joined."""
    slices = [slice(at, at + BLOCK) for at in range(0, count, BLOCK)]
    with ThreadPoolExecutor(WORKERS) as pool:
        return tuple(np.concatenate(parts) for parts in zip(*pool.map(work, slices), strict=True))
