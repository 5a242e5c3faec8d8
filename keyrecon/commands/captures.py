"""Commands that begin with motion capture."""

from pathlib import Path
from typing import Annotated

from tyro.conf import OmitArgPrefixes, UseAppendAction, arg

from keyrecon.app import depth_training as depth_job
from keyrecon.app import side_training as side_job
from keyrecon.app.console import show
from keyrecon.body_models.depth_training import DepthTrainingOptions
from keyrecon.body_models.side_training import SideTrainingOptions
from keyrecon.commands.arguments import Files
from keyrecon.synthetic.sequence import SynthOptions, synthesize


def synth(
    out: Annotated[Path, arg(metavar="FOLDER")],
    mocap: Annotated[UseAppendAction[tuple[Path, ...]], arg(metavar="FILE")] = (),
    options: OmitArgPrefixes[Annotated[SynthOptions, arg(name="")]] = SynthOptions(),
) -> None:
    """Render a sequence whose truth is known, from motion capture or built-in tennis.

    Args:
        out: Folder for video.mp4, truth.npz, picks.json and scene.json.
        mocap: A .bvh, .amc (with its .asf) or .c3d file; repeat to join; else built-in tennis.
    """
    synthesize(out, mocap, options, show)
    print(f"Wrote {out}/video.mp4, truth.npz and picks.json.")


def depths(
    captures: Files,
    out: Annotated[Path, arg(metavar="FILE")] = Path("depths.npz"),
    options: OmitArgPrefixes[
        Annotated[DepthTrainingOptions, arg(name="")]
    ] = DepthTrainingOptions(),
) -> None:
    """Learn from motion capture what depth bones usually have that look alike in a picture.

    It helps `keyrecon run` with the depth signs that nobody gave; a model comes with the program.
    To use another: keyrecon run PROJECT --depths FILE.

    Args:
        captures: .bvh, .amc (with its .asf) or .c3d files, or folders of them.
        out: File to write.
    """
    print(depth_job.learn(captures, out, options, show))


def sides(
    captures: Files,
    out: Annotated[Path, arg(metavar="FILE")] = Path("sides.npz"),
    options: OmitArgPrefixes[Annotated[SideTrainingOptions, arg(name="")]] = SideTrainingOptions(),
) -> None:
    """Learn from motion capture how left arms and right ones go with the rest of a body.

    It helps `keyrecon run` to keep them apart where they meet; a model comes with the program.
    To use another: keyrecon run PROJECT --sides FILE.

    Args:
        captures: .bvh, .amc (with its .asf) or .c3d files, or folders of them.
        out: File to write.
    """
    print(side_job.learn(captures, out, options, show))
