"""What the player's parts look like: colour histograms learnt from a few clicks.

Every click stands for the patch of like-coloured pixels around it, grown in Lab from the click
and no farther than a part of the body reaches, so that one click yields hundreds of samples and
does not leak into its neighbours. Samples of all clicks of a part go into one histogram, smoothed
so that colours between samples count too. The surroundings are histogrammed the same way from the
same frames, outside of where the player can be. Back-projection (Swain and Ballard, IJCV 7, 1991;
Section 4.1 of the ECCV 2004 paper) gives every pixel the posterior

    q(bin) / (q(bin) + k b(bin)),        q the part, b the surroundings,

which is a look-up in a table of bins: 16 of lightness, 32 of each chroma.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8, UInt16
from scipy.ndimage import gaussian_filter

from keyrecon.errors import KeyreconError
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within
from keyrecon.records import Colors, Pick

if TYPE_CHECKING:
    from keyrecon.io.video import Video

BINS = (16, 32, 32)
"""Of L, a and b: chroma tells skin from clay, lightness varies with folds and shade."""
HISTOGRAM_SPREAD = (0.8, 0.8, 0.8)
"""Standard deviation that spreads a sample over neighbouring bins, bins. A quarter more or less,
others with it: at most 1.9 points, 2.4 mm on four clips; lightness halved: 2.4 points."""
MAX_COLOR_DIFFERENCE = (22, 9, 9)
"""How far L, a and b may lie from the click's colour, of 255: shading within one material. A
quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips."""
PATCH_RADIUS = {"head": 0.05, "foot": 0.06}
"""How far around a click a part goes, player heights: half a head, half a shoe. A quarter more or
less, others with it: at most 1.9 points, 2.4 mm on four clips."""
ABOVE_SOLE = 0.02, 0.04, 0.06
"""How far above a click on a foot its shoe is looked for, player heights: up to the ankle. A
quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips."""
MIN_FLOOR, MIN_SHOE = 0.15, 0.1
"""Shares of the patch's circle that a floor fills at least, and a shoe. A quarter more or less,
others with them: at most 1.9 points, 2.4 mm on four clips."""
MIN_GAIN = 2.5
"""Nats by which a shoe's colours are rarer in the scene and on the leg than those of the floor:
on rendered players 3.6 to 6. Of 47 clicks on shoes of six real clips none moves."""
REGION_RADIUS = 0.08
"""The same for regions of clothing and skin, player heights. A quarter more or less, others with
it: at most 1.9 points, 2.4 mm on four clips."""
HEAD_CORE = 0.45
"""Share of a head's radius within which everything is head: hair beside skin. A quarter more or
less, others with it: at most 1.9 points, 2.4 mm on four clips."""
MIN_DENSITY = 1e-5
"""Density below which a colour counts as observed nowhere, and belongs to nobody. A quarter more or
less, others with it: at most 1.9 points, 2.4 mm on four clips."""
MAX_SHARED_WITH_PARTS = 0.4
"""Share of the head's colours found in other parts that makes it no colour of its own."""
MAX_COMMON_SHARE = 0.35
"""Two parts with this share of their colours in common cannot be told apart pixel by pixel. A
quarter more or less, others with it: at most 1.9 points, 1.8 mm on four clips."""
SURROUNDINGS_MARGINS = 1.0, 0.6, 0.35
"""Shares of the room around the player that are left out of the surroundings, tried in turn: a
player who fills the picture shows them close by only, where an arm may reach now and then."""
MIN_SURROUNDINGS = 0.02
"""Pixels that tell the surroundings' colours at least, squared player heights. A quarter more or
less, others with it: at most 1.9 points, 2.4 mm on four clips."""
SURROUNDINGS_RADIUS = 0.75
"""Nothing of the player lies farther sideways from the head-feet axis, player heights. A quarter
more or less, others with it: at most 1.9 points, 2.4 mm on four clips."""


@dataclass(frozen=True)
class ColorOptions:
    """How colours are weighed."""

    surroundings: Annotated[float, within(0.01, 100)] = 1.0
    """How much the colours around a part count against it; higher finds less of the player and is
    surer.

    k of the log ratio. A quarter more or less, others with it: at most 1.9 points, 2.4 mm on four
    clips.
    """


def learn_colors(
    video: "Video",
    picks: Sequence[Pick],
    options: ColorOptions = ColorOptions(),
    progress: Progress = silent,
) -> Colors:
    """Colour histograms of the picked parts and of what surrounds the player.

    At least one frame must have both a head and a foot picked: that gives the player's size.
    Raises KeyreconError for a pick outside the video and for what is missing.
    """
    _check_picks(video, picks)
    height = picked_height(picks)
    names = tuple(dict.fromkeys(("head", "foot", *sorted({p.part for p in picks}))))
    counts = np.zeros((len(names), *BINS))
    around = np.zeros((len(SURROUNDINGS_MARGINS), *BINS))
    shoes: list[list[UInt16[np.ndarray, "_"]]] = []
    for frame in progress(sorted({p.frame for p in picks}), "Learning colours"):
        lab = to_lab(video.frame(frame))
        bins = color_bins(lab)
        here = [p for p in picks if p.frame == frame]
        for pick in here:
            if pick.part == "foot":
                shoes.append(
                    [bins[grow_patch(lab, p, height)] for p in _at_and_above(pick, height)]
                )
            else:
                counts[names.index(pick.part)] += _count(bins[grow_patch(lab, pick, height)])
        for row, margin in enumerate(SURROUNDINGS_MARGINS):
            around[row] += _count(bins[_outside(lab.shape[:2], here, margin * height)])
    scene = _smooth(_choose_surroundings(around, height))
    rest = [_smooth(c) for name, c in zip(names, counts, strict=True) if name != "head"]
    known = np.maximum(scene, np.max(rest, axis=0))
    circle = np.pi * (PATCH_RADIUS["foot"] * height) ** 2
    for patches in shoes:
        counts[names.index("foot")] += _count(_shoe_patch(patches, known, circle))
    return Colors(
        names=names,
        histograms=np.stack([_smooth(c) for c in counts]).astype(np.float32),
        surroundings=(scene * options.surroundings).astype(np.float32),
        height=height,
    )


def _choose_surroundings(
    around: Float[np.ndarray, "m l a b"], height: float
) -> Float[np.ndarray, "l a b"]:
    """Counts of colours beyond the widest margin around the player that leaves enough of them."""
    enough = around.sum(axis=(1, 2, 3)) >= MIN_SURROUNDINGS * height**2
    if not enough.any():
        raise KeyreconError(
            "The player fills the picture in every picked frame, so nothing shows the "
            "surroundings; pick also in a frame where the player is farther from its edges."
        )
    return around[enough.argmax()]


def _at_and_above(pick: Pick, height: float) -> list[Pick]:
    """A click, and places above it as far as a shoe is high."""
    steps = (share * height for share in ABOVE_SOLE)
    return [pick, *(replace(pick, y=max(0.0, pick.y - step)) for step in steps)]


def _shoe_patch(
    patches: list[UInt16[np.ndarray, "_"]], known: Float[np.ndarray, "bins"], circle: float
) -> UInt16[np.ndarray, "n"]:
    """The patch of a click, or of the place above it that has colours of its own.

    A click beneath the sole has the colours of the floor, which are `known` like those of the leg.
    """
    if len(patches[0]) < MIN_FLOOR * circle:
        return patches[0]
    unlikeness = [-float(np.log(known[patch] + MIN_DENSITY).mean()) for patch in patches]
    better = [
        at
        for at in range(1, len(patches))
        if unlikeness[at] > unlikeness[0] + MIN_GAIN and len(patches[at]) >= MIN_SHOE * circle
    ]
    return patches[max(better, key=lambda at: unlikeness[at]) if better else 0]


def picked_height(picks: Sequence[Pick]) -> float:
    """Length from head to mid-feet, px: the median over frames where both were picked."""
    heights = []
    for frame in {p.frame for p in picks}:
        heads = [(p.x, p.y) for p in picks if p.frame == frame and p.part == "head"]
        feet = [(p.x, p.y) for p in picks if p.frame == frame and p.part == "foot"]
        if heads and feet:
            heights.append(np.linalg.norm(np.mean(heads, axis=0) - np.mean(feet, axis=0)))
    if not heights:
        raise KeyreconError(
            "No frame has both a head and a foot marked or picked, so the player's size is "
            "unknown; mark one whole body, or pick the head and both feet, in one frame where the "
            "player stands upright."
        )
    return float(np.median(heights))


def _check_picks(video: "Video", picks: Sequence[Pick]) -> None:
    for pick in picks:
        if not 0 <= pick.frame < len(video):
            raise KeyreconError(
                f"The pick of '{pick.part}' is on frame {pick.frame}, but the video has frames "
                f"0 to {len(video) - 1}."
            )
        if not (0 <= pick.x < video.width and 0 <= pick.y < video.height):
            raise KeyreconError(
                f"The pick of '{pick.part}' at ({pick.x:g}, {pick.y:g}) on frame {pick.frame} is "
                f"outside the picture of {video.width} x {video.height} px; pick it again."
            )
    if "head" not in {p.part for p in picks}:
        raise KeyreconError("The head is not picked in any frame; pick its centre.")
    if "foot" not in {p.part for p in picks}:
        raise KeyreconError(
            "No foot is picked in any frame; pick both shoes, or mark both knees and ankles of a "
            "frame that shows them: a player whose feet are never in the picture has no known size."
        )


def to_lab(picture: UInt8[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "h w 3"]:
    """RGB to Lab, all three channels 0-255."""
    return cv2.cvtColor(picture, cv2.COLOR_RGB2LAB)


def color_bins(lab: UInt8[np.ndarray, "*n 3"]) -> UInt16[np.ndarray, "*n"]:
    """Histogram bin of every Lab pixel."""
    bits = lab.astype(np.uint16)
    return ((bits[..., 0] >> 4) << 10) | ((bits[..., 1] >> 3) << 5) | (bits[..., 2] >> 3)


def look_up(
    table: Float[np.ndarray, "*C bins"], bins: UInt16[np.ndarray, "*n"]
) -> Float[np.ndarray, "..."]:
    """Entries of a table of colour bins, or of several, for every pixel."""
    return np.take(table, bins, axis=-1, mode="clip")  # which asks for no copy, as "raise" does


def posterior_tables(colors: Colors) -> Float[np.ndarray, "C bins"]:
    """Probability of each part rather than the surroundings, by colour bin."""
    return colors.histograms / (colors.histograms + colors.surroundings + MIN_DENSITY)


def distinct_parts(colors: Colors) -> dict[int, list[int]]:
    """Which parts can be told apart by colour: a representative, and those that look like it.

    The head is hair and skin: it is left out where other parts that were picked explain it.
    Parts that share much of their colour, blond hair and skin in the shade, count as one, since
    the border between them would be drawn by noise.
    """
    head = colors.names.index("head")
    others = [c for c in range(len(colors.names)) if c != head]
    explained = np.minimum(colors.histograms[head], colors.histograms[others].max(axis=0)).sum()
    parts = others if explained > MAX_SHARED_WITH_PARTS else [head, *others]
    groups: dict[int, list[int]] = {}
    for part in parts:
        alike = [
            first
            for first, members in groups.items()
            if max(np.minimum(colors.histograms[part], colors.histograms[m]).sum() for m in members)
            > MAX_COMMON_SHARE
        ]
        if not alike:
            groups[part] = [part]
            continue
        groups[alike[0]].append(part)
        for other in alike[1:]:
            groups[alike[0]] += groups.pop(other)
    return groups


def foot_table(colors: Colors) -> Float[np.ndarray, "bins"]:
    """Probability of a shoe rather than the surroundings or the skin and clothes above it."""
    foot = colors.histograms[colors.names.index("foot")]
    rest = [c for c, name in enumerate(colors.names) if name not in ("foot", "head")]
    other = 0.5 * colors.histograms[rest].max(axis=0) if rest else 0.0
    return foot / (foot + colors.surroundings + other + MIN_DENSITY)


def grow_patch(
    lab: UInt8[np.ndarray, "h w 3"], pick: Pick, height: float
) -> Bool[np.ndarray, "h w"]:
    """Pixels that a click stands for: like-coloured and connected, near the click."""
    radius = max(2.0, PATCH_RADIUS.get(pick.part, REGION_RADIUS) * height)
    rows, columns = lab.shape[:2]
    x, y = min(round(pick.x), columns - 1), min(round(pick.y), rows - 1)
    reach = int(np.ceil(radius))
    x0, y0 = max(0, x - reach), max(0, y - reach)
    crop = cv2.GaussianBlur(lab[y0 : y + reach + 1, x0 : x + reach + 1], (3, 3), 0)
    mask = np.zeros((crop.shape[0] + 2, crop.shape[1] + 2), np.uint8)
    flags = 4 | cv2.FLOODFILL_MASK_ONLY | cv2.FLOODFILL_FIXED_RANGE | (1 << 8)
    cv2.floodFill(
        crop, mask, (x - x0, y - y0), 0, MAX_COLOR_DIFFERENCE, MAX_COLOR_DIFFERENCE, flags
    )
    yy, xx = np.mgrid[: crop.shape[0], : crop.shape[1]]
    distance = np.hypot(xx - (x - x0), yy - (y - y0))
    inside = (mask[1:-1, 1:-1] > 0) & (distance <= radius)
    inside |= distance <= (HEAD_CORE * radius if pick.part == "head" else 1.0)
    patch = np.zeros((rows, columns), bool)
    patch[y0 : y0 + crop.shape[0], x0 : x0 + crop.shape[1]] = inside
    return patch


def _outside(
    shape: tuple[int, int], picks: Sequence[Pick], height: float
) -> Bool[np.ndarray, "h w"]:
    """Pixels that cannot be the player's, given the clicks of one frame."""
    outside = np.ones(shape, bool)
    sides = SURROUNDINGS_RADIUS * height
    points = np.array([(p.x, p.y) for p in picks])
    named = {p.part for p in picks}
    # Without the head (feet) in this frame, the player may reach a whole height above (below).
    above = 0.5 * height if "head" in named else 1.3 * height
    below = 0.15 * height if "foot" in named else 1.2 * height
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    x0, y0, x1, y1 = x0 - sides, y0 - above, x1 + sides, y1 + below
    outside[max(0, int(y0)) : max(0, int(y1)), max(0, int(x0)) : max(0, int(x1))] = False
    return outside


def _count(bins: UInt16[np.ndarray, "n"]) -> Float[np.ndarray, "l a b"]:
    return np.bincount(bins, minlength=int(np.prod(BINS))).reshape(BINS).astype(float)


def _smooth(counts: Float[np.ndarray, "l a b"]) -> Float[np.ndarray, "bins"]:
    spread = gaussian_filter(counts, HISTOGRAM_SPREAD, mode="constant")
    return (spread / max(spread.sum(), 1e-9)).ravel()
