"""Which part of the player every pixel of a crop shows (Section 4.1).

A pixel belongs to part c of the player with

    P(c) = f q_c(colour) / (sum of q + u),

f the probability that it differs from the background, q the colour histograms, u a uniform colour:
a racket differs from the background and yet is none of the player's colours. Where the background
was never observed, the histogram of the surroundings stands in for it. The maps are low-passed, the
most likely one names the pixel, and components that are small or hang on nothing are dropped.

Most of a crop is background. The sum of all maps tells where the player may be at all, and only
there the maps are told apart.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32, UInt8

from keyrecon.records import Colors
from keyrecon.segmentation.color_model import BINS, color_bins, distinct_parts, look_up

UNIFORM_WEIGHT = 16.0
"""Weight of a colour that is none of the player's, against all colours being equally likely. A
quarter more or less, others with it: at most 0.7 points, 1.2 mm on four clips."""
LOW_PASS = 0.008
"""Low-pass of the maps, player heights: an edge stays where it is, noise goes. A quarter more or
less, others with it: at most 1.9 points, 1.5 mm on four clips."""
GROWTH = 0.05
"""How far a region grows into unknown colours, player heights. A quarter more or less, others with
it: at most 1.0 points, 1.8 mm on four clips."""
MIN_AREA = 0.0015
"""Smaller components are dropped and smaller holes filled, squared player heights. A quarter more
or less, others with it: at most 1.9 points, 1.5 mm on four clips."""
MAX_GAP = 0.06
"""A component farther from the body is not part of it, player heights. A quarter more or less,
others with it: at most 1.9 points, 1.8 mm on four clips."""
WINDOW_MARGIN = 8
"""Pixels beyond everything that regions may reach: no low-pass looks farther. A quarter more or
less, others with it: at most 1.9 points, 1.8 mm on four clips."""


@dataclass(frozen=True, eq=False)
class PartTables:
    """Probability of each part by colour bin, ready for looking up."""

    different: Float32[np.ndarray, "bins G"]
    """Of pixels that differ from the background."""
    unknown: Float32[np.ndarray, "bins G"]
    """Of pixels before a background that was never observed."""
    any_different: Float32[np.ndarray, "bins"]
    any_unknown: Float32[np.ndarray, "bins"]
    """Sums over all parts."""
    values: UInt8[np.ndarray, "G"]
    """Label of each part."""


def build_part_tables(colors: Colors) -> PartTables:
    """Tables of the parts that can be told apart by colour."""
    groups = distinct_parts(colors)
    parts = [colors.histograms[members].mean(axis=0) for members in groups.values()]
    table = np.stack(parts, axis=1) / len(parts)
    total = table.sum(axis=1, keepdims=True) + UNIFORM_WEIGHT / np.prod(BINS)
    different = (table / total).astype(np.float32)
    unknown = (table / (total + colors.surroundings[:, None])).astype(np.float32)
    values = np.array(list(groups), np.uint8) + 1
    return PartTables(different, unknown, different.sum(axis=1), unknown.sum(axis=1), values)


def label_crop(
    lab: UInt8[np.ndarray, "h w 3"],
    foreground: Float[np.ndarray, "h w"],
    tables: PartTables,
    axis: Float[np.ndarray, "2 2"],
    player: int,
) -> UInt8[np.ndarray, "h w"]:
    """0 background, 1 + c part c; `axis` runs from head to mid-feet in crop pixels.

    The player is `player` px tall.
    """
    bins = color_bins(lab)
    unknown = foreground == 0.5
    anything = look_up(tables.any_different, bins) * foreground
    anything[unknown] = tables.any_unknown[bins[unknown]]
    anything = _low_pass(anything, player)
    labels = np.zeros(bins.shape, np.uint8)
    window = _window(anything >= 0.5, round((GROWTH + MAX_GAP) * player) + WINDOW_MARGIN)
    if window is None:
        return labels
    likely = np.take(tables.different, bins[window], axis=0)
    likely *= foreground[window][..., None]
    likely[unknown[window]] = tables.unknown[bins[window][unknown[window]]]
    inside = tables.values[_low_pass(likely, player).argmax(axis=2)]
    inside[anything[window] < 0.5] = 0
    inside = _fill(inside, _low_pass(foreground[window], player) > 0.7, player)
    corner = np.array([window[1].start, window[0].start])
    labels[window] = _clean(inside, axis - corner, player)
    return labels


def _low_pass(values: Float32[np.ndarray, "h w *c"], player: int) -> Float32[np.ndarray, "h w *c"]:
    return cv2.GaussianBlur(values, (0, 0), LOW_PASS * player).reshape(values.shape)


def _window(mask: Bool[np.ndarray, "h w"], margin: int) -> tuple[slice, slice] | None:
    """Rows and columns with anything in them, and a margin; None where there is nothing."""
    x, y, width, height = cv2.boundingRect(mask.view(np.uint8))
    if not width:
        return None
    rows = slice(max(0, y - margin), y + height + margin)
    return rows, slice(max(0, x - margin), x + width + margin)


def _fill(
    labels: UInt8[np.ndarray, "h w"], differs: Bool[np.ndarray, "h w"], player: int
) -> UInt8[np.ndarray, "h w"]:
    """Let regions grow a little into what differs from the background without a known colour.

    Folds, prints and deep shade are closed; a racket keeps out, but for what the hand holds.
    """
    for _ in range(round(GROWTH * player / 2)):
        grown = cv2.dilate(labels, np.ones((5, 5), np.uint8))
        labels = np.where((labels == 0) & differs, grown, labels)
    return labels


def _clean(
    labels: UInt8[np.ndarray, "h w"], axis: Float[np.ndarray, "2 2"], player: int
) -> UInt8[np.ndarray, "h w"]:
    """Keep what hangs together with the body; give specks to what surrounds them."""
    min_area = MIN_AREA * player**2
    size = max(3, round(MAX_GAP * player) | 1)
    near = cv2.dilate((labels > 0).astype(np.uint8), np.ones((size, size), np.uint8))
    _, pieces = cv2.connectedComponents(near, connectivity=4)
    along = np.linspace(0, 1, 40)[:, None]
    spots = np.rint(axis[0] + along * (axis[1] - axis[0])).astype(int)
    spots = spots[((spots >= 0) & (spots < labels.shape[::-1])).all(axis=1)]
    hits = np.bincount(pieces[spots[:, 1], spots[:, 0]], minlength=2)
    hits[0] = 0
    labels = np.where(pieces == hits.argmax(), labels, 0).astype(np.uint8)
    filled = cv2.medianBlur(labels, 5)
    for value in range(int(labels.max()) + 1):
        window = _window(labels == value, 0)
        if window is None:
            continue
        mask = (labels[window] == value).view(np.uint8)
        _, parts, stats, _ = cv2.connectedComponentsWithStats(mask, ltype=cv2.CV_16U)
        small = stats[:, cv2.CC_STAT_AREA] < min_area
        small[0] = False
        if small.any():
            specks = small[parts]
            instead = filled[window][specks]
            labels[window][specks] = np.where(instead == value, 0, instead)
    return labels
