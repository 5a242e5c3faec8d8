"""Where painted lines lie in a picture, beside where a camera puts them.

Points along the model's lines are projected, and the picture is read across the line at each: the
stripe is looked for as wide as it must appear there, brighter than both its sides. After Harris and
Stennett, "RAPiD, a video rate object tracker", BMVC 1990: one distance per point, across the line,
is all that a line tells.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from keyrecon.world.court import CourtModel
from keyrecon.world.pinhole import NEAREST, Pinhole

SPACING = 6.0
"""px between points that are measured: the picture's blur reaches about so far."""
MARGIN = 3.0
"""px from the edge of the picture within which nothing is measured."""
MIN_WIDTH, MAX_WIDTH = 1.4, 30.0
"""px: a stripe narrower than this looks so wide all the same; a wider one is not measured."""
MIN_CONTRAST = 4.0
"""Grey levels by which a stripe is brighter than both its sides."""
NEARNESS = 0.5
"""Share of its contrast that a stripe at the end of the search loses against one in its middle."""


@dataclass(frozen=True, eq=False)
class LineSamples:
    """Points of the court that are measured in a picture, M of them."""

    points: Float[np.ndarray, "M 3"]
    line: Int[np.ndarray, "M"]
    pixels: Float[np.ndarray, "M 2"]
    """Where a camera puts them."""
    normals: Float[np.ndarray, "M 2"]
    """Across the line in the picture."""
    width: Float[np.ndarray, "M"]
    """Of the stripe there, px."""


@dataclass(frozen=True, eq=False)
class LineOffsets:
    """How far along its normal each sample's stripe was seen."""

    offset: Float[np.ndarray, "M"]
    """px"""
    seen: Bool[np.ndarray, "M"]


def choose_samples(
    camera: Pinhole, court: CourtModel, shape: tuple[int, int], spacing: float = SPACING
) -> LineSamples:
    """Points in the picture, evenly spaced in it along every line."""
    across, down, depth = camera.local(court.points).T
    ahead = np.maximum(depth, NEAREST)
    flat = across / ahead, down / ahead
    x, y = (camera.focal * f + p for f, p in zip(flat, camera.principal, strict=True))
    height, width = shape
    inside = (x > MARGIN) & (x < width - 1 - MARGIN) & (y > MARGIN) & (y < height - 1 - MARGIN)
    shown = np.flatnonzero(inside & (depth > NEAREST))
    normals, widths = _appearance(
        camera, court, shown, (flat[0][shown], flat[1][shown]), depth[shown]
    )
    narrow = np.zeros(len(x), dtype=bool)
    narrow[shown] = widths < MAX_WIDTH
    step = np.zeros(len(x))
    step[1:] = np.sqrt(np.diff(x) ** 2 + np.diff(y) ** 2)
    step[1:] = np.where(narrow[1:] & narrow[:-1], np.minimum(step[1:], spacing), 0)
    mark = np.floor(np.cumsum(step) / spacing) + 1e6 * court.line
    begins = np.ones(len(mark), dtype=bool)
    begins[1:] = mark[1:] > mark[:-1]
    taken = np.flatnonzero((narrow & begins)[shown])
    chosen = shown[taken]
    return LineSamples(
        court.points[chosen],
        court.line[chosen],
        np.column_stack([x[chosen], y[chosen]]),
        normals[taken],
        widths[taken],
    )


def _appearance(
    camera: Pinhole,
    court: CourtModel,
    chosen: Int[np.ndarray, "n"],
    flat: tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]],
    depth: Float[np.ndarray, "n"],
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n"]]:
    """Normals and widths, px, of stripes at points of the court.

    The points are seen at `flat` times the focal length, `depth` metres before the camera.
    """
    right, down, away = (court.direction[chosen] @ camera.rotation.T).T
    per_metre = camera.focal / depth
    along = (right - flat[0] * away) * per_metre, (down - flat[1] * away) * per_metre
    speed = np.maximum(np.hypot(*along), 1e-9)
    normal = -along[1] / speed, along[0] / speed
    right, down, away = (court.across[chosen] @ camera.rotation.T).T
    stripe = (right - flat[0] * away) * (2 * per_metre), (down - flat[1] * away) * (2 * per_metre)
    return np.column_stack(normal), np.abs(stripe[0] * normal[0] + stripe[1] * normal[1])


def measure_offsets(
    grey: UInt8[np.ndarray, "h w"], samples: LineSamples, search: float
) -> LineOffsets:
    """Look for each stripe up to `search` px to both sides."""
    if not len(samples.points):
        return LineOffsets(np.zeros(0), np.zeros(0, dtype=bool))
    reach = int(np.ceil(search))
    contrast = _contrast(grey, samples, reach)
    offsets = np.arange(-reach, reach + 1)
    best = (contrast * (1 - NEARNESS * np.abs(offsets) / (reach + 1))).argmax(axis=1)
    rows = np.arange(len(best))
    at = np.clip(best, 1, 2 * reach - 1)
    before, here, after = (contrast[rows, at + k] for k in (-1, 0, 1))
    bend = before - 2 * here + after
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(bend < 0, 0.5 * (before - after) / bend, 0.0)
    seen = (here > MIN_CONTRAST) & (best == at) & (np.abs(shift) <= 1)
    return LineOffsets(offsets[at] + np.clip(shift, -1, 1), seen)


def _contrast(
    grey: UInt8[np.ndarray, "h w"], samples: LineSamples, reach: int
) -> Float[np.ndarray, "M places"]:
    """How much brighter a stripe of the width it must have is than both its sides, at every pixel
    up to `reach` along the normals."""
    half = np.maximum(samples.width, MIN_WIDTH) / 2
    flank = np.maximum(half, 2.0)
    gap = 0.6 + 0.1 * samples.width
    far = reach + int(np.ceil((half + gap + flank).max())) + 2
    steps = np.arange(-far, far + 1)
    x, y = (
        (at[:, None] + steps * normal[:, None]).astype(np.float32)
        for at, normal in zip(samples.pixels.T, samples.normals.T, strict=True)
    )
    profile = cv2.remap(grey, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    total = np.zeros((len(profile), profile.shape[1] + 1), np.float32)
    np.cumsum(profile, axis=1, dtype=np.float32, out=total[:, 1:])
    near, wide = half + gap, half + gap + flank
    place = far - reach + 0.5 + np.stack([half, -half, wide, near, -near, -near - flank])
    low = np.floor(place).astype(int)
    share = (place - low).astype(np.float32)[..., None]
    row = np.arange(len(total)) * total.shape[1]
    values = total.ravel().take((low + row)[..., None] + np.arange(2 * reach + 2))
    up_to = values[..., :-1] * (1 - share) + values[..., 1:] * share
    inner = (up_to[0] - up_to[1]) / (2 * half)[:, None]
    right = (up_to[2] - up_to[3]) / flank[:, None]
    left = (up_to[4] - up_to[5]) / flank[:, None]
    return inner - np.maximum(left, right)
