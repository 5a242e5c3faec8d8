"""Player coordinates: every frame relative to the player, in player heights.

The origin of a frame is the midpoint of head and feet, smoothed over time after the camera's own
motion is taken out, so that what moves in these coordinates is the body and neither the camera
nor the noise of the tracker. Points are complex numbers x + iy: turning and stretching a limb is
then one product.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.body import Skeleton
from keyrecon.numerics.geometry import from_complex, to_complex, warp_points
from keyrecon.records import Annotations, CameraPath, Shots, Track
from keyrecon.timeline import part_of_path, take_frames

SMOOTHING_SECONDS = 0.05
"""Standard deviation of the smoothing of the origin: short against a step of 0.3 s and more, long
against the tracker's jitter from frame to frame. Halved or doubled, others with it: at most 0.1
points, 0.6 mm on one clip."""


@dataclass(frozen=True, eq=False)
class BodyFrame:
    """Where the player's coordinate system lies in every frame."""

    origin: Complex[np.ndarray, "T"]
    """px"""
    height: Float[np.ndarray, "T"]
    """px"""

    def from_pixels(
        self, points: Float[np.ndarray, "*n 2"], frames: int | Int[np.ndarray, "..."]
    ) -> Complex[np.ndarray, "*n"]:
        """Pixels to player coordinates; `frames` broadcasts against the points."""
        return (to_complex(points) - self.origin[frames]) / self.height[frames]

    def to_pixels(
        self, points: Complex[np.ndarray, "*n"], frames: int | Int[np.ndarray, "..."]
    ) -> Float[np.ndarray, "*n 2"]:
        """Player coordinates to pixels."""
        return from_complex(points * self.height[frames] + self.origin[frames])

    def of_marks(self, annotations: Annotations) -> "PlayerMarks":
        """Annotated joints in player coordinates."""
        frames = annotations.frames
        places = self.from_pixels(annotations.joints, frames[:, None])
        return PlayerMarks(annotations.skeleton, frames, places)


@dataclass(frozen=True, eq=False)
class PlayerMarks:
    """Annotated joints in player coordinates; NaN where a joint is not marked."""

    skeleton: Skeleton
    frames: Int[np.ndarray, "K"]
    joints: Complex[np.ndarray, "K J"]


def stabilise_shots(track: Track, camera: CameraPath, shots: Shots, fps: float) -> BodyFrame:
    """Player coordinates in every shot by itself."""
    parts = [
        stabilise_player(take_frames(track, part), part_of_path(camera, part), fps)
        for part in shots.parts
    ]
    return BodyFrame(
        np.concatenate([part.origin for part in parts]),
        np.concatenate([part.height for part in parts]),
    )


def stabilise_player(track: Track, camera: CameraPath, fps: float) -> BodyFrame:
    """Player coordinates from head, feet and the camera's motion, in one shot.

    Beyond the ends of the shot the path is continued by its point reflection in the end, so that
    the smoothed origin of a player who moves on lies on the path there too.
    """
    middle = (track.head + track.mid_feet) / 2
    sigma = SMOOTHING_SECONDS * fps
    half_width = int(np.ceil(2.5 * sigma))
    last = len(middle) - 1
    now = np.arange(len(middle))
    from_reference = np.linalg.inv(camera.to_reference)

    def observed(frames: Int[np.ndarray, "T"]) -> Float[np.ndarray, "T 2"]:
        """The player at other frames, in the picture of each frame."""
        return warp_points(from_reference @ camera.to_reference[frames], middle[frames])

    total, weights = np.zeros_like(middle), 0.0
    for lag in range(-half_width, half_width + 1):
        other = now + lag
        end = np.clip(other, 0, last)
        reflected = np.clip(2 * end - other, 0, last)
        beyond = (other != end)[:, None]
        point = np.where(beyond, 2 * observed(end) - observed(reflected), observed(end))
        weight = np.exp(-0.5 * (lag / sigma) ** 2)
        total += weight * point
        weights += weight
    return BodyFrame(to_complex(total / weights), track.height.astype(float))


def ground_path(
    body_frame: BodyFrame, camera: CameraPath, shots: Shots
) -> Complex[np.ndarray, "T"]:
    """Way of the origin over the ground as the camera sees it, player heights, from 0 in each shot.

    What stands on the ground keeps the sum of this and of its player coordinates, however the
    camera turns.
    """
    path = np.zeros(len(body_frame.origin), complex)
    for part in shots.parts:
        origin, to_reference = body_frame.origin[part], camera.to_reference[part]
        step = np.linalg.inv(to_reference[1:]) @ to_reference[:-1]
        before = to_complex(warp_points(step, from_complex(origin[:-1])))
        path[part][1:] = np.cumsum((origin[1:] - before) / body_frame.height[part][1:])
    return path
