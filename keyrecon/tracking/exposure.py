"""How bright each frame is: clouds pass, cameras set their exposure anew, lamps flicker.

Colours of the player and of the scene are compared over the whole video, and following marks by
optical flow takes it that brightness stays. So every frame is held against a key picture of its
view, brought into place by the camera's motion: what most blocks of pixels differ by, as a factor,
is the exposure's. Brightness as it is stored is a power of the light, so a factor of the light is a
factor there too. Whatever moves by itself is outvoted. A new key picture is taken when the view has
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
"""Share of the key picture's usable blocks below which a frame shares too little with it."""
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
"""A key picture that the camera's motion changes by less, reduced px, is not moved."""

Blocks = Float[np.ndarray, "h w"]
Matrix = Float[np.ndarray, "3 3"]


@dataclass(frozen=True, eq=False)
class _KeyPicture:
    """Blocks that others are held against, and what is known of their exposure."""

    blocks: Blocks
    place: Matrix
    """Homography to the first frame."""
    brightness: float
    """Logarithm, beside the first frame's."""


@dataclass(eq=False)
class ExposureMeter:
    """Measures one frame of a shot after the other."""

    black: int = 0
    """How black is stored."""
    brightness: list[float] = field(default_factory=list)
    """Logarithm for each frame, beside the first one's."""
    light: list[float] = field(default_factory=list)
    """Brightness that a quarter of the blocks of each frame exceed."""
    brightest: list[float] = field(default_factory=list)
    """Brightness that hardly any block of each frame exceeds."""
    key: _KeyPicture | None = None

    def add(self, grey: UInt8[np.ndarray, "h w"], to_start: Matrix) -> None:
        """A frame, and the homography from its pixels to those of the first one."""
        width = min(WIDTH, grey.shape[1])
        small = shrinking(width / grey.shape[1])
        place = small @ to_start @ np.linalg.inv(small)
        size = (width, max(1, round(grey.shape[0] * width / grey.shape[1])))
        reduced = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
        blocks = reduced.astype(np.float32) - self.black
        if self.key is None:
            self.key = _KeyPicture(blocks, place, 0.0)
        moved = _in_place(self.key.blocks, np.linalg.inv(place) @ self.key.place)
        usable = _can_tell(moved) & _can_tell(blocks)
        factor = np.log(blocks[usable] / moved[usable])
        middle = float(np.median(factor)) if len(factor) else 0.0
        agreeing = factor[np.abs(factor - middle) < AGREEMENT]
        known = self.brightness[-1] if self.brightness else 0.0
        if len(agreeing) > max(LEAST_AGREEING * len(factor), LEAST_USABLE * blocks.size):
            known = self.key.brightness + float(agreeing.mean())
        if usable.sum() <= LEAST_SHARED * _can_tell(self.key.blocks).sum():
            self.key = _KeyPicture(blocks, place, known)
        self.brightness.append(known)
        shown = blocks[blocks > BAR] if (blocks > BAR).any() else blocks
        self.light.append(float(np.percentile(shown, 75)))
        self.brightest.append(float(np.percentile(blocks, BRIGHT_BLOCKS)))

    def factors(self) -> Float[np.ndarray, "T"]:
        """Brightness of each frame, as factors on what is usual."""
        brightness = np.array(self.brightness) - np.median(self.brightness)
        factors: Float[np.ndarray, "T"] = np.exp(np.clip(brightness, -np.log(MOST), np.log(MOST)))
        return factors * self._darkness()

    def _darkness(self) -> float:
        """The light of a dark shot as a factor on what is usual; 1 where there is enough."""
        light = float(np.median(self.light))
        if light >= DARK:
            return 1.0
        dark = max(light / USUAL_LIGHT, max(self.brightest) / WHITE, 1 / MOST)
        return min(1.0, dark)

    def exposure(self) -> Float[np.ndarray, "T"] | None:
        """The same; None where there is enough light, and it hardly changes."""
        factors = self.factors()
        return factors if np.abs(np.log(factors)).max() > np.log1p(EVEN) else None


def _can_tell(blocks: Blocks) -> Bool[np.ndarray, "h w"]:
    """Blocks that are neither nearly black nor nearly white."""
    return (blocks > DARKEST) & (blocks < BRIGHTEST)


def _in_place(blocks: Blocks, to_frame: Matrix) -> Blocks:
    """Blocks of a key picture as another frame's view shows them, 0 where it shows nothing."""
    height, width = blocks.shape
    corners = np.array([[(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)]])
    if np.abs(cv2.perspectiveTransform(corners, to_frame) - corners).max() < IN_PLACE:
        return blocks
    return cv2.warpPerspective(blocks, to_frame, (width, height), flags=cv2.INTER_LINEAR)
