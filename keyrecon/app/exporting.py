"""`keyrecon export`: a project's motion in other programs' formats, told by suffix.

All files are looked at before the first is written, and none may be one that the project or its
owner needs: `keyrecon export rally rally/annotations.json` must not put a computed motion in the
place of what a person marked, nor an overlay in the place of the video it is drawn on.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from keyrecon.app.court import export_calibration
from keyrecon.app.project import load_motion
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.export import check_packages, check_suffix, export_motion
from keyrecon.io.formats.motion_file import (
    cut_further_arrays,
    read_further_arrays,
    read_on_court,
)
from keyrecon.io.workspace import Workspace
from keyrecon.progress import Progress
from keyrecon.records import Motion
from keyrecon.report.overlay import OverlayOptions, check_overlay, write_overlay
from keyrecon.timeline import cut_motion

OVERLAY, CALIBRATION = ".mp4", ".toml"
WITH_VIDEO = (OVERLAY, ".json")
"""Suffixes of files that need the video: its pictures, or their size."""


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
    done = [export_calibration(workspace, file) for file in cameras]
    if len(cameras) == len(files):
        return done
    motion = load_motion(workspace.folder)
    first, last = chosen_frames(frames, len(motion.time))
    cut = cut_motion(motion, slice(first, last + 1))
    further = cut_further_arrays(read_further_arrays(workspace.motion_file), first, last)
    lines = done
    for file in files:
        if file in cameras:
            continue
        if file.suffix.lower() == OVERLAY:
            shown = None if frames is None else (first, last)
            court = read_on_court(workspace.motion_file)
            club = read_further_arrays(workspace.motion_file).get("club2d")
            write_overlay(file, workspace.video(), motion, progress, overlay, shown, court, club)
            lines.append(f"Wrote {file}.")
        else:
            lines.append(_write(file, cut, workspace, first, further))
    return lines


def chosen_frames(text: str | None, count: int) -> tuple[int, int]:
    """First and last frame of "A-B"; all `count` of them where nothing is said."""
    if text is None:
        return 0, count - 1
    match = re.fullmatch(r"\s*(\d+)\s*-\s*(\d+)\s*", text)
    if not match:
        raise KeyreconError(
            f"--frames takes the first and the last, such as 120-180; got '{text}'."
        )
    first, last = int(match[1]), int(match[2])
    if not first <= last < count:
        raise KeyreconError(
            f"--frames {text} cannot be: the motion has frames 0 to {count - 1}, and the first "
            "comes before the last."
        )
    return first, last


def _check_place(file: Path, workspace: Workspace) -> None:
    if not file.parent.is_dir():
        raise KeyreconError(f"There is no folder {file.parent} to write {file.name} into; make it.")
    if workspace.needs(file):
        raise KeyreconError(
            f"{file} belongs to the project and would be lost; export to another name or folder."
        )


def _write(
    file: Path,
    motion: Motion,
    workspace: Workspace,
    first_frame: int,
    further: Mapping[str, np.ndarray],
) -> str:
    video = workspace.video() if file.suffix.lower() in WITH_VIDEO else None
    size = (video.width, video.height) if video else None
    return f"Wrote {file}: {export_motion(file, motion, size, first_frame, further)}."
