"""The player cut out of every frame at one size, and channels that tell its parts apart.

Crops hang on the rough place of the head, so that arms, racket and a false foot do not move them.
Channels are: how far a pixel is from the background, back-projection of every part, and edges of
four directions, doubled in angle so that dark-on-bright and bright-on-dark count alike.
"""

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from scipy.fft import next_fast_len

from keyrecon.io.frame_reader import read_small, shrinking, side_by_side
from keyrecon.io.video import Video
from keyrecon.numerics.geometry import cut_affine
from keyrecon.progress import Progress, silent
from keyrecon.records import Colors, Track
from keyrecon.segmentation.color_model import (
    color_bins,
    foot_table,
    look_up,
    posterior_tables,
    to_lab,
)
from keyrecon.segmentation.foreground_model import ForegroundModel
from keyrecon.segmentation.part_evidence import BACKGROUND_WEIGHT

ABOVE_HEAD, BELOW_HEAD, ASIDE = 0.3, 1.25, 0.86
"""Reach of a crop from the head, player heights: a jump or a deep lunge stays inside. A quarter
more or less, others with them: at most 1.9 points, 1.8 mm on four clips; with half below the head
no player is found."""
OVERSAMPLING = 1.2
"""Pictures are read this much larger than the crops, which keeps edges sharp, and no larger. A
quarter more or less, others with it: at most 1.9 points, 1.8 mm on four clips."""
DIRECTIONS = 4
"""Of edges: level, upright and the two diagonals."""
FAINT = 8.0
"""Grey-level slope per pixel that counts half: noise counts for little, all edges alike. A quarter
more or less, others with it: at most 1.9 points, 1.8 mm on four clips."""


@dataclass(frozen=True, eq=False)
class Cropping:
    """Where the crop of each frame lies; the player is equally tall in all of them."""

    origin: Float[np.ndarray, "T 2"]
    """Picture position of each crop's pixel (0, 0)."""
    scale: Float[np.ndarray, "T"]
    """Crop pixels per picture pixel."""
    size: tuple[int, int]
    """Rows and columns."""

    @classmethod
    def below_heads(cls, track: Track, player: float) -> "Cropping":
        """Crops placed by the head, the player `player` px tall; sizes are quick to transform."""
        rows, columns = (ABOVE_HEAD + BELOW_HEAD) * player, 2 * ASIDE * player
        size = 2 * next_fast_len(round(rows / 2)), 2 * next_fast_len(round(columns / 2))
        corner, scale = np.array([(size[1] - 1) / 2, ABOVE_HEAD * player]), player / track.height
        return cls(track.head - corner / scale[:, None], scale, size)

    @classmethod
    def around_boxes(cls, track: Track, player: float, size: tuple[int, int]) -> "Cropping":
        """Crops of one size around the middle of the track's box."""
        scale = player / track.height
        center = (track.box[:, :2] + track.box[:, 2:]) / 2
        return cls(center - (np.array(size[::-1]) - 1) / 2 / scale[:, None], scale, size)

    def every(self, step: int) -> "Cropping":
        """The crops of each `step`-th frame."""
        return Cropping(self.origin[::step], self.scale[::step], self.size)

    def reading_width(self, video: Video) -> int:
        """Width that pictures are reduced to before they are cropped, px."""
        return min(video.width, round(video.width * OVERSAMPLING * float(np.median(self.scale))))

    def crop_to_picture(self, t: int) -> Float[np.ndarray, "3 3"]:
        """Affine map from the crop of frame t to its picture."""
        scale, corner = float(self.scale[t]), self.origin[t]
        return np.array([[1 / scale, 0, corner[0]], [0, 1 / scale, corner[1]], [0, 0, 1]])

    def to_picture(self, places: Float[np.ndarray, "m 2"], t: int) -> Float[np.ndarray, "m 2"]:
        """Picture pixels of places in the crop of frame t."""
        return self.origin[t] + places / self.scale[t]

    def from_picture(self, places: Float[np.ndarray, "m 2"], t: int) -> Float[np.ndarray, "m 2"]:
        """Places in the crop of frame t of picture pixels."""
        return (places - self.origin[t]) * self.scale[t]


@dataclass(frozen=True, eq=False)
class Crops:
    """The player in every frame."""

    lab: UInt8[np.ndarray, "T h w 3"]
    foreground: UInt8[np.ndarray, "T h w"]
    """Probability that a pixel is not background, of 255; 0 outside the picture."""


def cut_crops(
    video: Video, cropping: Cropping, scene: ForegroundModel, progress: Progress = silent
) -> Crops:
    """Read all frames and cut the player out."""
    count, size = len(video), cropping.size
    lab = np.zeros((count, *size, 3), np.uint8)
    foreground = np.zeros((count, *size), np.uint8)
    width = cropping.reading_width(video)
    to_small = shrinking(width / video.width)

    def cut(entry: tuple[int, UInt8[np.ndarray, "y x 3"]]) -> None:
        t, picture = entry
        to_picture = cropping.crop_to_picture(t)
        way = (to_small @ to_picture)[:2]
        whole = np.full(picture.shape[:2], 255, np.uint8)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        inside = cv2.warpAffine(whole, way, size[::-1], flags=flags)
        lab[t] = to_lab(cut_affine(picture, way, size))
        foreground[t] = np.rint(scene.foreground(lab[t], t, to_picture) * inside)

    pictures = progress(read_small(video, width), "Cutting out the player", count)
    deque(side_by_side(cut, enumerate(pictures)), maxlen=0)
    return Crops(lab, foreground)


@dataclass(frozen=True, eq=False)
class Channels:
    """Feature channels of crops, which correlation filters are trained on."""

    tables: Float[np.ndarray, "C bins"]
    """Posterior of each part by colour bin."""
    border: Float[np.ndarray, "h w"]
    """Falls to zero towards the border, as filters take a crop for periodic."""

    @classmethod
    def of(cls, colors: Colors, size: tuple[int, int]) -> "Channels":
        """Channels for the colours of a player and crops of one size."""
        tables = np.stack([*posterior_tables(colors), foot_table(colors)])
        rows, columns = (np.hanning(n + 2)[1:-1] ** 0.25 for n in size)
        return cls(tables.astype(np.float32), np.outer(rows, columns).astype(np.float32))

    def compute(
        self, lab: UInt8[np.ndarray, "h w 3"], foreground: UInt8[np.ndarray, "h w"]
    ) -> Float[np.ndarray, "D h w"]:
        """All channels of a crop."""
        parts = len(self.tables)
        channels = np.empty((1 + parts + DIRECTIONS, *foreground.shape), np.float32)
        np.multiply(foreground, np.float32(1 / 255), out=channels[0])
        channels[1 : 1 + parts] = look_up(self.tables, color_bins(lab))
        channels[1 : 1 + parts] *= BACKGROUND_WEIGHT + (1 - BACKGROUND_WEIGHT) * channels[0]
        light = np.ascontiguousarray(lab[..., 0])
        gx, gy = (cv2.Sobel(light, cv2.CV_32F, *d, scale=0.25) for d in ((1, 0), (0, 1)))
        size = np.hypot(gx, gy)
        share = 1 / ((size + FAINT) * (size + 1e-6))
        along, across = (gx * gx - gy * gy) * share, 2 * gx * gy * share
        for channel, map_ in zip(
            channels[-DIRECTIONS:], (along, -along, across, -across), strict=True
        ):
            np.maximum(map_, 0, out=channel)
        channels *= self.border
        return channels

    def player(self, channels: Float[np.ndarray, "D h w"]) -> Float[np.ndarray, "h w"]:
        """Any part of the player where the scene is covered, from the channels of a crop."""
        return channels[1 : 1 + len(self.tables)].max(axis=0) * channels[0]
