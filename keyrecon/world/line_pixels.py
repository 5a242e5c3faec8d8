"""Pixels of painted lines, and the straight lines that they lie on.

A pixel of a line is brighter than what lies on both sides of it, at one of two widths, and its
neighbourhood has one direction (structure tensor), unlike letters, spectators and leaves. After
Farin, Krabbe, de With and Effelsberg, "Robust camera calibration for sport videos using court
models", Storage and Retrieval Methods and Applications for Multimedia, SPIE 5307, 2004, sections
3.1 and 3.2; the test printed there for linear structure is inverted. Each pixel votes in Hough
space near its own direction alone. The strongest line is fitted to its pixels by robust least
squares, its pixels are taken away, and the next is looked for.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32, Int, UInt8

WIDTHS = (4, 10)
"""How far away both sides of a line are looked at, px of a picture 960 wide: a line must be
narrower than that. A broadcast's lines are 2 to 6 px wide, a baseline at the camera's feet 10."""
MIN_CONTRAST = 9.0
"""Grey levels by which a line is brighter than both sides, at least."""
NOISE_FACTOR = 4.0
"""And so many times the picture's noise."""
MIN_COHERENCE = 0.55
"""(l1 - l2) / (l1 + l2) of the structure tensor: 1 for one direction, 0 for none."""
MAX_TURN = np.radians(7.0)
"""Between the direction of a pixel's neighbourhood and the line that it lies on."""
NEAR_LINE = 2.0
"""px from a line within which pixels count for it."""
SPECK = 0.011
"""Length of the shortest piece of a line, as a share of the picture's width."""
MIN_COVER = 0.3
"""Pixels of a line at least, as a share of its length: what specks in a row lack."""
MIN_LENGTH = 0.035
"""Pixels of a line at least, as a share of the picture's width."""
ANGLES, RHO = 360, 2.0
"""Hough space: bins over half a turn, and px per bin."""
DIRECTIONS = 8
"""Bins of direction in `LinePixels.near`, one bit each."""


@dataclass(frozen=True, eq=False)
class LinePixels:
    """Where a picture has painted lines, px of the picture they were found in."""

    points: Float[np.ndarray, "P 2"]
    angle: Float[np.ndarray, "P"]
    """Direction of the line's normal, radians in [0, pi)."""
    near: UInt8[np.ndarray, "h w"]
    """Bit k is set where a line pixel whose normal points into bin k, or the next, is close by."""

    @property
    def density(self) -> float:
        """Share of the picture where a bit is set, by chance found when looking for a line."""
        bits = np.unpackbits(self.near.reshape(-1, 1)[::7], axis=1)
        return float(bits.mean())


@dataclass(frozen=True, eq=False)
class ImageLine:
    """A straight line in the picture: n . p = rho."""

    normal: Float[np.ndarray, "2"]
    rho: float
    ends: Float[np.ndarray, "2 2"]
    """Of its pixels, without the outermost 2 %."""
    pixels: int

    @property
    def length(self) -> float:
        """From end to end, px."""
        return float(np.linalg.norm(self.ends[1] - self.ends[0]))


def find_line_pixels(grey: UInt8[np.ndarray, "h w"]) -> LinePixels:
    """Pixels brighter than both sides in a neighbourhood of one direction."""
    soft = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), 0.7)
    contrast = np.zeros_like(soft)
    for width in WIDTHS:
        ridge = _ridge(soft, max(2, round(width * grey.shape[1] / 960)))
        contrast = np.maximum(contrast, ridge)
    noise = 1.48 * float(np.median(np.abs(cv2.Laplacian(soft, cv2.CV_32F)))) / 4
    bright = contrast > max(MIN_CONTRAST, NOISE_FACTOR * noise)
    angle, coherent = _directions(soft)
    y, x = np.nonzero(_without_specks(bright & coherent))
    # A turn a hair below 0 is pi in single precision, which is more than pi.
    points, normals = np.column_stack([x, y]).astype(float), angle[y, x].astype(float) % np.pi
    return LinePixels(points, normals, _near(points, normals, grey.shape))


def _without_specks(mask: Bool[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
    """Without groups of pixels too short to be a piece of a line: grain of grass and clay."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    size = stats[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1)
    size[0] = 0
    return (size >= SPECK * mask.shape[1])[labels]


def _ridge(soft: Float32[np.ndarray, "h w"], reach: int) -> Float32[np.ndarray, "h w"]:
    """How much brighter each pixel is than both its sides, across or along the picture."""
    padded = cv2.copyMakeBorder(soft, reach, reach, reach, reach, cv2.BORDER_REPLICATE)
    rows, columns = slice(reach, -reach), slice(reach, -reach)
    aside = np.maximum(padded[rows, : -2 * reach], padded[rows, 2 * reach :])
    above = np.maximum(padded[: -2 * reach, columns], padded[2 * reach :, columns])
    return soft - np.minimum(aside, above)


def _directions(
    soft: Float32[np.ndarray, "h w"],
) -> tuple[Float32[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
    """Direction across the structure at each pixel, and whether it has one at all."""
    dx, dy = (cv2.Scharr(soft, cv2.CV_32F, *order) for order in ((1, 0), (0, 1)))
    xx, yy, xy = (cv2.GaussianBlur(a * b, (0, 0), 2.5) for a, b in ((dx, dx), (dy, dy), (dx, dy)))
    spread = np.hypot(xx - yy, 2 * xy)
    angle = 0.5 * np.arctan2(2 * xy, xx - yy) % np.pi
    return angle, spread > MIN_COHERENCE * (xx + yy)


def _near(
    points: Float[np.ndarray, "P 2"], angle: Float[np.ndarray, "P"], shape: tuple[int, ...]
) -> UInt8[np.ndarray, "h w"]:
    """Where a line of each direction is close by, one bit per direction."""
    bins = np.floor(angle / np.pi * DIRECTIONS).astype(int)
    # A direction near the border of two bins is seen in both.
    other = np.floor(angle / np.pi * DIRECTIONS - 0.5).astype(int)
    other = np.where(other == bins, bins + 1, other) % DIRECTIONS
    reach = max(1, round(NEAR_LINE * shape[1] / 960))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    near = np.zeros(shape, np.uint8)
    x, y = points.astype(int).T
    for k in range(DIRECTIONS):
        mine = (bins == k) | (other == k)
        one = np.zeros(shape, np.uint8)
        one[y[mine], x[mine]] = 1
        grown = cv2.dilate(one, disc).astype(np.uint8)
        near |= grown * np.uint8(1 << k)
    return near


def find_lines(pixels: LinePixels, shape: tuple[int, int], most: int) -> list[ImageLine]:
    """The `most` longest straight lines, strongest first."""
    height, width = shape
    least = MIN_LENGTH * width
    offset = int(np.ceil(np.hypot(height, width) / RHO))
    cells, size = _cells(pixels, offset), (ANGLES, 2 * offset + 1)
    left = np.ones(len(pixels.points), dtype=bool)
    votes = _count(cells, size)
    lines: list[ImageLine] = []
    while len(lines) < most:
        soft = cv2.blur(votes.astype(np.float32), (3, 3), borderType=cv2.BORDER_REPLICATE)
        peak = int(soft.argmax())
        a, r = divmod(peak, votes.shape[1])
        if soft[a, r] * 9 < least:
            break
        theta = (a + 0.5) / ANGLES * np.pi
        normal, rho = np.array([np.cos(theta), np.sin(theta)]), (r - offset) * RHO
        line, taken = _fit(pixels, left, normal, rho)
        votes -= _count(cells[left & taken], size)
        left &= ~taken
        if line is None or not taken.any():
            votes[max(a - 1, 0) : a + 2, max(r - 1, 0) : r + 2] = 0
        elif line.pixels >= max(least, MIN_COVER * line.length):
            lines.append(line)
    return lines


def _cells(pixels: LinePixels, offset: int) -> Int[np.ndarray, "P turns"]:
    """Cells of Hough space that a pixel votes for: lines through it that run about its way."""
    reach = round(MAX_TURN / np.pi * ANGLES * 0.6)
    turns = np.arange(-reach, reach + 1)
    a = np.floor(pixels.angle / np.pi * ANGLES).astype(np.int32)[:, None] + turns
    theta = (np.arange(-reach, ANGLES + reach) + 0.5) / ANGLES * np.pi
    cosine, sine = np.cos(theta)[a + reach], np.sin(theta)[a + reach]
    rho = pixels.points[:, :1] * cosine + pixels.points[:, 1:] * sine
    rho = np.where((a < 0) | (a >= ANGLES), -rho, rho)  # the same line, turned by half a turn
    return a % ANGLES * (2 * offset + 1) + np.rint(rho / RHO).astype(np.int32) + offset


def _count(cells: Int[np.ndarray, "n turns"], size: tuple[int, int]) -> Int[np.ndarray, "a r"]:
    return np.bincount(cells.ravel(), minlength=size[0] * size[1]).reshape(size)


def _fit(
    pixels: LinePixels, left: Bool[np.ndarray, "P"], normal: Float[np.ndarray, "2"], rho: float
) -> tuple[ImageLine | None, Bool[np.ndarray, "P"]]:
    """A line through the pixels near a first guess, and those pixels."""
    for reach in (3 * NEAR_LINE, 2 * NEAR_LINE, 1.5 * NEAR_LINE):
        taken = left & _belongs(pixels, normal, rho, reach)
        if taken.sum() < 8:
            return None, taken
        near = pixels.points[taken].astype(np.float32)
        vx, vy, x, y = cv2.fitLine(near, cv2.DIST_HUBER, 0, 0.01, 0.01).ravel().astype(float)
        normal = np.array([-vy, vx])
        rho = float(normal @ (x, y))
    taken = left & _belongs(pixels, normal, rho, 2 * NEAR_LINE)
    if not taken.any():
        return None, taken
    along = pixels.points[taken] @ (normal[1], -normal[0])
    ends = np.percentile(along, (2, 98))[:, None] * np.array([normal[1], -normal[0]])
    return ImageLine(normal, rho, ends + rho * normal, len(np.unique(np.rint(along)))), taken


def _belongs(
    pixels: LinePixels, normal: Float[np.ndarray, "2"], rho: float, reach: float
) -> Bool[np.ndarray, "P"]:
    """Pixels close to a line whose neighbourhood runs its way."""
    angle = np.arctan2(normal[1], normal[0])
    turn = np.abs((pixels.angle - angle + np.pi / 2) % np.pi - np.pi / 2)
    return (np.abs(pixels.points @ normal - rho) < reach) & (turn < MAX_TURN)
