"""`keyrecon export`: a project's motion in other programs' formats, told by suffix.

All files are looked at before the first is written, and none may be one that the project or its
owner needs: `keyrecon export rally rally/annotations.json` must not put a computed motion in the
place of what a person marked, nor an overlay in the place of the video it is drawn on.
"""

from collections.abc import Sequence
from pathlib import Path

from keyrecon.app.project import load_motion
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.export import check_suffix, export_motion
from keyrecon.io.workspace import Workspace
from keyrecon.progress import Progress
from keyrecon.records import Motion
from keyrecon.report.overlay import write_overlay

OVERLAY = ".mp4"
WITH_VIDEO = (OVERLAY, ".json")
"""Suffixes of files that need the video: its pictures, or their size."""


def export(workspace: Workspace, files: Sequence[Path], progress: Progress) -> list[str]:
    """Write the motion in other formats; returns a line for each file."""
    if not files:
        raise KeyreconError("No file was named; give one or more, such as motion.bvh motion.trc.")
    for file in files:
        check_suffix(file, (OVERLAY,))
        _check_place(file, workspace)
    motion = load_motion(workspace.folder)
    return [_write(file, motion, workspace, progress) for file in files]


def _check_place(file: Path, workspace: Workspace) -> None:
    if not file.parent.is_dir():
        raise KeyreconError(f"There is no folder {file.parent} to write {file.name} into; make it.")
    if file.exists() and any(kept.samefile(file) for kept in workspace.kept_files()):
        raise KeyreconError(
            f"{file} belongs to the project and would be lost; export to another name or folder."
        )


def _write(file: Path, motion: Motion, workspace: Workspace, progress: Progress) -> str:
    suffix = file.suffix.lower()
    video = workspace.video() if suffix in WITH_VIDEO else None
    if video is not None and suffix == OVERLAY:
        write_overlay(file, video, motion, progress)
    else:
        export_motion(file, motion, (video.width, video.height) if video else None)
    return f"Wrote {file}."
