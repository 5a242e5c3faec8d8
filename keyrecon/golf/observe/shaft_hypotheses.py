"""What a line segment would mean if it were the club: where the hands and its head would be.

Of every segment come several hypotheses (Lepetit, Shahrokni and Fua, CVPR 2003, keep many per frame
too): either end may be the one that is held. The held end is extended back to the player, where
the hands are; a shaft that passes behind the player may be held farther on. The other end is
extended to the last pixel of the foreground in its line, where the club head is. A hypothesis
weighs what was detected of it, less where it lies on the player, whose clothes have stripes and
folds.

Constants were chosen on rendered swings; see benchmarks/golf.py.
"""

from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from keyrecon.golf.observe.foreground import FrameForeground
from keyrecon.golf.observe.line_segments import LineSegments
from keyrecon.numerics.picture_points import sample_picture
from keyrecon.ranges import within

SAMPLE_STEP = 0.01
"""Places at which a line is sampled, player heights apart."""
SHAFT_FOREGROUND = 0.3
"""Probability of foreground that continues a shaft to its head."""
GAP_SAMPLES = 3
"""Places in a row that may be missing."""
TOUCH = 0.03
"""Farthest that the hand end is from the player's mask, player heights: half a fist. Without it
path edges, rails and captions are clubs that nobody holds."""
BEYOND_HANDS = (0.04, 0.16)
"""Stretch behind the end of a shaft that lies beyond the hands that hold it, player heights."""
TIP_SHARE = 0.4
"""Share of this stretch in which the scene shows where nothing of the player lies behind."""


@dataclass(frozen=True)
class ShaftOptions:
    """What may be a club; lengths in player heights."""

    longest: Annotated[float, within(0.04, 20)] = 0.75
    """From the hands to the head of the club: a driver is about two thirds."""
    reach: Annotated[float, within(0.01, 3)] = 0.3
    """Farthest that the detected part of a shaft begins from the hands."""
    arms: Annotated[float, within(0.03, 10)] = 0.6
    """Farthest that the hands get from where the shoulders were clicked."""
    on_player: Annotated[float, within(0, 1)] = 0.1
    """Weight of what lies on the player against what lies beside."""
    rim: Annotated[float, within(0, 0.2)] = 0.008
    """What lies no farther from the player's outline still lies on the player."""
    free: Annotated[float, within(0, 0.5)] = 0.02
    """Least distance of the head from the player: what ends at him is a gap between his arms."""
    loose: Annotated[float, within(0, 1)] = 0.5
    """Weight of a shaft whose head would be nearer to the player than the hands that hold it."""
    bridged: Annotated[float, within(0, 10)] = 0.3
    """Cost of each length between the joined segments of a shaft."""
    least: Annotated[float, within(0.001, 1)] = 0.05
    """Less of a shaft is nothing."""
    most: Annotated[int, within(1, 1000)] = 24
    """Hypotheses kept in a frame."""


@dataclass(frozen=True, eq=False)
class ShaftHypotheses:
    """Hypotheses of one frame about the club."""

    ends: Float[np.ndarray, "n 2 2"]
    """Hand end, head end, px."""
    weight: Float[np.ndarray, "n"]
    """What was detected of it, player heights."""
    tip: Bool[np.ndarray, "n"]
    """Whether nothing of the player lies behind the hand end in the shaft's line: else the shaft
    may pass behind the player and be held farther on."""


@dataclass(frozen=True, eq=False)
class _Player:
    """The player without the club, and how far pixels are from him."""

    foreground: FrameForeground
    distance: Float[np.ndarray, "h w"]
    """Pixels of the mask."""
    rim: float
    """Distance up to which something lies on the player, pixels of the mask."""

    def outside(self, points: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n"]:
        """Distance to the player at points of the video, pixels of the mask."""
        return _read(self.distance, self.foreground, points)


def propose_shafts(
    segments: LineSegments,
    foreground: FrameForeground,
    figure: Bool[np.ndarray, "h w"],
    shoulders: Float[np.ndarray, "2"],
    options: ShaftOptions = ShaftOptions(),
) -> ShaftHypotheses:
    """The most likely clubs of a frame, best first.

    `figure` is the player's mask without the club, `shoulders` the middle between them, px.
    """
    player = _Player(
        foreground, cv2.distanceTransform((~figure).astype(np.uint8), cv2.DIST_L2, 3),
        options.rim * foreground.height * foreground.shrink,
    )  # fmt: skip
    rows = []
    for segment, support in zip(segments.ends, segments.support / foreground.height, strict=True):
        weight = _weigh(segment, support, player, options)
        if weight < options.least:
            continue
        for held, other in (segment, segment[::-1]):
            head = _extend_to_head(held, other, foreground, options)
            hand = _extend_to_hands(held, head, player, options)
            if _possible(np.stack([hand, head]), player, shoulders, options):
                near, far = player.outside(np.stack([hand, head]))
                share = 1.0 if near < far else options.loose
                rows.append((share * weight, hand, head, _is_tip(hand, head, player)))
    rows = sorted(rows, key=lambda r: -r[0])[: options.most]
    return ShaftHypotheses(
        np.array([r[1:3] for r in rows]).reshape(-1, 2, 2),
        np.array([r[0] for r in rows], float),
        np.array([r[3] for r in rows], bool),
    )


def _weigh(
    segment: Float[np.ndarray, "2 2"], support: float, player: _Player, options: ShaftOptions
) -> float:
    """What was detected of a segment beside the player; `support` in player heights."""
    foreground = player.foreground
    line = segment[0] + np.linspace(0, 1, 12)[:, None] * (segment[1] - segment[0])
    sure = _read(foreground.known.astype(np.uint8), foreground, line) > 0
    beside = ((player.outside(line) > player.rim) & sure).mean()
    length = float(np.linalg.norm(segment[1] - segment[0])) / foreground.height
    weight = support * (options.on_player + (1 - options.on_player) * beside)
    return weight - options.bridged * max(0.0, length - support)


def _possible(
    ends: Float[np.ndarray, "2 2"],
    player: _Player,
    shoulders: Float[np.ndarray, "2"],
    options: ShaftOptions,
) -> bool:
    """Whether the player holds the hand end, and the club reaches its head, off the player."""
    height, shrink = player.foreground.height, player.foreground.shrink
    held, away = player.outside(ends)
    free = away > options.free * height * shrink and held <= TOUCH * height * shrink
    near = np.linalg.norm(ends[0] - shoulders) < options.arms * height
    return bool(free and near and np.linalg.norm(ends[1] - ends[0]) < options.longest * height)


def _is_tip(hand: Float[np.ndarray, "2"], head: Float[np.ndarray, "2"], player: _Player) -> bool:
    """Whether the scene shows behind the hands, in the line of the shaft."""
    unit = (hand - head) / np.linalg.norm(hand - head)
    line = hand + player.foreground.height * np.linspace(*BEYOND_HANDS, 10)[:, None] * unit
    return bool((player.outside(line) > player.rim).mean() > TIP_SHARE)


def _read(
    picture: Float[np.ndarray, "h w"] | UInt8[np.ndarray, "h w"],
    foreground: FrameForeground,
    points: Float[np.ndarray, "n 2"],
) -> Float[np.ndarray, "n"]:
    """Values of a picture of the mask's size at points in px of the video."""
    places = foreground.to_mask(points)
    read = sample_picture(picture, places[:, None], cv2.BORDER_REPLICATE)
    return read.ravel().astype(float)


def _extend_to_head(
    held: Float[np.ndarray, "2"],
    other: Float[np.ndarray, "2"],
    foreground: FrameForeground,
    options: ShaftOptions,
) -> Float[np.ndarray, "2"]:
    """The last place of the foreground beyond the free end of a segment."""
    unit = (other - held) / np.linalg.norm(other - held)
    steps = np.arange(1, round(options.longest / SAMPLE_STEP)) * SAMPLE_STEP * foreground.height
    aside = np.array([-unit[1], unit[0]]) / foreground.shrink
    lines = other + steps[:, None] * unit + np.arange(-1, 2)[:, None, None] * aside
    there = foreground.sample(lines).max(axis=0) > SHAFT_FOREGROUND
    missing = np.convolve(~there, np.ones(GAP_SAMPLES), "full")[: len(there)] >= GAP_SAMPLES
    stop = int(missing.argmax()) if missing.any() else len(there)
    last = np.flatnonzero(there[:stop])
    return other + unit * (steps[last[-1]] if len(last) else 0.0)


def _extend_to_hands(
    held: Float[np.ndarray, "2"],
    head: Float[np.ndarray, "2"],
    player: _Player,
    options: ShaftOptions,
) -> Float[np.ndarray, "2"]:
    """Where the line of a shaft meets the player; its end, if that is too far off."""
    unit = (held - head) / np.linalg.norm(held - head)
    steps = np.arange(0, options.reach, SAMPLE_STEP) * player.foreground.height
    there = player.outside(held + steps[:, None] * unit) <= 1.0
    return held + unit * (steps[there.argmax()] if there.any() else 0.0)
