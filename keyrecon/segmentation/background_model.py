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
from jaxtyping import Bool, Float, Float32, UInt8

from keyrecon.io.frame_reader import read_small, shrinking
from keyrecon.io.video import Video
from keyrecon.numerics.geometry import warp_points
from keyrecon.progress import Progress, silent
from keyrecon.records import Background, CameraPath, Track
from keyrecon.segmentation.color_model import to_lab

LARGEST_MOSAIC = 4.0
"""Sides of the mosaic, pictures: a camera that turns far enough leaves any plane."""
NOISE = 4
"""Deviation of video noise and compression, grey levels; the least spread assumed."""
SHADOW = 0.35
"""Weight of a darkening: a shadow takes up to half of the light and leaves the chroma."""
DEEPEST_SHADOW = 0.45
"""Share of the light that a cast shadow leaves, at least."""
TRUNK, LEGS = 0.7, 0.5
"""Widths of the player, arms close and knees bent, in heights: beyond it is background."""
ONE_FOOT, STRIDE = 0.1, 0.45
"""Feet nearer than this may be one foot taken twice; the other is then up to a stride aside. A leg
that is left out here and stands for long would become background. Player heights."""
HIPS = 0.45
"""Where trunk becomes legs, share of the way from head to mid-feet."""
UNKNOWN = 255
"""Spread of what was never seen."""
FREE, COVERED = 255, 128
"""Marks of pixels of a sampled frame away from the player, and near or on the player."""
RECURRENCE = 5
"""Two looks at the same background differ by no more, grey levels (video noise, compression)."""
RESEMBLANCE = 40.0
"""How far the background behind the player may be from that around, grey levels."""
FEWEST_LOOKS = 3
"""Times that a colour must recur behind the player to be taken for the background."""
LEAST_SHARE = 0.08
"""The same as a share of the sampled frames: a player may cover a place nearly all the time."""
CANDIDATES = 24
"""Sampled frames whose colours are tried."""
CHROMA = 1.6
"""Weight of a and b against L: chroma varies less with light."""
SQUARES = np.arange(256, dtype=np.float32)[:, None, None] * np.float32((1, CHROMA, CHROMA))
SQUARES *= SQUARES
"""Weighted square of a difference in L, a and b."""


@dataclass(frozen=True)
class BackgroundOptions:
    """How the scene is sampled."""

    samples: int = 48
    """Frames that the median is taken over."""
    player: float = 128.0
    """Height of the player in the plate, px."""
    sure: float = 3.0
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
    return combine_plate(lab, free, camera.to_reference[frames], shrink, look_behind=True)


def fill_plate(plate: Background, other: Background) -> Background:
    """A plate, filled in from another one of the same extent where it is unknown."""
    return Background(
        plate=np.where(plate.known[..., None], plate.plate, other.plate),
        spread=np.where(plate.known, plate.spread, other.spread),
        known=plate.known | other.known,
        from_reference=plate.from_reference,
    )


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
    look_behind: bool = False,
    least: float = 0.0,
) -> Background:
    """Median of Lab pictures where they are free of the player, in reference coordinates.

    `shrink` tells how many pixels of these pictures a pixel of the full picture has;
    `look_behind` fills in places that are never free from what recurs there; places that are free
    in less than the share `least` of their pictures, or in fewer than three, count as unknown.
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
        alpha = np.where(clear, FREE, COVERED).astype(np.uint8)
        layer = np.dstack([picture, alpha])
        layers.append(layer if still else cv2.warpPerspective(layer, shift @ path, size))
    stack = np.stack(layers)
    plate, spread, known = _median(stack, least)
    if look_behind:
        _inpaint_from_neighbours(stack, plate, spread, known)
    return Background(plate, spread, known, shift @ small)


@dataclass(frozen=True, eq=False)
class ForegroundModel:
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

    @cached_property
    def _doubt(self) -> Float32[np.ndarray, "256"]:
        """Square of the difference that is as likely the player as not, by `_spread`."""
        return np.square(np.arange(256, dtype=np.float32) * np.float32(self.sure / 8))

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
        under = cv2.subtract(low, lab)
        squares = cv2.LUT(cv2.max(under, cv2.subtract(lab, high)), SQUARES)
        light, a, b = cv2.split(squares)
        # A shadow darkens by a share; deeper than any shadow counts fully again.
        floor = cv2.multiply(cv2.extractChannel(low, 0), DEEPEST_SHADOW)
        shadow = (under[..., 0] > 0) & (cv2.extractChannel(lab, 0) > floor)
        np.multiply(light, SHADOW**2, out=light, where=shadow)
        square = light + a + b
        likely = square / (square + self._doubt[spread])
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
    """Where the player is: lines from above the head to the hips and on to each foot."""
    mask = np.zeros(shape, np.uint8)
    head, feet, height = track.head[frame], track.feet[frame], track.height[frame]
    hips = head + HIPS * (track.mid_feet[frame] - head)
    top = head - (0.0, 0.05 * height)
    if np.linalg.norm(feet[0] - feet[1]) < ONE_FOOT * height:
        feet = feet.mean(axis=0) + STRIDE * height * np.array([(-1, 0), (0, 0), (1, 0)])
    for start, end, width in ((top, hips, TRUNK), *((hips, foot, LEGS) for foot in feet)):
        x0, y0, x1, y1 = (round(float(c) * shrink) for c in (*start, *end))
        cv2.line(mask, (x0, y0), (x1, y1), 1, max(2, round(width * height * shrink)))
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
    layers: UInt8[np.ndarray, "n h w 4"], least: float
) -> tuple[UInt8[np.ndarray, "h w 3"], Float[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
    """Median, spread and presence over layers whose fourth channel says where they count."""
    counts = layers[..., 3] > (FREE + COVERED) // 2
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
    seen = (layers[..., 3] > COVERED // 2).sum(axis=0)
    return plate, spread, number >= np.maximum(FEWEST_LOOKS, least * seen)


def _inpaint_from_neighbours(
    layers: UInt8[np.ndarray, "n h w 4"],
    plate: UInt8[np.ndarray, "h w 3"],
    spread: Float[np.ndarray, "h w"],
    known: Bool[np.ndarray, "h w"],
) -> None:
    """Fill in, where the player always is nearby, what shows between the moving limbs.

    A player who stays in one place covers it in every sampled frame, but never all of it: behind
    the limbs the same colour comes back again and again, and it resembles the scene around. Every
    sampled colour is weighed by how often it recurs and how near it is to that scene.
    """
    hidden = ~known & ((layers[..., 3] > COVERED // 2).sum(axis=0) >= FEWEST_LOOKS)
    if not hidden.any() or not known.any():
        return
    around = cv2.inpaint(plate, (~known).astype(np.uint8), 5, cv2.INPAINT_TELEA)[hidden]
    seen = layers[:, hidden]
    values, valid = seen[..., :3], seen[..., 3] > COVERED // 2
    best = np.zeros(len(around), np.float32)
    color, looks = np.zeros_like(around), np.zeros(len(around), np.int64)
    most = looks
    for index in np.linspace(0, len(values) - 1, min(CANDIDATES, len(values))).astype(int):
        candidate = values[index]
        near = np.where(values > candidate, values - candidate, candidate - values)
        again = (near <= RECURRENCE).all(axis=2) & valid & valid[index]
        count = again.sum(axis=0)
        most = np.maximum(most, count)
        strange = (candidate.astype(np.float32) - around) / RESEMBLANCE
        score = count * np.exp(-0.5 * np.square(strange).sum(axis=1))
        total = np.einsum("npc,np->pc", values, again, dtype=np.float32)
        mean = total / np.maximum(count, 1)[:, None]
        better = score > best
        best[better], looks[better] = score[better], count[better]
        color[better] = mean[better].round()
    # A colour that recurs far more often is the scene, or a trunk that never leaves: nobody knows.
    found = looks >= np.maximum(0.5 * most, max(FEWEST_LOOKS, LEAST_SHARE * len(layers)))
    where = np.argwhere(hidden)[found]
    plate[where[:, 0], where[:, 1]] = color[found]
    spread[where[:, 0], where[:, 1]] = RECURRENCE / 2
    known[where[:, 0], where[:, 1]] = True


def _deviation(ranked: UInt8[np.ndarray, "n h w"], middle: np.ndarray) -> Float[np.ndarray, "h w"]:
    """Half the distance between the quartiles, as a standard deviation."""
    low = np.take_along_axis(ranked, (middle // 2)[None], axis=0)[0].astype(np.float32)
    center = np.take_along_axis(ranked, middle[None], axis=0)[0].astype(np.float32)
    return (center - low) / 0.6745
