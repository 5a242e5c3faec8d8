"""The video with the fitted golfer and club on it, and the view from above in a corner."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from keyrecon.golf.records import Camera, FittedSwing
from keyrecon.progress import Progress, silent
from keyrecon.report.drawing import draw_pose
from keyrecon.report.golf_figure import draw_from_above, draw_golfer
from keyrecon.video import Video
from keyrecon.video_writer import write_video

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
    for frame, picture in enumerate(progress(video.frames(), "Drawing the overlay", len(video))):
        yield draw_overlay(picture, fitted, camera, frame)


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
