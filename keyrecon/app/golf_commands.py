"""The commands under `keyrecon golf`."""

from pathlib import Path
from typing import Annotated

from tyro.conf import OmitArgPrefixes, Positional, arg
from tyro.extras import SubcommandApp

from keyrecon.app import golf as golf_job
from keyrecon.app import golf_training as mocap_swings
from keyrecon.app.console import show
from keyrecon.golf.prior.training import TrainOptions
from keyrecon.golf.swing_fit import GolfOptions
from keyrecon.io.formats.model_file import BUILT_IN_SWING_PRIOR

golf = SubcommandApp()


@golf.command(name="train")
def train_(
    swings: Positional[tuple[Path, ...]],
    out: Path = Path("prior.npz"),
    options: OmitArgPrefixes[Annotated[TrainOptions, arg(name="")]] = TrainOptions(),
) -> None:
    """Learn a swing prior from motion capture and print what it is worth.

    Prints the variance explained and the cross-validation error, for each number of components.

    Args:
        swings: .bvh, .amc (with its .asf) or .c3d files, or folders of them, one swing each.
        out: File to write.
    """
    print(mocap_swings.train(swings, out, options, show))


@golf.command
def fit(
    video: Positional[Path],
    clicks: Path,
    out: Path = Path("swing"),
    prior: Path = BUILT_IN_SWING_PRIOR,
    slowmo: float = 1.0,
    force: bool = False,
    options: Annotated[GolfOptions, arg(name="")] = GolfOptions(),
) -> None:
    """Fit the swing prior to a video filmed by one camera that stands still.

    Makes the project folder OUT and writes motion.npz, overlay.mp4 and report.html into it. An
    interrupted fit goes on where it stopped, and `keyrecon export OUT` writes other formats.

    Args:
        video: A whole swing, from the address to the finish.
        clicks: JSON file with a few joints clicked in one frame, and the player's height.
        out: Project folder; made if need be.
        prior: A swing prior of `keyrecon golf train`.
        slowmo: How many times slower than life the video plays (240 fps shown at 30: 8).
        force: Make every stage again.
        options: How the video is observed and the prior fitted.
    """
    print(golf_job.fit_file(video, clicks, out, prior, slowmo, force, options, show))
