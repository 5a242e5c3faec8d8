"""Where the camera stands and how it moves: it turns and zooms, but stays in its place.

A camera that only turns sees a background whose pictures are related by homographies, so the
whole background can be drawn once, on the plane of a reference view, and be looked up exactly
for every frame. A panning camera follows the player as an operator does: late, smoothly, with a
little unrest of the hands.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter, lfilter_zi

from keyrecon.numerics.geometry import look_at, project_perspective
from keyrecon.ranges import within


class View(StrEnum):
    """Side from which the player is filmed; the player faces the net."""

    FRONT = "front"
    BACK = "back"
    SIDE = "side"
    ABOVE = "above"
    OBLIQUE = "oblique"
    FACE_ON = "face-on"
    DOWN_THE_LINE = "down-the-line"


_PLACES = {  # azimuth from behind the player in degrees, height and distance in metres, spreads
    View.FRONT: ((180.0, 14.0), (1.9, 0.6), (9.0, 0.8)),
    View.BACK: ((0.0, 12.0), (2.6, 1.0), (11.0, 1.5)),
    View.SIDE: ((88.0, 10.0), (1.7, 0.4), (11.0, 1.5)),
    View.ABOVE: ((20.0, 25.0), (7.5, 1.0), (9.0, 1.0)),
    View.OBLIQUE: ((38.0, 10.0), (2.4, 0.7), (11.0, 1.5)),
    View.FACE_ON: ((180.0, 5.0), (1.15, 0.15), (4.8, 0.5)),
    View.DOWN_THE_LINE: ((88.0, 4.0), (1.15, 0.15), (4.8, 0.5)),
}

UP = np.array([0.0, 1.0, 0.0])
EDGE = 0.06
"""Share of the picture that a static camera keeps free around the player."""


@dataclass(frozen=True, eq=False)
class CameraMove:
    """A pinhole camera that turns and zooms in one place."""

    center: Float[np.ndarray, "3"]
    """World, metres."""
    rotation: Float[np.ndarray, "T 3 3"]
    """World to camera axes."""
    focal: Float[np.ndarray, "T"]
    """px"""
    size: tuple[int, int]
    """Width and height, px."""

    @property
    def principal(self) -> Float[np.ndarray, "2"]:
        """Principal point: the middle of the picture."""
        return (np.array(self.size) - 1) / 2

    def to_camera(self, world: Float[np.ndarray, "T *n 3"]) -> Float[np.ndarray, "T *n 3"]:
        """World points of every frame in that frame's camera axes."""
        return np.einsum("tij,t...j->t...i", self.rotation, world - self.center)

    def project(self, world: Float[np.ndarray, "T *n 3"]) -> Float[np.ndarray, "T *n 2"]:
        """Pixels of world points of every frame."""
        points = self.to_camera(world)
        focal = self.focal.reshape(-1, *[1] * (points.ndim - 1))
        return project_perspective(points, 1.0, np.zeros(2)) * focal + self.principal

    def to_plane(self, frame: int, rotation: Float[np.ndarray, "3 3"], focal: float) -> np.ndarray:
        """Homography from a frame's pixels to a plane at distance `focal` along a reference view.

        Plane coordinates are counted from the foot of its perpendicular.
        """
        inverse = np.array(
            [[1, 0, -self.principal[0]], [0, 1, -self.principal[1]], [0, 0, self.focal[frame]]]
        )
        return np.diag([focal, focal, 1.0]) @ rotation @ self.rotation[frame].T @ inverse


@dataclass(frozen=True)
class CameraPlanOptions:
    """How the player is filmed."""

    view: View = View.OBLIQUE
    """Side of the player that the camera stands on."""
    pan: bool = False
    """Follow the player instead of standing still."""
    width: Annotated[int, within(64, 7680)] = 1280
    """Width of the video, px."""
    height: Annotated[int, within(64, 4320)] = 720
    """Height of the video, px."""
    player_px: Annotated[float, within(20, 4000)] = 320.0
    """Stature of the standing player in the picture; a static camera shrinks it to keep everything
    in the picture."""


def plan_camera(
    points: Float[np.ndarray, "T 14 3"],
    fps: float,
    stature: float,
    options: CameraPlanOptions,
    rng: np.random.Generator,
) -> CameraMove:
    """Place a camera by its view and let it stand still or follow the player."""
    (azimuth, turn), (height, rise), (distance, away) = _PLACES[options.view]
    spread = rng.uniform(-1, 1, 3)
    angle = np.radians(azimuth + turn * spread[0])
    lo, hi = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    middle = (lo + hi) / 2
    middle[1] = 0.52 * stature
    across = distance + away * spread[1]
    center = np.array([middle[0] + across * np.sin(angle), 0, middle[2] + across * np.cos(angle)])
    center[1] = height + rise * spread[2]
    focal = options.player_px * float(np.linalg.norm(center - middle)) / stature
    size = (options.width, options.height)
    if options.pan:
        return _follow(points, fps, center, focal, size, rng)
    rotation = look_at(center, middle, UP)[None]
    still = CameraMove(center, rotation, np.array([focal]), size)
    reach = np.abs(still.project(points.reshape(1, -1, 3))[0] - still.principal).max(axis=0)
    room = np.array(size) / 2 * (1 - 2 * EDGE)
    focal *= min(1.0, float((room / reach).min()))
    frames = len(points)
    return CameraMove(center, np.repeat(rotation, frames, axis=0), np.full(frames, focal), size)


def _follow(
    points: Float[np.ndarray, "T 14 3"],
    fps: float,
    center: Float[np.ndarray, "3"],
    focal: float,
    size: tuple[int, int],
    rng: np.random.Generator,
) -> CameraMove:
    """Turn after the player with half a second of lag, and breathe a little with the zoom."""
    root = points.mean(axis=1) * [1, 0.35, 1]
    root[:, 1] += 0.6 * points[:, :, 1].mean()
    pole = np.exp(-1 / (0.3 * fps))
    start = lfilter_zi([1 - pole], [1, -pole])
    target = root
    for _ in range(2):
        target = np.stack(
            [lfilter([1 - pole], [1, -pole], c, zi=start * c[0])[0] for c in target.T], axis=1
        )
    unrest = _wander(rng, len(points), fps, seconds=1.2, count=4)
    target = target + unrest[:, :3] * [0.05, 0.03, 0.05]
    rotation = np.stack([look_at(center, t, UP) for t in target])
    zoom = 1 + 0.012 * unrest[:, 3]
    return CameraMove(center, rotation, focal * zoom, size)


def _wander(
    rng: np.random.Generator, frames: int, fps: float, seconds: float, count: int
) -> Float[np.ndarray, "T N"]:
    """`count` slow random curves of unit spread, correlated over so many `seconds`."""
    noise = rng.standard_normal((frames + int(8 * seconds * fps), count))
    curves = gaussian_filter1d(noise, seconds * fps, axis=0, mode="wrap")[:frames]
    return curves * np.sqrt(2 * np.sqrt(np.pi) * seconds * fps)
