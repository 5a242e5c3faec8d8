"""`keyrecon golf compare`: two fitted swings side by side on one page."""

from pathlib import Path

from keyrecon.errors import KeyreconError
from keyrecon.golf.records import RecordedSwing
from keyrecon.io.formats.swing_file import read_swing
from keyrecon.io.video import Video
from keyrecon.io.workspace import Workspace
from keyrecon.progress import Progress, silent
from keyrecon.report.golf_compare import write_comparison


def compare(first: Path, second: Path, out: Path, progress: Progress = silent) -> str:
    """Write the page of the swings in two project folders; returns what to print.

    Raises KeyreconError where a folder holds no golf fit, or `out` would take a project's place.
    """
    if not out.parent.is_dir():
        raise KeyreconError(f"There is no folder {out.parent} to write {out.name} into; make it.")
    workspaces = [Workspace(folder) for folder in (first, second)]
    for workspace in workspaces:
        if out.exists() and any(kept.samefile(out) for kept in workspace.kept_files()):
            raise KeyreconError(
                f"{out} belongs to the project {workspace.folder}; name another file with --out."
            )
    (a, video_a), (b, video_b) = (_read(workspace) for workspace in workspaces)
    titles = _title(first, video_a), _title(second, video_b)
    write_comparison(out, (a, b), (video_a, video_b), titles, progress)
    doubtful = [str(w.folder) for w, s in zip(workspaces, (a, b), strict=True) if s.doubts]
    lines = [f"Wrote {out}."]
    if doubtful:
        lines.append(
            f"WARNING: doubtful fits ({', '.join(doubtful)}): the page shows no numbers, and why."
        )
    return "\n".join(lines)


def _title(folder: Path, video: Video) -> str:
    """Folder and video: either alone may be the same for both."""
    return f"{folder.resolve().name}: {video.path.name}"


def _read(workspace: Workspace) -> tuple[RecordedSwing, Video]:
    swing, video = read_swing(workspace.motion_file), workspace.video()
    if len(swing.motion.time) != len(video):
        raise KeyreconError(
            f"{workspace.motion_file} has {len(swing.motion.time)} frames, its video {len(video)}; "
            "fit again with: keyrecon golf fit"
        )
    return swing, video
