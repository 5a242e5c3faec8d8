"""The video with the reconstructed pose on it: the quickest way to see whether to trust it.

Beside it, or instead of it, the figure can be shown from elsewhere: standing on its floor, in
parallel projection, the middle of its hips in the middle.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.errors import KeyreconError
from keyrecon.golf.records import fitted_frames
from keyrecon.io.formats.conventions import stand_on_floor
from keyrecon.io.video import Video
from keyrecon.io.video_writer import write_video
from keyrecon.progress import Progress, silent
from keyrecon.records import Motion
from keyrecon.report.court_drawing import draw_ground
from keyrecon.report.drawing import TRUNK, draw_club, draw_pose, joint_sides
from keyrecon.world.records import WorldCamera, WorldMotion

View = Literal["camera", "right", "left", "back", "above"]
Limbs = Literal["all", "upper", "lower", "left", "right", "none"]

SIDE_VIEWS = {
    "right": np.array([[0, 0, -1], [0, -1, 0], [-1, 0, 0]]),
    "left": np.array([[0, 0, 1], [0, -1, 0], [1, 0, 0]]),
    "back": np.array([[-1, 0, 0], [0, -1, 0], [0, 0, 1]]),
    "above": np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]),
}
"""From axes with Y up and z towards the camera to right, down and away in the view: from the right
and left of the picture, from opposite the camera, from above."""
TALL, WIDE = 1.45, 1.2
"""Height and width of a view in statures: a raised arm fits."""
GROUND, PAPER = (150, 152, 156), (206, 208, 212)
"""Colours of the floor and of what is behind, dark enough for a white trunk."""
LARGEST = 4096
"""Largest height of an overlay, px; players go no further."""


@dataclass(frozen=True)
class OverlayOptions:
    """How the overlay video shows the motion."""

    view: tuple[View, ...] = ("camera",)
    """Pictures side by side: the video itself (camera), or the figure from the right or left of
    the picture, from opposite the camera (back) or from above."""
    skeleton: Limbs = "all"
    """Joints that are drawn: all, one half of the body, one side of it, or none."""
    slowmo: float = 1.0
    """How many times slower than life the overlay plays."""
    size: int | None = None
    """Height of the overlay, px; that of the video by default."""
    court: bool = True
    """Where the court is known: its lines, the player's way on the ground, and rings about feet
    that stand."""


def write_overlay(
    path: Path,
    video: Video,
    motion: Motion,
    progress: Progress = silent,
    options: OverlayOptions = OverlayOptions(),
    frames: tuple[int, int] | None = None,
    court: tuple[WorldMotion, WorldCamera] | None = None,
    club: Float[np.ndarray, "T 2 2"] | None = None,
) -> None:
    """Write the video with the refined pose and the frame number on every frame.

    The pose is the projection of the 3D joints; near limbs cross over far ones. `frames` are the
    first and the last to be shown; those after the last one of the motion are shown as they are.
    `club` is that of a golf swing, from between the hands to its head, px; neither it nor the body
    is drawn where no swing was fitted. Raises KeyreconError for options that no video can follow.
    """
    check_overlay(options)
    pictures = overlay_frames(video, motion, progress, options, frames, court, club)
    write_video(path, pictures, video.fps / options.slowmo)


def check_overlay(options: OverlayOptions) -> None:
    """Raise KeyreconError for options that no video can follow."""
    if not 0.05 <= options.slowmo <= 100:
        raise KeyreconError(
            f"--slowmo says how many times slower than life the overlay plays; {options.slowmo:g} "
            "cannot be: give a number from 0.05 to 100."
        )
    if options.size is not None and not 64 <= options.size <= LARGEST:
        raise KeyreconError(
            f"--size is the height of the overlay in px; {options.size} cannot be: give a number "
            f"from 64 to {LARGEST}."
        )
    if not options.view:
        raise KeyreconError("--view names no picture; give camera, right, left, back or above.")


def overlay_frames(
    video: Video,
    motion: Motion,
    progress: Progress = silent,
    options: OverlayOptions = OverlayOptions(),
    frames: tuple[int, int] | None = None,
    court: tuple[WorldMotion, WorldCamera] | None = None,
    club: Float[np.ndarray, "T 2 2"] | None = None,
) -> Iterator[UInt8[np.ndarray, "h w 3"]]:
    """The pictures of `write_overlay`, one at a time."""
    first, last = frames or (0, len(video) - 1)
    height = options.size or video.height
    if club is not None:
        motion, club = _where_fitted(motion, club)
    hidden = _hidden_joints(motion, options.skeleton)
    sides = [view for view in options.view if view != "camera"]
    seen = {view: _side_view(motion, view, height) for view in sides}
    pictures = video.frames(first, last + 1)
    for frame, picture in enumerate(
        progress(pictures, "Drawing the overlay", last - first + 1), first
    ):
        panes = []
        if court is not None and options.court and frame < len(motion.time):
            picture = draw_ground(picture, court, motion, frame)
        if club is not None and frame < len(club) and np.isfinite(club[frame]).all():
            picture = picture.copy()
            draw_club(picture, club[frame])
        for view in options.view:
            if view == "camera":
                panes.append(_camera_pane(picture, motion, frame, hidden, height))
            else:
                panes.append(_side_pane(seen[view], motion, frame, hidden, height, view != "above"))
        shown = np.concatenate(panes, axis=1)
        _write_label(shown, f"frame {frame}   {video.time[frame]:.2f} s")
        yield shown


def _where_fitted(
    swing: Motion, club: Float[np.ndarray, "T 2 2"]
) -> tuple[Motion, Float[np.ndarray, "T 2 2"]]:
    """Body and club of a golf swing, unknown in frames to which nothing was fitted."""
    fitted = fitted_frames(swing)[:, None, None]
    points3d, points2d, ends = (
        np.where(fitted, points, np.nan) for points in (swing.points3d, swing.points2d, club)
    )
    return replace(swing, points3d=points3d, points2d=points2d), ends


def _hidden_joints(motion: Motion, limbs: Limbs) -> np.ndarray:
    """Which joints are not drawn."""
    skeleton = motion.skeleton
    sides = joint_sides(skeleton)
    shown = {
        "all": np.ones(len(sides), dtype=bool),
        "upper": ~skeleton.is_lower,
        "lower": skeleton.is_lower,
        "left": sides != 1,
        "right": sides != 0,
        "none": np.zeros(len(sides), dtype=bool),
    }
    return ~shown[limbs]


def _camera_pane(
    picture: UInt8[np.ndarray, "h w 3"],
    motion: Motion,
    frame: int,
    hidden: np.ndarray,
    height: int,
) -> UInt8[np.ndarray, "y x 3"]:
    """The video's picture with the pose on it, at the overlay's height."""
    scale = height / picture.shape[0]
    if scale != 1:
        size = (max(2, round(picture.shape[1] * scale)), height)
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    if frame >= len(motion.points2d):
        return picture.copy()
    points = (motion.points2d[frame] + 0.5) * scale - 0.5
    known = points[np.isfinite(points).all(axis=1)]
    tall = float(np.ptp(known, axis=0).max()) if len(known) else None
    shown = np.where(hidden[:, None], np.nan, points)
    depth, source = motion.points3d[frame, :, 2], motion.source[frame]
    return draw_pose(picture, shown, motion.skeleton, depth, source, tall)


def _side_view(motion: Motion, view: str, height: int) -> Float[np.ndarray, "T J 3"]:
    """Joints as the view shows them: px right, px down, depth away."""
    standing = stand_on_floor(motion, even_times=False)
    scale = height / (TALL * standing.stature)
    hips = [j for j, n in enumerate(motion.skeleton.names) if n in ("left_hip", "right_hip")]
    middle = standing.points[:, hips or [motion.skeleton.root]].mean(axis=1, keepdims=True)
    held = middle * ([1, 0, 1] if view != "above" else [1, 1, 1])
    seen = (standing.points - held) @ SIDE_VIEWS[view].T * scale
    at = 0.5 * height if view == "above" else _floor_row(height)
    return seen + np.array([0.5 * round(WIDE / TALL * height), at, 0])


def _floor_row(height: int) -> int:
    return round(0.93 * height)


def _side_pane(
    seen: Float[np.ndarray, "T J 3"],
    motion: Motion,
    frame: int,
    hidden: np.ndarray,
    height: int,
    floor: bool,
) -> UInt8[np.ndarray, "y x 3"]:
    """The figure alone, on its floor."""
    pane = np.full((height, round(WIDE / TALL * height), 3), PAPER if floor else GROUND, np.uint8)
    if floor:
        pane[_floor_row(height) :] = GROUND
    if frame >= len(seen):
        return pane
    points = np.where(hidden[:, None], np.nan, seen[frame])
    tall = height / TALL
    return draw_pose(
        pane, points[:, :2], motion.skeleton, seen[frame, :, 2], motion.source[frame], tall
    )


def _write_label(picture: UInt8[np.ndarray, "h w 3"], text: str) -> None:
    """Frame number on a darkened strip in the lower left corner; its size follows the picture's."""
    size = max(0.4, picture.shape[0] / 1200)
    (width, height), below = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, 1)
    edge = height // 2 + 2
    strip = picture[-(height + below + 2 * edge) :, : width + 2 * edge]
    strip //= 3
    at = (edge, picture.shape[0] - below - edge)
    cv2.putText(picture, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, TRUNK, 1, cv2.LINE_AA)
