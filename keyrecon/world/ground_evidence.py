"""Residuals of a camera over level ground, without a court.

A camera over level ground has four numbers: focal length, tilt, roll and height (it stands over the
origin and looks along y). Each kind of evidence is a function from such a camera to residuals in
standard deviations:

- Things that stand upright run towards the vertical vanishing point.
- The horizon is where lines of sight are level.
- A length on the ground, or an upright thing that stands on it, has the length that was given.
- The player is as tall wherever he stands: the distance at which his foot meets the ground is the
  one at which he is as small as he is. His size is taken from the lifted motion, so that he need
  not stand straight, and moves in depth as he walks about (Lv, Zhao and Nevatia, "Self-calibration
  of a camera from video of a walking human", ICPR 2002, use the vanishing points of head and feet).
- While a foot stands, his centre of mass is over his feet on average.

Pixels are those of one reference picture; a camera that turns and zooms has its frames there by the
homographies of its path. Only the player's size is read in the pictures of the frames themselves.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from keyrecon.numerics.geometry import unit_vectors
from keyrecon.world.pinhole import Pinhole, carried_focal
from keyrecon.world.placement import ANKLE_SHARE
from keyrecon.world.records import Kind

PLUMB = np.radians(0.5)
"""By which posts, corners of buildings and door frames are off the vertical (our estimate)."""
LEVEL = np.radians(0.3)
"""By which what is seen as the horizon is off it: hills and trees stand above it (our estimate)."""
LEAN = np.radians(4.0)
"""By which the line from the feet to the centre of mass leans in the picture in one moment: 7 cm
to a side of 1 m."""
LEANING = np.radians(1.5)
"""The same for all moments alike, which a player does who stands on one leg more."""
OUTLIERS = 2.0
"""Standard deviations from which on a moment of the player counts less (Cauchy)."""
NEAREST, FARTHEST = 0.2, 500.0
"""Metres within which a line of sight is taken to meet the ground."""


@dataclass(frozen=True, eq=False)
class MarkedEnds:
    """Marks in the reference picture."""

    kinds: tuple[Kind, ...]
    ends: Float[np.ndarray, "n 2 2"]
    metres: Float[np.ndarray, "n"]
    """NaN where not known."""

    @cached_property
    def upright(self) -> Int[np.ndarray, "m"]:
        """Numbers of the upright things."""
        return np.array([k for k, kind in enumerate(self.kinds) if kind == "vertical"], np.int64)


@dataclass(frozen=True, eq=False)
class Stances:
    """Moments in which a foot of the player stands, in the reference picture; his size in that of
    the frame."""

    frame: Int[np.ndarray, "N"]
    foot: Float[np.ndarray, "N 2"]
    """The standing ankle, px."""
    sights: Float[np.ndarray, "N 2 2"]
    """The same foot, and the middle of the hips, in the picture of their own frame."""
    from_reference: Float[np.ndarray, "N 3 3"]
    """Homographies from the reference picture into those of the frames."""
    behind: Float[np.ndarray, "N"]
    """Depth of the middle of the hips beyond that ankle, units of the motion."""
    scale: Float[np.ndarray, "N"]
    """px of its own frame per unit of the motion at the middle of the hips."""
    feet: Float[np.ndarray, "N 2"]
    """Between the ankles, px."""
    up: Float[np.ndarray, "N 2"]
    """From there to the centre of mass, px."""
    stature: float
    """In units of the motion."""
    given_height: float
    """The player's height that scales a motion in metres (`placement.given_height`)."""


@dataclass(frozen=True)
class GroundState:
    """A camera over the ground, and the player before it."""

    log_focal: float
    """px"""
    tilt: float
    """Radians that the camera looks down."""
    roll: float
    """Radians that it is turned clockwise about its axis, as its holder sees it."""
    log_height: float
    """Metres."""
    log_size: float
    """Metres per unit of the motion."""
    lean: float
    """Radians by which the player leans in all moments, clockwise in the picture."""

    def pinhole(self, principal: Float[np.ndarray, "2"]) -> Pinhole:
        """The camera: over the origin, its axis over y."""
        tilt, roll = self.tilt, self.roll
        level = np.array(
            [[1.0, 0, 0], [0, -np.sin(tilt), -np.cos(tilt)], [0, np.cos(tilt), -np.sin(tilt)]]
        )
        c, s = np.cos(roll), np.sin(roll)
        turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
        centre = np.array([0.0, 0.0, np.exp(self.log_height)])
        return Pinhole(float(np.exp(self.log_focal)), principal, turn @ level, centre)


def sight(camera: Pinhole, pixels: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 3"]:
    """Unit lines of sight in the world."""
    ray = np.column_stack([(pixels - camera.principal) / camera.focal, np.ones(len(pixels))])
    return (ray / np.linalg.norm(ray, axis=1, keepdims=True)) @ camera.rotation


def on_plane(
    camera: Pinhole, pixels: Float[np.ndarray, "n 2"], height: float = 0.0
) -> Float[np.ndarray, "n 3"]:
    """Where lines of sight meet a level plane, no farther than `FARTHEST`."""
    ray = sight(camera, pixels)
    drop = max(camera.centre[2] - height, 1e-3)
    along = drop / np.maximum(-ray[:, 2], drop / FARTHEST)
    return camera.centre + np.maximum(along, NEAREST)[:, None] * ray


def upward(camera: Pinhole, pixels: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
    """Unit directions in which upright things go up in the picture."""
    up = camera.rotation[:, 2]
    way = up[:2] - (pixels - camera.principal) / camera.focal * up[2]
    return way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)


def mark_residuals(camera: Pinhole, marks: MarkedEnds, click: float) -> Float[np.ndarray, "n 2"]:
    """Of all marks, in standard deviations; `click` is the noise of a click, px.

    The horizon has both numbers, for its two points; an upright thing leans, and where its length
    is known it is too long; a length is too long.
    """
    found = np.zeros((len(marks.kinds), 2))
    for number, kind in enumerate(marks.kinds):
        if kind == "horizon":
            found[number] = _off_horizon(camera, marks.ends[number], click)
        elif kind == "length":
            found[number, 1] = _too_long(camera, marks.ends[number], marks.metres[number], click)
        elif np.isfinite(marks.metres[number]):
            found[number, 1] = _too_tall(camera, marks.ends[number], marks.metres[number], click)
    upright = marks.upright
    found[upright, 0] = _leaning(camera, marks.ends[upright], click)
    return found


def _leaning(
    camera: Pinhole, ends: Float[np.ndarray, "n 2 2"], click: float
) -> Float[np.ndarray, "n"]:
    """How far ends lie beside the upright line through their middle."""
    way, up = ends[:, 1] - ends[:, 0], upward(camera, ends.mean(axis=1))
    spread = np.hypot(np.sqrt(2) * click, PLUMB * np.linalg.norm(way, axis=1))
    return (up[:, 0] * way[:, 1] - up[:, 1] * way[:, 0]) / spread


def _too_tall(
    camera: Pinhole, ends: Float[np.ndarray, "2 2"], metres: float, click: float
) -> float:
    """How far the top lies from where its length puts it; the lower end stands on the ground."""
    foot, top = sorted(ends, key=lambda end: -end[1])
    there = on_plane(camera, foot[None])[0] + [0, 0, metres]
    at = camera.project(there[None])[0]
    up = upward(camera, foot[None])[0]
    return float(np.nan_to_num((at - top) @ up / (np.sqrt(2) * click), nan=1e3))


def _too_long(
    camera: Pinhole, ends: Float[np.ndarray, "2 2"], metres: float, click: float
) -> float:
    """How far the length on the ground is off, by how much clicks may change it."""
    steps = click * np.concatenate([np.zeros((1, 2, 2)), np.eye(4).reshape(4, 2, 2)])
    places = on_plane(camera, (ends + steps).reshape(-1, 2)).reshape(-1, 2, 3)
    lengths = np.log(np.maximum(np.linalg.norm(places[:, 1] - places[:, 0], axis=1), 1e-3))
    spread = max(float(np.linalg.norm(lengths[1:] - lengths[0])), 1e-3)
    return float((lengths[0] - np.log(metres)) / spread)


def _off_horizon(
    camera: Pinhole, ends: Float[np.ndarray, "2 2"], click: float
) -> Float[np.ndarray, "2"]:
    """How far both points lie from the horizon."""
    up = camera.rotation[:, 2]
    ray = np.column_stack([(ends - camera.principal) / camera.focal, np.ones(2)])
    away = camera.focal * (ray @ up) / max(float(np.linalg.norm(up[:2])), 1e-6)
    return away / np.hypot(click, LEVEL * camera.focal)


def size_residuals(camera: Pinhole, stances: Stances, log_size: float) -> Float[np.ndarray, "N"]:
    """Distance of the player by his foot on the ground over that by his size, logarithm.

    His size is that of a body as deep in the picture as his hips, which were lifted about the line
    of sight to them: along it the foot lies nearer by the angle between both, and deeper by
    `behind`; depth is that distance times the cosine of its angle to the camera's axis. Focal
    length and axis are those of his own frame.
    """
    size = np.exp(log_size)
    place = on_plane(camera, stances.foot, ANKLE_SHARE * size * stances.stature)
    focal = carried_focal(camera, stances.from_reference)
    aside = (stances.sights - camera.principal) / focal[:, None, None]
    to_foot, to_hips = unit_vectors(np.insert(aside, 2, 1.0, axis=2)).swapaxes(0, 1)
    along = np.linalg.norm(place - camera.centre, axis=1) * (to_foot * to_hips).sum(axis=1)
    far = (along + size * stances.behind) * to_hips[:, 2]
    by_size = focal * size / stances.scale
    return np.log(np.maximum(far, NEAREST) / by_size)


def lean_residuals(camera: Pinhole, stances: Stances, lean: float) -> Float[np.ndarray, "N"]:
    """Angles in the picture between the player and the vertical, radians."""
    up, way = upward(camera, stances.feet), stances.up
    cross = up[:, 0] * way[:, 1] - up[:, 1] * way[:, 0]
    return np.arctan2(cross, (up * way).sum(axis=1)) - lean


def cauchy_residuals(residuals: Float[np.ndarray, "N"]) -> Float[np.ndarray, "N"]:
    """Residuals whose squares are Cauchy's loss."""
    return OUTLIERS * np.sign(residuals) * np.sqrt(np.log1p((residuals / OUTLIERS) ** 2))
