"""Pictures that say their number, for tests of reading and seeking."""

import numpy as np


def numbered_picture(number, width=128, height=64):
    """A grey picture whose blocks encode `number` in binary."""
    picture = np.full((height, width, 3), 60, dtype=np.uint8)
    for bit in range(10):
        value = 220 if number >> bit & 1 else 20
        picture[16:48, 4 + bit * 12 : 14 + bit * 12] = value
    return picture


def read_number(picture):
    """The number that `numbered_picture` drew."""
    blocks = [picture[28:36, 7 + bit * 12 : 11 + bit * 12].mean() for bit in range(10)]
    return sum((value > 120) << bit for bit, value in enumerate(blocks))
