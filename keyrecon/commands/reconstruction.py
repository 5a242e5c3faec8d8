"""The commands that take the options of every stage."""

import sys
from typing import Annotated, Literal

from tyro.conf import arg

from keyrecon.app.console import show
from keyrecon.commands.arguments import (
    MaybeHeight,
    MaybeNumber,
    MaybeWhole,
    MaybeWorkers,
    Project,
    Switch,
    body_height,
    typed_options,
)
from keyrecon.errors import KeyreconError
from keyrecon.io.option_tables import changed_options
from keyrecon.io.work_lock import lock_project
from keyrecon.io.workers import open_workers
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options, as_printed

Advanced = Annotated[Options, arg(name="")]


def keyframes(
    project: Project,
    budget: MaybeNumber = None,
    coverage: MaybeNumber = None,
    reach: MaybeWhole = None,
    method: Literal["best", "paper"] = "best",
    force: Switch = False,
    workers: MaybeWorkers = None,
    options: Advanced = Options(),
) -> None:
    """Find the player and choose the keyframes to mark.

    Writes keyframes.json and a picture of every keyframe to mark into keyframes/. The options of
    every stage are listed by `keyrecon keyframes --help-all`; few people ever need them.

    Shots and parts of the comparison are made side by side, by as many processes as there are cores
    or by --workers, with the same results to the last digit. Workers of a Dask cluster need the
    same version of keyrecon, and must see the project's folder and the video under the same paths,
    on a drive that all machines share.

    Args:
        project: Project folder.
        budget: Share of frames that you will mark (default: as many as needed, at most 1.5 %; up
            to 6 % of short videos). Frames that are marked already come on top, unless they
            stand for one that would be asked for.
        coverage: Share of frames that the keyframes must stand for (default: 0.95).
        reach: Longest gap to interpolate, in frames at 50 frames a second (default: 10).
        method: 'paper' does it as printed, for `keyrecon run --method paper`.
        force: Make every stage again.
        workers: Number of processes here, or address of a Dask scheduler, such as tcp://head:8786.
    """
    from keyrecon.app import keyframing  # each command reads what it needs itself

    printed = _is_printed(method, options)
    chosen = keyframing.KeyframeSettings(budget, coverage, reach)
    with lock_project(project, "keyrecon keyframes"), open_workers(workers) as made_by:
        workspace = Workspace(project, force, made_by)
        typed = typed_options(sys.argv)
        print(keyframing.find_keyframes(workspace, options, chosen, show, printed, typed))


def run(
    project: Project,
    height: MaybeHeight = None,
    fov: MaybeNumber = None,
    method: Literal["best", "paper"] = "best",
    partial: Switch = False,
    force: Switch = False,
    workers: MaybeWorkers = None,
    options: Advanced = Options(),
) -> None:
    """Carry the marked joints to every frame, lift them to 3D and refine the motion.

    Writes motion.npz and report.html. An interrupted run goes on where it stopped. The options of
    every stage are listed by `keyrecon run --help-all`; few people ever need them.

    Shots and parts of the comparison are made side by side, by as many processes as there are cores
    or by --workers, with the same results to the last digit. Workers of a Dask cluster need the
    same version of keyrecon, and must see the project's folder and the video under the same paths,
    on a drive that all machines share.

    Args:
        project: Project folder.
        height: The player's height, such as 1.80 or 180; without it lengths are in body heights.
        fov: Angle across the width of the picture, degrees: who is filmed from near comes out
            better with it. Phones have 60 to 75, held upright 35 to 45.
        method: 'paper' uses the forms printed in the paper.
        partial: Go on although keyframes are not marked yet.
        force: Make every stage again.
        workers: Number of processes here, or address of a Dask scheduler, such as tcp://head:8786.
    """
    from keyrecon.app import running  # and all that draws the report

    printed = _is_printed(method, options)
    with lock_project(project, "keyrecon run"), open_workers(workers) as made_by:
        workspace = Workspace(project, force, made_by)
        metres = None if height is None else body_height(height)
        chosen = running.run_options(workspace, options, metres, typed_options(sys.argv), fov)
        print(running.run(workspace, chosen, show, partial, printed=printed))


def _is_printed(method: Literal["best", "paper"], typed: Options) -> bool:
    """Whether the forms of the paper are asked for; not together with what they replace."""
    if method != "paper":
        return False
    if typed.prior == "golf":
        raise KeyreconError(
            "--prior golf puts a model's swing where --method paper interpolates between keyframes "
            "(Section 6.1); leave out one of the two."
        )
    names = typed_options(sys.argv)
    for name, value in changed_options(typed, as_printed(typed)).items():
        if name in names:
            flag = name.replace("_", "-")
            raise KeyreconError(
                f"--{flag} {value} is not what --method paper takes (the printed form has another "
                "in its place); leave out one of the two."
            )
    return True
