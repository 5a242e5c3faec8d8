"""Commands that begin with motion capture."""

from pathlib import Path
from typing import Annotated

from tyro.conf import OmitArgPrefixes, UseAppendAction, arg

from keyrecon.app import depth_training as depth_job
from keyrecon.app.console import show
from keyrecon.commands.arguments import Files
from keyrecon.lifting.priors.depth_training import DepthTrainingOptions
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
