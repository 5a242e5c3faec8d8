"""What the player swings: lines in a plane, drawn with the depth of that plane.

It moves faster than anything else in the picture, so it is drawn several times between two
instants of the figure. The racket has a handle, a throat and a strung oval, its size after the
ITF's rule 4: 0.685 m long, head 0.33 m x 0.26 m. The golf club is a mid iron: grip, shaft, head.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float

from keyrecon.synthetic.figure import Pointers, joint, unit

GRIP = 0.08
"""Metres from the wrist to the middle of the fist."""
STEP = 3.0
"""px that the tip moves at most between two drawings."""
MOST = 8
_CIRCLE = np.linspace(0, 2 * np.pi, 28, endpoint=False)


@dataclass(frozen=True)
class Stroke:
    """A line of an implement."""

    points: tuple[tuple[float, float], ...]
    """Along from the fist and across; metres."""
    width: float
    """Metres."""
    closed: bool = False
    strung: bool = False
    """Whether a net of strings fills it."""


@dataclass(frozen=True)
class Implement:
    """What is held in the hand."""

    strokes: tuple[Stroke, ...]
    reach: float
    """Metres from the fist to a point that stands for how fast it moves."""


RACKET = Implement(
    (
        Stroke(
            tuple((0.43 + 0.16 * np.cos(a), 0.125 * np.sin(a)) for a in _CIRCLE.tolist()),
            0.02, closed=True, strung=True,
        ),
        Stroke(((-0.07, 0.0), (0.12, 0.0)), 0.03),
        Stroke(((0.11, 0.0), (0.30, 0.072)), 0.02),
        Stroke(((0.11, 0.0), (0.30, -0.072)), 0.02),
    ),
    0.5,
)  # fmt: skip


def golf_club(length: float) -> Implement:
    """An iron; `length` is from between the hands to the end of the head, metres."""
    return Implement(
        (
            Stroke(((-0.13, 0.0), (0.13, 0.0)), 0.024),
            Stroke(((0.13, 0.0), (length - 0.03, 0.0)), 0.009),
            Stroke(((length - 0.04, 0.0), (length - 0.01, 0.075)), 0.04),
        ),
        length,
    )


@dataclass(frozen=True, eq=False)
class Layer:
    """Something drawn over a part of the picture: premultiplied colour and cover."""

    left: int
    top: int
    color: Float[np.ndarray, "h w 4"]
    depth: Float[np.ndarray, "h w"]
    """px at the scale of the picture, as in `raster.Surface`."""


def racket_frames(
    points: Float[np.ndarray, "T 14 3"], pointers: Pointers
) -> Float[np.ndarray, "T 3 3"]:
    """Fist, direction to the tip and direction across the strings, in the world."""
    side = "left" if pointers.left_handed else "right"
    wrist, elbow = joint(points, f"{side}_wrist"), joint(points, f"{side}_elbow")
    fist = wrist + GRIP * unit(wrist - elbow)
    across = unit(np.cross(pointers.strings, pointers.racket))
    return np.stack([fist, pointers.racket, across], axis=1)


def draw_implement(
    implement: Implement,
    poses: Float[np.ndarray, "n 3 3"],
    focal: float,
    principal: Float[np.ndarray, "2"],
    size: tuple[int, int],
    depth_scale: float,
    color: Float[np.ndarray, "3"],
) -> Layer | None:
    """Average of an implement at several poses in camera axes.

    Focal length, principal point and picture size are px; `depth_scale` is px per metre of depth.
    """
    flat = np.concatenate([stroke.points for stroke in implement.strokes])
    outline = poses[:, :1] + flat[:, :1] * poses[:, 1:2] + flat[:, 1:] * poses[:, 2:]
    pixels = outline[..., :2] / outline[..., 2:] * focal + principal
    lo = np.maximum(np.floor(pixels.min(axis=(0, 1))) - 4, 0).astype(int)
    hi = np.minimum(np.ceil(pixels.max(axis=(0, 1))) + 5, size).astype(int)
    if (hi <= lo).any():
        return None
    shape = (int(hi[1] - lo[1]), int(hi[0] - lo[0]))
    scale = focal / poses[:, 0, 2].mean()
    frame = np.zeros(shape, np.float32)
    strings = np.zeros(shape, np.float32)
    for one in np.round((pixels - lo) * 16).astype(np.int32):
        lines, net = _draw_strokes(implement, one, scale, shape)
        frame += lines
        strings += net
    frame /= 255 * len(poses)
    strings /= 255 * len(poses)
    cover = np.maximum(frame, strings * (1 - frame))
    paint = frame[..., None] * color + np.maximum(cover - frame, 0)[..., None] * np.float32(200)
    middle = len(poses) // 2
    depth = _plane_depth(pixels[middle] - lo, outline[middle, :, 2] * depth_scale, shape)
    return Layer(int(lo[0]), int(lo[1]), np.dstack([paint, cover]).astype(np.float32), depth)


def _draw_strokes(
    implement: Implement, points: np.ndarray, scale: float, shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Cover of lines and of strings at one pose, 0-255; `points` in sixteenths of a px."""
    lines, net = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)
    first = 0
    for stroke in implement.strokes:
        outline = points[first : first + len(stroke.points)]
        first += len(outline)
        if stroke.strung:
            cv2.fillPoly(net, [outline], 70, cv2.LINE_AA, 4)
        width = max(1, round(stroke.width * scale))
        cv2.polylines(lines, [outline], stroke.closed, 255, width, cv2.LINE_AA, 4)
    return lines, net


def _plane_depth(
    pixels: Float[np.ndarray, "n 2"], depth: Float[np.ndarray, "n"], shape: tuple[int, int]
) -> Float[np.ndarray, "h w"]:
    """Depth of the plane through the outline, kept between its nearest and farthest point."""
    terms = np.column_stack([pixels, np.ones(len(pixels))])
    gram = terms.T @ terms + np.diag([1.0, 1.0, 0.0])
    a, b, c = np.linalg.solve(gram, terms.T @ depth)
    y, x = np.mgrid[: shape[0], : shape[1]]
    return np.clip(a * x + b * y + c, depth.min(), depth.max()).astype(np.float32)
