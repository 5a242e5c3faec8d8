"""One frame: background, shadow, figure over the time of exposure, noise.

The shutter stays open around the time of the frame. The background is looked up through the
homography of the turning camera and smeared along its turn; the shadow is that of every solid,
thrown on the floor by the sun.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from keyrecon.body import LSP14
from keyrecon.numerics.picture_points import sample_picture
from keyrecon.synthetic.exposure import Instant, choose_instants, draw_figure, lay_over
from keyrecon.synthetic.figure import PARTS, FigureSolids
from keyrecon.synthetic.stage import Stage, pose_figure


@dataclass(frozen=True, eq=False)
class Frame:
    """A drawn frame and what the renderer knows about it."""

    picture: UInt8[np.ndarray, "h w 3"]
    parts: UInt8[np.ndarray, "h w"]
    """Index into figure.PARTS at mid-exposure."""
    visible: Bool[np.ndarray, "14"]
    """Joints not hidden by another part of the body, and inside the picture."""
    club: float
    """Share of the racket's or club's axis, from the hands on, that a person can see, 0-1."""


def draw_frame(stage: Stage, frame: int) -> Frame:
    """Draw one frame."""
    picture = _draw_background(stage, frame).astype(np.float32)
    times = choose_instants(stage, frame)
    solids = pose_figure(stage, times)
    _cast_shadow(stage, frame, solids, picture)
    drawn = draw_figure(stage, frame, times, solids)
    without = picture.copy()
    lay_over(picture, drawn)
    lay_over(without, [replace(instant, racket=None) for instant in drawn])
    club = _see_club(stage, frame, np.abs(picture - without).max(axis=2))
    parts = _label_parts(stage, drawn, solids)
    visible = _find_visible(stage, frame, drawn)
    return Frame(_develop(stage, frame, picture), parts, visible, club)


def _draw_background(stage: Stage, frame: int) -> UInt8[np.ndarray, "h w 3"]:
    """Look the background up and smear it along the camera's turn."""
    lookup = stage.background.lookup(stage.move, frame)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    picture = cv2.warpPerspective(
        stage.background.picture, lookup, stage.move.size,
        flags=flags, borderMode=cv2.BORDER_REPLICATE,
    )  # fmt: skip
    following = min(frame + 1, len(stage.move.focal) - 1)
    if following == frame:
        return picture
    middle = np.append(stage.move.principal, 1)
    later = np.linalg.solve(stage.background.lookup(stage.move, following), lookup @ middle)
    turn = (later[:2] / later[2] - middle[:2]) * stage.exposure
    return _smear(picture, turn)


def _smear(picture: UInt8[np.ndarray, "h w 3"], way: Float[np.ndarray, "2"]) -> np.ndarray:
    """Average along a way, px."""
    reach = int(np.ceil(np.abs(way).max() / 2))
    if np.linalg.norm(way) < 0.6:
        return picture
    kernel = np.zeros((2 * reach + 1, 2 * reach + 1), np.float32)
    for share in np.linspace(-0.5, 0.5, 8 * reach + 1):
        x, y = way * share + reach
        x0, y0 = min(int(x), 2 * reach - 1), min(int(y), 2 * reach - 1)
        fx, fy = x - x0, y - y0
        kernel[y0 : y0 + 2, x0 : x0 + 2] += np.outer([1 - fy, fy], [1 - fx, fx])
    return cv2.filter2D(picture, -1, kernel / kernel.sum())


def _cast_shadow(
    stage: Stage, frame: int, solids: FigureSolids, picture: Float[np.ndarray, "h w 3"]
) -> None:
    """Darken the floor where the figure keeps the sun off; drawn at half resolution."""
    middle = len(solids.start) // 2
    ends = np.stack([solids.start[middle], solids.end[middle]], axis=1)
    sun = np.array(stage.look.sun)
    circle = np.linspace(0, 2 * np.pi, 10, endpoint=False)
    ring = np.stack([np.cos(circle), 0 * circle, np.sin(circle)], axis=1)
    floor = ends - ends[..., 1:2] / sun[1] * sun
    rims = floor[:, :, None] + ring * (solids.radii * solids.squeeze[:, :1])[:, :, None, None]
    outlines = stage.project(rims.reshape(len(ends), -1, 3), frame) / 2
    height, width = picture.shape[0] // 2, picture.shape[1] // 2
    mask = np.zeros((height, width), np.uint8)
    for outline in np.round(outlines * 16).astype(np.int32):
        cv2.fillConvexPoly(mask, cv2.convexHull(outline), 255, cv2.LINE_AA, 4)
    x, y, w, h = cv2.boundingRect(mask)
    if w == 0:
        return
    x0, y0, x1, y1 = max(x - 6, 0), max(y - 6, 0), min(x + w + 6, width), min(y + h + 6, height)
    soft = cv2.GaussianBlur(mask[y0:y1, x0:x1], (0, 0), 0.8 + 1.6 * (1 - stage.look.sunshine))
    soft = cv2.resize(soft, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR)
    depth = (0.2 + 0.35 * stage.look.sunshine) / 255
    picture[2 * y0 : 2 * y1, 2 * x0 : 2 * x1] *= 1 - soft[..., None].astype(np.float32) * depth


def _label_parts(
    stage: Stage, drawn: list[Instant], solids: FigureSolids
) -> UInt8[np.ndarray, "h w"]:
    """Parts at mid-exposure."""
    width, height = stage.move.size
    parts = np.zeros((height, width), np.uint8)
    if not drawn:
        return parts
    surface, racket = drawn[len(drawn) // 2].surface, drawn[len(drawn) // 2].racket
    rows, columns = surface.solid.shape
    hit = surface.solid >= 0
    region = parts[surface.top : surface.top + rows, surface.left : surface.left + columns]
    region[hit] = solids.part[surface.solid[hit]]
    if racket:
        rows, columns = racket.depth.shape
        region = parts[racket.top : racket.top + rows, racket.left : racket.left + columns]
        region[racket.color[..., 3] > 0.5] = PARTS.index("racket")
    return parts


_COVER = np.array(
    [0.11 if "hip" in n else 0.09 if n in ("neck", "head_top") or "shoulder" in n else 0.06
     for n in LSP14.names]
)  # fmt: skip
"""Depth of flesh and cloth in front of a joint, in statures."""


def _find_visible(stage: Stage, frame: int, drawn: list[Instant]) -> Bool[np.ndarray, "14"]:
    """Joints in the picture whose surface is nearer than any other limb's."""
    if not drawn:
        return np.zeros(len(LSP14.names), bool)
    surface = drawn[len(drawn) // 2].surface
    rows, columns = surface.solid.shape
    pixels = stage.project(stage.points[frame], frame)
    cell = np.round(pixels).astype(int) - (surface.left, surface.top)
    inside = ((pixels >= 0) & (pixels < stage.move.size)).all(axis=1)
    cell = np.clip(cell, 0, (columns - 1, rows - 1))
    depth = stage.in_camera(stage.points[frame], frame)[:, 2]
    scale = stage.move.focal[frame] / depth.mean()
    before = depth * scale - surface.depth[cell[:, 1], cell[:, 0]]
    return inside & (before < _COVER * stage.pointers.stature * scale)


FIST = 0.15
"""Metres of the racket or club that the hands cover."""
STANDS_OUT = 8.0
"""Grey levels by which a line must differ from what is behind it to be seen through the noise."""


def _see_club(stage: Stage, frame: int, change: Float[np.ndarray, "h w"]) -> float:
    """Share of the axis of what is swung along which it changes the picture visibly."""
    start, way, _ = stage.racket[frame]
    along = np.linspace(FIST, stage.held.reach, 40)[:, None]
    pixels = stage.project(start + along * way, frame)
    there = cv2.dilate(change, np.ones((3, 3), np.uint8))
    return float((sample_picture(there, pixels[:, None]) > STANDS_OUT).mean())


def _develop(stage: Stage, frame: int, picture: Float[np.ndarray, "h w 3"]) -> np.ndarray:
    """Add sensor noise and round to 8 bits."""
    rng = np.random.default_rng([stage.seed, 5, frame])
    height, width = picture.shape[:2]
    y = rng.integers(stage.noise.shape[0] - height)
    x = rng.integers(stage.noise.shape[1] - width)
    return cv2.add(picture, stage.noise[y : y + height, x : x + width], dtype=cv2.CV_8U)
