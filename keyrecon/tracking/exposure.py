"""Exposure of each frame relative to its shot: clouds, automatic exposure, flicker of lamps.

Colours of the player and of the scene are compared over the whole video, and following marks by
optical flow takes it that brightness stays. So every frame is held against a reference of its
view, brought into place by the camera's motion: what most blocks of pixels differ by, as a factor,
is the exposure's. Brightness as it is stored is a power of the light, so a factor of the light is a
factor there too. Whatever moves by itself is outvoted. A new reference is taken when the view has
left the last one, so errors add up per view, not per frame.

Where a shot's brightness stays within `EVEN` of its median, nothing is done about it, unless all of
it is dark: differences of colour are judged in grey levels, of which the dark has few.
"""

from dataclasses import dataclass, field

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from keyrecon.io.frame_reader import shrinking

WIDTH = 64
"""Pictures are reduced to this width: means of blocks, whose noise says nothing."""
EVEN = 0.05
"""Change of brightness that is left alone. Eighteen real clips, on courts, ranges and indoors, and
eight rendered ones change by .035 at most."""
DARKEST, BRIGHTEST = 8.0, 210.0
"""Brightness above black beyond which a block may hold clipped pixels, which no exposure
changes."""
AGREEMENT = 0.1
"""How far the factor of a block may be from that of most, relative, to be of the same light."""
LEAST_AGREEING = 0.4
"""Share of the blocks that can tell its exposure that must agree in a frame."""
LEAST_USABLE = 0.02
"""Share of all blocks that must agree: fewer may be the player's, whose own brightness changes."""
LEAST_SHARED = 0.6
"""Share of the reference's usable blocks below which a frame shares too little with it."""
MOST = 4.0
"""Factor beyond which a picture fades to black or white, which no exposure mends."""
DARK, USUAL_LIGHT = 50.0, 100.0
"""Above black: a shot is dark of which three quarters stay below the first, and is read as if they
stayed below the second. Of eighteen real clips the darkest has 67, the others 97 to 215."""
BAR = 1.0
"""Above black: blocks up to this are bars beside the picture, which say nothing of its light."""
WHITE, BRIGHT_BLOCKS = 180.0, 99.8
"""Above black: a dark shot is brightened no further than that this percentile of a frame's blocks
comes to the first, so that a lit player before a dark wall stays below white."""
IN_PLACE = 0.02
"""A reference that the camera's motion changes by less, reduced px, is not moved."""

Blocks = Float[np.ndarray, "h w"]
Matrix = Float[np.ndarray, "3 3"]


@dataclass(frozen=True, eq=False)
class _Reference:
    """Blocks of one frame with which other frames are compared, and their exposure."""

    blocks: Blocks
    place: Matrix
    """Homography to the first frame."""
    log_exposure: float
    """Natural logarithm of the brightness relative to the first frame."""


@dataclass(eq=False)
class ExposureMeter:
    """Measures one frame of a shot after the other."""

    black: int = 0
    """How black is stored."""
    log_exposure: list[float] = field(default_factory=list)
    """Of each frame, relative to the first one."""
    upper_quartiles: list[float] = field(default_factory=list)
    """Brightness that a quarter of the blocks of each frame exceed, grey levels above black."""
    highlights: list[float] = field(default_factory=list)
    """Brightness that hardly any block of each frame exceeds (`BRIGHT_BLOCKS`), likewise."""
    reference: _Reference | None = None

    def add(self, grey: UInt8[np.ndarray, "h w"], to_start: Matrix) -> None:
        """A frame, and the homography from its pixels to those of the first one."""
        width = min(WIDTH, grey.shape[1])
        small = shrinking(width / grey.shape[1])
        place = small @ to_start @ np.linalg.inv(small)
        size = (width, max(1, round(grey.shape[0] * width / grey.shape[1])))
        reduced = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
        blocks = reduced.astype(np.float32) - self.black
        if self.reference is None:
            self.reference = _Reference(blocks, place, 0.0)
        warped = _warp_blocks(self.reference.blocks, np.linalg.inv(place) @ self.reference.place)
        usable = _well_exposed(warped) & _well_exposed(blocks)
        factor = np.log(blocks[usable] / warped[usable])
        middle = float(np.median(factor)) if len(factor) else 0.0
        agreeing = factor[np.abs(factor - middle) < AGREEMENT]
        known = self.log_exposure[-1] if self.log_exposure else 0.0
        if len(agreeing) > max(LEAST_AGREEING * len(factor), LEAST_USABLE * blocks.size):
            known = self.reference.log_exposure + float(agreeing.mean())
        if usable.sum() <= LEAST_SHARED * _well_exposed(self.reference.blocks).sum():
            self.reference = _Reference(blocks, place, known)
        self.log_exposure.append(known)
        shown = blocks[blocks > BAR] if (blocks > BAR).any() else blocks
        self.upper_quartiles.append(float(np.percentile(shown, 75)))
        self.highlights.append(float(np.percentile(blocks, BRIGHT_BLOCKS)))

    def factors(self) -> Float[np.ndarray, "T"]:
        """Brightness of each frame as a factor on the shot's median, times `_underexposure`."""
        log_exposure = np.array(self.log_exposure) - np.median(self.log_exposure)
        factors: Float[np.ndarray, "T"] = np.exp(np.clip(log_exposure, -np.log(MOST), np.log(MOST)))
        return factors * self._underexposure()

    def _underexposure(self) -> float:
        """Brightness of a dark shot as a factor on a usual one; 1 where it is bright enough."""
        upper_quartile = float(np.median(self.upper_quartiles))
        if upper_quartile >= DARK:
            return 1.0
        dark = max(upper_quartile / USUAL_LIGHT, max(self.highlights) / WHITE, 1 / MOST)
        return min(1.0, dark)

    def exposure(self) -> Float[np.ndarray, "T"] | None:
        """The factors; None where the shot is bright enough, and they hardly change."""
        factors = self.factors()
        return factors if np.abs(np.log(factors)).max() > np.log1p(EVEN) else None


def _well_exposed(blocks: Blocks) -> Bool[np.ndarray, "h w"]:
    """Blocks that are neither nearly black nor nearly white."""
    return (blocks > DARKEST) & (blocks < BRIGHTEST)


def _warp_blocks(blocks: Blocks, to_frame: Matrix) -> Blocks:
    """Blocks of a reference as another frame's view shows them, 0 where it shows nothing."""
    height, width = blocks.shape
    corners = np.array([[(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)]])
    if np.abs(cv2.perspectiveTransform(corners, to_frame) - corners).max() < IN_PLACE:
        return blocks
    return cv2.warpPerspective(blocks, to_frame, (width, height), flags=cv2.INTER_LINEAR)
