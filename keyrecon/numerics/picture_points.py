"""Pictures read at points between pixels, and points tracked from one picture to the next."""

import cv2
import numpy as np
from jaxtyping import Bool, Float, Shaped, UInt8

PYRAMID_LEVELS = 3
"""Halvings of the picture through which points are tracked (OpenCV's default). A quarter more or
less, others with it: at most 1.9 points, 2.4 mm on four clips."""


def sample_picture(
    picture: Shaped[np.ndarray, "y x *c"],
    points: Float[np.ndarray, "h w 2"],
    border: int = cv2.BORDER_CONSTANT,
) -> Shaped[np.ndarray, "h w *c"]:
    """Bilinear values at a grid of points; outside the picture zero unless `border` says else."""
    return cv2.remap(  # type: ignore[call-overload]  # OpenCV's stubs lack the missing second map
        picture, points.astype(np.float32), None, cv2.INTER_LINEAR, borderMode=border
    )


def track_there_and_back(
    before: UInt8[np.ndarray, "h w"],
    after: UInt8[np.ndarray, "h w"],
    points: Float[np.ndarray, "n *one 2"],
    window: int,
) -> tuple[Float[np.ndarray, "n *one 2"], Float[np.ndarray, "n"], Bool[np.ndarray, "n"]]:
    """Where points are in the next picture, how far from its start each is when tracked back, px,
    and which were tracked both ways; `window` is the side of the patch compared (Lucas-Kanade)."""
    there, tracked = track_points(before, after, points, window)
    back, again = track_points(after, before, there, window)
    return there, np.linalg.norm(back - points, axis=-1).ravel(), tracked & again


def track_points(
    before: UInt8[np.ndarray, "h w"],
    after: UInt8[np.ndarray, "h w"],
    points: Float[np.ndarray, "n *one 2"],
    window: int,
) -> tuple[Float[np.ndarray, "n *one 2"], Bool[np.ndarray, "n"]]:
    """Where points are in the next picture, and which were tracked."""
    there, tracked, _ = cv2.calcOpticalFlowPyrLK(  # type: ignore[call-overload]  # stubs want a guess
        before, after, points, None, winSize=(window, window), maxLevel=PYRAMID_LEVELS
    )
    return there, tracked.ravel() > 0
