"""Coloured regions of the player and their directed edges (Section 4.1).

Every frame is cut out around the player and brought to a common player height, and its pixels are
labelled with the part of the player that they show (`part_labels.py`). Contours of each region,
inner borders between two colours included, are walked so that the region lies on the left in the
picture, and sampled at regular arc length: each sample is an edge element, a point with a unit
tangent. What lies within any region is sampled as well: the player's silhouette.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import cv2
import numpy as np
from jaxtyping import Bool, Complex, Float, Int, UInt8

from keyrecon.io.frame_reader import read_small, shrinking, side_by_side
from keyrecon.io.video import Video
from keyrecon.numerics.geometry import cut_affine, from_complex
from keyrecon.numerics.ragged import ranges
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within
from keyrecon.records import Background, CameraPath, Colors, Edges, Track
from keyrecon.segmentation.color_model import to_lab
from keyrecon.segmentation.foreground_model import ForegroundModel
from keyrecon.segmentation.part_labels import build_part_tables, label_crop
from keyrecon.segmentation.player_crops import Cropping

CROP_WIDTH, CROP_HEIGHT = 1.75, 1.5
"""Size of the crop, player heights: a lunge with an arm stretched out; a raised arm. A quarter more
or less, others with them: at most 1.9 points, 1.8 mm on four clips."""
WAIST_SHARE = 0.42
"""Where the body is cut, shares of the way from head to mid-feet: hips .44, waist .37. A quarter
more or less, others with it: at most 1.9 points, 1.2 mm on four clips; halved or doubled: 3.5
mm."""
OVERLAP = 0.05
"""Width of the band that counts for both halves, in the same shares. A quarter more or less, others
with it: at most 1.9 points, 1.8 mm on four clips."""
MIN_SAMPLES = 6
"""Contours with fewer samples have no direction to speak of. A quarter more or less, others with
it: at most 1.0 points, 1.8 mm on four clips."""
INSIDE_SPACING = 0.04
"""Spacing of the places on the player, heights: a shank is as broad as two. Half of it made no
difference to what the silhouette tells of legs. A quarter more or less, others with it: at most 1.9
points, 1.8 mm on four clips."""
SMOOTHING_KERNEL = np.exp(-0.5 * np.arange(-3, 4) ** 2)
SMOOTHING_KERNEL /= SMOOTHING_KERNEL.sum()
"""Low-pass along a contour, over samples: pixels make stairs."""


@dataclass(frozen=True)
class EdgeOptions:
    """How regions and edges are traced."""

    player: Annotated[int, within(24, 1000)] = 112
    """Height of the player in the crops, px; smaller is faster and coarser.

    A quarter more or less, others with it: at most 0.7 points, 1.2 mm on four clips; halved: 2.4
    points.
    """
    step: Annotated[float, within(0.004, 0.2)] = 0.018
    """Distance between edge elements along an outline, player heights; larger is faster and
    coarser.

    A quarter more or less, others with it: at most 1.9 points, 1.8 mm on four clips.
    """
    most: Annotated[int, within(20, 10_000)] = 400
    """Edge elements of one frame at most.

    A quarter more or less, others with it: at most 1.7 points, 1.2 mm on four clips.
    """


def find_edges(
    video: Video,
    track: Track,
    camera: CameraPath,
    background: Background,
    colors: Colors,
    options: EdgeOptions = EdgeOptions(),
    progress: Progress = silent,
) -> tuple[Edges, ...]:
    """Directed edges of every frame, px of the full picture."""
    scene = ForegroundModel(background, camera)
    tables = build_part_tables(colors)
    size = (round(CROP_HEIGHT * options.player), round(CROP_WIDTH * options.player))
    cropping = Cropping.around_boxes(track, float(options.player), size)
    width = cropping.reading_width(video)
    to_small = shrinking(width / video.width)

    def trace(entry: tuple[int, UInt8[np.ndarray, "h w 3"]]) -> Edges:
        t, picture = entry
        to_picture = cropping.crop_to_picture(t)
        way = (to_small @ to_picture)[:2]
        crop = to_lab(cut_affine(picture, way, size))
        foreground = scene.foreground(crop, t, to_picture)
        foreground = foreground * _inside_picture(way, size, picture.shape[:2])
        axis = cropping.from_picture(np.stack([track.head[t], track.mid_feet[t]]), t)
        labels = label_crop(crop, foreground, tables, axis, options.player)
        edges = _to_picture(trace_edges(labels, options), cropping, track, t)
        inside = sample_inside(labels, INSIDE_SPACING * options.player)
        return replace(edges, inside=cropping.to_picture(inside, t))

    pictures = progress(read_small(video, width), "Tracing edges", len(video))
    return tuple(side_by_side(trace, enumerate(pictures)))


def _inside_picture(
    to_picture: Float[np.ndarray, "2 3"], size: tuple[int, int], picture: tuple[int, int]
) -> UInt8[np.ndarray, "y x"]:
    """1 where a crop of `size` lies inside a picture of another (rows, columns)."""
    rows = to_picture[1, 1] * np.arange(size[0]) + to_picture[1, 2]
    columns = to_picture[0, 0] * np.arange(size[1]) + to_picture[0, 2]
    inside = (rows >= 0) & (rows <= picture[0] - 1)
    across = (columns >= 0) & (columns <= picture[1] - 1)
    return (inside[:, None] & across).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class _Elements:
    """Edge elements of a crop."""

    points: Float[np.ndarray, "E 2"]
    tangent: Float[np.ndarray, "E 2"]
    color: Int[np.ndarray, "E"]


@dataclass(frozen=True, eq=False)
class _Contours:
    """Closed contours, one after the other."""

    pixels: Complex[np.ndarray, "N"]
    """x + iy"""
    sizes: Int[np.ndarray, "W"]
    backwards: Bool[np.ndarray, "W"]
    """Whether the region is on the right."""
    color: Int[np.ndarray, "W"]


def trace_edges(labels: UInt8[np.ndarray, "h w"], options: EdgeOptions) -> _Elements:
    """Contours of all regions as elements with the region on their left, in crop pixels."""
    step = options.step * options.player
    contours = _find_contours(labels, (MIN_SAMPLES - 0.5) * step)
    walks, lengths = _resample(contours, step)
    points, tangent = _smooth_walks(walks, lengths)
    elements = _Elements(points, tangent, np.repeat(contours.color, lengths))
    size = np.array(labels.shape[::-1])
    inside = ((points > 1) & (points < size - 2)).all(axis=1)
    return _thin(elements, np.logical_and(inside, tangent.any(axis=1)), options.most)


def sample_inside(labels: UInt8[np.ndarray, "h w"], spacing: float) -> Float[np.ndarray, "P 2"]:
    """Middles of the cells of a grid that regions cover by half and more, crop pixels."""
    cell = max(1, round(spacing))
    covered = cv2.blur((labels > 0).astype(np.float32), (cell, cell))
    rows, columns = (
        spacing * (np.arange(int(length / spacing)) + 0.5) - 0.5 for length in labels.shape
    )
    seen = covered[np.rint(rows).astype(int)[:, None], np.rint(columns).astype(int)]
    row, column = np.nonzero(seen >= 0.5)
    return np.stack([columns[column], rows[row]], axis=1)


def _find_contours(labels: UInt8[np.ndarray, "h w"], min_length: float) -> _Contours:
    """Contours and holes of all regions, but for those too short to have a direction."""
    pixels, backwards, color = [np.zeros((0, 1, 2), np.int32)], [], []
    for value in range(1, int(labels.max(initial=0)) + 1):
        mask = (labels == value).view(np.uint8)
        contours, tree = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        for contour, place in zip(contours, tree[0] if contours else (), strict=True):
            if len(contour) * np.sqrt(2) >= min_length:
                # On the picture, the signed area is negative when walking counter-clockwise.
                outside = cv2.contourArea(contour, oriented=True) > 0
                pixels.append(contour)
                backwards.append(outside != (place[3] >= 0))
                color.append(value - 1)
    x, y = np.concatenate(pixels)[:, 0].T
    sizes = np.array([len(contour) for contour in pixels[1:]], int)
    return _Contours(x + 1j * y, sizes, np.array(backwards, bool), np.array(color, int))


def _resample(
    contours: _Contours, step: float
) -> tuple[Complex[np.ndarray, "E"], Int[np.ndarray, "W"]]:
    """Regular samples of all contours, region on the left, and how many each has.

    All contours lie on one axis of arc length, each closed by its first pixel and a step away from
    the next: one interpolation serves them all. None where a contour is too short to tell.
    """
    first = np.cumsum(contours.sizes) - contours.sizes
    last = first + contours.sizes + np.arange(len(first))
    closed = np.insert(contours.pixels, first + contours.sizes, contours.pixels[first])
    gaps = np.abs(np.diff(closed, prepend=closed[:1]))
    gaps[last[:-1] + 1] = step
    along = np.cumsum(gaps)
    start = along[first + np.arange(len(first))]
    length = along[last] - start
    count = np.rint(length / step).astype(int)
    count[count < MIN_SAMPLES] = 0
    within = ranges(np.zeros_like(count), count)
    back = np.repeat(contours.backwards, count)
    within = np.where(back, np.repeat(count, count) - 1 - within, within)
    spacing = length / np.maximum(count, 1)
    at = np.repeat(start, count) + within * np.repeat(spacing, count)
    samples = np.interp(at, along, closed) if len(at) else np.zeros(0, complex)
    return samples, count


def _smooth_walks(
    walks: Complex[np.ndarray, "E"], lengths: Int[np.ndarray, "W"]
) -> tuple[Float[np.ndarray, "E 2"], Float[np.ndarray, "E 2"]]:
    """Points and unit tangents of closed walks that stand one after the other."""
    first = np.repeat(np.cumsum(lengths) - lengths, lengths)
    within, room = np.arange(len(walks)) - first, np.repeat(lengths, lengths)
    around = first[:, None] + (within[:, None] + np.arange(-3, 4)) % room[:, None]
    smooth = walks[around] @ SMOOTHING_KERNEL
    tangent = smooth[around[:, 5]] - smooth[around[:, 1]]
    size = np.abs(tangent)
    tangent = np.divide(tangent, size, out=np.zeros_like(tangent), where=size > 1e-6)
    # The contour runs through the centres of the region's outermost pixels; the edge is outside.
    smooth += 0.5j * tangent
    return from_complex(smooth), from_complex(tangent)


def _thin(elements: _Elements, keep: Bool[np.ndarray, "E"], max_elements: int) -> _Elements:
    """The elements to keep, evenly thinned to `max_elements`."""
    chosen = np.flatnonzero(keep)
    if len(chosen) > max_elements:
        chosen = chosen[np.linspace(0, len(chosen) - 1, max_elements).round().astype(int)]
    return _Elements(elements.points[chosen], elements.tangent[chosen], elements.color[chosen])


def _to_picture(elements: _Elements, cropping: Cropping, track: Track, frame: int) -> Edges:
    """Elements in pixels of the full picture, with the half of the body they belong to."""
    points = cropping.to_picture(elements.points, frame)
    head, way = track.head[frame], track.mid_feet[frame] - track.head[frame]
    share = (points - head) @ way / max(float(way @ way), 1e-9)
    return Edges(
        points=points,
        tangent=elements.tangent,
        color=elements.color,
        upper=share < WAIST_SHARE + OVERLAP / 2,
        lower=share > WAIST_SHARE - OVERLAP / 2,
    )
