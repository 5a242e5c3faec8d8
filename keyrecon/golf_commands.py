"""The commands under `keyrecon golf`."""

from pathlib import Path
from typing import Annotated

from tyro.conf import OmitArgPrefixes, Positional, arg
from tyro.extras import SubcommandApp

from keyrecon import swings as mocap_swings
from keyrecon.console import show
from keyrecon.golf.train import TrainOptions

golf = SubcommandApp()


@golf.command(name="train")
def train_(
    swings: Positional[tuple[Path, ...]],
    out: Path = Path("prior.npz"),
    options: OmitArgPrefixes[Annotated[TrainOptions, arg(name="")]] = TrainOptions(),
) -> None:
    """Learn a swing prior from motion capture and print what it is worth.

    Prints the variance explained and the error of swings left out, for each number of components.

    Args:
        swings: .bvh, .amc (with its .asf) or .c3d files, or folders of them, one swing each.
        out: File to write.
    """
    print(mocap_swings.train(swings, out, options, show))
