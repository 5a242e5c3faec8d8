"""The command that writes files for other programs."""

from typing import Annotated

from tyro.conf import arg

from keyrecon.app.console import show
from keyrecon.app.exporting import export as export_files
from keyrecon.commands.arguments import Files, Project
from keyrecon.io.workspace import Workspace
from keyrecon.report.overlay import OverlayOptions


def export(
    project: Project,
    files: Files,
    frames: Annotated[str | None, arg(metavar="A-B", help_behavior_hint="")] = None,
    overlay: Annotated[OverlayOptions, arg(name="")] = OverlayOptions(),
) -> None:
    """Write the motion in other formats, told by suffix.

    .bvh .trc .c3d .csv .nc .npz .glb, .json (COCO keypoints of every frame), .mp4 (overlay),
    .toml (the camera of keyrecon court or ground, as Pose2Sim reads it).

    Args:
        project: Project folder.
        files: One file or several; exports that are there are replaced.
        frames: First and last frame to write, such as 120-180; all by default.
        overlay: How the overlay video shows the motion.
    """
    for line in export_files(Workspace(project), files, show, frames, overlay):
        print(line)
