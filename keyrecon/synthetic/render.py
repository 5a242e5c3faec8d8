"""One frame: background, shadow, figure over the time of exposure, lens, noise.

The shutter stays open around the time of the frame. The figure is drawn at a few instants within
it and averaged, more of them the faster its fastest joint; each instant samples pixels at
another place, which smooths edges at no cost. The background is smeared along the turn of the
camera.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from keyrecon.body import LSP14
from keyrecon.synthetic.cameras import CameraMove
from keyrecon.synthetic.court import Background
from keyrecon.synthetic.figure import PARTS, FigureSolids, Pointers, build_solids, unit
from keyrecon.synthetic.looks import Look
from keyrecon.synthetic.racket import MOST as RACKET_MOST
from keyrecon.synthetic.racket import STEP as RACKET_STEP
from keyrecon.synthetic.racket import Layer, draw_racket
from keyrecon.synthetic.raster import Solids, Surface, draw_solids
from keyrecon.synthetic.shading import Light, Tiles, paint_surface

STEP = 5.0
"""px that a joint moves at most between two instants of an exposure."""
MOST_INSTANTS = 6
OFFSETS = ((-0.25, -0.25), (0.25, 0.25), (0.25, -0.25), (-0.25, 0.25))
"""Sampling places of successive instants, px."""


@dataclass(frozen=True, eq=False)
class Stage:
    """All that a frame is drawn from; frames can be drawn in any order."""

    points: Float[np.ndarray, "T 14 3"]
    """World, metres."""
    pointers: Pointers
    racket: Float[np.ndarray, "T 3 3"]
    """Fist, direction to the tip, direction across; see `racket.racket_frames`."""
    move: CameraMove
    background: Background
    look: Look
    tiles: Tiles
    noise: Int[np.ndarray, "h w 3"]
    """Sensor noise, cut at another place for every frame."""
    exposure: float
    """Share of the time between frames that the shutter is open."""
    seed: int


@dataclass(frozen=True, eq=False)
class Frame:
    """A drawn frame and what the renderer knows about it."""

    picture: UInt8[np.ndarray, "h w 3"]
    parts: UInt8[np.ndarray, "h w"]
    """Index into figure.PARTS at mid-exposure."""
    visible: Bool[np.ndarray, "14"]
    """Joints not hidden by another part of the body, and inside the picture."""


def draw_frame(stage: Stage, frame: int) -> Frame:
    """Draw one frame."""
    picture = _draw_background(stage, frame).astype(np.float32)
    times = _instants(stage, frame)
    solids = _pose(stage, times)
    _cast_shadow(stage, frame, solids, picture)
    drawn = _draw_figure(stage, frame, times, solids)
    _lay_over(picture, drawn)
    parts, visible = _label(stage, frame, drawn, solids)
    return Frame(_develop(stage, frame, picture), parts, visible)


def _draw_background(stage: Stage, frame: int) -> UInt8[np.ndarray, "h w 3"]:
    """Look the background up and smear it along the camera's turn."""
    lookup = stage.background.lookup(stage.move, frame)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    picture = cv2.warpPerspective(
        stage.background.picture, lookup, stage.move.size, flags=flags, borderMode=cv2.BORDER_REPLICATE
    )
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


def _instants(stage: Stage, frame: int) -> Float[np.ndarray, "S"]:
    """Times at which the figure is drawn, in frames."""
    last = len(stage.points) - 1
    around = stage.points[[max(frame - 1, 0), min(frame + 1, last)]]
    pixels = (around - stage.move.center) @ stage.move.rotation[frame].T
    pixels = pixels[..., :2] / pixels[..., 2:] * stage.move.focal[frame]
    speed = np.linalg.norm(pixels[1] - pixels[0], axis=-1).max() / 2 * stage.exposure
    count = int(np.clip(np.ceil(speed / STEP), 2, MOST_INSTANTS))
    times = frame + stage.exposure * ((np.arange(count) + 0.5) / count - 0.5)
    return np.clip(times, 0, last)


def _pose(stage: Stage, times: Float[np.ndarray, "S"]) -> FigureSolids:
    """Solids at times between frames."""
    low = np.minimum(times.astype(int), len(stage.points) - 2)
    share = times - low

    def at(values: np.ndarray) -> np.ndarray:
        weight = share.reshape(-1, *[1] * (values.ndim - 1))
        return values[low] * (1 - weight) + values[low + 1] * weight

    p = stage.pointers
    pointers = Pointers(
        unit(at(p.front)), unit(at(p.face)), unit(at(p.toes)), unit(at(p.racket)),
        unit(at(p.strings)), p.stature, p.left_handed,
    )  # fmt: skip
    return build_solids(at(stage.points), pointers, stage.look.build)


def _light(stage: Stage, frame: int) -> Light:
    rotation = stage.move.rotation[frame]
    look = stage.look
    return Light(
        rotation @ np.array(look.sun), rotation @ np.array([0, 1.0, 0]),
        look.sun_color, look.sunshine, look.court.outside,
    )  # fmt: skip


def _in_camera(stage: Stage, frame: int, solids: FigureSolids, instant: int) -> Solids:
    rotation, center = stage.move.rotation[frame], stage.move.center
    return Solids(
        (solids.start[instant] - center) @ rotation.T,
        (solids.end[instant] - center) @ rotation.T,
        solids.side[instant] @ rotation.T,
        solids.radii, solids.squeeze, solids.open_end,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Instant:
    surface: Surface
    color: Float[np.ndarray, "h w 3"]
    racket: Layer | None
    """Already without what the body hides."""


def _draw_figure(
    stage: Stage, frame: int, times: Float[np.ndarray, "S"], solids: FigureSolids
) -> list[_Instant]:
    colors = stage.look.part_colors[solids.part]
    light = _light(stage, frame)
    focal = float(stage.move.focal[frame])
    drawn = []
    for instant, time in enumerate(times):
        local = _in_camera(stage, frame, solids, instant)
        surface = draw_solids(
            local, focal, stage.move.principal, stage.move.size, OFFSETS[instant % len(OFFSETS)]
        )
        if surface is not None and (surface.solid >= 0).any():
            color = paint_surface(surface, solids.part, colors, light, stage.tiles)
            step = stage.exposure / len(times)
            racket = _draw_racket(stage, frame, (time, step), focal / local.start[:, 2].mean())
            drawn.append(_Instant(surface, color, _hide(racket, surface)))
    return drawn


def _draw_racket(
    stage: Stage, frame: int, span: tuple[float, float], scale: float
) -> Layer | None:
    """The racket, smeared over a span of time (middle, length; in frames)."""
    time, length = span
    focal, rotation = float(stage.move.focal[frame]), stage.move.rotation[frame]
    last = len(stage.racket) - 1

    def at(times: np.ndarray) -> np.ndarray:
        low = np.minimum(np.clip(times, 0, last).astype(int), last - 1)
        share = np.clip(times - low, 0, 1)[:, None, None]
        poses = stage.racket[low] * (1 - share) + stage.racket[low + 1] * share
        poses = poses - np.array([1.0, 0, 0])[:, None] * stage.move.center
        return poses @ rotation.T

    ends = at(time + length * np.array([-0.5, 0.5]))
    tips = ends[:, 0] + 0.5 * ends[:, 1]
    way = np.linalg.norm(tips[1] - tips[0]) * focal / tips[0, 2]
    count = int(np.clip(np.ceil(way / RACKET_STEP), 1, RACKET_MOST))
    poses = at(time + length * ((np.arange(count) + 0.5) / count - 0.5))
    view = (focal, stage.move.principal, stage.move.size, scale)
    return draw_racket(poses, view, np.float32(stage.look.racket))


def _hide(racket: Layer | None, surface: Surface) -> Layer | None:
    """Take away the pixels of a layer that lie behind the body."""
    if racket is None:
        return None
    height, width = racket.depth.shape
    y0, x0 = max(racket.top, surface.top), max(racket.left, surface.left)
    y1 = min(racket.top + height, surface.top + surface.depth.shape[0])
    x1 = min(racket.left + width, surface.left + surface.depth.shape[1])
    if y1 > y0 and x1 > x0:
        body = surface.depth[
            y0 - surface.top : y1 - surface.top, x0 - surface.left : x1 - surface.left
        ]
        ours = (slice(y0 - racket.top, y1 - racket.top), slice(x0 - racket.left, x1 - racket.left))
        racket.color[ours] *= (racket.depth[ours] < body)[..., None]
    return racket


def _lay_over(picture: Float[np.ndarray, "h w 3"], drawn: list[_Instant]) -> None:
    """Average the instants, soften them as a lens does and lay them over the picture."""
    if not drawn:
        return
    left, top, right, bottom = _union(drawn, picture.shape)
    total = np.zeros((bottom - top, right - left, 4), np.float32)
    for one in drawn:
        layer = np.zeros_like(total) if one.racket or len(drawn) > 1 else total
        y, x = one.surface.top - top, one.surface.left - left
        height, width = one.surface.solid.shape
        part = layer[y : y + height, x : x + width]
        part[..., :3] = one.color
        part[..., 3] = one.surface.solid >= 0
        if one.racket:
            y, x = one.racket.top - top, one.racket.left - left
            height, width = one.racket.depth.shape
            part = layer[y : y + height, x : x + width]
            part *= 1 - one.racket.color[..., 3:]
            part += one.racket.color
        total += layer
    total = cv2.GaussianBlur(total / len(drawn), (3, 3), 0.55)
    region = picture[top:bottom, left:right]
    region *= 1 - total[..., 3:]
    region += total[..., :3]


def _union(drawn: list[_Instant], shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    boxes = [(i.surface.left, i.surface.top, *i.surface.solid.shape[::-1]) for i in drawn]
    rackets = [i.racket for i in drawn if i.racket]
    boxes = np.array(boxes + [(r.left, r.top, *r.depth.shape[::-1]) for r in rackets])
    left, top = boxes[:, :2].min(axis=0)
    right, bottom = (boxes[:, :2] + boxes[:, 2:]).max(axis=0)
    return max(left - 2, 0), max(top - 2, 0), min(right + 2, shape[1]), min(bottom + 2, shape[0])


def _cast_shadow(
    stage: Stage, frame: int, solids: FigureSolids, picture: Float[np.ndarray, "h w 3"]
) -> None:
    """Darken the floor under the figure: the sun's shadow, and a soft one of the sky."""
    middle = len(solids.start) // 2
    ends = np.stack([solids.start[middle], solids.end[middle]], axis=1)
    sun = np.array(stage.look.sun)
    circle = np.linspace(0, 2 * np.pi, 10, endpoint=False)
    ring = np.stack([np.cos(circle), 0 * circle, np.sin(circle)], axis=1)
    height, width = picture.shape[:2]
    mask = np.zeros((height // 2, width // 2), np.uint8)
    floor = ends - ends[..., 1:2] / sun[1] * sun
    rims = floor[:, :, None] + ring * (solids.radii * solids.squeeze[:, :1])[:, :, None, None]
    local = (rims.reshape(len(ends), -1, 3) - stage.move.center) @ stage.move.rotation[frame].T
    pixels = local[..., :2] / local[..., 2:] * stage.move.focal[frame] + stage.move.principal
    for outline in pixels / 2:
        hull = cv2.convexHull(np.round(outline * 16).astype(np.int32))
        cv2.fillConvexPoly(mask, hull, 255, cv2.LINE_AA, 4)
    x, y, w, h = cv2.boundingRect(mask)
    if w == 0:
        return
    pad = 6
    x0, y0, x1, y1 = max(x - pad, 0), max(y - pad, 0), min(x + w + pad, width // 2), min(y + h + pad, height // 2)
    soft = cv2.GaussianBlur(mask[y0:y1, x0:x1], (0, 0), 0.8 + 1.6 * (1 - stage.look.sunshine))
    soft = cv2.resize(soft, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR)
    dark = 1 - soft[..., None].astype(np.float32) * ((0.2 + 0.35 * stage.look.sunshine) / 255)
    picture[2 * y0 : 2 * y1, 2 * x0 : 2 * x1] *= dark


def _label(
    stage: Stage, frame: int, drawn: list[_Instant], solids: FigureSolids
) -> tuple[UInt8[np.ndarray, "h w"], Bool[np.ndarray, "14"]]:
    """Parts at mid-exposure, and which joints nothing else hides."""
    width, height = stage.move.size
    parts = np.zeros((height, width), np.uint8)
    visible = np.zeros(len(LSP14.names), bool)
    if not drawn:
        return parts, visible
    surface = drawn[len(drawn) // 2].surface
    rows, columns = surface.solid.shape
    hit = surface.solid >= 0
    region = parts[surface.top : surface.top + rows, surface.left : surface.left + columns]
    region[hit] = solids.part[surface.solid[hit]]
    racket = drawn[len(drawn) // 2].racket
    if racket:
        rows_, columns_ = racket.depth.shape
        region = parts[racket.top : racket.top + rows_, racket.left : racket.left + columns_]
        region[racket.color[..., 3] > 0.5] = PARTS.index("racket")
    local = (stage.points[frame] - stage.move.center) @ stage.move.rotation[frame].T
    pixels = local[:, :2] / local[:, 2:] * stage.move.focal[frame] + stage.move.principal
    cell = np.round(pixels).astype(int) - (surface.left, surface.top)
    inside = ((cell >= 0) & (cell < (columns, rows))).all(axis=1)
    cell = np.clip(cell, 0, (columns - 1, rows - 1))
    scale = stage.move.focal[frame] / local[:, 2].mean()
    before = local[:, 2] * scale - surface.depth[cell[:, 1], cell[:, 0]]
    stature = stage.pointers.stature * scale
    visible = inside & (before < _COVER * stature)
    return parts, visible


_COVER = np.array(
    [0.11 if "hip" in n else 0.09 if n in ("neck", "head_top") or "shoulder" in n else 0.06
     for n in LSP14.names]
)  # fmt: skip
"""Depth of flesh and cloth in front of a joint, in statures."""


def _develop(stage: Stage, frame: int, picture: Float[np.ndarray, "h w 3"]) -> np.ndarray:
    """Add sensor noise and round to 8 bits."""
    rng = np.random.default_rng([stage.seed, 5, frame])
    height, width = picture.shape[:2]
    y = rng.integers(stage.noise.shape[0] - height)
    x = rng.integers(stage.noise.shape[1] - width)
    return cv2.add(picture, stage.noise[y : y + height, x : x + width], dtype=cv2.CV_8U)
