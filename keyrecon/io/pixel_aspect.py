"""Pixels that are not square: DV, DVD and anamorphic video tell how wide theirs are to be shown.

One scale for both directions of the picture, lengths of limbs and angles all need square pixels.
A new video without them is refused; one that a project has already is told of and used on, since
marks hang on it.
"""

import logging
from fractions import Fraction
from functools import cache
from pathlib import Path

from keyrecon.errors import KeyreconError, quoted

logger = logging.getLogger(__name__)

SQUARE = 0.01
"""Share by which the sides of a pixel may differ: encoders round what they tell."""


def check_pixels(path: Path, aspect: Fraction | None, square_only: bool) -> None:
    """Raise KeyreconError where pixels are `aspect` wide to high; a warning if not `square_only`.

    A video that tells nothing counts as square.
    """
    if aspect is None or abs(aspect - 1) < SQUARE:
        return
    square = path.with_name(f"{path.stem}_square.mp4")
    text = (
        f"{path} has pixels of {aspect.numerator}:{aspect.denominator} (width to height), and as "
        "square ones they would bend all lengths and angles; make them square with: ffmpeg -i "
        f'{quoted(path)} -vf "scale=trunc(iw*sar/2)*2:ih,setsar=1" {quoted(square)}'
    )
    if square_only:
        raise KeyreconError(text)
    _warn_once(text)


@cache
def _warn_once(text: str) -> None:
    """A project opens its video many times."""
    logger.warning("Warning: %s", text)
