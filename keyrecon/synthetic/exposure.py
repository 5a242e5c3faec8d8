"""The figure over the time that the shutter is open.

It is drawn at a few instants and averaged, more of them the faster its fastest joint; each
instant samples the pixels at another place, which smooths edges at no cost. A small blur stands
for the lens.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float

from keyrecon.synthetic.figure import FigureSolids
from keyrecon.synthetic.racket import MOST as RACKET_MOST
from keyrecon.synthetic.racket import STEP as RACKET_STEP
from keyrecon.synthetic.racket import Layer, draw_implement
from keyrecon.synthetic.raster import Solids, Surface, draw_solids
from keyrecon.synthetic.shading import paint_surface
from keyrecon.synthetic.stage import Stage

STEP = 5.0
"""px that a joint moves at most between two instants of an exposure."""
MOST_INSTANTS = 6
OFFSETS = ((-0.25, -0.25), (0.25, 0.25), (0.25, -0.25), (-0.25, 0.25))
"""Sampling places of successive instants, px."""


@dataclass(frozen=True, eq=False)
class Instant:
    """The figure as seen at one instant."""

    surface: Surface
    color: Float[np.ndarray, "h w 3"]
    racket: Layer | None
    """Already without what the body hides."""


def choose_instants(stage: Stage, frame: int) -> Float[np.ndarray, "S"]:
    """Times at which the figure is drawn, in frames."""
    last = len(stage.points) - 1
    around = stage.points[[max(frame - 1, 0), min(frame + 1, last)]]
    pixels = stage.project(around, frame)
    speed = np.linalg.norm(pixels[1] - pixels[0], axis=-1).max() / 2 * stage.exposure
    count = int(np.clip(np.ceil(speed / STEP), 2, MOST_INSTANTS))
    times = frame + stage.exposure * ((np.arange(count) + 0.5) / count - 0.5)
    return np.clip(times, 0, last)


def draw_figure(
    stage: Stage, frame: int, times: Float[np.ndarray, "S"], solids: FigureSolids
) -> list[Instant]:
    """Draw the figure at each of some times, given as frames."""
    colors = stage.look.part_colors[solids.part]
    light = stage.light(frame)
    focal = float(stage.move.focal[frame])
    drawn = []
    for instant, time in enumerate(times):
        local = _take_instant(stage, frame, solids, instant)
        surface = draw_solids(
            local, focal, stage.move.principal, stage.move.size, OFFSETS[instant % len(OFFSETS)]
        )
        if surface is not None and (surface.solid >= 0).any():
            color = paint_surface(surface, solids.part, colors, light, stage.tiles)
            step = stage.exposure / len(times)
            racket = _draw_racket(stage, frame, (time, step), focal / local.start[:, 2].mean())
            drawn.append(Instant(surface, color, _hide(racket, surface)))
    return drawn


def _take_instant(stage: Stage, frame: int, solids: FigureSolids, instant: int) -> Solids:
    """Solids of one instant in camera axes."""
    return Solids(
        stage.in_camera(solids.start[instant], frame),
        stage.in_camera(solids.end[instant], frame),
        solids.side[instant] @ stage.move.rotation[frame].T,
        solids.radii, solids.squeeze, solids.open_end,
    )  # fmt: skip


def _draw_racket(stage: Stage, frame: int, span: tuple[float, float], scale: float) -> Layer | None:
    """The racket, smeared over a span of time (middle, length; in frames)."""
    time, length = span
    focal = float(stage.move.focal[frame])
    last = len(stage.racket) - 1

    def at(times: np.ndarray) -> np.ndarray:
        low = np.minimum(np.clip(times, 0, last).astype(int), last - 1)
        share = np.clip(times - low, 0, 1)[:, None, None]
        poses = stage.racket[low] * (1 - share) + stage.racket[low + 1] * share
        poses = poses - np.array([1.0, 0, 0])[:, None] * stage.move.center
        return poses @ stage.move.rotation[frame].T

    ends = at(time + length * np.array([-0.5, 0.5]))
    tips = ends[:, 0] + stage.held.reach * ends[:, 1]
    way = np.linalg.norm(tips[1] - tips[0]) * focal / tips[0, 2]
    count = int(np.clip(np.ceil(way / RACKET_STEP), 1, RACKET_MOST))
    poses = at(time + length * ((np.arange(count) + 0.5) / count - 0.5))
    color = np.array(stage.look.racket, np.float32)
    return draw_implement(
        stage.held, poses, focal, stage.move.principal, stage.move.size, scale, color
    )


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


def lay_over(picture: Float[np.ndarray, "h w 3"], drawn: list[Instant]) -> None:
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
    mean = cv2.GaussianBlur(total / len(drawn), (3, 3), 0.55)
    region = picture[top:bottom, left:right]
    region *= 1 - mean[..., 3:]
    region += mean[..., :3]


def _union(drawn: list[Instant], shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    bodies = [(i.surface.left, i.surface.top, *i.surface.solid.shape[::-1]) for i in drawn]
    rackets = [i.racket for i in drawn if i.racket]
    boxes = np.array(bodies + [(r.left, r.top, *r.depth.shape[::-1]) for r in rackets])
    left, top = boxes[:, :2].min(axis=0).tolist()
    right, bottom = (boxes[:, :2] + boxes[:, 2:]).max(axis=0).tolist()
    return max(left - 2, 0), max(top - 2, 0), min(right + 2, shape[1]), min(bottom + 2, shape[0])
