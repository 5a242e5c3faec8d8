"""The surroundings of the player, drawn once per sequence by casting a ray per pixel.

A tennis court of regulation size (ITF Rules of Tennis, rule 1: 23.77 m by 10.97 m, net 0.914 m at
the middle; here to the middles of its lines, where the rule has their outer edges) inside four
walls with boards, trees and sky above them. The near baseline lies at z = 0 and the net at negative
z. The result is a picture on the plane of a reference view, from which every frame of a turning
camera is looked up by a homography.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.synthetic.cameras import CameraMove
from keyrecon.synthetic.looks import Court, Look
from keyrecon.synthetic.props import PropView, add_props
from keyrecon.synthetic.shading import make_noise

NET_Z = -11.885
LENGTH = 23.77
HALF_SINGLES, HALF_DOUBLES, SERVICE = 4.115, 5.485, 6.40
WALLS = (-10.0, 10.0, -30.0, 7.0)
"""Left, right, far and near wall, metres."""
WALL_HEIGHT = 2.6
SHARPNESS = 1.2
"""Resolution of the background relative to the frames, so that looking it up keeps it sharp."""
MOST_PIXELS = 8e6


@dataclass(frozen=True, eq=False)
class CourtPicture:
    """A picture on the plane of a reference view."""

    picture: UInt8[np.ndarray, "h w 3"]
    rotation: Float[np.ndarray, "3 3"]
    focal: float
    corner: Float[np.ndarray, "2"]
    """Plane coordinates of pixel (0, 0)."""

    def lookup(self, move: CameraMove, frame: int) -> Float[np.ndarray, "3 3"]:
        """Homography from a frame's pixels to the picture's."""
        shift = np.array([[1, 0, -self.corner[0]], [0, 1, -self.corner[1]], [0, 0, 1.0]])
        return shift @ move.to_plane(frame, self.rotation, self.focal)


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays of a picture: one origin, a direction per pixel whose length is one plane distance."""

    origin: Float[np.ndarray, "3"]
    direction: Float[np.ndarray, "3 h w"]

    def meet(self, axis: int, at: float | Float[np.ndarray, "h w"]) -> Float[np.ndarray, "h w"]:
        """Ray parameter at a plane square to an axis; infinite where it is behind."""
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (at - np.float32(self.origin[axis])) / self.direction[axis]
        return np.where(t > 0, t, np.float32(np.inf))

    def at(self, t: Float[np.ndarray, "h w"], axis: int) -> Float[np.ndarray, "h w"]:
        """One coordinate of the points at ray parameter t."""
        return np.float32(self.origin[axis]) + np.where(np.isfinite(t), t, 0) * self.direction[axis]


def draw_background(move: CameraMove, look: Look, seed: int, beyond: float) -> CourtPicture:
    """Surroundings as seen in all frames of a camera move; things stand `beyond` metres away."""
    rays, rotation, focal, lo = cast_rays(move)
    painted, surface_t = _paint(rays, look, np.random.default_rng([seed, 23]))
    picture = np.clip(painted, 0, 255).astype(np.uint8)
    view = PropView(move.center, rotation, focal, -lo, beyond)
    behind = move.center[2] < NET_Z  # the camera looks through the net from the far side
    add_props(picture, view, look, seed, lambda z: (z > NET_Z) == behind)
    _add_net(picture, rays, surface_t, look.court)
    add_props(picture, view, look, seed, lambda z: (z > NET_Z) != behind)
    return CourtPicture(picture, rotation, focal, lo)


def on_court(
    points: Float[np.ndarray, "*n 3"], centre: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "*n 3"]:
    """Points in the axes of `keyrecon.world.court`, whose near half is that of a camera's centre:
    metres, origin at the middle of the net, y away from the camera, z up."""
    x, y, z = np.moveaxis(points, -1, 0)
    side = -1.0 if centre[2] < NET_Z else 1.0
    return np.stack([side * x, side * (NET_Z - z), y], axis=-1)


def cast_rays(move: CameraMove) -> tuple[Rays, np.ndarray, float, Float[np.ndarray, "2"]]:
    """Rays of the picture that holds all frames; its rotation, focal length and corner."""
    rotation = move.rotation[len(move.rotation) // 2]
    focal = float(move.focal.max()) * SHARPNESS
    lo, hi = _extent(move, rotation, focal)
    shrink = min(1.0, float(np.sqrt(MOST_PIXELS / np.prod(hi - lo))))
    focal, lo, hi = focal * shrink, np.floor(lo * shrink), np.ceil(hi * shrink)
    return _cast(move.center, rotation, focal, (lo, hi)), rotation, focal, lo


def _extent(
    move: CameraMove, rotation: Float[np.ndarray, "3 3"], focal: float
) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the smallest part of the plane that holds all frames."""
    width, height = move.size
    corners = np.array([(x, y, 1) for x in (-3, width + 2) for y in (-3, height + 2)])
    planes = np.stack([move.to_plane(t, rotation, focal) for t in range(len(move.rotation))])
    moved = corners @ planes.transpose(0, 2, 1)
    moved = (moved[..., :2] / moved[..., 2:]).reshape(-1, 2)
    return moved.min(axis=0), moved.max(axis=0)


def _cast(
    origin: Float[np.ndarray, "3"],
    rotation: Float[np.ndarray, "3 3"],
    focal: float,
    window: tuple[np.ndarray, np.ndarray],
) -> Rays:
    lo, hi = window
    x = (np.arange(lo[0], hi[0] + 1) / focal).astype(np.float32)
    y = (np.arange(lo[1], hi[1] + 1) / focal).astype(np.float32)
    back = rotation.T.astype(np.float32)
    direction = back[:, 0, None, None] * x + back[:, 1, None, None] * y[:, None]
    direction += back[:, 2, None, None]
    return Rays(origin, direction)


def _paint(
    rays: Rays, look: Look, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "h w 3"], Float[np.ndarray, "h w"]]:
    """Floor, walls, trees, crowd and sky; and the ray parameter at which they are met."""
    court = look.court
    floor_t = rays.meet(1, 0.0)
    side = np.where(rays.direction[0] > 0, np.float32(WALLS[1]), np.float32(WALLS[0]))
    end = np.where(rays.direction[2] > 0, np.float32(WALLS[3]), np.float32(WALLS[2]))
    side_t, end_t = rays.meet(0, side), rays.meet(2, end)
    wall_t = np.minimum(side_t, end_t)
    on_floor = floor_t < wall_t
    noise = make_noise(rng, 1024, (1.0, 5.0, 24.0))
    broad = make_noise(rng, 1024, (12.0, 40.0, 90.0))
    x, z = rays.at(floor_t, 0), rays.at(floor_t, 2)
    picture = _paint_floor(x, z, court, (noise, broad))
    along = np.where(side_t < end_t, rays.at(side_t, 2), rays.at(end_t, 0) + 40)
    wall = _paint_wall(along, rays.at(wall_t, 1), court, (noise, broad))
    picture = np.where(on_floor[..., None], picture, wall)
    return picture, np.minimum(floor_t, wall_t)


def sample(tile: np.ndarray, u: np.ndarray, v: np.ndarray, texel: float) -> np.ndarray:
    """Nearest texels of a periodic tile, `texel` metres each."""
    mask = len(tile) - 1
    return tile[(u / texel).astype(np.int32) & mask, (v / texel).astype(np.int32) & mask]


def _paint_floor(
    x: Float[np.ndarray, "h w"], z: Float[np.ndarray, "h w"], court: Court, tiles: tuple
) -> Float[np.ndarray, "h w 3"]:
    """Playing surface with grain, wear and lines."""
    x, z = np.clip(x, -200, 200), np.clip(z, -200, 200)
    grain, broad = tiles
    spread = {"clay": (0.05, 0.07), "grass": (0.09, 0.08)}.get(court.surface, (0.035, 0.03))
    light = 1 + spread[0] * sample(grain, x, z, 0.012) + spread[1] * sample(broad, x, z, 0.02)
    if court.surface == "grass":
        light *= 1 + 0.05 * np.sign(np.sin(x * np.pi / 1.8))
    far = z > NET_Z - LENGTH / 2 - 0.05
    inside = far & (z < 0.05) & (np.abs(x) < HALF_DOUBLES + 0.05)
    floor, ground = np.array((court.inside, court.outside), np.float32)
    color = np.where(inside[..., None], floor, ground)
    cover = _lines(x, z) * (0.9 + 0.06 * sample(broad, z, x, 0.015))
    color = color + cover[..., None] * (np.array(court.line, np.float32) - color)
    return (color * light[..., None]).astype(np.float32)


def _lines(x: Float[np.ndarray, "h w"], z: Float[np.ndarray, "h w"]) -> Float[np.ndarray, "h w"]:
    """Share of each pixel that court lines cover, from the pixel's footprint on the floor."""
    foot_x = np.abs(np.gradient(x, axis=0)) + np.abs(np.gradient(x, axis=1)) + 1e-4
    foot_z = np.abs(np.gradient(z, axis=0)) + np.abs(np.gradient(z, axis=1)) + 1e-4

    def stripe(value: np.ndarray, foot: np.ndarray, at: float, width: float) -> np.ndarray:
        inside = (width / 2 - np.abs(value - at)) / foot + 0.5
        return np.clip(inside, 0, np.minimum(1, width / foot))

    def span(value: np.ndarray, foot: np.ndarray, lo: float, hi: float) -> np.ndarray:
        return stripe(value, foot, (lo + hi) / 2, hi - lo)

    court = (2 * NET_Z, 0.0)
    cover = np.zeros_like(x)
    for line in (-HALF_DOUBLES, -HALF_SINGLES, HALF_SINGLES, HALF_DOUBLES):
        cover = np.maximum(cover, stripe(x, foot_x, line, 0.05) * span(z, foot_z, *court))
    for line in court:
        width = span(x, foot_x, -HALF_DOUBLES, HALF_DOUBLES)
        cover = np.maximum(cover, stripe(z, foot_z, line, 0.1) * width)
    for line in (NET_Z - SERVICE, NET_Z + SERVICE):
        width = span(x, foot_x, -HALF_SINGLES, HALF_SINGLES)
        cover = np.maximum(cover, stripe(z, foot_z, line, 0.05) * width)
    middle = span(z, foot_z, NET_Z - SERVICE, NET_Z + SERVICE)
    cover = np.maximum(cover, stripe(x, foot_x, 0.0, 0.05) * middle)
    return np.maximum(cover, stripe(x, foot_x, 0.0, 0.05) * span(z, foot_z, -0.15, 0.0))


def _paint_wall(
    along: Float[np.ndarray, "h w"], height: Float[np.ndarray, "h w"], court: Court, tiles: tuple
) -> Float[np.ndarray, "h w 3"]:
    """Wind screen with posts and boards, trees above it, sky above them."""
    along, height = np.clip(along, -200, 200), np.clip(height, -50, 400)
    grain, broad = tiles
    weave = 1 + 0.05 * sample(grain, along, height, 0.015)
    weave += 0.06 * sample(broad, along, height, 0.03)
    screen = np.array(court.wall, np.float32) * weave[..., None]
    post = (np.abs((along + 1.1) % 3.0 - 1.5) < 0.035) | (np.abs(height - WALL_HEIGHT) < 0.04)
    screen[post] *= 0.55
    place = np.floor(along / 6.0)
    board = (np.abs(along % 6.0 - 2.4) < 1.3) & (np.abs(height - 0.75) < 0.42) & (place % 2 == 0)
    letters = board & (np.abs(height - 0.75) < 0.2) & (sample(broad, along, place, 0.006) > 0.1)
    screen[board] = np.array(court.board, np.float32) * weave[board][:, None]
    screen[letters] = np.array(court.line, np.float32) * weave[letters][:, None]
    crown = 4.6 + 1.3 * sample(broad, along, 0 * along, 0.05)
    crown += 0.25 * sample(grain, along, height, 0.02)
    leaves = 1 + 0.2 * sample(grain, along, height, 0.03)
    leaves += 0.25 * sample(broad, along, height, 0.02)
    trees = np.array(court.trees, np.float32) * np.clip(leaves, 0.25, 2)[..., None]
    haze = np.clip((height - 3) / 40, 0, 1)[..., None]
    sky = np.array(court.sky, np.float32) * (1 - 0.25 * haze)
    foot = np.abs(np.gradient(height, axis=0)) + 1e-3
    cover = np.clip((crown - height) / foot + 0.5, 0, 1)[..., None]
    above = sky + cover * (trees - sky)
    if court.crowd:
        above = _seat_crowd(above, along, height)
    return np.where((height < WALL_HEIGHT)[..., None], screen, above).astype(np.float32)


SEAT, ROW = 0.56, 0.62
"""Metres between two spectators and between two rows of a stand."""


def _seat_crowd(
    picture: Float[np.ndarray, "h w 3"],
    along: Float[np.ndarray, "h w"],
    height: Float[np.ndarray, "h w"],
) -> Float[np.ndarray, "h w 3"]:
    """Rows of people in all colours above the wall."""
    up = (height - WALL_HEIGHT - 0.15) / ROW
    row = np.floor(up)
    shifted = along / SEAT + 0.5 * row
    seat = np.floor(shifted)
    number = np.abs(np.sin(seat * 12.9898 + row * 78.233) * 43758.5453) % 1.0
    x, y = (shifted - seat - 0.5) * SEAT, (up - row) * ROW
    clothes = np.stack([(number * k) % 1.0 for k in (7.0, 13.0, 29.0)], axis=-1) * 190 + 45
    skin = np.array((205, 155, 122), np.float32) * (0.45 + 0.6 * ((number * 41) % 1.0))[..., None]
    taken = (number > 0.22) & (row >= 0) & (row < 5)
    body = taken & (np.abs(x) < 0.2) & (y < 0.36)
    head = taken & (x**2 + (y - 0.45) ** 2 < 0.0121)
    stand = np.array((74, 78, 84), np.float32)
    picture = np.where(((row >= 0) & (row < 5))[..., None], stand, picture)
    picture = np.where(body[..., None], clothes, picture)
    return np.where(head[..., None], skin, picture)


def _add_net(
    picture: UInt8[np.ndarray, "h w 3"],
    rays: Rays,
    surface_t: Float[np.ndarray, "h w"],
    court: Court,
) -> None:
    """Hang the net, through which the far court is seen."""
    t = rays.meet(2, NET_Z)
    x, y = rays.at(t, 0), rays.at(t, 1)
    top = 0.914 + 0.156 * np.abs(x) / 6.4
    shown = (t < surface_t) & (np.abs(x) < 6.4) & (y > 0) & (y < top)
    band = shown & (y > top - 0.06)
    post = (t < surface_t) & (np.abs(np.abs(x) - 6.4) < 0.05) & (y > 0) & (y < 1.07)
    mesh = 0.5 + 0.15 * np.sign(np.sin(x * np.pi / 0.045)) * np.sign(np.sin(y * np.pi / 0.045))
    picture[shown] = (picture[shown] * (1 - mesh[shown][:, None]) + 14).astype(np.uint8)
    picture[band] = np.round(court.line)
    picture[post] = (40, 60, 50)
