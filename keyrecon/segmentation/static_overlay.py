"""Letters and logos laid over the picture: they stand still while the scene moves.

Edges that keep their place and direction in pictures from all over the video are laid over it, or
they run along the way the camera pans, like a base line. Both mislead: a corner on such a line is
tracked anywhere along it. A corner that once moved with the scene is neither.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

MIN_PERSISTENCE = 0.85
"""An edge that keeps its place and direction to this degree all along is laid over the picture
(or the camera is static)."""


@dataclass(eq=False)
class StaticOverlay:
    """Running evidence of what keeps its place in the picture."""

    gradient: Float[np.ndarray, "2 h w"] | None = None
    strength: Float[np.ndarray, "h w"] | None = None
    moved: Int[np.ndarray, "h w"] | None = None
    """How much more often a corner there moved with the scene than it did not."""

    def add(self, grey: UInt8[np.ndarray, "h w"]) -> None:
        """Take one more picture into account."""
        soft = cv2.GaussianBlur(grey, (0, 0), 1.0)
        slope = np.stack([cv2.Sobel(soft, cv2.CV_32F, 1, 0), cv2.Sobel(soft, cv2.CV_32F, 0, 1)])
        size = np.hypot(*slope)
        self.gradient = slope if self.gradient is None else self.gradient + slope
        self.strength = size if self.strength is None else self.strength + size

    def count(
        self,
        shape: tuple[int, ...],
        corners: Float[np.ndarray, "n 2"],
        moves_along: Bool[np.ndarray, "n"],
    ) -> None:
        """Take corners into account at whose place the scene moved, and whether they did."""
        if self.moved is None:
            self.moved = np.zeros(shape[:2], int)
        x, y = corners.astype(int).T
        self.moved[y, x] += np.where(moves_along, 1, -1)

    def mask(self) -> Bool[np.ndarray, "h w"]:
        """Where persistent edges lie, if they are few against those that do not persist."""
        if self.gradient is None or self.strength is None:
            raise ValueError("no picture was added")
        strong = self.strength > np.percentile(self.strength, 90)
        persistent = strong & (np.hypot(*self.gradient) > MIN_PERSISTENCE * self.strength)
        if persistent.sum() > 0.5 * strong.sum():
            return np.zeros(strong.shape, bool)
        size = max(3, strong.shape[1] // 60)
        return cv2.dilate(persistent.astype(np.uint8), np.ones((size, size))) > 0

    def share(self, corners: Float[np.ndarray, "n 2"]) -> float:
        """Share of corners that lie on something laid over the picture."""
        x, y = corners.astype(int).T
        held = self.mask()
        if self.moved is not None:
            held &= self.moved <= 0
        return float(held[y, x].mean()) if len(x) else 0.0
