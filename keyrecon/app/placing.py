"""A project's motion in the world of its camera: what `run`, `court` and `ground` do with it."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from keyrecon.errors import quoted
from keyrecon.io.formats.camera_file import read_camera, read_origin
from keyrecon.io.formats.motion_file import (
    OF_WORLD,
    read_whole_motion,
    write_motion,
)
from keyrecon.io.provenance import camera_digest, read_run
from keyrecon.io.workspace import Workspace
from keyrecon.records import Motion
from keyrecon.report.court_drawing import draw_way, write_court_picture
from keyrecon.world.lean import TILT_ERROR, USUAL_TILT
from keyrecon.world.placement import place_motion, stature_change
from keyrecon.world.records import COURT, Origin, WorldCamera, WorldMotion
from keyrecon.world.run_measures import measure_run

MAX_MISFIT = 0.2
"""Share by which the player's size by the court may differ from the height that was given: rendered
sequences are off by 2 to 9 %, a court taken for another by a third and more."""
STATURES = (1.1, 2.3)
"""Heights that players have, metres."""
MAX_TILT_ERROR = np.radians(2.5)
"""Standard deviation of the vertical up to which a motion gains from it. On six seconds of eight
rendered sequences, N-MPJPE over that of the lifted motion: -7.6 mm with the true camera, -7.4 with
one tilted by 1 degree either way (worse than lifted in 0 of 16), -6.6 by 2 (4), -3.7 by 4 (7),
+4.8 by 8 (6 of 8). A wrong focal length with the right tilt did no harm up to .6 and 1.6 times.
Under a steep camera the lift itself is far off (`most_tilt_error`): volleys from 32 degrees above
gain 13 mm with the true camera, 7 (-24 and +9) with one tilted by 5 either way; two close views of
a man from 23 degrees, marked by eye, gain 5 to 20 mm with the vertical known to 4 to 6 degrees."""


@dataclass(frozen=True, eq=False)
class PlacedMotion:
    """A motion in the world, where it was put there, and what is said of it."""

    lines: tuple[str, ...] = ()
    court: tuple[WorldMotion, WorldCamera] | None = None
    before: Origin | None = None
    """The world that the motion was in until now."""

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the camera that there is tells no way; none where it tells one."""
        return () if self.court else self.lines


def place_stored_motion(workspace: Workspace) -> PlacedMotion:
    """The motion that there is in the world of a new camera; what else its file holds stays."""
    if not workspace.motion_file.is_file():
        return PlacedMotion()
    motion, further = read_whole_motion(workspace.motion_file)
    more = {name: values for name, values in further.items() if name not in OF_WORLD}
    placed = write_placed_motion(workspace, motion, more)
    return replace(placed, before=read_origin(further) if "points3d_world" in further else None)


def write_placed_motion(
    workspace: Workspace, motion: Motion, more: Mapping[str, np.ndarray] | None = None
) -> PlacedMotion:
    """Write motion.npz, with the motion in the world where a camera is known.

    What the motion is without one is written the same in any case; `more` are further arrays of
    the file.
    """
    placed = _place_motion(workspace, motion)
    write_motion(workspace.motion_file, motion, placed.court, more)
    picture = workspace.folder / "way.jpg"
    picture.unlink(missing_ok=True)
    if placed.court is None:
        return placed
    world, camera = placed.court
    way, where = measure_run(world, motion), camera.origin
    if way is None:
        return placed
    title = f"{way.length.value:.1f} m run, top speed {way.top_speed.value:.1f} m/s"
    write_court_picture(picture, draw_way(world, motion, way.speed, title, where))
    height = f" The player is {world.height_ratio:.2f} m tall by the {where}."
    line = f"On the {where}: {title}; {picture} shows the way."
    line += height if motion.units != "m" else ""
    return replace(placed, lines=(line, *placed.lines))


def _place_motion(workspace: Workspace, motion: Motion) -> PlacedMotion:
    """The motion in the world of the project's camera, or why it is in none."""
    if not workspace.camera_file.is_file():
        return PlacedMotion()
    found = read_camera(workspace.camera_file)
    change = stature_change(motion, found)
    camera = found.scaled(change)
    doubt = _camera_doubt(motion, camera)
    world = None if doubt else place_motion(motion, camera)
    doubt = doubt or _doubt(world, motion, camera)
    if world is None or doubt:
        return PlacedMotion((f"No way on the {camera.origin}: {doubt}",))
    return PlacedMotion(_describe_change(workspace, found, change), (world, camera))


def _describe_change(workspace: Workspace, camera: WorldCamera, change: float) -> tuple[str, ...]:
    """That the camera was found with a player of another height."""
    if change == 1 or camera.stature is None:
        return ()
    return (
        f"The camera was found with a player {camera.stature:.2f} m tall who is "
        f"{change * camera.stature:.2f} m now, and its distances were scaled with him; for "
        f"camera.npz and {camera.origin}.jpg anew: keyrecon {camera.origin} "
        f"{quoted(workspace.folder)}",
    )


def most_tilt_error(camera: WorldCamera) -> float:
    """Standard deviation of the vertical up to which a motion gains from it, radians.

    At least `MAX_TILT_ERROR`; where the camera looks down steeply, what a lift that knows nothing
    of it gets wrong (`keyrecon.world.lean`).
    """
    down = -camera.R[camera.found, 2, 2]
    if not len(down):
        return float(MAX_TILT_ERROR)
    slope = abs(float(np.median(down / np.sqrt(np.maximum(1 - down**2, 1e-6)))))
    return float(max(MAX_TILT_ERROR, np.arctan(TILT_ERROR * max(slope - USUAL_TILT, 0))))


def _camera_doubt(motion: Motion, camera: WorldCamera) -> str:
    """Why a camera is not used for a motion; empty where it is."""
    if len(camera.found) != len(motion.time):
        remedy = f"run keyrecon {camera.origin} again."
        if len(camera.found) > len(motion.time):  # the video has grown since the motion was made
            remedy = "make the motion anew with keyrecon run."
        return (
            f"camera.npz was made for {len(camera.found)} frames and the motion has "
            f"{len(motion.time)}; {remedy}"
        )
    tilt = float(np.nanmax(np.append(camera.sd_tilt, -1)))
    most = most_tilt_error(camera)
    if tilt > most:
        return (
            f"how far the camera looks down is open by {np.degrees(tilt):.1f} degrees, and a "
            f"motion gains from no more than {np.degrees(most):.1f}; the motion stays as "
            "it is without a camera."
        )
    return ""


def _doubt(world: WorldMotion | None, motion: Motion, camera: WorldCamera) -> str:
    """Why a motion is not put into the world; empty where it is."""
    where = camera.origin
    if world is None:
        seen = "with the court " if where == COURT else ""
        return f"in no frame {seen}was a foot seen to stand on the ground."
    low, high = (1 - MAX_MISFIT, 1 + MAX_MISFIT) if motion.units == "m" else STATURES
    if not low < world.height_ratio < high:
        return (
            f"by the {where} the player would be {world.height_ratio:.2f} "
            f"{'times the height given' if motion.units == 'm' else 'm tall'}; look at "
            f"{where}.jpg, and at the height."
        )
    return ""


def outdated_report_lines(workspace: Workspace, placed: PlacedMotion) -> list[str]:
    """The way to a report with the motion in the world, or in none any more; nothing where the
    report knows this camera, or is that of a golf fit, which knows none."""
    run, command = read_run(workspace), f"keyrecon run {quoted(workspace.folder)}"
    if not workspace.report_file.is_file() or (workspace.is_golf and run is None):
        return []
    if placed.court is not None:
        if run is not None and run.camera == camera_digest(workspace):
            return []
        return [f"For a report with the {placed.court[1].origin}: {command}"]
    return [f"For a report without the {placed.before}: {command}"] if placed.before else []


def touch_after(file: Path, other: Path) -> None:
    """Let clicks and marks that were changed while a camera was made count as newer than it."""
    time = other.stat().st_mtime_ns + 1_000_000
    os.utime(file, ns=(time, time))
