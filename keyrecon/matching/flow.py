"""How the picture moves from frame to frame, seen from the player.

The player is cut out at a fixed size in player coordinates, which takes out the camera and the
walk, and dense inverse search (Kroeger, Timofte, Dai and Van Gool, ECCV 2016) measures the
motion to the next frame and back. What does not come back to where it started is not trusted:
skin that appears from behind a leg, the background at the edge of an arm.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Complex, Float, Float16, Int, UInt8

from keyrecon.matching.window import Window
from keyrecon.progress import Progress, silent
from keyrecon.video import Video

LEFT, TOP, SIDE = -0.85, -1.0, 1.7
"""The square that holds a player with a raised arm, player heights from the origin."""
STRIDE = 2
"""The flow is kept at every second pixel of the cut-out."""
RETURN_SPREAD = 0.012
"""A return that misses by this, player heights, halves the trust: one to two pixels."""


@dataclass(frozen=True, eq=False)
class Flow:
    """Motion from frame t to t + 1 (last: none) on a grid around the player."""

    motion: Float16[np.ndarray, "T G G 2"]
    """Player heights."""
    trust: Float16[np.ndarray, "T G G"]
    """0-1, from the way back."""


def measure_flow(
    video: Video, window: Window, resolution: float, progress: Progress = silent
) -> Flow:
    """Flow between neighbouring frames, the player `resolution` px tall in the cut-outs."""
    size = STRIDE * round(SIDE * resolution / STRIDE)
    resolution = size / SIDE
    method = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    motion, trust, before = [], [], None
    for cut in progress(cut_outs(video, window, size), "following motion", len(video)):
        if before is not None:
            there = method.calc(before, cut, None)
            back = method.calc(cut, before, None)
            motion.append((there[::STRIDE, ::STRIDE] / resolution).astype(np.float16))
            trust.append(_return_trust(there, back, resolution))
        before = cut
    grid = len(range(0, size, STRIDE))
    motion.append(np.zeros((grid, grid, 2), np.float16))
    trust.append(np.zeros((grid, grid), np.float16))
    return Flow(np.stack(motion), np.stack(trust))


def cut_outs(video: Video, window: Window, size: int) -> Iterator[UInt8[np.ndarray, "S S"]]:
    """Grey pictures of the player, upright and of one size."""
    tall = float(np.median(window.height)) * SIDE
    width = min(video.width, round(1.3 * size / tall * video.width))
    shrink = width / video.width
    for t, picture in enumerate(video.frames(width=width)):
        scale = window.height[t] * SIDE / size * shrink
        corner = (window.origin[t] + (LEFT + 1j * TOP) * window.height[t] + 0.5) * shrink - 0.5
        to_picture = np.array([[scale, 0, corner.real], [0, scale, corner.imag]])
        grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
        yield cv2.warpAffine(
            grey, to_picture, (size, size), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )  # fmt: skip


def _return_trust(
    there: Float[np.ndarray, "S S 2"], back: Float[np.ndarray, "S S 2"], resolution: float
) -> Float16[np.ndarray, "G G"]:
    y, x = np.mgrid[0 : len(there) : STRIDE, 0 : len(there) : STRIDE].astype(np.float32)
    there = there[::STRIDE, ::STRIDE]
    returned = cv2.remap(
        back, x + there[..., 0], y + there[..., 1], cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )  # fmt: skip
    miss = np.linalg.norm(there + returned, axis=-1) / resolution
    return (1 / (1 + (miss / RETURN_SPREAD) ** 2)).astype(np.float16)


def sample_flow(
    flow: Flow, frames: Int[np.ndarray, "P"], points: Complex[np.ndarray, "P S"]
) -> tuple[Complex[np.ndarray, "P S"], Float[np.ndarray, "P S"]]:
    """(motion, trust) at points of the frames, bilinear; no trust outside the cut-out."""
    grid = flow.motion.shape[1]
    x = np.nan_to_num((points.real - LEFT) / SIDE * grid)
    y = np.nan_to_num((points.imag - TOP) / SIDE * grid)
    inside = (x >= 0) & (y >= 0) & (x < grid - 1) & (y < grid - 1) & np.isfinite(points)
    x, y = np.clip(x, 0, grid - 1.001), np.clip(y, 0, grid - 1.001)
    column, row, at = x.astype(int), y.astype(int), frames[:, None]
    u, v = x - column, y - row
    motion = np.zeros(points.shape, complex)
    trust = np.zeros(points.shape)
    for down, right, share in ((0, 0, (1 - u) * (1 - v)), (0, 1, u * (1 - v)),
                               (1, 0, (1 - u) * v), (1, 1, u * v)):
        cell = at, row + down, column + right
        motion += share * (flow.motion[(*cell, 0)] + 1j * flow.motion[(*cell, 1)])
        trust += share * flow.trust[cell]
    return motion, trust * inside
