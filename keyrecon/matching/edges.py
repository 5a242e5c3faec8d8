"""Coloured regions of the player and their directed edges (Section 4.1).

Every frame is cut out around the player and brought to a common player height. A pixel of the crop
belongs to part c of the player with

    P(c) = f q_c(colour) / (sum of q + u),

f the probability that it differs from the background, q the colour histograms, u a uniform colour:
a racket differs from the background and yet is none of the player's colours. Where the background
was never seen, the histogram of the surroundings stands in for it. The maps are low-passed, the
most likely one names the pixel, and components that are small or hang on nothing are dropped.
Contours of each region, inner borders between two colours included, are walked so that the region
lies on the left as seen on the picture, and sampled at regular arc length: each sample is an edge
element, a point with a unit tangent.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Complex, Float, Int, UInt8

from keyrecon.background import Scene
from keyrecon.colors import BINS, color_bins, distinct_parts, to_lab
from keyrecon.matching.window import from_complex
from keyrecon.pictures import read_small, shrinking, side_by_side
from keyrecon.progress import Progress, silent
from keyrecon.records import Background, CameraPath, Colors, Edges, Figures, Track
from keyrecon.video import Video

CROP_WIDTH, CROP_HEIGHT = 1.75, 1.5
"""Size of the crop, player heights: a lunge with an arm stretched out; a raised arm."""
UNIFORM = 16.0
"""Weight of a colour that is none of the player's, against all colours being equally likely."""
SOFTEN = 0.008
"""Low-pass of the maps, player heights: an edge stays where it is, noise goes."""
GROWTH = 0.05
"""How far a region grows into unknown colours, player heights."""
LEAST_AREA = 0.0015
"""Smaller components are dropped and smaller holes filled, squared player heights."""
NEARBY = 0.06
"""A component farther from the body is not part of it, player heights."""
WAIST = 0.42
"""Where the body is cut, shares of the way from head to mid-feet: hips .44, waist .37."""
OVERLAP = 0.05
"""Width of the band that counts for both halves, in the same shares."""
LEAST_SAMPLES = 6
"""Contours with fewer samples have no direction to speak of."""
SMOOTHING = np.exp(-0.5 * np.arange(-3, 4) ** 2)
SMOOTHING /= SMOOTHING.sum()
"""Low-pass along a contour, over samples: pixels make stairs."""


@dataclass(frozen=True)
class EdgeOptions:
    """How regions and edges are found."""

    player: int = 112
    """Player height in the crops, px; smaller is faster and coarser."""
    step: float = 0.018
    """Distance between edge elements along a contour, player heights."""
    most: int = 400
    """Edge elements of one frame at most."""


@dataclass(frozen=True, eq=False)
class _Palette:
    """Tables over colour bins, ready for looking up."""

    parts: Float[np.ndarray, "bins G"]
    """Colours of the parts that can be told apart."""
    total: Float[np.ndarray, "bins"]
    """Sum of the parts' colours and of a colour that is none of them."""
    surroundings: Float[np.ndarray, "bins"]
    values: UInt8[np.ndarray, "G"]
    """Label of each."""


def _mix_palette(colors: Colors) -> _Palette:
    groups = distinct_parts(colors)
    parts = [colors.seen[members].mean(axis=0) for members in groups.values()]
    values = np.array(list(groups), np.uint8) + 1
    table = np.ascontiguousarray(np.stack(parts, axis=1) / len(parts), np.float32)
    total = table.sum(axis=1) + np.float32(UNIFORM / np.prod(BINS))
    return _Palette(table, total, colors.surroundings.astype(np.float32), values)


def find_edges(  # noqa: PLR0913
    video: Video,
    track: Track,
    camera: CameraPath,
    background: Background,
    colors: Colors,
    options: EdgeOptions = EdgeOptions(),
    progress: Progress = silent,
) -> Figures:
    """Label crops and directed edges of every frame; edges in px of the full picture."""
    scene = Scene(background, camera)
    palette = _mix_palette(colors)
    scale = options.player / track.height
    size = (round(CROP_WIDTH * options.player), round(CROP_HEIGHT * options.player))
    center = (track.box[:, :2] + track.box[:, 2:]) / 2
    origin = center - (np.array(size) - 1) / 2 / scale[:, None]
    # Pictures are read no larger than needed; a little larger than the crop keeps edges sharp.
    width = min(video.width, round(video.width * 1.2 * float(np.median(scale))))
    shrink = width / video.width
    labels = np.zeros((len(video), size[1], size[0]), np.uint8)

    def look(entry: tuple[int, UInt8[np.ndarray, "h w 3"]]) -> Edges:
        t, picture = entry
        crop, to_picture, present = _cut_out(picture, origin[t], float(scale[t]), shrink, size)
        foreground = scene.foreground(crop, t, to_picture)
        spots = (track.head[t], track.mid_feet[t])
        axis = np.stack([(p - origin[t]) * scale[t] for p in spots])
        labels[t] = label_crop(crop, foreground * present, palette, axis, options)
        found = trace_edges(labels[t], options)
        return _place(found, origin[t], float(scale[t]), track, t)

    pictures = progress(read_small(video, width), "Finding edges", len(video))
    return Figures(tuple(side_by_side(look, enumerate(pictures))), labels, origin, scale)


def _cut_out(
    picture: UInt8[np.ndarray, "h w 3"],
    origin: Float[np.ndarray, "2"],
    scale: float,
    shrink: float,
    size: tuple[int, int],
) -> tuple[UInt8[np.ndarray, "y x 3"], Float[np.ndarray, "3 3"], UInt8[np.ndarray, "y x"]]:
    """The crop in Lab, the way from its pixels to the full picture, and where there is one."""
    to_picture = np.array([[1 / scale, 0, origin[0]], [0, 1 / scale, origin[1]], [0, 0, 1]])
    to_small = shrinking(shrink) @ to_picture
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    crop = cv2.warpAffine(picture, to_small[:2], size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    columns = to_small[0, 0] * np.arange(size[0]) + to_small[0, 2]
    rows = to_small[1, 1] * np.arange(size[1]) + to_small[1, 2]
    inside = (rows >= 0) & (rows <= picture.shape[0] - 1)
    across = (columns >= 0) & (columns <= picture.shape[1] - 1)
    return to_lab(crop), to_picture, (inside[:, None] & across).astype(np.uint8)


def label_crop(
    lab: UInt8[np.ndarray, "h w 3"],
    foreground: Float[np.ndarray, "h w"],
    palette: _Palette,
    axis: Float[np.ndarray, "2 2"],
    options: EdgeOptions,
) -> UInt8[np.ndarray, "h w"]:
    """0 background, 1 + c part c; `axis` runs from head to mid-feet in crop pixels."""
    bins = color_bins(lab)
    known = palette.total[bins]
    scene = np.where(foreground == 0.5, palette.surroundings[bins], known)
    weight = foreground / (foreground * known + (1 - foreground) * scene)
    likely = palette.parts[bins] * weight[..., None]
    likely = cv2.GaussianBlur(likely.astype(np.float32), (0, 0), SOFTEN * options.player)
    labels = palette.values[likely.argmax(axis=2)]
    labels[likely @ np.ones(likely.shape[2], np.float32) < 0.5] = 0
    differs = cv2.GaussianBlur(foreground, (0, 0), SOFTEN * options.player) > 0.7
    return _clean(_fill(labels, differs, options), axis, options)


def _fill(
    labels: UInt8[np.ndarray, "h w"], differs: Bool[np.ndarray, "h w"], options: EdgeOptions
) -> UInt8[np.ndarray, "h w"]:
    """Let regions grow a little into what differs from the background without a known colour.

    Folds, prints and deep shade are closed; a racket keeps out, but for what the hand holds.
    """
    for _ in range(round(GROWTH * options.player / 2)):
        grown = cv2.dilate(labels, np.ones((5, 5), np.uint8))
        labels = np.where((labels == 0) & differs, grown, labels)
    return labels


def _clean(
    labels: UInt8[np.ndarray, "h w"], axis: Float[np.ndarray, "2 2"], options: EdgeOptions
) -> UInt8[np.ndarray, "h w"]:
    """Keep what hangs together with the body; give specks to what surrounds them."""
    least = LEAST_AREA * options.player**2
    size = max(3, round(NEARBY * options.player) | 1)
    near = cv2.dilate((labels > 0).astype(np.uint8), np.ones((size, size), np.uint8))
    _, pieces = cv2.connectedComponents(near, connectivity=4)
    along = np.linspace(0, 1, 40)[:, None]
    spots = np.rint(axis[0] + along * (axis[1] - axis[0])).astype(int)
    rows = spots[:, 1].clip(0, labels.shape[0] - 1)
    columns = spots[:, 0].clip(0, labels.shape[1] - 1)
    votes = np.bincount(pieces[rows, columns], minlength=2)
    votes[0] = 0
    labels = np.where(pieces == votes.argmax(), labels, 0).astype(np.uint8)
    filled = cv2.medianBlur(labels, 5)
    for value in np.unique(labels):
        _, parts, stats, _ = cv2.connectedComponentsWithStats((labels == value).astype(np.uint8))
        small = stats[:, cv2.CC_STAT_AREA] < least
        small[0] = False
        if small.any():
            specks = small[parts]
            labels[specks] = np.where(filled[specks] == value, 0, filled[specks])
    return labels


@dataclass(frozen=True, eq=False)
class _Elements:
    """Edge elements of a crop."""

    points: Float[np.ndarray, "E 2"]
    tangent: Float[np.ndarray, "E 2"]
    color: Int[np.ndarray, "E"]


def trace_edges(labels: UInt8[np.ndarray, "h w"], options: EdgeOptions) -> _Elements:
    """Contours of all regions as elements with the region on their left, in crop pixels."""
    step = options.step * options.player
    walks, colors = [], []
    for value in np.unique(labels[labels > 0]):
        mask = (labels == value).astype(np.uint8)
        contours, tree = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        for contour, place in zip(contours, tree[0] if contours else (), strict=True):
            sampled = _resample(contour, step)
            if len(sampled) >= LEAST_SAMPLES:
                walks.append(_walk(sampled, contour, hole=bool(place[3] >= 0)))
                colors.append(int(value) - 1)
    if not walks:
        return _Elements(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, int))
    lengths = [len(walk) for walk in walks]
    points, tangent = _smooth_walks(np.concatenate(walks), np.array(lengths))
    found = _Elements(points, tangent, np.repeat(colors, lengths))
    size = np.array(labels.shape[::-1])
    keep = ((points > 1) & (points < size - 2)).all(axis=1) & tangent.any(axis=1)
    return _thin(found, keep, options.most)


def _resample(contour: Int[np.ndarray, "n 1 2"], step: float) -> Complex[np.ndarray, "m"]:
    """Regular samples of a closed contour, x + iy; none where it is too short to tell."""
    if len(contour) * np.sqrt(2) < (LEAST_SAMPLES - 0.5) * step:
        return np.zeros(0, complex)
    pixels = contour[:, 0].astype(float).view(complex)[:, 0]
    closed = np.append(pixels, pixels[0])
    length = np.concatenate([[0], np.cumsum(np.abs(np.diff(closed)))])
    count = round(length[-1] / step)
    return np.interp(np.arange(count) * (length[-1] / max(count, 1)), length, closed)


def _walk(
    sampled: Complex[np.ndarray, "m"], contour: Int[np.ndarray, "n 1 2"], hole: bool
) -> Complex[np.ndarray, "m"]:
    """Samples in the direction that has the region on its left, y pointing down."""
    # Seen on the picture, the signed area is negative when walking counter-clockwise.
    outside = cv2.contourArea(contour, oriented=True) > 0
    return sampled if outside == hole else sampled[::-1]


def _smooth_walks(
    walks: Complex[np.ndarray, "E"], lengths: Int[np.ndarray, "W"]
) -> tuple[Float[np.ndarray, "E 2"], Float[np.ndarray, "E 2"]]:
    """Points and unit tangents of closed walks that stand one after the other."""
    first = np.repeat(np.cumsum(lengths) - lengths, lengths)
    within, room = np.arange(len(walks)) - first, np.repeat(lengths, lengths)
    around = first[:, None] + (within[:, None] + np.arange(-3, 4)) % room[:, None]
    smooth = walks[around] @ SMOOTHING
    tangent = smooth[around[:, 5]] - smooth[around[:, 1]]
    size = np.abs(tangent)
    tangent = np.divide(tangent, size, out=np.zeros_like(tangent), where=size > 1e-6)
    # The contour runs through the centres of the region's outermost pixels; the edge is outside.
    smooth += 0.5j * tangent
    return from_complex(smooth), from_complex(tangent)


def _thin(found: _Elements, keep: Bool[np.ndarray, "E"], most: int) -> _Elements:
    """The elements to keep, evenly thinned to `most`."""
    chosen = np.flatnonzero(keep)
    if len(chosen) > most:
        chosen = chosen[np.linspace(0, len(chosen) - 1, most).round().astype(int)]
    return _Elements(found.points[chosen], found.tangent[chosen], found.color[chosen])


def _place(
    found: _Elements, origin: Float[np.ndarray, "2"], scale: float, track: Track, frame: int
) -> Edges:
    """Elements in pixels of the full picture, told which half of the body they belong to."""
    points = origin + found.points / scale
    head, way = track.head[frame], track.mid_feet[frame] - track.head[frame]
    share = (points - head) @ way / max(float(way @ way), 1e-9)
    return Edges(
        points=points,
        tangent=found.tangent,
        color=found.color,
        upper=share < WAIST + OVERLAP / 2,
        lower=share > WAIST - OVERLAP / 2,
    )
