"""`keyrecon court`: the camera of every frame from the tennis court in the picture."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from keyrecon.errors import KeyreconError, quoted
from keyrecon.io.formats.camera_file import read_camera, write_calibration, write_camera
from keyrecon.io.formats.court_points import merge_clicks
from keyrecon.io.formats.motion_file import read_motion, write_motion
from keyrecon.io.video import Video
from keyrecon.io.workspace import COURT, Workspace
from keyrecon.pipeline import Options
from keyrecon.progress import Progress
from keyrecon.records import Motion
from keyrecon.report.court_drawing import draw_court, draw_way, write_court_picture
from keyrecon.tracking.camera_motion import estimate_camera_motion
from keyrecon.world.calibration import CalibrationOptions, calibrate_court
from keyrecon.world.clicked_points import ContradictoryClicks, check_click
from keyrecon.world.court import tennis_court
from keyrecon.world.placement import place_motion
from keyrecon.world.records import CourtCamera, CourtClick, WorldMotion
from keyrecon.world.run_measures import measure_run

MAX_MISFIT = 0.2
"""Share by which the player's size by the court may differ from the height that was given: rendered
sequences are off by 2 to 9 %, a court taken for another by a third and more."""
STATURES = (1.1, 2.3)
"""Heights that players have, metres."""


@dataclass(frozen=True, eq=False)
class PlacedMotion:
    """A motion on the court, where it was put there, and what is said of it."""

    lines: tuple[str, ...] = ()
    court: tuple[WorldMotion, CourtCamera] | None = None


def court_click(text: str) -> CourtClick:
    """Parse NAME:FRAME:X,Y."""
    try:
        name, frame, place = (part.strip() for part in text.split(":"))
        x, y = (float(part) for part in place.split(","))
        return CourtClick(name, int(frame), x, y)
    except ValueError as fault:
        raise KeyreconError(
            f"--point needs NAME:FRAME:X,Y, such as near-left:0:212.5,640; got '{text}'."
        ) from fault


def calibrate(
    workspace: Workspace,
    clicks: Sequence[CourtClick],
    options: CalibrationOptions,
    progress: Progress,
    forget: Sequence[str] = (),
) -> str:
    """Find the court, write camera.npz and court.jpg; returns the text to show.

    The project keeps the clicks, with those of former calls; `forget` names points (or "all") whose
    clicks are taken out first. New clicks that contradict the rest are not kept.
    """
    video = workspace.video()
    options = workspace.options(options, CalibrationOptions(), COURT)
    dropped = _forgotten(workspace.court_clicks(), forget)
    kept = [click for click in workspace.court_clicks() if click not in dropped]
    for click in clicks:
        check_click(click, len(video), (video.width, video.height))
    together = merge_clicks(kept, clicks)
    try:
        camera = _find_camera(workspace, video, together, options, progress)
    except ContradictoryClicks as fault:
        raise KeyreconError(f"{fault}{_whose(clicks, kept)}") from fault
    except KeyreconError as fault:
        workspace.change_court_clicks(clicks, dropped)
        raise KeyreconError(f"{fault}{_how_many(together)}") from fault
    workspace.change_court_clicks(clicks, dropped)
    workspace.remember(options, CalibrationOptions(), COURT)
    write_camera(workspace.camera_file, camera)
    seen = np.flatnonzero(camera.found)
    frame = int(seen[len(seen) // 2])
    drawn = draw_court(video.frame(frame), camera, frame, tennis_court(options.court))
    picture = workspace.folder / "court.jpg"
    write_court_picture(picture, drawn)
    placed = PlacedMotion()
    if workspace.motion_file.is_file():
        placed = write_placed_motion(workspace, read_motion(workspace.motion_file))
    return "\n".join(
        [
            *describe_camera(camera),
            f"{workspace.camera_file}: the camera of every frame. {picture}: the court's lines "
            f"drawn on frame {frame}; look whether they lie on the painted ones. If not, keyrecon "
            f"court {quoted(workspace.folder)} --point NAME:FRAME:X,Y for four points or more.",
            *([f"By {len(together)} clicked points; they are kept."] if together else []),
            *placed.lines,
            *_old_report(workspace, placed),
        ]
    )


def _old_report(workspace: Workspace, placed: PlacedMotion) -> list[str]:
    """The way to a report with the court."""
    if placed.court is None or not workspace.report_file.is_file():
        return []
    return [f"For a report with the court: keyrecon run {quoted(workspace.folder)}"]


def _find_camera(
    workspace: Workspace,
    video: Video,
    clicks: tuple[CourtClick, ...],
    options: CalibrationOptions,
    progress: Progress,
) -> CourtCamera:
    keep = workspace.stages.keep
    motion = workspace.options(Options(), Options()).camera
    path = keep("camera", estimate_camera_motion, video, options=motion, progress=progress)
    return keep("court", calibrate_court, video, path, clicks, options=options, progress=progress)


def _forgotten(kept: Sequence[CourtClick], names: Sequence[str]) -> list[CourtClick]:
    """Clicks that are named by their points, or "all" of them."""
    known = {click.name for click in kept}
    if unknown := sorted(set(names) - known - {"all"}):
        there = f"it has {', '.join(sorted(known))}" if known else "it has none"
        raise KeyreconError(f"The project has no click on {unknown[0]} to forget; {there}.")
    return [click for click in kept if "all" in names or click.name in names]


def _whose(new: Sequence[CourtClick], kept: Sequence[CourtClick]) -> str:
    """What becomes of clicks that contradict one another."""
    if not kept:
        return ""
    old = ", ".join(click.name for click in kept)
    return (
        f"{' The new clicks were not kept.' if new else ''} Clicks of former calls: {old}; "
        "--forget NAME takes one out, --forget all starts anew."
    )


def _how_many(clicks: Sequence[CourtClick]) -> str:
    names = ", ".join(click.name for click in clicks)
    return f" Clicked so far, and kept: {names}." if clicks else ""


def write_placed_motion(workspace: Workspace, motion: Motion) -> PlacedMotion:
    """Write motion.npz, with the motion on the court where that is known.

    What the motion is without a court is written the same in any case.
    """
    if not workspace.camera_file.is_file():
        write_motion(workspace.motion_file, motion)
        return PlacedMotion()
    camera, world = read_camera(workspace.camera_file), None
    if len(camera.found) == len(motion.time):
        world = place_motion(motion, camera)
    doubt = _doubt(world, motion, camera)
    if world is None or doubt:
        write_motion(workspace.motion_file, motion)
        return PlacedMotion((f"No way on the court: {doubt}",))
    write_motion(workspace.motion_file, motion, (world, camera))
    way = measure_run(world, motion)
    if way is None:
        return PlacedMotion(court=(world, camera))
    picture = workspace.folder / "way.jpg"
    title = f"{way.length.value:.1f} m run, top speed {way.top_speed.value:.1f} m/s"
    write_court_picture(picture, draw_way(world.root, way.speed, title))
    height = f" The player is {world.height_ratio:.2f} m tall by the court."
    line = f"On the court: {title}; {picture} shows the way."
    return PlacedMotion((line + (height if motion.units != "m" else ""),), (world, camera))


def _doubt(world: WorldMotion | None, motion: Motion, camera: CourtCamera) -> str:
    """Why a motion is not put on the court; empty where it is."""
    if len(camera.found) != len(motion.time):
        return (
            f"camera.npz was made for {len(camera.found)} frames and the motion has "
            f"{len(motion.time)}; run keyrecon court again."
        )
    if world is None:
        return "in no frame with the court was a foot seen to stand on the ground."
    low, high = (1 - MAX_MISFIT, 1 + MAX_MISFIT) if motion.units == "m" else STATURES
    if not low < world.height_ratio < high:
        return (
            f"by the court the player would be {world.height_ratio:.2f} "
            f"{'times the height given' if motion.units == 'm' else 'm tall'}; look at court.jpg, "
            "and at the height."
        )
    return ""


def export_calibration(workspace: Workspace, file: Path) -> str:
    """Write the camera as Pose2Sim reads it; returns the line to show."""
    if not workspace.camera_file.is_file():
        raise KeyreconError(
            f"{workspace.folder} has no camera yet; run: keyrecon court {quoted(workspace.folder)}"
        )
    video = workspace.video()
    camera = read_camera(workspace.camera_file)
    return f"Wrote {file}{write_calibration(file, camera, (video.width, video.height), file.stem)}."


def describe_camera(camera: CourtCamera) -> list[str]:
    """Where the camera stands, how surely, and in which frames it was found."""
    seen = np.flatnonzero(camera.found)
    x, y, z = camera.centre[seen].mean(axis=0)
    sd = np.nanmax(camera.sd_centre, axis=0)
    focal, share = camera.focal[seen], float(np.nanmax(camera.sd_focal / camera.focal))
    side = "right" if x > 0 else "left"
    lengths = f"{focal.min():.0f}" if np.ptp(focal) < 1 else f"{focal.min():.0f}-{focal.max():.0f}"
    lines = [
        f"Court found in {camera.found.mean():.1%} of {len(camera.found)} frames. The camera "
        f"stands {-y:.1f} m from the net, {abs(x):.1f} m to the {side} of its middle and {z:.1f} m "
        f"high (standard deviations {sd[1]:.2f}, {sd[0]:.2f} and {sd[2]:.2f} m); focal length "
        f"{lengths} px within {share:.1%}."
    ]
    if not camera.found.all():
        lost = np.flatnonzero(np.diff(np.concatenate([[True], camera.found, [True]]).astype(int)))
        stretches = [f"{a}-{b - 1}" for a, b in zip(lost[::2], lost[1::2], strict=True)]
        more = f" and {len(stretches) - 6} more" if len(stretches) > 6 else ""
        lines.append(f"No court seen in frames {', '.join(stretches[:6])}{more}.")
    return lines
