"""The command that calibrates the camera where there is no court."""

from typing import Annotated

from tyro.conf import UseAppendAction, arg

from keyrecon.commands.arguments import MaybeNumber, Project

ENDS = "FRAME:X,Y:X,Y[:METRES]"


def ground(
    project: Project,
    vertical: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar=ENDS)] = (),
    length: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="FRAME:X,Y:X,Y:METRES")] = (),
    horizon: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="FRAME:X,Y:X,Y")] = (),
    fov: MaybeNumber = None,
    forget: Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME")] = (),
) -> None:
    """Find camera and ground where there is no court, and put the motion on it.

    Writes camera.npz, and ground.jpg with squares of a metre on the ground. The player's own height
    as he walks about tells much of it; two upright things, the horizon or a known length tell more.
    The project keeps what is marked. For example:

        keyrecon ground swing --vertical 0:212,120:214,655 --vertical 0:1010,98:1006,640

    Args:
        project: Project folder, with a motion (keyrecon run).
        vertical: Both ends of an upright thing in a frame; with a length it stands on the ground.
        length: Both ends of a known length on the ground.
        horizon: Two points of the horizon.
        fov: Angle across the width of the picture, degrees.
        forget: Take a mark out of the project: vertical-2, fov; "all" takes all of them.
    """
    from keyrecon.app.console import show
    from keyrecon.app.ground import find_ground, ground_mark
    from keyrecon.io.work_lock import lock_project
    from keyrecon.io.workspace import Workspace
    from keyrecon.world.records import KINDS, GroundMarks

    typed = zip(KINDS, (vertical, length, horizon), strict=True)
    marks = tuple(ground_mark(kind, text) for kind, texts in typed for text in texts)
    with lock_project(project, "keyrecon ground"):
        print(find_ground(Workspace(project), GroundMarks(marks, fov), show, forget))
