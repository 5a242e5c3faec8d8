"""Medians and other ranks over a stack of pictures, without sorting it."""

import numpy as np
from jaxtyping import Bool, Int, UInt8

BLOCK = 2**20
"""Values searched at a time, so that they stay in the cache; changes nothing but time."""
BITS = 128, 64, 32, 16, 8, 4, 2, 1
"""Of a grey level, the highest first."""


def value_of_rank(
    values: UInt8[np.ndarray, "n *p"],
    rank: Int[np.ndarray, "*p"],
    counts: Bool[np.ndarray, "n *p"] | None = None,
) -> UInt8[np.ndarray, "*p"]:
    """The value that `rank` others of its pixel precede, in order; those that do not count are 255.

    A value of 8 bits is found bit by bit: it is the greatest that at most `rank` values are below.
    """
    found = np.empty(rank.shape, np.uint8)
    rows = max(1, BLOCK * len(rank) // max(values.size, 1))
    number = np.uint8 if len(values) <= np.iinfo(np.uint8).max else np.uint16
    for start in range(0, len(rank), rows):
        part = slice(start, start + rows)
        block = np.ascontiguousarray(values[:, part])
        if counts is not None:
            block = np.where(counts[:, part], block, np.uint8(255))
        sought, value = rank[part].astype(number), np.zeros(rank[part].shape, np.uint8)
        for bit in BITS:
            greater = value | np.uint8(bit)
            below = np.add.reduce((block < greater).view(np.uint8), axis=0, dtype=number)
            value = np.where(below <= sought, greater, value)
        found[part] = value
    return found
