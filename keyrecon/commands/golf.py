"""A model of whole golf swings: train it, fit it to a video.

Only what a person would set is an option here; how a video is observed and a prior fitted stands in
the options records of the stages, for programs, with the evidence for each value.
"""

from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import arg

from keyrecon.app import golf as golf_job
from keyrecon.app import golf_comparing
from keyrecon.app import golf_training as mocap_swings
from keyrecon.app.console import show
from keyrecon.commands.arguments import (
    Files,
    MaybeFile,
    MaybeNumber,
    MaybeWhole,
    Project,
    Switch,
    VideoFile,
)
from keyrecon.golf.prior.training import TrainOptions
from keyrecon.golf.prior.variation import VariationOptions


def train(
    swings: Files,
    out: Annotated[Path, arg(metavar="FILE")] = Path("prior.npz"),
    components: int = TrainOptions().components,
    variations: int = VariationOptions().count,
    seed: int = VariationOptions().seed,
) -> None:
    """Learn a swing prior from motion capture and print what it is worth.

    Prints the variance explained and the cross-validation error, for each number of components.

    Args:
        swings: .bvh, .amc (with its .asf) or .c3d files, or folders of them, one swing each.
        out: File to write.
        components: Components kept at most; a fit may use fewer still.
        variations: Plausible variations that join each capture; 0 for captures alone.
        seed: Number from which the variations are drawn; another one gives others.
    """
    options = TrainOptions(components, VariationOptions(variations, seed))
    print(mocap_swings.train(swings, out, options, show))


def fit(
    video: VideoFile,
    clicks: MaybeFile = None,
    out: Annotated[Path, arg(metavar="FOLDER")] = Path("swing"),
    prior: MaybeFile = None,
    slowmo: MaybeNumber = None,
    method: Annotated[
        Literal["swing", "windows"] | None, arg(metavar="{swing,windows}", help_behavior_hint="")
    ] = None,
    components: MaybeWhole = None,
    force: Switch = False,
) -> None:
    """Fit the swing prior to a video of one swing, filmed from one place.

    Makes the project folder OUT and writes report.html, golf.csv, overlay.mp4 and motion.npz into
    it. An interrupted fit goes on where it stopped, `keyrecon export OUT` writes other formats,
    `keyrecon golf compare A B` sets two swings side by side.

    Without CLICKS those count that were made on the page, `keyrecon annotate OUT`: there a fit is
    also looked at, put right and made again. The project keeps prior, method and components, which
    count until others are told. CLICKS is a small JSON file: six joints of the player in one frame,
    best at the address.

        {"keyrecon_golf_clicks": 1, "frame": 0, "size": [1280, 720],
         "stature": 1.80, "left_handed": false,
         "joints": {"head_top": [640, 180], "root": [640, 400],
                    "right_knee": [600, 510], "left_knee": [680, 510],
                    "right_ankle": [590, 620], "left_ankle": [690, 620]}}

    "size" is that of the video, "root" lies between the hips, "right_" is the player's own right
    (on the left of a picture from the front). "stature" in metres may be left out.

    Args:
        video: A whole swing, from the address to the finish.
        clicks: JSON file with a few joints clicked in one frame; without it those of the project.
        out: Project folder; made if need be.
        prior: A swing prior of `keyrecon golf train`, or the one that is built-in (default).
        slowmo: How many times slower than life the video plays (240 fps at 30: 8); found without.
        method: 'swing' (default) fits all frames at once, 'windows' slides over three as the paper.
        components: Components of the prior used at most (default: 40); fewer keep nearer its mean.
        force: Make every stage again.
    """
    settings = golf_job.GolfSettings(method, components, prior)
    print(golf_job.fit_file(video, clicks, out, slowmo, force, progress=show, settings=settings))


def compare(
    first: Project,
    second: Project,
    out: Annotated[Path, arg(metavar="FILE")] = Path("compare.html"),
) -> None:
    """Two fitted swings side by side, aligned at address, top, hit and finish.

    Args:
        first: Project folder of a golf fit.
        second: Another one.
        out: HTML file to write.
    """
    print(golf_comparing.compare(first, second, out, show))
