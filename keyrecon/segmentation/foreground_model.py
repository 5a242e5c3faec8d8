"""How far every pixel of a frame is from the scene without the player (see `background_model`).

A pixel is compared with the whole range of colours that the background has within a pixel of its
place, so that a camera path that is a little off does not light up every edge (the idea of ViBe's
neighbours, Barnich and Van Droogenbroeck, IEEE TIP 20, 2011, turned into an interval), and
darkening without a change of chroma, a shadow, counts for less.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Float, Float32, UInt8

from keyrecon.io.frame_reader import shrinking
from keyrecon.records import Background, CameraPath

MIN_SPREAD = 4
"""Deviation of video noise and compression, grey levels; the least that is assumed. A quarter more
or less, others with it: at most 1.9 points, 2.4 mm on four clips."""
SHADOW_WEIGHT = 0.35
"""Weight of a darkening: a shadow takes up to half of the light and leaves the chroma. A quarter
more or less, others with it: at most 1.9 points, 2.4 mm on four clips."""
MIN_SHADOW_LIGHT = 0.45
"""Share of the light that a cast shadow leaves, at least. A quarter more or less, others with it:
at most 1.9 points, 2.4 mm on four clips."""
UNKNOWN = 255
"""Spread of what was never observed."""
CHROMA_WEIGHT = 1.6
"""Weight of a and b against L: chroma varies less with light. A quarter more or less, others with
it: at most 1.9 points, 2.4 mm on four clips."""
SQUARES = np.outer(
    np.array((1, CHROMA_WEIGHT, CHROMA_WEIGHT), np.float32), np.arange(256, dtype=np.float32)
)
SQUARES *= SQUARES
"""Weighted square of a difference in L, a and b, a row each. L by a quarter more or less, others
with it: at most 1.9 points, 1.8 mm on four clips; halved or doubled: 4.2 mm."""
LIT_OR_SHADED = np.array([1.0, SHADOW_WEIGHT**2, *np.zeros(254)], np.float32)
"""Weight of the square of a difference in L, by whether it may be a shadow's: looked up, which
takes a tenth of the time of a product where a mask says so."""


@dataclass(frozen=True, eq=False)
class ForegroundModel:
    """A background ready to be compared with the frames of its video."""

    background: Background
    camera: CameraPath

    @cached_property
    def _later(self) -> tuple["ForegroundModel", ...]:
        """Those of later frames, the last one first."""
        later = self.background.later[::-1]
        return tuple(replace(self, background=background) for background in later)

    @cached_property
    def _low(self) -> UInt8[np.ndarray, "h w 3"]:
        """Least colour around every pixel of the background."""
        return cv2.erode(self.background.color, np.ones((3, 3), np.uint8))

    @cached_property
    def _high(self) -> UInt8[np.ndarray, "h w 3"]:
        """Greatest colour around every pixel of the background."""
        return cv2.dilate(self.background.color, np.ones((3, 3), np.uint8))

    @cached_property
    def _spread(self) -> UInt8[np.ndarray, "h w"]:
        """Deviation in steps of 1/8 grey level; UNKNOWN where the scene was not observed."""
        spread = np.clip(self.background.spread * 8, 8 * MIN_SPREAD, UNKNOWN - 1).astype(np.uint8)
        unseen = cv2.dilate((~self.background.known).astype(np.uint8), np.ones((3, 3), np.uint8))
        spread[unseen > 0] = UNKNOWN
        return spread

    @cached_property
    def _even_odds(self) -> Float32[np.ndarray, "256"]:
        """Square of the difference that is as likely the player as not, by `_spread`."""
        return np.square(np.arange(256, dtype=np.float32) * np.float32(self.background.sure / 8))

    def foreground(
        self,
        lab: UInt8[np.ndarray, "h w 3"],
        frame: int,
        to_picture: Float[np.ndarray, "3 3"],
    ) -> Float[np.ndarray, "h w"]:
        """Probability that each pixel of a crop is not background; 0.5 where nobody knows.

        0 where something is laid over the picture: whoever is behind it is not seen.

        `to_picture` maps pixels of the crop to those of the full picture of this frame.
        """
        for later in self._later:
            if frame >= later.background.first:
                return later.foreground(lab, frame, to_picture)
        to_scene = self.background.from_reference @ self.camera.to_reference[frame] @ to_picture
        size = (lab.shape[1], lab.shape[0])
        low, high = (_warp_to_crop(color, to_scene, size) for color in (self._low, self._high))
        spread = _warp_to_crop(self._spread, to_scene, size)
        under = cv2.subtract(low, lab)
        differences = cv2.split(cv2.max(under, cv2.subtract(lab, high)))
        light, a, b = (cv2.LUT(d, s) for d, s in zip(differences, SQUARES, strict=True))
        # A shadow darkens by a share; deeper than any shadow counts fully again.
        floor = cv2.multiply(cv2.extractChannel(low, 0), MIN_SHADOW_LIGHT)  # type: ignore[call-overload]  # stubs want an array
        shadow = (cv2.extractChannel(under, 0) > 0) & (cv2.extractChannel(lab, 0) > floor)
        square = light * cv2.LUT(shadow.view(np.uint8), LIT_OR_SHADED) + a + b
        likely = square / (square + cv2.LUT(spread, self._even_odds))
        likely[spread == UNKNOWN] = 0.5
        if self.background.overlay.any():
            overlay = self.background.overlay.astype(np.uint8)
            to_overlay = shrinking(self.background.shrink) @ to_picture
            likely[_warp_to_crop(overlay, to_overlay, size) == 1] = 0.0
        return likely


def _warp_to_crop(
    scene: UInt8[np.ndarray, "h w *c"], to_scene: Float[np.ndarray, "3 3"], size: tuple[int, int]
) -> UInt8[np.ndarray, "y x *c"]:
    """The part of the scene that lies behind a crop of `size` (columns, rows)."""
    to_scene = to_scene / to_scene[2, 2]
    if scene.shape[1::-1] == size and np.allclose(to_scene, np.eye(3), atol=1e-6):
        return scene
    smooth = cv2.INTER_LINEAR if scene.ndim == 3 else cv2.INTER_NEAREST
    return cv2.warpPerspective(
        scene, to_scene, size, flags=smooth | cv2.WARP_INVERSE_MAP, borderValue=UNKNOWN
    )
