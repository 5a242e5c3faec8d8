"""The command that writes files for other programs."""

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from keyrecon.app.console import show
from keyrecon.app.exporting import export as export_files
from keyrecon.io.workspace import Workspace
from keyrecon.report.overlay import OverlayOptions


def export(
    project: Positional[Path],
    files: Positional[tuple[Path, ...]],
    frames: Annotated[str | None, arg(metavar="A-B")] = None,
    overlay: Annotated[OverlayOptions, arg(name="")] = OverlayOptions(),
) -> None:
    """Write the motion in other formats, told by suffix.

    .bvh .trc .c3d .csv .nc .npz .glb, .json (COCO keypoints of every frame), .mp4 (overlay),
    .toml (the camera of keyrecon court, as Pose2Sim reads it).

    Args:
        project: Project folder.
        files: Files to write.
        frames: First and last frame to write; all by default.
        overlay: How the overlay video shows the motion.
    """
    for line in export_files(Workspace(project), files, show, frames, overlay):
        print(line)
