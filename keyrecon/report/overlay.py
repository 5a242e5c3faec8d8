"""The video with the reconstructed pose on it: the quickest way to see whether to trust it.

Beside it, or instead of it, the figure can be shown from elsewhere: standing on its floor, in
parallel projection, the middle of its hips in the middle. Where the court is known the figure is
where it stands there, with the lines and the way about it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.errors import KeyreconError
from keyrecon.golf.records import fitted_frames
from keyrecon.io.formats.conventions import IN_WORLD, WorldJoints, stand_on_floor
from keyrecon.io.video import Video
from keyrecon.io.video_writer import write_video
from keyrecon.progress import Progress, silent
from keyrecon.records import Motion
from keyrecon.report.court_drawing import draw_ground, draw_ground_beside
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
COURT_TALL = 8.0
"""Metres of a court that the view from above shows from its top to its bottom: at least a line is
in it wherever a player stands on a court."""
GROUND, PAPER = (150, 152, 156), (206, 208, 212)
"""Colours of the floor and of what is behind, dark enough for a white trunk."""
LARGEST = 4096
"""Largest height of an overlay, px; players go no further."""
OVERLAY_COMMENT = "keyrecon overlay"
"""Stands in the file, which is told by it from a film."""


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
    write_video(path, pictures, video.fps / options.slowmo, comment=OVERLAY_COMMENT)


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
    beside = court if options.court else None
    seen = {view: _side_view(motion, view, height, beside) for view in sides}
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
                panes.append(_side_pane(seen[view], motion, frame, hidden))
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


@dataclass(frozen=True, eq=False)
class _SideView:
    """How the figure is seen from elsewhere."""

    joints: Float[np.ndarray, "T J 3"]
    """px right, px down, depth away."""
    to_view: Float[np.ndarray, "3 3"]
    """From axes with Y up to those of the view, px."""
    held: Float[np.ndarray, "T 3"]
    """What lies at `middle` in each frame, with Y up."""
    middle: Float[np.ndarray, "3"]
    """px"""
    height: int
    floor: bool
    """Whether it is seen from the side, with the floor below it."""
    tall: float
    """Stature, px."""
    court: tuple[WorldMotion, WorldCamera] | None
    """Where the figure is where the court has it."""

    def project(self, frame: int, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 2"]:
        """Points in the world as they are seen in a frame, px."""
        placed = points[:, [0, 2, 1]] * [1, 1, -1]
        return ((placed - self.held[frame]) @ self.to_view.T + self.middle)[:, :2]


def _side_view(
    motion: Motion, view: str, height: int, court: tuple[WorldMotion, WorldCamera] | None
) -> _SideView:
    """The figure as a view shows it; on the court where it has a place there in all frames."""
    world = None if court is None else WorldJoints(court[0].points, court[1].origin)
    standing = stand_on_floor(motion, even_times=False, world=world)
    if world is not None and not standing.placing.startswith(IN_WORLD[world.origin]):
        court = None
    above = view == "above"
    scale = height / (COURT_TALL if above and court else TALL * standing.stature)
    hips = [j for j, n in enumerate(motion.skeleton.names) if n in ("left_hip", "right_hip")]
    middle = standing.points[:, hips or [motion.skeleton.root]].mean(axis=1)
    held = middle * ([1, 1, 1] if above else [1, 0, 1])
    to_view = SIDE_VIEWS[view] * scale
    at = 0.5 * height if above else float(_floor_row(height))
    shift = np.array([0.5 * round(WIDE / TALL * height), at, 0])
    joints = (standing.points - held[:, None]) @ to_view.T + shift
    return _SideView(
        joints, to_view, held, shift, height, not above, scale * standing.stature, court
    )


def _floor_row(height: int) -> int:
    return round(0.93 * height)


def _side_pane(
    view: _SideView, motion: Motion, frame: int, hidden: np.ndarray
) -> UInt8[np.ndarray, "y x 3"]:
    """The figure alone, on its floor, and the court about it."""
    size = (view.height, round(WIDE / TALL * view.height), 3)
    pane = np.full(size, PAPER if view.floor else GROUND, np.uint8)
    if view.floor:
        pane[_floor_row(view.height) :] = GROUND
    if frame >= len(view.joints):
        return pane
    if view.court is not None and np.isfinite(view.held[frame]).all():
        draw_ground_beside(pane, partial(view.project, frame), view.court, motion, frame)
    seen = view.joints[frame]
    points, tall = np.where(hidden[:, None], np.nan, seen), view.tall
    return draw_pose(pane, points[:, :2], motion.skeleton, seen[:, 2], motion.source[frame], tall)


def _write_label(picture: UInt8[np.ndarray, "h w 3"], text: str) -> None:
    """Frame number on a darkened strip in the lower left corner; its size follows the picture's."""
    size = max(0.4, picture.shape[0] / 1200)
    (width, height), below = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, 1)
    edge = height // 2 + 2
    strip = picture[-(height + below + 2 * edge) :, : width + 2 * edge]
    strip //= 3
    at = (edge, picture.shape[0] - below - edge)
    cv2.putText(picture, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, TRUNK, 1, cv2.LINE_AA)
