"""What the page's step "Ground" shows: marks, and squares of a metre over a frame.

Marks are in ground_marks.json before the page hears of them.
"""

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from keyrecon.annotate.assist.court_views import drawn_lines
from keyrecon.io.formats.camera_file import read_camera
from keyrecon.io.formats.motion_file import read_motion
from keyrecon.io.workspace import Workspace
from keyrecon.records import Motion
from keyrecon.report.court_drawing import metre_grid
from keyrecon.world.ground_marks import check_field_of_view, check_mark, mark_names
from keyrecon.world.placement import stature_change
from keyrecon.world.records import COURT, GroundMark, GroundMarks, Kind, WorldCamera

Json = dict[str, Any]
Place = tuple[float, float]
POST = np.array([[[0.0, 0, 0], [0, 0, 1.75]]])
"""Stands at the origin, so that a tilt is seen."""


def describe_ground(workspace: Workspace) -> Json:
    """What was marked, and what is known of the camera."""
    marks, camera = workspace.ground_marks(), _camera(workspace)
    return {
        "marks": [
            {
                "name": name,
                "kind": mark.kind,
                "frame": mark.frame,
                "ends": [mark.start, mark.end],
                "metres": mark.metres,
            }
            for name, mark in zip(mark_names(marks.marks), marks.marks, strict=True)
        ],
        "field_of_view": marks.field_of_view,
        "motion": workspace.motion_file.is_file(),
        "court": camera is not None and camera.origin == COURT,
        "camera": None if camera is None or camera.origin == COURT else _in_words(camera),
        "changed": _changed(workspace) or _is_of_another_height(workspace, camera),
    }


def keep_ground_mark(
    workspace: Workspace,
    kind: Kind,
    frame: int,
    ends: tuple[Place, Place],
    metres: float | None,
) -> Json:
    """Keep a mark; durable when this is answered."""
    mark = GroundMark(kind, frame, *ends, metres)
    video = workspace.video()
    check_mark(mark, len(video), (video.width, video.height))
    workspace.change_ground_marks(GroundMarks((mark,)))
    return describe_ground(workspace)


def drop_ground_mark(
    workspace: Workspace,
    kind: Kind,
    frame: int,
    ends: tuple[Place, Place],
    metres: float | None,
) -> Json:
    """Take a mark away; one that is gone already stays gone."""
    mark = GroundMark(kind, frame, *ends, metres)
    workspace.change_ground_marks(dropped=GroundMarks((mark,)))
    return describe_ground(workspace)


def keep_field_of_view(workspace: Workspace, degrees: float | None) -> Json:
    """Keep the field of view, or none."""
    if degrees is not None:
        check_field_of_view(degrees)
        workspace.change_ground_marks(GroundMarks((), degrees))
    else:
        known = workspace.ground_marks().field_of_view
        workspace.change_ground_marks(dropped=GroundMarks((), known))
    return describe_ground(workspace)


def describe_ground_view(workspace: Workspace, size: tuple[int, int], frame: int) -> Json:
    """Squares of a metre and a post in one frame; none where the camera is not known."""
    camera = _camera(workspace)
    if camera is None or camera.origin == COURT or not _has(camera, frame):
        return {"lines": [], "post": []}

    def project(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 2"]:
        return camera.project(frame, points)

    grid = metre_grid(np.zeros((1, 2)))
    return {
        "lines": drawn_lines(grid, project, size),
        "post": drawn_lines(POST, project, size),
    }


def _has(camera: WorldCamera, frame: int) -> bool:
    return frame < len(camera.found) and bool(camera.found[frame])


def _changed(workspace: Workspace) -> bool:
    """Whether marks are newer than the camera."""
    marks, camera = workspace.ground_marks_file, workspace.camera_file
    if not marks.is_file():
        return False
    return not camera.is_file() or marks.stat().st_mtime_ns > camera.stat().st_mtime_ns


def _is_of_another_height(workspace: Workspace, camera: WorldCamera | None) -> bool:
    """Whether the camera's metres are those of a height that the player has no more."""
    file = workspace.motion_file
    if camera is None or camera.stature is None or not file.is_file():
        return False
    return stature_change(_read_motion(file, file.stat().st_mtime_ns), camera) != 1


@lru_cache(maxsize=1)
def _read_motion(file: Path, changed: int) -> Motion:
    """The motion; read again when the file has changed."""
    return read_motion(file)


def _camera(workspace: Workspace) -> WorldCamera | None:
    file = workspace.camera_file
    return read_camera(file) if file.is_file() else None


def _in_words(camera: WorldCamera) -> str:
    """Where it stands, and how surely."""
    seen = int(np.flatnonzero(camera.found)[0])
    height, sd = camera.centre[seen, 2], camera.sd_centre[seen, 2]
    tilt = np.degrees(np.arcsin(-camera.R[seen, 2, 2]))
    return (
        f"The camera is {height:.2f} m high (\u00b1 {sd:.2f}) and looks "
        f"{'down' if tilt >= 0 else 'up'} by {abs(tilt):.1f}\u00b0 "
        f"(\u00b1 {np.degrees(camera.sd_tilt[seen]):.1f}); its focal length is known within "
        f"{camera.sd_focal[seen] / camera.focal[seen]:.0%}."
    )
