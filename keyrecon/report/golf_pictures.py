"""The golfer's volumetric primitives on a picture, and from above (CVPR 2005, Fig. 1).

A tapered capsule looks like the hull of two discs; far ones are drawn before near ones.

Pictures of a swing: key postures with the golfer on them, and the paths of club and hands.

The video with the fitted golfer and club on it, and the view from above in a corner.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.golf.prior.skeleton import NAMES
from keyrecon.golf.records import (
    Camera,
    Capsules,
    FittedSwing,
    Observations,
    RootPose,
    fitted_frames,
)
from keyrecon.io.video import Video
from keyrecon.io.video_writer import write_video
from keyrecon.progress import Progress, silent
from keyrecon.report.drawing import CLUB, LEFT, RIGHT, SEAM, SUBPIXEL, draw_club, draw_pose
from keyrecon.report.pictures import jpeg_uri

BODY = (196, 190, 180)
FLOOR = (46, 52, 50)
VIEW_RADIUS = 1.5
"""Metres from the player to the edge of the view from above."""


@dataclass(frozen=True, eq=False)
class Discs:
    """Both ends of every capsule in a picture."""

    centres: Float[np.ndarray, "Q 2 2"]
    """px"""
    radii: Float[np.ndarray, "Q 2"]
    """px"""
    order: list[int]
    """Far to near."""


def draw_golfer(
    picture: UInt8[np.ndarray, "h w 3"], fitted: FittedSwing, camera: Camera, frame: int
) -> UInt8[np.ndarray, "h w 3"]:
    """A copy of the picture with translucent primitives and the club on it."""
    ends, radii = _place(fitted.capsules, fitted.pose, frame)
    scale = camera.focal / np.maximum(ends[..., 2:], 0.1)
    discs = Discs(
        ends[..., :2] * scale + camera.principal,
        radii * scale[..., 0],
        np.argsort(-ends[..., 2].mean(axis=1)).tolist(),
    )
    layer = picture.copy()
    _draw_discs(layer, discs, fitted.capsules)
    drawn = cv2.addWeighted(layer, 0.6, picture, 0.4, 0)
    draw_club(drawn, fitted.club2d[frame])
    return drawn


def draw_from_above(fitted: FittedSwing, frame: int, size: int) -> UInt8[np.ndarray, "size size 3"]:
    """The primitives from above: the camera is below the picture and looks up in it."""
    scale = size / (2 * VIEW_RADIUS)

    def stand(points: np.ndarray, frame: int) -> np.ndarray:
        return points if fitted.camera is None else fitted.camera.undo(points, frame)

    middle = stand(fitted.pose.origins[0, :1], 0)[0]

    def from_above(points: np.ndarray) -> np.ndarray:
        flat = (points - middle)[..., [0, 2]] * [1.0, -1.0]
        return flat * scale + size / 2

    ends, radii = _place(fitted.capsules, fitted.pose, frame)
    ends = stand(ends, frame)
    discs = Discs(from_above(ends), radii * scale, np.argsort(-ends[..., 1].mean(axis=1)).tolist())
    picture = np.full((size, size, 3), FLOOR, np.uint8)
    _draw_discs(picture, discs, fitted.capsules)
    draw_club(picture, from_above(stand(fitted.club[frame], frame)))
    return picture


def _place(
    capsules: Capsules, pose: RootPose, frame: int
) -> tuple[Float[np.ndarray, "Q 2 3"], Float[np.ndarray, "Q 2"]]:
    """Both ends in camera axes, and radii."""
    local = np.stack([capsules.start, capsules.end], axis=1)
    turned = local @ np.swapaxes(pose.rotations[frame, capsules.segment], 1, 2)
    return pose.origins[frame, capsules.segment][:, None] + turned, capsules.radii


def _draw_discs(picture: UInt8[np.ndarray, "h w 3"], discs: Discs, capsules: Capsules) -> None:
    around = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = np.stack([np.cos(around), np.sin(around)], axis=1)
    for q in discs.order:
        rims = discs.centres[q][:, None] + discs.radii[q][:, None, None] * ring
        hull = cv2.convexHull((rims.reshape(-1, 2) * 2**SUBPIXEL).astype(np.int32))
        name = NAMES[capsules.segment[q]]
        side = LEFT if name.startswith("left") else RIGHT if name.startswith("right") else BODY
        cv2.fillConvexPoly(picture, hull, side, cv2.LINE_AA, SUBPIXEL)
        cv2.polylines(picture, [hull], True, SEAM, 1, cv2.LINE_AA, SUBPIXEL)


HANDS = (0, 114, 178)
"""Blue of Okabe and Ito."""
WIDTH = 520
"""Of a picture in the page, px."""
ROOM = 0.12
"""Around the player, shares of his height."""
ABOVE = 260
"""Side of a view from above, px."""


def key_pictures(
    video: Video, fitted: FittedSwing, observations: Observations
) -> list[tuple[int, str, str]]:
    """Frame, picture with the golfer, and view from above, of the four key postures."""
    frames = np.clip(fitted.keys.round().astype(int), 0, len(video) - 1).tolist()
    part = _around_swing(video, fitted)
    rows = []
    for frame, picture in _chosen(video, frames):
        drawn = draw_golfer(picture, fitted, observations.camera, frame)[part]
        rows.append((frame, _small(drawn), jpeg_uri(draw_from_above(fitted, frame, ABOVE))))
    return rows


def overlay_strip(
    video: Video, fitted: FittedSwing, observations: Observations, count: int = 18
) -> list[tuple[int, str]]:
    """Frames evenly through the swing with the golfer on them."""
    first, last = fitted.keys[[0, 3]]
    frames = np.unique(np.linspace(first, last, count).round().astype(int))
    frames = frames[(frames >= 0) & (frames < len(video))].tolist()
    part = _around_swing(video, fitted)
    return [
        (frame, _small(draw_golfer(picture, fitted, observations.camera, frame)[part]))
        for frame, picture in _chosen(video, frames)
    ]


def path_picture(video: Video, fitted: FittedSwing, observations: Observations) -> str:
    """The paths of club head and hands over the picture at the hit; dots are detections."""
    hit = int(np.clip(round(float(fitted.keys[2])), 0, len(video) - 1))
    drawn = video.frame(hit).copy()
    swing = slice(max(0, int(fitted.keys[0])), int(np.ceil(fitted.keys[3])) + 1)
    for end, color in ((1, CLUB), (0, HANDS)):
        _draw_path(drawn, fitted.club2d[swing, end], color)
        for point in observations.club[swing, end]:
            if np.isfinite(point).all():
                cv2.circle(drawn, _pixel(point), 3, color, -1, cv2.LINE_AA)
    return _small(drawn, 2 * WIDTH)


def _around_swing(video: Video, fitted: FittedSwing) -> tuple[slice, slice]:
    """The part of the picture, rows and columns, that the player is in at any time of the fit."""
    points = fitted.motion.points2d[fitted_frames(fitted.motion)].reshape(-1, 2)
    room = ROOM * np.ptp(points[:, 1])
    low = np.maximum(points.min(axis=0) - room, 0).astype(int)
    high = np.minimum(points.max(axis=0) + room, (video.width, video.height)).astype(int)
    return slice(low[1], high[1]), slice(low[0], high[0])


def _draw_path(
    picture: UInt8[np.ndarray, "h w 3"], path: Float[np.ndarray, "n 2"], color: Sequence[int]
) -> None:
    line = np.round(np.clip(path, -1e4, 1e4)).astype(np.int32)
    cv2.polylines(picture, [line], False, (20, 20, 24), 4, cv2.LINE_AA)
    cv2.polylines(picture, [line], False, color, 2, cv2.LINE_AA)


def _pixel(point: Float[np.ndarray, "2"]) -> tuple[int, int]:
    x, y = np.round(np.clip(point, -1e4, 1e4)).astype(int).tolist()
    return x, y


def _chosen(video: Video, frames: list[int]) -> list[tuple[int, np.ndarray]]:
    """Frames by number, read in one pass; a number may occur twice."""
    wanted = set(frames)
    pictures = dict(zip(sorted(wanted), video.chosen_frames(wanted, max(frames)), strict=True))
    return [(frame, pictures[frame]) for frame in frames]


def _small(picture: UInt8[np.ndarray, "h w 3"], width: int = WIDTH) -> str:
    share = min(1.0, width / picture.shape[1])
    return jpeg_uri(cv2.resize(picture, None, fx=share, fy=share, interpolation=cv2.INTER_AREA))


INSET = 0.3
"""Side of the view from above as a share of the picture's height."""


def write_golf_overlay(
    path: Path, video: Video, fitted: FittedSwing, camera: Camera, progress: Progress = silent
) -> None:
    """Write the overlay as a video."""
    write_video(path, _overlay_frames(video, fitted, camera, progress), video.fps)


def _overlay_frames(
    video: Video, fitted: FittedSwing, camera: Camera, progress: Progress
) -> Iterator[UInt8[np.ndarray, "h w 3"]]:
    shown = fitted_frames(fitted.motion)
    for frame, picture in enumerate(progress(video.frames(), "Drawing the overlay", len(video))):
        yield draw_overlay(picture, fitted, camera, frame) if shown[frame] else picture


def draw_overlay(
    picture: UInt8[np.ndarray, "h w 3"], fitted: FittedSwing, camera: Camera, frame: int
) -> UInt8[np.ndarray, "h w 3"]:
    """Primitives, skeleton and club on one picture, the view from above in its upper corner."""
    motion = fitted.motion
    drawn = draw_golfer(picture, fitted, camera, frame)
    drawn = draw_pose(
        drawn, motion.points2d[frame], motion.skeleton, motion.points3d[frame, :, 2],
        motion.source[frame],
    )  # fmt: skip
    size = round(INSET * picture.shape[0])
    left = _emptier_side(fitted, picture.shape[1])
    columns = slice(0, size) if left else slice(picture.shape[1] - size, None)
    drawn[:size, columns] = draw_from_above(fitted, frame, size)
    return drawn


def _emptier_side(fitted: FittedSwing, width: int) -> bool:
    """Whether the player stands in the right half, so that the left has room."""
    return float(np.median(fitted.motion.points2d[..., 0])) > width / 2
