"""The video with the reconstructed pose on it: the quickest way to see whether to trust it."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from keyrecon.io.video import Video
from keyrecon.io.video_writer import write_video
from keyrecon.progress import Progress, silent
from keyrecon.records import Motion
from keyrecon.report.drawing import TRUNK, draw_pose


def write_overlay(path: Path, video: Video, motion: Motion, progress: Progress = silent) -> None:
    """Write the video with the refined pose and the frame number on every frame.

    The pose is the projection of the 3D joints; near limbs cross over far ones. Frames after
    the last one of the motion are shown as they are.
    """
    write_video(path, overlay_frames(video, motion, progress), video.fps)


def overlay_frames(
    video: Video, motion: Motion, progress: Progress = silent
) -> Iterator[UInt8[np.ndarray, "h w 3"]]:
    """The pictures of `write_overlay`, one at a time."""
    for frame, picture in enumerate(progress(video.frames(), "Drawing the overlay", len(video))):
        if frame < len(motion.points2d):
            picture = draw_pose(
                picture,
                motion.points2d[frame],
                motion.skeleton,
                motion.points3d[frame, :, 2],
                motion.source[frame],
            )
        _write_label(picture, f"frame {frame}   {video.time[frame]:.2f} s")
        yield picture


def _write_label(picture: UInt8[np.ndarray, "h w 3"], text: str) -> None:
    """Frame number on a darkened strip in the lower left corner; its size follows the picture's."""
    size = max(0.4, picture.shape[0] / 1200)
    (width, height), below = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, 1)
    edge = height // 2 + 2
    strip = picture[-(height + below + 2 * edge) :, : width + 2 * edge]
    strip //= 3
    at = (edge, picture.shape[0] - below - edge)
    cv2.putText(picture, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, TRUNK, 1, cv2.LINE_AA)
