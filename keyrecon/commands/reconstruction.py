"""The commands that take the options of every stage."""

from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from keyrecon.app import keyframing, running
from keyrecon.app.console import show
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options

Advanced = Annotated[Options, arg(name="")]


def keyframes(
    project: Positional[Path],
    budget: float | None = None,
    coverage: float | None = None,
    reach: int | None = None,
    method: Literal["best", "paper"] | None = None,
    force: bool = False,
    options: Advanced = Options(),
) -> None:
    """Find the player and choose the keyframes to annotate.

    Writes keyframes.json and a picture of every keyframe to annotate into keyframes/.

    Args:
        project: Project folder.
        budget: Share of frames that a person will mark; a half body is half a frame
            (default: what the coverage needs, as many as half a minute takes at least, and at
            most 0.015 from half a minute on, up to 0.06 in a shorter video).
        coverage: Share of frames that keyframes must stand for, alpha of Eq. 1 (default 0.95).
        reach: Longest gap to interpolate, T of Eq. 1, in frames at 50 fps (default 10).
        method: 'paper' tracks, compares and chooses as the paper prints it (Eq. 2-4), for
            keyrecon run --method paper; 'best' is ours (default).
        force: Make every stage again.
    """
    chosen = keyframing.KeyframeSettings(budget, coverage, reach)
    print(
        keyframing.find_keyframes(
            Workspace(project, force), options, chosen, show, method == "paper"
        )
    )


def run(
    project: Positional[Path],
    height: float | None = None,
    method: Literal["best", "paper"] | None = None,
    partial: bool = False,
    force: bool = False,
    options: Advanced = Options(),
) -> None:
    """Carry the annotated joints to every frame, lift them to 3D and refine the motion.

    Writes motion.npz and report.html. An interrupted run goes on where it stopped.

    Args:
        project: Project folder.
        height: The athlete's height in metres; without it lengths are in body heights.
        method: 'paper' uses the forms printed in the paper, 'best' ours (default).
        partial: Go on although keyframes are not annotated yet.
        force: Make every stage again.
    """
    workspace = Workspace(project, force)
    chosen = running.settings(workspace, options, height)
    print(running.run(workspace, chosen, show, partial, printed=method == "paper"))
