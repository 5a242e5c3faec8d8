"""Points of the player's surface matched in the next frame (CVPR 2005, Section 4.3).

Points on a grid over the player are tracked by pyramidal Lucas-Kanade, forwards and back; those
that do not come back to where they started, or lie where nothing holds them, are left out.
"""

from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from keyrecon.numerics.picture_points import track_there_and_back
from keyrecon.ranges import within


@dataclass(frozen=True)
class MatchOptions:
    """How points are matched; lengths in player heights."""

    spacing: Annotated[float, within(0.002, 0.6)] = 0.03
    """Between points of the grid."""
    window: Annotated[float, within(0.002, 0.9)] = 0.045
    """Side of the window that is compared."""
    back: Annotated[float, within(0.0002, 0.08)] = 0.004
    """How far from its start a point may come back."""
    texture: Annotated[float, within(0, 1)] = 3e-4
    """Least smaller eigenvalue of the gradients around a point, as OpenCV scales it: a tenth of
    all points in clothes without a pattern have less."""


def match_points(
    grey: UInt8[np.ndarray, "h w"],
    following: UInt8[np.ndarray, "h w"],
    player: Bool[np.ndarray, "h w"],
    height: float,
    options: MatchOptions = MatchOptions(),
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n 2"]]:
    """Points of a picture on the player, and where they are in the following picture, px.

    `height` is that of the player in these pictures, px.
    """
    start = _textured_points(grey, player, height, options)
    if not len(start):
        return np.zeros((0, 2)), np.zeros((0, 2))
    side = max(7, round(options.window * height)) | 1
    end, off, tracked = track_there_and_back(grey, following, start, side)
    good = (off < max(0.5, options.back * height)) & tracked
    return start[good].astype(float), end[good].astype(float)


def _textured_points(
    grey: UInt8[np.ndarray, "h w"],
    player: Bool[np.ndarray, "h w"],
    height: float,
    options: MatchOptions,
) -> Float[np.ndarray, "n 2"]:
    """Points of a grid well inside the player that something holds in both directions."""
    margin = max(3, round(options.window * height / 2)) | 1
    inside = cv2.erode(player.astype(np.uint8), np.ones((margin, margin)))
    step = max(2, round(options.spacing * height))
    rows, columns = (np.arange(step // 2, size, step) for size in grey.shape)
    y, x = (c.ravel() for c in np.meshgrid(rows, columns))
    held = cv2.cornerMinEigenVal(grey, margin)
    keep = (inside[y, x] > 0) & (held[y, x] > options.texture)
    return np.stack([x[keep], y[keep]], axis=1).astype(np.float32)
