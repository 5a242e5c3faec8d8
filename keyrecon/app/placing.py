"""A project's motion in the world of its camera: what `run`, `court` and `ground` do with it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from keyrecon.errors import quoted
from keyrecon.io.formats.camera_file import read_camera
from keyrecon.io.formats.motion_file import (
    OF_WORLD,
    read_further_arrays,
    read_motion,
    write_motion,
)
from keyrecon.io.workspace import Workspace
from keyrecon.records import Motion
from keyrecon.report.court_drawing import draw_way, write_court_picture
from keyrecon.world.lean import TILT_ERROR, USUAL_TILT
from keyrecon.world.placement import place_motion, stature_change
from keyrecon.world.records import COURT, WorldCamera, WorldMotion
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

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the camera that there is tells no way; none where it tells one."""
        return () if self.court else self.lines


def place_again(workspace: Workspace) -> PlacedMotion:
    """The motion that there is in the world of a new camera; what else its file holds stays."""
    if not workspace.motion_file.is_file():
        return PlacedMotion()
    further = read_further_arrays(workspace.motion_file)
    more = {name: values for name, values in further.items() if name not in OF_WORLD}
    return write_placed_motion(workspace, read_motion(workspace.motion_file), more)


def write_placed_motion(
    workspace: Workspace, motion: Motion, more: Mapping[str, np.ndarray] | None = None
) -> PlacedMotion:
    """Write motion.npz, with the motion in the world where a camera is known.

    What the motion is without one is written the same in any case; `more` are further arrays of
    the file.
    """
    if not workspace.camera_file.is_file():
        write_motion(workspace.motion_file, motion, more=more)
        return PlacedMotion()
    found, world = read_camera(workspace.camera_file), None
    change = stature_change(motion, found)
    camera, where = found.scaled(change), found.origin
    doubt = _camera_doubt(motion, camera)
    if not doubt:
        world = place_motion(motion, camera)
        doubt = _doubt(world, motion, camera)
    if world is None or doubt:
        write_motion(workspace.motion_file, motion, more=more)
        return PlacedMotion((f"No way on the {where}: {doubt}",))
    write_motion(workspace.motion_file, motion, (world, camera), more)
    way = measure_run(world, motion)
    if way is None:
        return PlacedMotion(tuple(_describe_change(workspace, found, change)), (world, camera))
    picture = workspace.folder / "way.jpg"
    title = f"{way.length.value:.1f} m run, top speed {way.top_speed.value:.1f} m/s"
    write_court_picture(picture, draw_way(world, motion, way.speed, title, where))
    height = f" The player is {world.height_ratio:.2f} m tall by the {where}."
    line = f"On the {where}: {title}; {picture} shows the way."
    line += height if motion.units != "m" else ""
    return PlacedMotion((line, *_describe_change(workspace, found, change)), (world, camera))


def _describe_change(workspace: Workspace, camera: WorldCamera, change: float) -> list[str]:
    """That the camera was found with a player of another height."""
    if change == 1 or camera.stature is None:
        return []
    return [
        f"The camera was found with a player {camera.stature:.2f} m tall who is "
        f"{change * camera.stature:.2f} m now, and its distances were scaled with him; for "
        f"camera.npz and {camera.origin}.jpg anew: keyrecon {camera.origin} "
        f"{quoted(workspace.folder)}"
    ]


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
        return (
            f"camera.npz was made for {len(camera.found)} frames and the motion has "
            f"{len(motion.time)}; run keyrecon {camera.origin} again."
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


def old_report(workspace: Workspace, placed: PlacedMotion) -> list[str]:
    """The way to a report with the motion in the world."""
    if placed.court is None or not workspace.report_file.is_file():
        return []
    where = placed.court[1].origin
    return [f"For a report with the {where}: keyrecon run {quoted(workspace.folder)}"]
