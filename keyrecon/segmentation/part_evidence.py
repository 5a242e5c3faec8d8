"""Where a small picture shows the player's colours: maps that candidates are searched in.

Colours recur in the scene (clay like skin, lines like white shoes), so back-projection is weighted
by how far a pixel is from the background. That background is estimated before the player is
tracked, from what lacks the player's colours.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

from keyrecon.records import CameraPath
from keyrecon.segmentation.background_model import (
    BackgroundOptions,
    complete_background,
    median_background,
    sample_frames,
)
from keyrecon.segmentation.color_model import color_bins, look_up, to_lab
from keyrecon.segmentation.foreground_model import ForegroundModel
from keyrecon.segmentation.static_overlay import find_overlay

Reader = Callable[[Int[np.ndarray, "n"]], Iterable[UInt8[np.ndarray, "h w 3"]]]
"""Gives the reduced pictures of the frames with the given numbers, in order."""
SHOE_RADIUS = 0.045
"""Geometric mean radius of a shoe, player heights: .15 x .07 of stature from the side. A quarter
more or less, others with it: at most 1.9 points, 2.4 mm on four clips."""
HEAD_RADIUS = 0.062
"""Player heights: .055 of stature, and head to feet is .9 of stature (Drillis and Contini)."""
BACKGROUND_WEIGHT = 0.2
"""Weight of colour where nothing differs from the background: a player may stand still. Chosen on
rendered sequences; see benchmarks/sensitivity.py."""
MIN_CLEAR_SHARE = 0.15
"""Share of the frames in which a place must lack the player's colours for their median to count: a
racket or a shadow passes more rarely than that, even where the scene has the colours itself. A
quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """Maps of one frame, 0-1."""

    head: Float[np.ndarray, "h w"]
    foot: Float[np.ndarray, "h w"]
    player: Float[np.ndarray, "h w"]
    """Any part of the player."""
    inside: Float[np.ndarray, "h1 w1"]
    """Integral of `player`."""
    trunk: Float[np.ndarray, "h1 w1"] | None = None
    """The same of the trunk alone, where somebody told what it looks like."""


def background_hypotheses(
    pictures: Reader,
    numbers: Int[np.ndarray, "n"],
    camera: CameraPath,
    shrink: float,
    player: Float[np.ndarray, "bins"],
) -> tuple[ForegroundModel, ...]:
    """Backgrounds before the player is tracked: the median of what does not have their colours.

    Where everything has, the background does, and the median of all it is; or a player stands still
    there, and it is unknown. That is the second, where there is such a place. `pictures` gives the
    frames with some of the `numbers`, reduced by `shrink`.
    """
    sampled = numbers[sample_frames(len(numbers), BackgroundOptions.samples)]
    lab = [to_lab(p) for p in pictures(sampled)]
    paths = camera.to_reference[sampled]
    window = np.ones((3, 3), np.uint8)
    free = [
        cv2.dilate((look_up(player, color_bins(p)) > 0.5).astype(np.uint8), window) == 0
        for p in lab
    ]
    overlay = find_overlay(lab, free, paths, shrink)
    clear = median_background(lab, free, paths, shrink, min_share=MIN_CLEAR_SHARE, overlay=overlay)
    anywhere = [np.ones_like(f) for f in free]
    plain = median_background(lab, anywhere, paths, shrink, overlay=overlay)
    supposed = complete_background(clear, plain)
    scenes = (supposed,) if (clear.known == supposed.known).all() else (supposed, clear)
    return tuple(ForegroundModel(scene, camera) for scene in scenes)


def evaluate_evidence(
    lab: UInt8[np.ndarray, "h w 3"],
    tables: Float[np.ndarray, "n bins"],
    foreground: Float[np.ndarray, "h w"],
    tall: float,
) -> Evidence:
    """Back-projection weighted by foreground, low-passed at the size of each part.

    The tables are those of the head, the feet, the whole player and, where known, the trunk.
    """
    bins = color_bins(lab)
    weight = (BACKGROUND_WEIGHT + (1 - BACKGROUND_WEIGHT) * foreground).astype(np.float32)
    head = look_up(tables[0], bins) * weight
    foot = look_up(tables[1], bins) * weight
    any_part = look_up(tables[2], bins) * foreground.astype(np.float32)
    return Evidence(
        head=cv2.GaussianBlur(head, (0, 0), max(0.8, 0.25 * HEAD_RADIUS * tall)),
        foot=cv2.GaussianBlur(foot, (0, 0), max(0.8, 0.25 * SHOE_RADIUS * tall)),
        player=any_part,
        inside=cv2.integral(any_part),
        trunk=cv2.integral(look_up(tables[3], bins) * weight) if len(tables) > 3 else None,
    )


def mean_inside(
    total: Float[np.ndarray, "h1 w1"],
    places: Float[np.ndarray, "m 2"],
    window: tuple[float, float, float, float],
    tall: float,
) -> Float[np.ndarray, "m"]:
    """Mean of a map in a window (player heights) around each place, from its integral `total`."""
    rows, columns = np.array(total.shape) - 1
    x = np.rint(places[:, :1] + tall * np.array(window[0::2])).astype(int).clip(0, columns)
    y = np.rint(places[:, 1:] + tall * np.array(window[1::2])).astype(int).clip(0, rows)
    inside = (
        total[y[:, 1], x[:, 1]] - total[y[:, 0], x[:, 1]]
        - total[y[:, 1], x[:, 0]] + total[y[:, 0], x[:, 0]]
    )  # fmt: skip
    area = tall * (window[2] - window[0]) * tall * (window[3] - window[1])
    return inside / area
