"""`keyrecon export`: a project's motion in other programs' formats, told by suffix.

All files are looked at before the first is written, and none may be one that the project or its
owner needs: `keyrecon export rally rally/annotations.json` must not put a computed motion in the
place of what a person marked, nor an overlay in the place of the video it is drawn on. The same
holds for other projects, and for marks and tables in any folder that no export has written.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from keyrecon.app.court import load_camera
from keyrecon.app.project import load_whole_motion
from keyrecon.errors import KeyreconError, counted, quoted
from keyrecon.io.formats.camera_file import write_calibration
from keyrecon.io.formats.coco import is_coco_motion
from keyrecon.io.formats.conventions import NO_MOTION
from keyrecon.io.formats.export import check_packages, check_suffix, export_motion
from keyrecon.io.formats.motion_file import (
    cut_further_arrays,
    motion_on_court,
    read_motion,
)
from keyrecon.io.project_folder import another_projects_file
from keyrecon.io.video_writer import comment_of
from keyrecon.io.workspace import Workspace
from keyrecon.progress import Progress
from keyrecon.records import Motion
from keyrecon.report.overlay import (
    OVERLAY_COMMENT,
    OverlayOptions,
    check_overlay,
    write_overlay,
)
from keyrecon.timeline import cut_motion
from keyrecon.world.placement import stature_change

OVERLAY, CALIBRATION = ".mp4", ".toml"
WITH_VIDEO = (OVERLAY, ".json")
"""Suffixes of files that need the video: its pictures, or their size."""
SIGN = b"# keyrecon "
"""Tables and calibrations that were exported begin with it."""


def export(
    workspace: Workspace,
    files: Sequence[Path],
    progress: Progress,
    frames: str | None = None,
    overlay: OverlayOptions = OverlayOptions(),
) -> list[str]:
    """Write the motion in other formats; returns a line for each file.

    `frames` are the first and the last to be written, "A-B"; `overlay` is for the video alone.
    """
    if not files:
        raise KeyreconError("No file was named; give one or more, such as motion.bvh motion.trc.")
    for file in files:
        check_suffix(file, (OVERLAY, CALIBRATION))
        check_packages(file)
        _check_place(file, workspace)
    check_overlay(overlay)
    if overlay != OverlayOptions() and not any(f.suffix.lower() == OVERLAY for f in files):
        raise KeyreconError(
            "--view, --skeleton, --slowmo, --size and --no-court are for the overlay video; name "
            "an .mp4 file, or leave them out."
        )
    cameras = [file for file in files if file.suffix.lower() == CALIBRATION]
    motions = [file for file in files if file not in cameras]
    chosen = _read_motion(workspace, frames) if motions else None
    motion = _motion_of_camera(workspace, chosen) if cameras else None
    lines = [_write_calibration(file, workspace, motion, frames) for file in cameras]
    if chosen is None:
        return lines
    for file in motions:
        if file.suffix.lower() == OVERLAY:
            lines.append(_write_overlay(file, chosen, workspace, progress, overlay))
        else:
            lines.append(_write(file, chosen, workspace))
    return lines + _describe_growth(workspace, len(chosen.motion.time))


def _describe_growth(workspace: Workspace, frames: int) -> list[str]:
    """That the video has more frames than the motion; a video that is gone tells nothing."""
    try:
        now = len(workspace.video())
    except KeyreconError:
        return []
    if now == frames:
        return []
    return [
        f"The motion is of the first {counted(frames, 'frame')}, and the video has {now} by now: "
        f"make it anew: keyrecon run {quoted(workspace.folder)}"
    ]


@dataclass(frozen=True, eq=False)
class _ChosenMotion:
    """The motion of all frames, what else its file holds, and which frames are written."""

    motion: Motion
    further: Mapping[str, np.ndarray]
    frames: tuple[int, int] | None
    """First and last; None where none were named."""


def _read_motion(workspace: Workspace, frames: str | None) -> _ChosenMotion:
    """All that is written, read at once: a run that ends meanwhile puts another in its place."""
    motion, further = load_whole_motion(workspace.folder)
    chosen = None if frames is None else chosen_frames(frames, len(motion.time))
    if chosen is not None and not motion.known[chosen[0] : chosen[1] + 1].any():
        raise KeyreconError(NO_MOTION)
    return _ChosenMotion(motion, further, chosen)


def chosen_frames(text: str, count: int, whose: str = "the motion") -> tuple[int, int]:
    """First and last frame of "A-B", of `count` frames."""
    match = re.fullmatch(r"\s*(\d+)\s*-\s*(\d+)\s*", text)
    if not match:
        raise KeyreconError(
            f"--frames takes the first and the last, such as 120-180; got '{text}'."
        )
    first, last = int(match[1]), int(match[2])
    if not first <= last < count:
        raise KeyreconError(
            f"--frames {text} cannot be: {whose} has frames 0 to {count - 1}, and the first "
            "comes before the last."
        )
    return first, last


def _check_place(file: Path, workspace: Workspace) -> None:
    if not file.parent.is_dir():
        raise KeyreconError(f"There is no folder {file.parent} to write {file.name} into; make it.")
    others = another_projects_file(file) and not file.parent.samefile(workspace.folder)
    kept = workspace.is_kept(file) and not _is_export(file, workspace)
    if others or kept or workspace.reserves(file):
        owner = f"the project in {file.parent}" if others else "the project"
        raise KeyreconError(
            f"{file} belongs to {owner} and would be lost; export to another name or folder."
        )
    if file.is_file() and not _is_export(file, workspace):
        raise KeyreconError(
            f"{file} is there already and no export has written it; delete it or choose another "
            "name."
        )


def _is_export(file: Path, workspace: Workspace) -> bool:
    """Whether a file that is there holds nothing, or what an export has written.

    Of what people write by hand, mark or film: whatever has another suffix is taken for a result.
    Overlays of former versions do not say that they are; those in the folder of exports are.
    """
    suffix = file.suffix.lower()
    if suffix not in (".json", ".csv", CALIBRATION, OVERLAY) or file.stat().st_size == 0:
        return True
    if suffix == OVERLAY:
        in_exports = file.parent.resolve() == workspace.exports.resolve()
        return in_exports or comment_of(file) == OVERLAY_COMMENT
    if suffix == ".json":
        return is_coco_motion(file)
    with file.open("rb") as opened:
        return opened.read(len(SIGN)) == SIGN


def _write(file: Path, chosen: _ChosenMotion, workspace: Workspace) -> str:
    video = workspace.video() if file.suffix.lower() in WITH_VIDEO else None
    size = (video.width, video.height) if video else None
    first, last = chosen.frames or (0, len(chosen.motion.time) - 1)
    motion = cut_motion(chosen.motion, slice(first, last + 1))
    further = cut_further_arrays(chosen.further, first, last)
    return f"Wrote {file}: {export_motion(file, motion, size, first, further)}."


def _write_overlay(
    file: Path,
    chosen: _ChosenMotion,
    workspace: Workspace,
    progress: Progress,
    overlay: OverlayOptions,
) -> str:
    court = motion_on_court(chosen.further, workspace.motion_file)
    video, club = workspace.video(), chosen.further.get("club2d")
    write_overlay(file, video, chosen.motion, progress, overlay, chosen.frames, court, club)
    return f"Wrote {file}."


def _motion_of_camera(workspace: Workspace, chosen: _ChosenMotion | None) -> Motion | None:
    """The motion whose metres a camera is to have: the one that is written beside it, else the
    project's; None where there is none."""
    if chosen is not None:
        return chosen.motion
    return read_motion(workspace.motion_file) if workspace.motion_file.is_file() else None


def _write_calibration(
    file: Path, workspace: Workspace, motion: Motion | None, frames: str | None
) -> str:
    """The camera as Pose2Sim reads it, in the metres of the motion."""
    camera, video = load_camera(workspace), workspace.video()
    chosen = None if frames is None else chosen_frames(frames, len(camera.found), "camera.npz")
    change = 1.0 if motion is None else stature_change(motion, camera)
    camera = camera.scaled(change)
    done = write_calibration(file, camera, (video.width, video.height), file.stem, chosen)
    if change != 1:
        done += f"; scaled with the player, who is {camera.stature:.2f} m tall now"
    return f"Wrote {file}{done}."
