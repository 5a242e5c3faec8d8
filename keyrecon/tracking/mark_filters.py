"""Check a track by filters that only marks have taught.

The tracker learns the player's looks from its own frames: what it took for a head once it finds
again everywhere, and is sure of it. Filters trained on nothing but what a person marked, and what
flow has followed from there (`TrackAnchors`), know little of other poses, but nothing wrong. Where
they do not respond at all, something else was followed, and the confidence says so. (To keep such
frames from the tracker's lessons was tried: with one marked body they may be right all the same.)
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Complex64, Float, UInt8

from keyrecon.records import Track
from keyrecon.segmentation.player_crops import Cropping
from keyrecon.tracking.correlation_filters import Examples, Filters, respond, train_filters

NEAR = 0.04
"""Responses count that far around a place, player heights: half a shoe's length."""
SCALE = 200
"""Of a stored response: 1 is usual at a mark."""
HEAD_RESPONSES, HEAD_RIGHT = (0.05, 0.12), (0.15, 1.0)
"""Responses at a tracked head, and the share of heads that are right. Evidence: 18 real clips and
thirds of them, one to ten bodies marked, 1224 heads and 1437 pairs of feet that nothing fixes. With
a response below .05 heads are right (within .12 player heights) in 12 of 100, below .1 in 47, below
.2 in 95, above in 99. The tracker's own confidence says nothing: right in 97 of 100 where it is
.5 to .8, in 96 where it is .97."""
FOOT_RESPONSES, FOOT_RIGHT = (0.05, 0.3), (0.45, 1.0)
"""The same of the worse foot: right in 46 of 100 with less than .05, in 54, 70 and 79 below .1, .2
and .3, and in 99 above."""


@dataclass(frozen=True, eq=False)
class MarkFilters:
    """Filters of head and foot, taught by marks."""

    filters: Filters
    near: int
    """Pixels of the crop that responses count around a place."""

    @classmethod
    def learn(cls, examples: Examples, size: tuple[int, int], player: float) -> "MarkFilters":
        """From fixed points in crops of a size, of a player of some px."""
        filters = train_filters(examples, size, player)
        return cls(filters, max(1, round(NEAR * player)))

    def responses(self, spectrum: Complex64[np.ndarray, "C h f"]) -> UInt8[np.ndarray, "2 y x"]:
        """The best response about every second pixel of a crop, by head and foot."""
        window = np.ones((2 * self.near + 1, 2 * self.near + 1), np.uint8)
        nearby = [cv2.dilate(part, window)[::2, ::2] for part in respond(self.filters, spectrum)]
        return np.clip(SCALE * np.stack(nearby), 0, 255).astype(np.uint8)


def responses_at(
    responses: UInt8[np.ndarray, "2 y x"], parts: Float[np.ndarray, "3 2"]
) -> tuple[float, float]:
    """At a head, and at the worse of two feet, in pixels of the crop; 0 outside of it."""
    rows, columns = responses.shape[1:]
    places = np.rint(parts / 2).astype(int)
    at = [
        float(responses[min(part, 1), y, x]) / SCALE if 0 <= x < columns and 0 <= y < rows else 0.0
        for part, (x, y) in enumerate(places.tolist())
    ]
    return at[0], min(at[1:])


def doubted(
    track: Track,
    looks: Sequence[UInt8[np.ndarray, "2 y x"] | None],
    cropping: Cropping,
    rows: int,
) -> Track:
    """A track that is no surer than it looks like the marks; where nobody told looks, the same.

    Feet beneath the picture, which has so many `rows`, look like nothing, and are not asked.
    """
    parts = np.concatenate([track.head[:, None], track.feet], axis=1)
    found = np.array(
        [
            (1.0, 1.0) if own is None else responses_at(own, cropping.from_picture(parts[t], t))
            for t, own in enumerate(looks)
        ]
    )
    right = np.interp(found[:, 0], HEAD_RESPONSES, HEAD_RIGHT)
    feet_right = np.interp(found[:, 1], FOOT_RESPONSES, FOOT_RIGHT)
    right = np.minimum(right, np.where(track.feet_inside(rows), feet_right, 1.0))
    return replace(track, confidence=track.confidence * right)
