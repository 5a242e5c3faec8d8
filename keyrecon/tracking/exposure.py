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
from jaxtyping import Float, UInt8

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
"""Share of the blocks that must agree for a frame to tell its exposure."""
LEAST_SHARED = 0.6
"""Share of the blocks below which a frame shares too little with the key picture."""
MOST = 4.0
"""Factor beyond which a picture fades to black or white, which no exposure mends."""
DARK, USUAL_LIGHT = 50.0, 100.0
"""Above black: a shot is dark of which three quarters stay below the first, and is read as if they
stayed below the second. Of eighteen real clips the darkest has 67, the others 97 to 215."""
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
        usable = (np.minimum(moved, blocks) > DARKEST) & (np.maximum(moved, blocks) < BRIGHTEST)
        factor = np.log(blocks[usable] / moved[usable])
        middle = float(np.median(factor)) if len(factor) else 0.0
        agreeing = factor[np.abs(factor - middle) < AGREEMENT]
        known = self.brightness[-1] if self.brightness else 0.0
        if len(agreeing) > LEAST_AGREEING * blocks.size:
            known = self.key.brightness + float(agreeing.mean())
        if usable.sum() < LEAST_SHARED * blocks.size:
            self.key = _KeyPicture(blocks, place, known)
        self.brightness.append(known)
        self.light.append(float(np.percentile(blocks, 75)))

    def factors(self) -> Float[np.ndarray, "T"]:
        """Brightness of each frame, as factors on what is usual."""
        brightness = np.array(self.brightness) - np.median(self.brightness)
        factors: Float[np.ndarray, "T"] = np.exp(np.clip(brightness, -np.log(MOST), np.log(MOST)))
        light = float(np.median(self.light))
        return factors * max(light, 1.0) / USUAL_LIGHT if light < DARK else factors

    def exposure(self) -> Float[np.ndarray, "T"] | None:
        """The same; None where there is enough light, and it hardly changes."""
        factors = self.factors()
        return factors if np.abs(np.log(factors)).max() > np.log1p(EVEN) else None


def _in_place(blocks: Blocks, to_frame: Matrix) -> Blocks:
    """Blocks of a key picture as another frame's view shows them, 0 where it shows nothing."""
    height, width = blocks.shape
    corners = np.array([[(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)]])
    if np.abs(cv2.perspectiveTransform(corners, to_frame) - corners).max() < IN_PLACE:
        return blocks
    return cv2.warpPerspective(blocks, to_frame, (width, height), flags=cv2.INTER_LINEAR)
