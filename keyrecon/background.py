"""The scene without the player, and how far a pixel is from it.

Sampled frames are warped into the coordinates of the reference frame, and every pixel of the plate
is the median of what was seen there while the player was elsewhere. Where the camera turns, the
plate is a mosaic. A pixel of a frame is compared with the whole range of colours that the plate
shows within a pixel of its place, so that a camera path that is a little off does not light up
every edge (the idea of ViBe's neighbours, Barnich and Van Droogenbroeck, IEEE TIP 20, 2011, turned
into an interval), and darkening without a change of chroma, a shadow, counts for less.

The plate is small: the player is `player` px tall in it, which is all that tracking and edges need.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from keyrecon.camera import warp_points
from keyrecon.colors import to_lab
from keyrecon.pictures import read_small, shrinking
from keyrecon.progress import Progress, silent
from keyrecon.records import Background, CameraPath, Track
from keyrecon.video import Video

LARGEST_MOSAIC = 4.0
"""Sides of the mosaic, pictures: a camera that turns far enough leaves any plane."""
NOISE = 4
"""Deviation of video noise and compression, grey levels; the least spread assumed."""
SHADOW = 0.35
"""Weight of a darkening: a shadow takes up to half of the light and leaves the chroma."""
DEEPEST_SHADOW = 0.45
"""Share of the light that a cast shadow leaves, at least."""
BODY_HALF_WIDTH = 0.33
"""Around the head-feet axis, player heights: nothing there is used for the plate."""
UNKNOWN = 255
"""Spread of what was never seen."""
CHROMA = 1.6
"""Weight of a and b against L: chroma varies less with light."""


@dataclass(frozen=True)
class BackgroundOptions:
    """How the scene is sampled."""

    samples: int = 48
    """Frames that the median is taken over."""
    player: float = 128.0
    """Height of the player in the plate, px."""
    sure: float = 4.0
    """A pixel this many deviations off is as likely the player as not."""


def build_background(
    video: Video,
    camera: CameraPath,
    track: Track,
    options: BackgroundOptions = BackgroundOptions(),
    progress: Progress = silent,
) -> Background:
    """The plate of a sequence, with the tracked player left out."""
    width = reduced_width(video, float(np.median(track.height)), options)
    shrink = width / video.width
    frames = sample_frames(len(video), options.samples)
    pictures = read_small(video, width, set(frames.tolist()))
    lab = [to_lab(p) for p in progress(pictures, "Learning the background", len(frames))]
    free = [~_body(track, int(t), shrink, lab[0].shape[:2]) for t in frames]
    return combine_plate(lab, free, camera.to_reference[frames], shrink)


def reduced_width(video: Video, height: float, options: BackgroundOptions) -> int:
    """Width of pictures in which the player is `options.player` px tall; never enlarged."""
    return max(16, round(video.width * min(1.0, options.player / height)))


def sample_frames(count: int, samples: int) -> np.ndarray:
    """Frame numbers spread evenly over a sequence."""
    return np.unique(np.linspace(0, count - 1, min(samples, count)).round().astype(int))


def combine_plate(
    lab: list[UInt8[np.ndarray, "h w 3"]],
    free: list[Bool[np.ndarray, "h w"]],
    to_reference: Float[np.ndarray, "n 3 3"],
    shrink: float,
) -> Background:
    """Median of Lab pictures where they are free of the player, in reference coordinates.

    `shrink` tells how many pixels of these pictures a pixel of the full picture has.
    """
    small = shrinking(shrink)
    rows, columns = lab[0].shape[:2]
    paths = small @ to_reference @ np.linalg.inv(small)
    low, high = _extent(paths, (rows, columns))
    shift = np.array([[1.0, 0.0, -low[0]], [0.0, 1.0, -low[1]], [0.0, 0.0, 1.0]])
    size = (int(high[0] - low[0]), int(high[1] - low[1]))
    still = size == (columns, rows) and np.allclose(paths, np.eye(3), atol=1e-9)
    layers = []
    for picture, clear, path in zip(lab, free, paths, strict=True):
        alpha = clear.astype(np.uint8) * 255
        layer = np.dstack([picture, alpha])
        layers.append(layer if still else cv2.warpPerspective(layer, shift @ path, size))
    plate, spread, known = _median(np.stack(layers))
    return Background(plate, spread, known, shift @ small)


@dataclass(frozen=True, eq=False)
class Scene:
    """A background ready to be compared with the frames of its video."""

    background: Background
    camera: CameraPath
    sure: float = BackgroundOptions.sure

    @cached_property
    def _low(self) -> UInt8[np.ndarray, "h w 3"]:
        """Least colour around every pixel of the plate."""
        return cv2.erode(self.background.plate, np.ones((3, 3), np.uint8))

    @cached_property
    def _high(self) -> UInt8[np.ndarray, "h w 3"]:
        """Greatest colour around every pixel of the plate."""
        return cv2.dilate(self.background.plate, np.ones((3, 3), np.uint8))

    @cached_property
    def _spread(self) -> UInt8[np.ndarray, "h w"]:
        """Deviation in steps of 1/8 grey level; UNKNOWN where the scene was not seen."""
        spread = np.clip(self.background.spread * 8, 8 * NOISE, UNKNOWN - 1).astype(np.uint8)
        unseen = cv2.dilate((~self.background.known).astype(np.uint8), np.ones((3, 3), np.uint8))
        spread[unseen > 0] = UNKNOWN
        return spread

    def foreground(
        self,
        lab: UInt8[np.ndarray, "h w 3"],
        frame: int,
        to_picture: Float[np.ndarray, "3 3"],
    ) -> Float[np.ndarray, "h w"]:
        """Probability that each pixel of a crop is not background; 0.5 where nobody knows.

        `to_picture` maps pixels of the crop to those of the full picture of this frame.
        """
        to_plate = self.background.from_reference @ self.camera.to_reference[frame] @ to_picture
        size = (lab.shape[1], lab.shape[0])
        low, high = (_seen_through(plate, to_plate, size) for plate in (self._low, self._high))
        spread = _seen_through(self._spread, to_plate, size)
        under, over = cv2.subtract(low, lab), cv2.subtract(lab, high)
        off = cv2.max(under, over).astype(np.float32)
        # A shadow darkens by a share; deeper than any shadow counts fully again.
        floor = cv2.multiply(low[..., 0], DEEPEST_SHADOW)
        shadow = (under[..., 0] > 0) & (lab[..., 0] > floor)
        off[..., 0][shadow] *= SHADOW
        off *= (1.0, CHROMA, CHROMA)
        square = np.einsum("ijk,ijk->ij", off, off)
        likely = square / (square + (spread.astype(np.float32) * (self.sure / 8)) ** 2)
        likely[spread == UNKNOWN] = 0.5
        return likely


def _seen_through(
    plate: UInt8[np.ndarray, "h w *c"], to_plate: Float[np.ndarray, "3 3"], size: tuple[int, int]
) -> UInt8[np.ndarray, "y x *c"]:
    """The part of a plate that a crop of `size` (columns, rows) looks at."""
    to_plate = to_plate / to_plate[2, 2]
    if plate.shape[1::-1] == size and np.allclose(to_plate, np.eye(3), atol=1e-6):
        return plate
    smooth = cv2.INTER_LINEAR if plate.ndim == 3 else cv2.INTER_NEAREST
    return cv2.warpPerspective(
        plate, to_plate, size, flags=smooth | cv2.WARP_INVERSE_MAP, borderValue=UNKNOWN
    )


def _body(
    track: Track, frame: int, shrink: float, shape: tuple[int, int]
) -> Bool[np.ndarray, "h w"]:
    """Where the player is, generously: a thick line from above the head to the feet."""
    mask = np.zeros(shape, np.uint8)
    head, feet, height = track.head[frame], track.feet[frame], track.height[frame]
    width = max(2, round(2 * BODY_HALF_WIDTH * height * shrink))
    for foot in feet:
        ends = (np.array([head, foot]) * shrink).round().astype(int)
        cv2.line(mask, tuple(map(int, ends[0])), tuple(map(int, ends[1])), 1, width)
    return mask > 0


def _extent(
    paths: Float[np.ndarray, "n 3 3"], shape: tuple[int, int]
) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    """Corners of the mosaic, px of the reduced reference frame."""
    rows, columns = shape
    corners = np.array([(0, 0), (columns, 0), (columns, rows), (0, rows)], float)
    spots = np.concatenate([warp_points(p, corners) for p in paths])
    size, middle = np.array([columns, rows]), np.array([columns, rows]) / 2
    reach = LARGEST_MOSAIC / 2 * size
    low = np.maximum(np.floor(np.minimum(spots.min(axis=0), 0) - 1e-6), middle - reach)
    high = np.minimum(np.ceil(np.maximum(spots.max(axis=0), size) + 1e-6), middle + reach)
    tight = np.abs(spots.min(axis=0)).max() < 1e-6 and np.abs(spots.max(axis=0) - size).max() < 1e-6
    return (np.zeros(2), size.astype(float)) if tight else (np.floor(low), np.ceil(high))


def _median(
    layers: UInt8[np.ndarray, "n h w 4"],
) -> tuple[UInt8[np.ndarray, "h w 3"], Float[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
    """Median, spread and presence over layers whose fourth channel says where they count."""
    counts = layers[..., 3] > 250
    number = counts.sum(axis=0)
    plate = np.empty((*number.shape, 3), np.uint8)
    spread = np.zeros(number.shape, np.float32)
    middle = (np.maximum(number, 1) - 1) // 2
    for c in range(3):
        values = np.where(counts, layers[..., c], 255)
        ranked = np.sort(values, axis=0)
        # Values that do not count are 255 and so rank last.
        plate[..., c] = np.take_along_axis(ranked, middle[None], axis=0)[0]
        if c == 0:
            spread = _deviation(ranked, middle)
    return plate, spread, number >= 3


def _deviation(
    ranked: UInt8[np.ndarray, "n h w"], middle: np.ndarray
) -> Float[np.ndarray, "h w"]:
    """Half the distance between the quartiles, as a standard deviation."""
    low = np.take_along_axis(ranked, (middle // 2)[None], axis=0)[0].astype(np.float32)
    center = np.take_along_axis(ranked, middle[None], axis=0)[0].astype(np.float32)
    return (center - low) / 0.6745
