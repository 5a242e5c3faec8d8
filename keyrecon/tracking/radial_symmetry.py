"""Fast radial symmetry: where a map is bright and round, or elliptical.

Every pixel with a noticeable gradient g counts for the point a radius n up the gradient, where the
centre of a bright disc of that radius would be (Loy and Zelinsky, PAMI 25(8), 2003):

    O_n(p+) += 1,  M_n(p+) += |g|,        p+ = p + n g / |g|
    S_n = A_n * (M_n / k_n) (min(O_n, k_n) / k_n)^alpha,   S the mean over n,

with k_n = 9.9 (8 for n = 1) and A_n a Gaussian of deviation n / 4 that sums to n. Only bright
centres are wanted, so the points down the gradient are left out.

For an ellipse G (unit circle) n, G = R diag(a, b) R^T, the centre lies at

    p+ = p + n G G^T g / |G^T g|,

exactly, as the normal of an ellipse is G^-T times that of the circle it comes from (the idea of
Ni, Singh and Bahlmann, CVPR 2012).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float

CIRCLE = np.eye(2)
"""G of a disc."""
MAX_GRADIENTS = 6000
"""Only the steepest pixels count: a part's outline has a hundred, the rest is clutter. Halved,
others with it: at most 0.3 points, 0.1 mm on one clip."""
MIN_PEAK_SHARE = 0.02
"""Maxima below this share of the highest are noise. Halved, others with it: at most 0.3 points, 0.1
mm on one clip."""


@dataclass(frozen=True, eq=False)
class GradientField:
    """The noticeable gradients of a map; coordinates apart, which is faster."""

    x: Float[np.ndarray, "n"]
    y: Float[np.ndarray, "n"]
    gx: Float[np.ndarray, "n"]
    gy: Float[np.ndarray, "n"]
    shape: tuple[int, int]
    """Of the map."""


def gradient_field(smooth: Float[np.ndarray, "h w"], min_share: float = 0.1) -> GradientField:
    """Gradients steeper than `min_share` times the steepest, at most MAX_GRADIENTS of them."""
    gx = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, scale=0.125)
    gy = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, scale=0.125)
    size = np.hypot(gx, gy)
    spots = np.flatnonzero(size > min_share * max(float(size.max()), 1e-9))
    if len(spots) > MAX_GRADIENTS:
        steepness = size.ravel()[spots]
        spots = spots[np.argpartition(steepness, -MAX_GRADIENTS)[-MAX_GRADIENTS:]]
    y, x = np.divmod(spots, smooth.shape[1])
    x, y = x.astype(np.float32), y.astype(np.float32)
    return GradientField(x, y, gx.ravel()[spots], gy.ravel()[spots], smooth.shape)


def ellipse(ratio: float, angle: float) -> Float[np.ndarray, "2 2"]:
    """G of an ellipse of unit area factor: axes sqrt(ratio) and 1 / sqrt(ratio), turned."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return turn @ np.diag([np.sqrt(ratio), 1 / np.sqrt(ratio)]) @ turn.T


def radial_symmetry(
    slope: GradientField,
    radii: Sequence[float],
    strictness: float = 2.0,
    form: Float[np.ndarray, "2 2"] = CIRCLE,
) -> Float[np.ndarray, "h w"]:
    """S for discs (or ellipses of one form) of the given radii, px; `strictness` is alpha."""
    rows, columns = slope.shape
    (a, b), (c, d) = form.astype(np.float32)
    across, along = a * slope.gx + c * slope.gy, b * slope.gx + d * slope.gy  # G^T g
    length = np.maximum(np.hypot(across, along), np.float32(1e-12))
    vx, vy = (a * across + b * along) / length, (c * across + d * along) / length
    size = np.hypot(slope.gx, slope.gy)
    total = np.zeros(rows * columns, np.float32)
    for radius in np.array(radii, np.float32):
        x = np.rint(slope.x + radius * vx).astype(np.int32)
        y = np.rint(slope.y + radius * vy).astype(np.int32)
        inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
        spot = (y * columns + x)[inside]
        # Few places get votes; one that gets several is worked out as often, with the same result.
        count = np.bincount(spot, minlength=rows * columns)[spot].astype(np.float32)
        strength = np.bincount(spot, weights=size[inside], minlength=rows * columns)[spot]
        cap = 8.0 if radius <= 1 else 9.9
        symmetry = strength.astype(np.float32) * (np.minimum(count, cap) / cap) ** strictness / cap
        total[spot] += symmetry * radius
    # The radii differ little, so one Gaussian does for all of them.
    score = total.reshape(rows, columns)
    return cv2.GaussianBlur(score, (0, 0), 0.25 * float(np.mean(radii))) / len(radii)


def find_peaks(
    score: Float[np.ndarray, "h w"],
    apart: float,
    max_peaks: int,
    where: Bool[np.ndarray, "h w"] | None = None,
) -> tuple[Float[np.ndarray, "m 2"], Float[np.ndarray, "m"]]:
    """The highest maxima at least `apart` px from each other: positions to sub-pixel, scores."""
    size = 2 * max(1, round(apart)) + 1
    top = cv2.dilate(score, np.ones((size, size), np.uint8))
    maxima = (score >= top) & (score > MIN_PEAK_SHARE * max(float(score.max()), 1e-12))
    if where is not None:
        maxima &= where
    y, x = np.nonzero(maxima)
    order = np.argsort(-score[y, x], kind="stable")[:max_peaks]
    y, x = y[order], x[order]
    places = np.stack([x + _offset(score, y, x, 1), y + _offset(score, y, x, 0)], axis=1)
    return places.astype(float), score[y, x].astype(float)


def _offset(
    score: Float[np.ndarray, "h w"], y: np.ndarray, x: np.ndarray, axis: int
) -> Float[np.ndarray, "m"]:
    """Vertex of the parabola through a maximum and its two neighbours."""
    size = score.shape[axis]
    at = (y, x)[axis]
    before, after = np.clip(at - 1, 0, size - 1), np.clip(at + 1, 0, size - 1)
    low = score[before, x] if axis == 0 else score[y, before]
    high = score[after, x] if axis == 0 else score[y, after]
    bend = low + high - 2 * score[y, x]
    offset = np.where(bend < -1e-12, 0.5 * (low - high) / np.minimum(bend, -1e-12), 0.0)
    return np.clip(offset, -0.5, 0.5)
