"""The command that calibrates the camera on a tennis court."""

import sys
from typing import Annotated

from tyro.conf import OmitArgPrefixes, UseAppendAction, arg

from keyrecon.app.console import show
from keyrecon.app.court import calibrate, court_click
from keyrecon.commands.arguments import Project, Switch, typed_options
from keyrecon.io.work_lock import lock_project
from keyrecon.io.workspace import Workspace
from keyrecon.world.calibration import CalibrationOptions


def court(
    project: Project,
    point: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME:FRAME:X,Y")] = (),
    forget: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME")] = (),
    force: Switch = False,
    options: OmitArgPrefixes[Annotated[CalibrationOptions, arg(name="")]] = CalibrationOptions(),
) -> None:
    """Find the tennis court in the picture, and with it the camera of every frame.

    Writes camera.npz, and court.jpg with the court's lines drawn on a frame. Where the lines alone
    do not tell, click four points of the court or more, in one call or in several: the project
    keeps them. For example:

        keyrecon court rally --point near-left:0:212,640 --point net-middle:0:655,301 ...

    Args:
        project: Project folder.
        point: A point of the court by name, the frame, and where it is in the picture.
        forget: Take the clicks on this point out of the project; "all" takes all of them.
        force: Look for the court again.
    """
    clicks = [court_click(text) for text in point]
    typed = {f"court.{name}" for name in typed_options(sys.argv)}
    with lock_project(project, "keyrecon court"):
        print(calibrate(Workspace(project, force), clicks, options, show, forget, typed))
