"""Frames as if all of them had been exposed alike."""

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import UInt8

if TYPE_CHECKING:
    import av

LUMA_FIRST = ("yuv420p", "yuvj420p", "yuv422p", "yuvj422p", "yuv444p", "yuvj444p", "nv12")
"""Pixel formats whose first plane is the brightness, a byte each."""
FULL_RANGE = 2
"""FFmpeg's number of colours whose black is stored as 0 (AVCOL_RANGE_JPEG)."""
LIMITED_BLACK = 16
"""How black is stored in all other brightness of 8 bit (ITU-R BT.601)."""


def even_exposure(
    picture: UInt8[np.ndarray, "h w *c"], exposure: float, black: int = 0
) -> UInt8[np.ndarray, "h w *c"]:
    """A picture as it would be with an exposure of 1; `black` is how black is stored."""
    if exposure == 1.0:
        return picture
    import cv2

    stored = np.arange(256.0)
    table = np.clip(np.rint(black + (stored - black) / exposure), 0, 255).astype(np.uint8)
    evened: UInt8[np.ndarray, "h w *c"] = cv2.LUT(np.ascontiguousarray(picture), table)
    return evened


def black_of(frame: "av.VideoFrame") -> int:
    """How black is stored in a frame's brightness, where that is read as `Video.grey_frames` does.

    Formats that must be converted come out in full range.
    """
    as_stored = frame.format.name in LUMA_FIRST
    full = frame.format.name.startswith("yuvj") or frame.color_range == FULL_RANGE
    return LIMITED_BLACK if as_stored and not full else 0
