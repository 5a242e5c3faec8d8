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
    local = camera.local(court.points)
    depth = np.maximum(local[:, 2], NEAREST)
    flat = local[:, :2] / depth[:, None]
    pixels = camera.focal * flat + camera.principal
    way = court.direction @ camera.rotation.T
    slope = (way[:, :2] - flat * way[:, 2:]) * (camera.focal / depth)[:, None]
    speed = np.maximum(np.hypot(slope[:, 0], slope[:, 1]), 1e-9)
    normals = np.column_stack([-slope[:, 1], slope[:, 0]]) / speed[:, None]
    side = court.across @ camera.rotation.T
    stripe = (side[:, :2] - flat * side[:, 2:]) * (2 * camera.focal / depth)[:, None]
    width = np.abs((stripe * normals).sum(axis=1))
    size = np.array(shape[::-1])
    inside = ((pixels > MARGIN) & (pixels < size - 1 - MARGIN)).all(axis=1)
    inside &= (local[:, 2] > NEAREST) & (width < MAX_WIDTH)
    step = np.linalg.norm(np.diff(pixels, axis=0, prepend=pixels[:1]), axis=1)
    step = np.where(inside & np.roll(inside, 1), np.minimum(step, spacing), 0)
    mark = np.floor(np.cumsum(step) / spacing) + 1e6 * court.line
    chosen = np.flatnonzero(inside & (np.diff(mark, prepend=-1) > 0))
    return LineSamples(
        court.points[chosen], court.line[chosen], pixels[chosen], normals[chosen], width[chosen]
    )


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
    grid = samples.pixels[:, None] + steps[:, None] * samples.normals[:, None]
    profile = cv2.remap(  # type: ignore[call-overload]  # stubs lack the missing second map
        grey, grid.astype(np.float32), None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    ).astype(np.float32)
    total = np.zeros((len(profile), profile.shape[1] + 1), np.float32)
    np.cumsum(profile, axis=1, out=total[:, 1:])
    centres = np.arange(-reach, reach + 1) + far + 0.5  # in the running total

    def up_to(shift: np.ndarray) -> np.ndarray:
        place = centres[0] + shift
        low = np.floor(place).astype(int)
        share = (place - low).astype(np.float32)[:, None]
        index = low[:, None] + np.arange(len(centres) + 1)
        values = np.take_along_axis(total, index, axis=1)
        return values[:, :-1] * (1 - share) + values[:, 1:] * share

    inner = (up_to(half) - up_to(-half)) / (2 * half)[:, None]
    right = (up_to(half + gap + flank) - up_to(half + gap)) / flank[:, None]
    left = (up_to(-half - gap) - up_to(-half - gap - flank)) / flank[:, None]
    return inner - np.maximum(left, right)
