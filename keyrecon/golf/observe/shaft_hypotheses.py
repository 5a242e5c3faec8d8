"""What a bar would mean if it were the club: where the hands hold it and where its head is.

Of every bar come several hypotheses (Lepetit, Shahrokni and Fua, CVPR 2003, keep many per frame
too): either end may be the one that is held. The held end is followed back to the player, where
the hands are; a shaft that passes behind the player may be held farther on. The other end is
followed to the last pixel of the foreground in its line, where the club head is. A hypothesis
weighs what was seen of it, less where it lies on the player, whose clothes have stripes and folds.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from keyrecon.golf.observe.foreground import Foreground
from keyrecon.golf.observe.line_segments import LineSegments

STEP = 0.01
"""Places at which a line is looked at, player heights apart."""
SEEN = 0.3
"""Probability of foreground that continues a shaft to its head."""
GAP = 3
"""Places in a row that may be missing."""
FIST = (0.04, 0.16)
"""Stretch behind the end of a shaft that lies beyond the hands that hold it, player heights."""


@dataclass(frozen=True)
class ShaftOptions:
    """What a club may look like; lengths in player heights."""

    longest: float = 0.75
    """From the hands to the head of the club: a driver is about two thirds."""
    reach: float = 0.3
    """Farthest that the seen part of a shaft begins from the hands."""
    arms: float = 0.6
    """Farthest that the hands get from where the shoulders were clicked."""
    on_player: float = 0.1
    """Weight of what lies on the player against what lies beside."""
    rim: float = 0.008
    """What lies no farther from the player's outline still lies on the player."""
    free: float = 0.02
    """Least distance of the head from the player: what ends at him is a gap between his arms."""
    loose: float = 0.5
    """Weight of a shaft whose head would be nearer to the player than the hands that hold it."""
    bridged: float = 0.3
    """Cost of each length between the joined bars of a shaft."""
    least: float = 0.05
    """Less seen of a shaft is nothing."""
    most: int = 24
    """Hypotheses kept in a frame."""


@dataclass(frozen=True, eq=False)
class ShaftHypotheses:
    """Hypotheses of one frame about the club."""

    ends: Float[np.ndarray, "n 2 2"]
    """Hand end, head end, px."""
    weight: Float[np.ndarray, "n"]
    """What was seen of it, player heights."""
    tip: Bool[np.ndarray, "n"]
    """Whether nothing of the player lies behind the hand end in the shaft's line: else the shaft
    may pass behind the player and be held farther on."""


def propose_shafts(
    bars: LineSegments,
    foreground: Foreground,
    frame: int,
    shoulders: Float[np.ndarray, "2"],
    options: ShaftOptions = ShaftOptions(),
) -> ShaftHypotheses:
    """The most likely clubs of a frame, best first; `shoulders` is the middle between them, px."""
    outside = _beside_player(foreground, frame)
    rim = options.rim * foreground.height * foreground.shrink
    rows = []
    for bar, support in zip(bars.ends, bars.support / foreground.height, strict=True):
        line = bar[0] + np.linspace(0, 1, 12)[:, None] * (bar[1] - bar[0])
        sure = _extend_both_ways(foreground.known.astype(np.uint8), foreground, line) > 0
        beside = ((_extend_both_ways(outside, foreground, line) > rim) & sure).mean()
        weight = support * (options.on_player + (1 - options.on_player) * beside)
        span = float(np.linalg.norm(bar[1] - bar[0])) / foreground.height
        weight -= options.bridged * max(0.0, span - support)
        if weight < options.least:
            continue
        for held, other in (bar, bar[::-1]):
            head = _follow_to_head(held, other, (foreground, frame), options)
            hand = _follow_to_hands(held, head, (outside, foreground), options)
            if _possible(np.stack([hand, head]), (outside, foreground), shoulders, options):
                tip = _is_tip(hand, head, (outside, foreground), rim)
                near, far = _extend_both_ways(outside, foreground, np.stack([hand, head]))
                rows.append((weight if near < far else options.loose * weight, hand, head, tip))
    rows = sorted(rows, key=lambda r: -r[0])[: options.most]
    return ShaftHypotheses(
        np.array([r[1:3] for r in rows]).reshape(-1, 2, 2),
        np.array([r[0] for r in rows], float),
        np.array([r[3] for r in rows], bool),
    )


def _possible(
    ends: Float[np.ndarray, "2 2"],
    player: tuple[Float[np.ndarray, "h w"], Foreground],
    shoulders: Float[np.ndarray, "2"],
    options: ShaftOptions,
) -> bool:
    """Whether arms reach the hand end, and the club reaches its head, away from the player."""
    outside, foreground = player
    height = foreground.height
    away = (
        _extend_both_ways(outside, foreground, ends[1:])[0]
        > options.free * height * foreground.shrink
    )
    near = np.linalg.norm(ends[0] - shoulders) < options.arms * height
    return bool(away and near and np.linalg.norm(ends[1] - ends[0]) < options.longest * height)


def _is_tip(
    hand: Float[np.ndarray, "2"],
    head: Float[np.ndarray, "2"],
    player: tuple[Float[np.ndarray, "h w"], Foreground],
    rim: float,
) -> bool:
    """Whether the scene shows behind the hands, in the line of the shaft."""
    outside, foreground = player
    unit = (hand - head) / np.linalg.norm(hand - head)
    line = hand + foreground.height * np.linspace(*FIST, 10)[:, None] * unit
    return bool((_extend_both_ways(outside, foreground, line) > rim).mean() > 0.4)


def _beside_player(foreground: Foreground, frame: int) -> Float[np.ndarray, "h w"]:
    """Distance of every pixel to the player without the club, pixels of the mask."""
    free = (~foreground.player(frame)).astype(np.uint8)
    return cv2.distanceTransform(free, cv2.DIST_L2, 3)


def _extend_both_ways(
    picture: Float[np.ndarray, "h w"] | UInt8[np.ndarray, "h w"],
    foreground: Foreground,
    points: Float[np.ndarray, "n 2"],
) -> Float[np.ndarray, "n"]:
    """Values of a picture of the mask's size at points in px of the video."""
    places = (points * foreground.shrink + (foreground.shrink - 1) / 2).astype(np.float32)
    read = cv2.remap(
        picture, places[:, None], None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return read.ravel().astype(float)


def _follow_to_head(
    held: Float[np.ndarray, "2"],
    other: Float[np.ndarray, "2"],
    seen: tuple[Foreground, int],
    options: ShaftOptions,
) -> Float[np.ndarray, "2"]:
    """The last place of the foreground beyond the free end of a bar."""
    foreground, frame = seen
    unit = (other - held) / np.linalg.norm(other - held)
    steps = np.arange(1, round(options.longest / STEP)) * STEP * foreground.height
    aside = np.array([-unit[1], unit[0]]) / foreground.shrink
    lines = other + steps[:, None] * unit + np.arange(-1, 2)[:, None, None] * aside
    there = foreground.sample(frame, lines).max(axis=0) > SEEN
    missing = np.convolve(~there, np.ones(GAP), "full")[: len(there)] >= GAP
    stop = int(missing.argmax()) if missing.any() else len(there)
    last = np.flatnonzero(there[:stop])
    return other + unit * (steps[last[-1]] if len(last) else 0.0)


def _follow_to_hands(
    held: Float[np.ndarray, "2"],
    head: Float[np.ndarray, "2"],
    player: tuple[Float[np.ndarray, "h w"], Foreground],
    options: ShaftOptions,
) -> Float[np.ndarray, "2"]:
    """Where the line of a shaft meets the player; its end, if that is too far away."""
    outside, foreground = player
    unit = (held - head) / np.linalg.norm(held - head)
    steps = np.arange(0, options.reach, STEP) * foreground.height
    there = _extend_both_ways(outside, foreground, held + steps[:, None] * unit) <= 1.0
    return held + unit * (steps[there.argmax()] if there.any() else 0.0)
