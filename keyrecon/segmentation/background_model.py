"""The scene without the player.

Sampled frames are warped into the coordinates of the reference frame, and every pixel of the
background is the median of what was observed there while the player was elsewhere. Where the camera
turns, it is a mosaic. How far a pixel is from it: see `foreground_model`.

A camera that is carried along shows near things move before far ones, and no mosaic fits all of its
frames: the range of colours at a place grows until it holds the player's too, who vanishes. It
shows in the deviation from the median. Then the frames of a few seconds have a background of their
own, the shorter the farther the scene is from lying still in its mosaic.

The background is small: the player is `player` px tall in it, which is all that tracking and edges
need.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from keyrecon.io.frame_reader import read_small, shrinking, side_by_side
from keyrecon.io.video import Video
from keyrecon.numerics.geometry import warp_points
from keyrecon.numerics.order_statistics import value_of_rank
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within
from keyrecon.records import Background, CameraPath, Colors, Track
from keyrecon.segmentation.color_model import color_bins, look_up, posterior_tables, to_lab
from keyrecon.segmentation.player_mask import player_core, player_mask
from keyrecon.segmentation.static_overlay import find_overlay

MAX_MOSAIC_SIZE = 4.0
"""Sides of the mosaic, pictures: a camera that turns far enough leaves any plane. A quarter more or
less, others with it: at most 1.9 points, 2.4 mm on four clips."""
FREE, COVERED, PLAYER = 255, 128, 0
"""Marks of pixels of a sampled frame away from the player, near, and on him."""
MAX_SAME_DIFFERENCE = 5
"""Two observations of the same background differ by no more, grey levels (video noise,
compression). A quarter more or less, others with it: at most 1.9 points, 1.8 mm on four clips."""
SURROUNDINGS_SPREAD = 40.0
"""How far the background behind the player may be from that around, grey levels. A quarter more or
less, others with it: at most 1.9 points, 1.8 mm on four clips."""
MIN_OBSERVATIONS = 3
"""Times that a colour must recur behind the player to be taken for the background. A quarter more
or less, others with it: at most 1.9 points, 2.4 mm on four clips."""
MIN_RECURRENCE = 0.08
"""The same as a share of the sampled frames: a player may cover a place nearly all the time. A
quarter more or less, others with it: at most 1.9 points, 1.8 mm on four clips."""
MAX_CANDIDATES = 24
"""Sampled frames whose colours are tried behind the player."""
STRIP = 4096
"""Pixels behind the player that are tried at a time, several strips side by side; changes nothing
but time and memory."""
MAX_MEAN_SPREAD = 8.0
"""Mean deviation of the scene from its median, grey levels, up to which one background does for all
frames: of four real clips, turned and held in the hand among them, it is .7 to 4.3; of a camera
carried round a player 16.6 for 11 s, 13.8, 11.0 and 9.2 for halves, quarters and sevenths of it.
Three times it, where a pixel is as likely the player as not, is a third of what there is between
black and a mid grey."""
LEAST_SECONDS = 2.0
"""A background is made of the frames of so long a time at least: who is followed moves off his own
place before it within a few steps, and not sooner."""
NORMAL_QUARTILE = 0.6745
"""Distance of the quartiles of a normal distribution from its mean, standard deviations."""


@dataclass(frozen=True)
class BackgroundOptions:
    """How the scene is sampled."""

    samples: Annotated[int, within(3, 1000)] = 48
    """Frames from which the scene without the player is made; more are slower."""
    player: Annotated[float, within(24, 1000)] = 128.0
    """Height of the player in the pictures of the scene, px.

    A quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips.
    """
    sure: Annotated[float, within(0.3, 30)] = 3.0
    """A pixel that differs from the scene by this many standard deviations is as likely the player
    as not.

    A quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips.
    """


def build_background(
    video: Video,
    camera: CameraPath,
    track: Track,
    colors: Colors | None = None,
    options: BackgroundOptions = BackgroundOptions(),
    progress: Progress = silent,
) -> Background:
    """The background of a sequence, with the tracked player left out; several, one after the other,
    where the scene does not lie still in one.

    The player's `colors` tell where the scene is seen although the track has the player there.
    """
    table = None if colors is None else posterior_tables(colors).max(axis=0)
    width = reduced_width(video, float(np.median(track.height)), options)
    frames = slice(0, len(video))
    whole = _sample_scene(video, frames, camera, track, table, width, options, progress)
    overlay = find_overlay(whole.lab, whole.free, whole.paths, whole.shrink)
    background = whole.background(overlay)
    most = int(len(video) / (LEAST_SECONDS * video.fps))
    count = 1
    while _mean_spread(background) > MAX_MEAN_SPREAD and count < most:
        count = min(2 * count, most)
        ends = np.linspace(0, len(video), count + 1).round().astype(int).tolist()
        spans = progress([*pairwise(ends)], "Modelling the background in parts", count)
        parts = [
            # one part's pictures at a time: of all together they would fill the memory
            _sample_scene(
                video, slice(*span), camera, track, table, width, options, silent
            ).background(overlay)
            for span in spans
        ]
        background = replace(parts[0], later=tuple(parts[1:]))
    return background


def _mean_spread(background: Background) -> float:
    """Mean deviation of what was observed, in all of the backgrounds, grey levels."""
    every = (background, *background.later)
    return float(np.mean([part.spread[part.known].mean() for part in every if part.known.any()]))


@dataclass(frozen=True, eq=False)
class _SceneSamples:
    """Some frames of a part of a sequence, reduced."""

    first: int
    """Frame that the part begins with."""
    lab: list[UInt8[np.ndarray, "h w 3"]]
    free: list[Bool[np.ndarray, "h w"]]
    """Away from the player."""
    player: list[Bool[np.ndarray, "h w"]]
    """On the player."""
    paths: Float[np.ndarray, "n 3 3"]
    """To the frame in the middle of the part, or to the reference frame for all of it."""
    to_own: Float[np.ndarray, "3 3"]
    """From the reference frame to that."""
    shrink: float
    sure: float
    """As `Background` has it."""

    def background(self, overlay: Bool[np.ndarray, "h w"]) -> Background:
        """Their median, in coordinates of the reference frame."""
        own = median_background(
            self.lab,
            self.free,
            self.paths,
            self.shrink,
            inpaint=True,
            overlay=overlay,
            player=self.player,
        )
        to_own = own.from_reference @ self.to_own
        return replace(own, from_reference=to_own, first=self.first, sure=self.sure)


def _sample_scene(
    video: Video,
    part: slice,
    camera: CameraPath,
    track: Track,
    player: Float[np.ndarray, "bins"] | None,
    width: int,
    options: BackgroundOptions,
    progress: Progress,
) -> _SceneSamples:
    """Frames spread over a part of a sequence; `player` is the probability of each colour.

    The mosaic of a short part lies about its own middle, which may be far from the reference.
    """
    count, shrink = part.stop - part.start, width / video.width
    frames = part.start + sample_frames(count, options.samples)
    pictures = read_small(video, width, set(frames.tolist()))
    lab = [to_lab(p) for p in progress(pictures, "Modelling the background", len(frames))]
    shape = lab[0].shape[:2]
    free = [~player_mask(track, int(t), shrink, shape) for t in frames]
    on_player = [player_core(track, int(t), shrink, shape) for t in frames]
    if player is not None:
        alike = (look_up(player, color_bins(picture)) > 0.5 for picture in lab)
        on_player = [core & colored for core, colored in zip(on_player, alike, strict=True)]
    to_own = np.eye(3)
    if count < len(video):
        to_own = np.linalg.inv(camera.to_reference[part.start + count // 2])
    paths = to_own @ camera.to_reference[frames]
    return _SceneSamples(part.start, lab, free, on_player, paths, to_own, shrink, options.sure)


def complete_background(first: Background, other: Background) -> Background:
    """A background, filled in from another one of the same extent where it is unknown."""
    return Background(
        color=np.where(first.known[..., None], first.color, other.color),
        spread=np.where(first.known, first.spread, other.spread),
        known=first.known | other.known,
        from_reference=first.from_reference,
        overlay=first.overlay,
        shrink=first.shrink,
    )


def reduced_width(video: Video, height: float, options: BackgroundOptions) -> int:
    """Width of pictures in which the player is `options.player` px tall; never enlarged."""
    return max(16, round(video.width * min(1.0, options.player / height)))


def sample_frames(count: int, samples: int) -> np.ndarray:
    """Frame numbers spread evenly over a sequence."""
    return np.unique(np.linspace(0, count - 1, min(samples, count)).round().astype(int))


def median_background(
    lab: list[UInt8[np.ndarray, "h w 3"]],
    free: list[Bool[np.ndarray, "h w"]],
    to_reference: Float[np.ndarray, "n 3 3"],
    shrink: float,
    inpaint: bool = False,
    min_share: float = 0.0,
    overlay: Bool[np.ndarray, "h w"] | None = None,
    player: list[Bool[np.ndarray, "h w"]] | None = None,
) -> Background:
    """Median of Lab pictures where they are free of the player, in reference coordinates.

    `shrink` tells how many pixels of these pictures a pixel of the full picture has;
    `inpaint` fills in places that are never free from what recurs there; places that are free
    in less than `min_share` of their pictures, or in fewer than three, count as unknown. What is
    laid over the pictures (`overlay`) is no part of the scene, nor is what lies on the `player`.
    """
    small = shrinking(shrink)
    rows, columns = lab[0].shape[:2]
    paths = small @ to_reference @ np.linalg.inv(small)
    low, high = _extent(paths, (rows, columns))
    shift = np.array([[1.0, 0.0, -low[0]], [0.0, 1.0, -low[1]], [0.0, 0.0, 1.0]])
    size = (int(high[0] - low[0]), int(high[1] - low[1]))
    still = size == (columns, rows) and np.allclose(paths, np.eye(3), atol=1e-9)
    if overlay is None:
        overlay = np.zeros((rows, columns), bool)
    if player is None:
        player = [np.zeros((rows, columns), bool)] * len(lab)
    layers = np.empty((4, len(lab), size[1], size[0]), np.uint8)
    for k, (picture, clear, on_player, path) in enumerate(
        zip(lab, free, player, paths, strict=True)
    ):
        alpha = np.where(clear & ~overlay, np.uint8(FREE), np.uint8(COVERED))
        alpha[on_player] = PLAYER
        channels = [*cv2.split(picture), alpha]
        if not still:
            warped = cv2.warpPerspective(cv2.merge(channels), shift @ path, size)
            channels = [*cv2.split(warped)]
        for layer, channel in zip(layers, channels, strict=True):
            layer[k] = channel
    color, spread, known = _median(layers, min_share)
    if inpaint:
        _inpaint_behind_player(layers, color, spread, known)
    return Background(color, spread, known, shift @ small, overlay, shrink)


def _extent(
    paths: Float[np.ndarray, "n 3 3"], shape: tuple[int, int]
) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    """Corners of the mosaic, px of the reduced reference frame."""
    rows, columns = shape
    corners = np.array([(0, 0), (columns, 0), (columns, rows), (0, rows)], float)
    spots = np.concatenate([warp_points(p, corners) for p in paths])
    size, middle = np.array([columns, rows]), np.array([columns, rows]) / 2
    reach = MAX_MOSAIC_SIZE / 2 * size
    low = np.maximum(np.floor(np.minimum(spots.min(axis=0), 0) - 1e-6), middle - reach)
    high = np.minimum(np.ceil(np.maximum(spots.max(axis=0), size) + 1e-6), middle + reach)
    tight = np.abs(spots.min(axis=0)).max() < 1e-6 and np.abs(spots.max(axis=0) - size).max() < 1e-6
    return (np.zeros(2), size.astype(float)) if tight else (np.floor(low), np.ceil(high))


def _median(
    layers: UInt8[np.ndarray, "4 n h w"], min_share: float
) -> tuple[UInt8[np.ndarray, "h w 3"], Float[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
    """Median, spread and whether known, of layers whose fourth channel says where they count."""
    counts = layers[3] > (FREE + COVERED) // 2
    number = np.add.reduce(counts, axis=0, dtype=np.int16)
    middle = (np.maximum(number, 1) - 1) // 2

    def of_channel(c: int, rank: Int[np.ndarray, "h w"]) -> UInt8[np.ndarray, "h w"]:
        return value_of_rank(layers[c], rank, counts)

    ranks = [(0, middle), (1, middle), (2, middle), (0, middle // 2)]
    *channels, lower = side_by_side(lambda wanted: of_channel(*wanted), ranks)
    color = np.dstack(channels)
    # Distance from the lower quartile to the median, as a standard deviation. Tried: half the
    # distance between both quartiles. On the first 240 frames of six rendered sequences it moved
    # PCK by -1.8 to +1.5 points (97.3 on average with either) and the share of frames with both
    # feet right by -9 to +8 points: neither is better, and this one is cheaper.
    spread = (color[..., 0].astype(np.float32) - lower) / NORMAL_QUARTILE
    inside = np.add.reduce(layers[3] > COVERED // 2, axis=0, dtype=np.int16)
    return color, spread, number >= np.maximum(MIN_OBSERVATIONS, min_share * inside)


def _inpaint_behind_player(
    layers: UInt8[np.ndarray, "4 n h w"],
    color: UInt8[np.ndarray, "h w 3"],
    spread: Float[np.ndarray, "h w"],
    known: Bool[np.ndarray, "h w"],
) -> None:
    """Fill in, where the player always is nearby, what recurs between the moving limbs.

    A player who stays in one place covers it in every sampled frame, but never all of it: behind
    the limbs the same colour comes back again and again, and it resembles the scene around. Every
    sampled colour is weighed by how often it recurs and how near it is to that scene. Behind the
    middle of the body only what moves away from it is seen (`player_core`).
    """
    hidden = ~known & ((layers[3] > COVERED // 2).sum(axis=0) >= MIN_OBSERVATIONS)
    if not hidden.any() or not known.any():
        return
    around = cv2.inpaint(color, (~known).astype(np.uint8), 5, cv2.INPAINT_TELEA)[hidden]
    strips = np.array_split(np.arange(len(around)), -(-len(around) // STRIP))
    observed = layers[:, :, hidden]
    parts = side_by_side(lambda part: _recurring_color(observed[..., part], around[part]), strips)
    chosen, filled = (np.concatenate(column) for column in zip(*parts, strict=True))
    rows, columns = np.argwhere(hidden)[filled].T
    color[rows, columns] = chosen[filled]
    spread[rows, columns] = MAX_SAME_DIFFERENCE / 2
    known[rows, columns] = True


def _recurring_color(
    observed: UInt8[np.ndarray, "4 n p"], around: UInt8[np.ndarray, "p 3"]
) -> tuple[UInt8[np.ndarray, "p 3"], Bool[np.ndarray, "p"]]:
    """The colour that recurs most and resembles what is around, and whether it recurs enough."""
    valid = observed[3] > COVERED // 2
    channels = np.ascontiguousarray(observed[:3])
    number = np.uint8 if len(valid) <= np.iinfo(np.uint8).max else np.uint16
    best = np.zeros(len(around), np.float32)
    chosen, recurrence = np.zeros_like(around), np.zeros(len(around), np.int64)
    most = recurrence
    tried = np.linspace(0, len(valid) - 1, min(MAX_CANDIDATES, len(valid))).astype(int)
    for index in tried:
        candidate = channels[:, index].T
        least = candidate - np.minimum(candidate, MAX_SAME_DIFFERENCE)
        width = candidate + np.minimum(255 - candidate, MAX_SAME_DIFFERENCE) - least
        same = valid & valid[index]
        for values, low, range_ in zip(channels, least.T, width.T, strict=True):
            same &= values - low <= range_  # what is below wraps around and is far above
        count = np.add.reduce(same.view(np.uint8), axis=0, dtype=number).astype(np.int64)
        most = np.maximum(most, count)
        strange = (candidate.astype(np.float32) - around) / SURROUNDINGS_SPREAD
        score = count * np.exp(-0.5 * np.square(strange).sum(axis=1))
        better = score > best
        best[better], recurrence[better] = score[better], count[better]
        part = same[:, better]
        for c, values in enumerate(channels):
            total = np.add.reduce(values[:, better] * part, axis=0, dtype=np.uint32)
            chosen[better, c] = (total / count[better]).round()
    # A colour that recurs far more often is the scene, or a trunk that never leaves: nobody knows.
    min_recurrence = max(MIN_OBSERVATIONS, MIN_RECURRENCE * len(valid))
    return chosen, recurrence >= np.maximum(0.5 * most, min_recurrence)
