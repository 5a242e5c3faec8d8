"""What stands about on a court: benches, boxes, bags, an umpire's chair, people, balls.

Some of it wears the player's own colours, so that colour alone does not tell where the player
is. Everything is drawn once into the background, and only where it lies behind the player.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.body import LSP14
from keyrecon.synthetic.figure import build_solids, point_figure
from keyrecon.synthetic.looks import Look, Rgb, choose_look
from keyrecon.synthetic.raster import Solids, draw_solids
from keyrecon.synthetic.shading import Light, Tiles, make_tiles, paint_surface


@dataclass(frozen=True, eq=False)
class PropView:
    """Camera and picture that props are drawn into."""

    center: Float[np.ndarray, "3"]
    rotation: Float[np.ndarray, "3 3"]
    focal: float
    principal: Float[np.ndarray, "2"]
    beyond: float
    """Metres from the camera within which nothing may stand."""

    def project(self, world: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 2"]:
        """Pixels of world points in front of the camera."""
        local = (world - self.center) @ self.rotation.T
        return local[:, :2] / local[:, 2:] * self.focal + self.principal

    def depth(self, world: Float[np.ndarray, "3"]) -> float:
        """Distance along the view, metres."""
        return float((world - self.center) @ self.rotation[2])


@dataclass(frozen=True)
class Box:
    """A box on the floor or above it."""

    place: tuple[float, float, float]
    """Middle of its underside, metres."""
    size: tuple[float, float, float]
    color: Rgb


@dataclass(frozen=True)
class Person:
    """A bystander."""

    x: float
    z: float
    turn: float
    """From facing the net to the right, radians."""
    seated: bool
    number: int
    """Decides the clothes."""


def add_props(
    picture: UInt8[np.ndarray, "h w 3"],
    view: PropView,
    look: Look,
    seed: int,
    wanted: Callable[[float], bool],
) -> None:
    """Draw a seed's furniture, people and balls whose z is wanted, farthest first."""
    rng = np.random.default_rng([seed, 31])
    things: list[tuple[float, Box | Person]] = []
    for box in _choose_boxes(rng, look):
        things.append((view.depth(np.array(box.place)), box))
    for person in _choose_people(rng):
        things.append((view.depth(np.array([person.x, 0, person.z])), person))
    tiles = make_tiles(rng)
    for depth, thing in sorted(things, key=lambda t: -t[0]):
        z = thing.place[2] if isinstance(thing, Box) else thing.z
        if depth < view.beyond or not wanted(z):
            continue
        if isinstance(thing, Box):
            _draw_box(picture, view, thing, look)
        else:
            _draw_person(picture, view, thing, look, tiles)
    _draw_balls(picture, view, rng, wanted)


def _choose_boxes(rng: np.random.Generator, look: Look) -> list[Box]:
    boxes = []
    colors = [look.shirt, look.shorts, look.skin, (214, 204, 60), (235, 235, 235), look.court.board]
    for side in (-1, 1):
        for _ in range(int(rng.integers(1, 3))):
            z = float(rng.uniform(-14, 5))
            boxes.append(Box((side * 8.9, 0.38, z), (0.45, 0.07, 1.5), (170, 150, 120)))
            boxes.append(Box((side * 8.9, 0.0, z - 0.6), (0.4, 0.38, 0.08), (90, 90, 90)))
            boxes.append(Box((side * 8.9, 0.0, z + 0.6), (0.4, 0.38, 0.08), (90, 90, 90)))
            bag = colors[rng.integers(len(colors))]
            boxes.append(Box((side * 8.9, 0.45, z + 0.3), (0.35, 0.3, 0.5), bag))
    for _ in range(int(rng.integers(3, 8))):
        x, z = rng.uniform(3, 9) * rng.choice([-1, 1]), rng.uniform(-27, 6)
        w, h, d = rng.uniform(0.3, 0.7), rng.uniform(0.3, 0.9), rng.uniform(0.3, 0.7)
        boxes.append(Box((float(x), 0.0, float(z)), (w, h, d), colors[rng.integers(len(colors))]))
    for x, z in ((-6.75, -11.5), (-7.15, -11.5), (-6.75, -12.1), (-7.15, -12.1)):
        boxes.append(Box((x, 0.0, z), (0.05, 1.6, 0.05), (60, 70, 66)))
    boxes.append(Box((-6.95, 1.6, -11.8), (0.55, 0.08, 0.75), (60, 80, 70)))
    boxes.append(Box((-7.2, 1.68, -11.8), (0.06, 0.6, 0.7), (60, 80, 70)))
    return boxes


def _draw_box(picture: np.ndarray, view: PropView, box: Box, look: Look) -> None:
    """The faces that look at the camera, lit by their direction, and a shadow."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (0, 1) for z in (-1, 1)], float)
    world = np.array(box.place) + corners * np.array(box.size) * [0.5, 1, 0.5]
    if min(view.depth(c) for c in world) < 0.5:
        return
    sun = np.array(look.sun)
    fallen = world - world[:, 1:2] / sun[1] * sun
    _darken(picture, view.project(fallen), 1 - 0.45 * look.sunshine)
    for axis in range(3):
        for sign in (-1.0, 1.0):
            face = world[corners[:, axis] == (max(sign, 0) if axis == 1 else sign)]
            normal = np.eye(3)[axis] * sign
            if normal @ (face.mean(axis=0) - view.center) >= 0:
                continue
            facing = normal @ sun * look.sunshine
            light = 0.62 + 0.12 * normal[1] + 0.35 * max(facing, 0)
            hull = cv2.convexHull(np.round(view.project(face) * 16).astype(np.int32))
            color = np.clip(np.array(box.color) * light, 0, 255)
            cv2.fillConvexPoly(picture, hull, color.tolist(), cv2.LINE_AA, 4)


def _darken(picture: np.ndarray, outline: Float[np.ndarray, "n 2"], factor: float) -> None:
    """Darken the hull of some points, with a soft rim."""
    lo = np.maximum(np.floor(outline.min(axis=0)) - 4, 0).astype(int)
    hi = np.minimum(np.ceil(outline.max(axis=0)) + 5, picture.shape[1::-1]).astype(int)
    if (hi <= lo).any():
        return
    mask = np.zeros((hi[1] - lo[1], hi[0] - lo[0]), np.uint8)
    hull = cv2.convexHull(np.round((outline - lo) * 16).astype(np.int32))
    cv2.fillConvexPoly(mask, hull, 255, cv2.LINE_AA, 4)
    soft = cv2.GaussianBlur(mask, (0, 0), 1.5).astype(np.float32)[..., None] / 255
    region = picture[lo[1] : hi[1], lo[0] : hi[0]]
    region[:] = (region * (1 - soft * (1 - factor))).astype(np.uint8)


def _choose_people(rng: np.random.Generator) -> list[Person]:
    """Place, turn and posture of people along the walls, and one that stands nearer."""
    people = []
    for _ in range(int(rng.integers(3, 9))):
        wall = rng.integers(4)
        along = rng.uniform(0, 1)
        x, z = [(-9.4, 5 - 33 * along), (9.4, 5 - 33 * along), (18 * along - 9, -29.0),
                (18 * along - 9, 6.3)][wall]  # fmt: skip
        turn = [np.pi / 2, -np.pi / 2, np.pi, 0.0][wall]
        seated = bool(rng.random() < 0.4)
        people.append(Person(x, z, turn + rng.normal(0, 0.5), seated, int(rng.integers(1000))))
    x, z = float(rng.choice([-1, 1]) * rng.uniform(6.5, 8.5)), float(rng.uniform(-13, 5))
    people.append(Person(x, z, -np.sign(x) * np.pi / 2, False, int(rng.integers(1000))))
    return people


_STANDING = {  # right, up, forward in statures; the left side mirrors the right one
    "ankle": (0.06, 0.05, 0.0), "knee": (0.06, 0.29, 0.02), "hip": (0.055, 0.53, 0.0),
    "wrist": (0.15, 0.5, 0.06), "elbow": (0.16, 0.64, -0.02), "shoulder": (0.125, 0.82, 0.0),
    "neck": (0.0, 0.83, 0.0), "head_top": (0.0, 1.0, 0.02),
}  # fmt: skip
_SEATED = {
    **_STANDING, "knee": (0.07, 0.28, 0.06), "hip": (0.055, 0.29, -0.18),
    "wrist": (0.06, 0.36, 0.02), "elbow": (0.15, 0.40, -0.14), "shoulder": (0.125, 0.58, -0.18),
    "neck": (0.0, 0.59, -0.18), "head_top": (0.0, 0.76, -0.14),
}  # fmt: skip


def _stand(person: Person) -> Float[np.ndarray, "14 3"]:
    """Joints of a bystander in the world."""
    posture = _SEATED if person.seated else _STANDING
    rows = []
    for name in LSP14.names:
        side = -1.0 if name.startswith("left_") else 1.0
        r, u, f = posture[name.removeprefix("left_").removeprefix("right_")]
        rows.append((side * r, u, f))
    r, u, f = 1.74 * np.array(rows).T
    c, s = np.cos(person.turn), np.sin(person.turn)
    return np.stack([person.x + c * r + s * f, u, person.z + s * r - c * f], axis=1)


def _draw_person(
    picture: np.ndarray, view: PropView, person: Person, look: Look, tiles: Tiles
) -> None:
    """A clothed bystander; one in three wears the player's shirt."""
    points = np.repeat(_stand(person)[None], 3, axis=0)
    if min(view.depth(p) for p in points[0]) < 1:
        return
    clothes = choose_look(person.number)
    if person.number % 3 == 0:
        clothes = replace(clothes, shirt=look.shirt, sleeve=look.shirt)
    build = replace(clothes.build, skirt=clothes.build.skirt and not person.seated)
    figure = build_solids(points, point_figure(points, 50.0), build)
    solids = Solids(
        (figure.start[0] - view.center) @ view.rotation.T,
        (figure.end[0] - view.center) @ view.rotation.T,
        figure.side[0] @ view.rotation.T, figure.radii, figure.squeeze, figure.open_end,
    )  # fmt: skip
    surface = draw_solids(solids, view.focal, view.principal, picture.shape[1::-1])
    if surface is None or not (surface.solid >= 0).any():
        return
    floor = (points[0, [0, 5]] * [1, 0, 1]).repeat(4, axis=0)
    _darken(picture, view.project(floor + 0.16 * np.array(
        [(1, 0, 0), (-1, 0, 0), (0, 0, 1), (0, 0, -1)] * 2)), 0.6)  # fmt: skip
    light = Light(
        view.rotation @ np.array(look.sun), view.rotation[:, 1], look.sun_color, look.sunshine,
        look.court.outside,
    )  # fmt: skip
    color = paint_surface(surface, figure.part, clothes.part_colors[figure.part], light, tiles)
    height, width = surface.solid.shape
    region = picture[surface.top : surface.top + height, surface.left : surface.left + width]
    hit = surface.solid >= 0
    region[hit] = color[hit].astype(np.uint8)


_BALL = ((0.7, 1.0, (40, 50, 40)), (0.0, 1.0, (196, 208, 66)), (-0.3, 0.6, (222, 232, 110)))
"""Shadow, ball and its lit side: offset and size in radii, colour."""


def _draw_balls(
    picture: np.ndarray, view: PropView, rng: np.random.Generator, wanted: Callable[[float], bool]
) -> None:
    """Tennis balls on the floor."""
    for _ in range(int(rng.integers(2, 9))):
        ball = np.array([rng.uniform(-8, 8), 0.033, rng.uniform(-22, 5)])
        if view.depth(ball) < 1 or not wanted(ball[2]):
            continue
        x, y = view.project(ball[None])[0]
        radius = 0.033 * view.focal / view.depth(ball)
        for dy, factor, color in _BALL:
            centre = (round(16 * x), round(16 * (y + dy * radius)))
            cv2.circle(picture, centre, round(16 * radius * factor), color, -1, cv2.LINE_AA, 4)
