"""`keyrecon court`: the camera of every frame from the tennis court in the picture."""

from collections.abc import Collection, Sequence
from dataclasses import asdict

import numpy as np
from jaxtyping import Bool

from keyrecon.app.placing import outdated_report_lines, place_stored_motion, touch_after
from keyrecon.errors import KeyreconError, quoted
from keyrecon.io.durable import put_aside
from keyrecon.io.formats.camera_file import read_camera, write_camera
from keyrecon.io.formats.court_points import merge_clicks
from keyrecon.io.option_tables import changed_options, check_options
from keyrecon.io.video import Video
from keyrecon.io.workspace import COURT, Workspace
from keyrecon.pipeline import Options
from keyrecon.progress import Progress
from keyrecon.records import Shots
from keyrecon.report.court_drawing import draw_court, write_court_picture
from keyrecon.tracking.camera_motion import estimate_camera_motion
from keyrecon.world.calibration import CalibrationOptions, calibrate_court
from keyrecon.world.clicked_points import ContradictoryClicks, check_click
from keyrecon.world.court import CourtOptions, tennis_court
from keyrecon.world.records import GROUND, CourtClick, WorldCamera


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
    typed: Collection[str] = (),
) -> str:
    """Find the court, write camera.npz and court.jpg; returns the text to show.

    `typed` options, by dotted names, count also where their value is the default.
    The project keeps the clicks, with those of former calls; `forget` names points (or "all") whose
    clicks are taken out first. New clicks that contradict the rest are not kept. Where no court is
    found without clicks that were taken out, the camera of before is set aside.
    """
    check_options(options.court, "--")
    options = workspace.options(options, CalibrationOptions(), COURT, typed)
    widths = _unusual_widths(options.court)
    video = workspace.video()
    dropped = _forgotten(workspace.court_clicks(), forget)
    kept = [click for click in workspace.court_clicks() if click not in dropped]
    for click in clicks:
        check_click(click, len(video), (video.width, video.height))
    together = merge_clicks(kept, clicks)
    try:
        with workspace.remembering(options, CalibrationOptions(), COURT):
            camera, cuts = _find_camera(workspace, video, together, options, progress)
    except ContradictoryClicks as fault:
        raise KeyreconError(f"{fault}{_former_input_note(clicks, kept)}") from fault
    except KeyreconError as fault:
        workspace.change_court_clicks(clicks, dropped)
        aside = _set_aside_camera(workspace) if dropped or _lost_all_clicks(workspace) else ""
        painted = f" Looked for with {widths}." if widths else ""
        raise KeyreconError(f"{fault}{_click_count_note(together)}{painted}{aside}") from fault
    workspace.change_court_clicks(clicks, dropped)
    write_camera(workspace.camera_file, camera)
    if workspace.court_clicks() != together:
        touch_after(workspace.court_points_file, workspace.camera_file)
    seen = np.flatnonzero(camera.found)
    frame = int(seen[len(seen) // 2])
    drawn = draw_court(video.frame(frame), camera, frame, tennis_court(options.court))
    picture = workspace.folder / "court.jpg"
    write_court_picture(picture, drawn)
    placed = place_stored_motion(workspace)
    return "\n".join(
        [
            *describe_camera(camera, cuts),
            *_describe_cuts(cuts),
            *([f"project.toml remembers {widths}."] if widths else []),
            f"{workspace.camera_file}: the camera of every frame. {picture}: the court's lines "
            f"drawn on frame {frame}; look whether they lie on the painted ones. If not, keyrecon "
            f"court {quoted(workspace.folder)} --point NAME:FRAME:X,Y for four points or more.",
            *([f"By {len(together)} clicked points; they are kept."] if together else []),
            *placed.lines,
            *outdated_report_lines(workspace, placed),
        ]
    )


def _lost_all_clicks(workspace: Workspace) -> bool:
    """Whether the last click was taken away since the camera was found."""
    points, camera = workspace.court_points_file, workspace.camera_file
    if not (points.is_file() and camera.is_file()) or workspace.court_clicks():
        return False
    return points.stat().st_mtime_ns > camera.stat().st_mtime_ns


def _set_aside_camera(workspace: Workspace) -> str:
    """Take a court's camera out of the project, and the motion off the court; says so."""
    file = workspace.camera_file
    if not file.is_file() or read_camera(file).origin == GROUND:
        return ""
    copy = put_aside(file)
    file.unlink()
    lines = outdated_report_lines(workspace, place_stored_motion(workspace))
    return " ".join(
        [
            f" The camera that was found before was set aside as {copy.name}; nothing is placed on "
            "the court by it any more.",
            *lines,
        ]
    )


def _find_camera(
    workspace: Workspace,
    video: Video,
    clicks: tuple[CourtClick, ...],
    options: CalibrationOptions,
    progress: Progress,
) -> tuple[WorldCamera, tuple[int, ...]]:
    """The camera, and the frames with which other shots begin."""
    keep = workspace.stages.keep
    motion = workspace.options(Options(), Options()).camera
    path = keep("camera", estimate_camera_motion, video, options=motion, progress=progress)
    camera = keep("court", calibrate_court, video, path, clicks, options=options, progress=progress)
    return camera, path.cuts


def _forgotten(kept: Sequence[CourtClick], names: Sequence[str]) -> list[CourtClick]:
    """Clicks that are named by their points, or "all" of them."""
    known = {click.name for click in kept}
    if unknown := sorted(set(names) - known - {"all"}):
        there = f"it has {', '.join(sorted(known))}" if known else "it has none"
        raise KeyreconError(f"The project has no click on {unknown[0]} to forget; {there}.")
    return [click for click in kept if "all" in names or click.name in names]


def _unusual_widths(options: CourtOptions) -> str:
    """Widths of lines that are not the usual ones, as they are typed; empty where all are."""
    usual = asdict(CourtOptions())
    return " and ".join(
        f"--{name.replace('_', '-')} {value:g} (usual: {usual[name]:g})"
        for name, value in changed_options(options, CourtOptions()).items()
    )


def _former_input_note(new: Sequence[CourtClick], kept: Sequence[CourtClick]) -> str:
    """What becomes of clicks that contradict one another."""
    if not kept:
        return ""
    old = ", ".join(click.name for click in kept)
    return (
        f"{' The new clicks were not kept.' if new else ''} Clicks of former calls: {old}; "
        "--forget NAME takes one out, --forget all starts anew."
    )


def _click_count_note(clicks: Sequence[CourtClick]) -> str:
    names = ", ".join(click.name for click in clicks)
    return f" Clicked so far, and kept: {names}." if clicks else ""


def load_camera(workspace: Workspace) -> WorldCamera:
    """The project's camera."""
    if not workspace.camera_file.is_file():
        raise KeyreconError(
            f"{workspace.folder} has no camera yet; run: keyrecon court {quoted(workspace.folder)} "
            f"(where there is no court: keyrecon ground {quoted(workspace.folder)})"
        )
    return read_camera(workspace.camera_file)


def describe_camera(camera: WorldCamera, cuts: Sequence[int] = ()) -> list[str]:
    """Where the camera stands, how surely, and in which frames; other shots begin at `cuts`."""
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
    lost, shots = ~camera.found, Shots.between(tuple(cuts), len(camera.found)).parts
    aside = [k for k, shot in enumerate(shots) if shot.start in camera.elsewhere]
    for k in aside:
        lost[shots[k]] = False
    if lost.any():
        lines.append(f"No court seen in frames {_first_few(_stretches(lost))}.")
    if aside:
        named = [f"{k + 1} (frames {shots[k].start}-{shots[k].stop - 1})" for k in aside]
        one = len(named) == 1
        lines.append(
            f"Shot{'' if one else 's'} {_first_few(named)} show{'s' if one else ''} the court from "
            "another place than that camera's, and a project holds one place; points clicked in "
            "such a shot (--point) make that the place."
        )
    return lines


def _stretches(frames: Bool[np.ndarray, "T"]) -> list[str]:
    """First and last frames of unbroken stretches."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], frames, [False]]).astype(int)))
    ends = zip(edges[::2], edges[1::2] - 1, strict=True)
    return [f"{a}-{b}" if b > a else f"{a}" for a, b in ends]


def _describe_cuts(cuts: Sequence[int]) -> list[str]:
    """What becomes of a video with cuts; nothing of one without."""
    if not cuts:
        return []
    return [
        f"The picture is cut at frame {_first_few([str(cut) for cut in cuts])}: each shot was "
        "looked at by itself, and those that show the court from the same place have a camera."
    ]


def _first_few(words: Sequence[str]) -> str:
    return ", ".join(words[:6]) + (f" and {len(words) - 6} more" if len(words) > 6 else "")
