"""What the page's step "Court" shows: the model over a frame, and clicked points of it.

Clicks are in court_points.json before the page hears of it. Once four of one frame are newer than
the camera, the page is shown the court as they put it, before the whole clip is fitted.
"""

from collections.abc import Callable
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from keyrecon.errors import KeyreconError
from keyrecon.io.formats.camera_file import read_camera
from keyrecon.io.workspace import Workspace
from keyrecon.world.clicked_points import FEWEST, camera_from_points, check_click
from keyrecon.world.court import POINTS, tennis_court
from keyrecon.world.records import COURT, CourtClick, WorldCamera

Json = dict[str, Any]
Projection = Callable[[Float[np.ndarray, "n 3"]], Float[np.ndarray, "n 2"]]
PIECE = 0.5
"""Metres of a line that are drawn straight: perspective keeps lines straight, but not those that go
behind the camera."""
FARTHEST = 4.0
"""Widths of the picture beyond which nothing is drawn."""


def describe_court(workspace: Workspace) -> Json:
    """The court's map, its points, and what was clicked."""
    ends = tennis_court().ends
    return {
        "lines": ends.round(3).tolist(),
        "points": {name: list(place) for name, place in POINTS.items()},
        "fewest": FEWEST,
        **_state(workspace),
    }


def keep_court_point(
    workspace: Workspace, name: str, frame: int, place: tuple[float, float] | None
) -> Json:
    """Keep a click, or take one away where there is no place; durable when this is answered."""
    if place is None:
        clicks = workspace.court_clicks()
        old = [click for click in clicks if (click.name, click.frame) == (name, frame)]
        workspace.change_court_clicks((), old)
    else:
        video = workspace.video()
        click = CourtClick(name, frame, *place)
        check_click(click, len(video), (video.width, video.height))
        workspace.change_court_clicks([click])
    return _state(workspace)


def describe_court_view(workspace: Workspace, size: tuple[int, int], frame: int) -> Json:
    """The court over one frame: as the camera has it, or as newer clicks of this frame put it.

    `size` is the picture's, px.
    """
    here = [click for click in workspace.court_clicks() if click.frame == frame]
    if len(here) >= FEWEST and _changed(workspace):
        try:
            pixels = np.array([(click.x, click.y) for click in here])
            pinhole = camera_from_points([c.name for c in here], pixels, size[::-1])
        except KeyreconError as fault:
            return {"source": "clicks", "fault": str(fault), "lines": [], "points": {}}
        return {"source": "clicks", "fault": "", **_drawn(pinhole.project, size)}
    camera = _camera(workspace)
    if camera is None or frame >= len(camera.found) or not camera.found[frame]:
        return {"source": None, "fault": "", "lines": [], "points": {}}

    def project(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 2"]:
        return camera.project(frame, points)

    return {"source": "camera", "fault": "", **_drawn(project, size)}


def _state(workspace: Workspace) -> Json:
    camera = _camera(workspace)
    return {
        "clicks": [asdict(click) for click in workspace.court_clicks()],
        "changed": _changed(workspace),
        "found": None if camera is None else round(float(camera.found.mean()), 4),
    }


def _changed(workspace: Workspace) -> bool:
    """Whether clicks were made, or taken away, since the camera was found."""
    points, camera = workspace.court_points_file, workspace.camera_file
    if not points.is_file():
        return False
    if _camera(workspace) is None:
        return bool(workspace.court_clicks())
    return points.stat().st_mtime_ns > camera.stat().st_mtime_ns


def _camera(workspace: Workspace) -> WorldCamera | None:
    file = workspace.camera_file
    return _read(file, file.stat().st_mtime_ns) if file.is_file() else None


@lru_cache(maxsize=1)
def _read(file: Path, changed: int) -> WorldCamera | None:
    """The camera on a court; read again when the file has changed."""
    camera = read_camera(file)
    return camera if camera.origin == COURT else None


def _drawn(project: Projection, size: tuple[int, int]) -> Json:
    """Lines as pieces in the picture, and points that lie in it, px."""
    places = project(np.array(list(POINTS.values())))
    inside = np.asarray(((places >= 0) & (places < size)).all(axis=1))
    points = {
        name: place.round(1).tolist()
        for name, place, shown in zip(POINTS, places, inside, strict=True)
        if shown
    }
    return {"lines": drawn_lines(tennis_court().ends, project, size), "points": points}


def drawn_lines(
    ends: Float[np.ndarray, "L 2 3"], project: Projection, size: tuple[int, int]
) -> list[list[list[float]]]:
    """Straight lines of the world as pieces in the picture, px; nothing from behind the camera."""
    lines = []
    for start, end in ends:
        count = int(np.ceil(np.linalg.norm(end - start) / PIECE)) + 1
        pixels = project(start + np.linspace(0, 1, count)[:, None] * (end - start))
        near = np.isfinite(pixels).all(axis=1)
        near &= (np.abs(np.nan_to_num(pixels)) < FARTHEST * size[0]).all(axis=1)
        for part in np.split(np.arange(count), np.flatnonzero(np.diff(near)) + 1):
            if near[part[0]] and len(part) > 1:
                lines.append(pixels[part][[0, -1]].round(1).tolist())
    return lines
