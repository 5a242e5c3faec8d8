"""The command line: one function per command, a thin skin over the library.

Exit codes: 0 success, 1 with one line on stderr for what a user can mend, 2 for bad usage,
130 when interrupted (finished stages are kept, the same command goes on from there).
"""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import tyro
from tyro.conf import OmitArgPrefixes, Positional, UseAppendAction, arg

from keyrecon.app import demo as demonstration
from keyrecon.app import depth_training as depth_job
from keyrecon.app import keyframing
from keyrecon.app import project as work
from keyrecon.app.annotator import serve_annotator
from keyrecon.app.console import show
from keyrecon.app.exporting import export as export_files
from keyrecon.app.golf_commands import golf
from keyrecon.app.golf_demo import run_golf_demo
from keyrecon.errors import KeyreconError
from keyrecon.io.workspace import Workspace
from keyrecon.lifting.priors.depth_model import DepthTrainingOptions
from keyrecon.pipeline import Options
from keyrecon.records import Pick
from keyrecon.report.overlay import OverlayOptions
from keyrecon.synthetic.sequence import SynthOptions, synthesize

Advanced = Annotated[Options, arg(name="")]
Points = Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="X,Y")]
Regions = Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME:X,Y")]

app = tyro.extras.SubcommandApp()


@app.command
def demo(name: Positional[Literal["tennis", "golf"]] = "tennis", out: Path = Path("demo")) -> None:
    """Run the whole job on the built-in synthetic sequence and print its accuracy.

    Tennis renders 36 s whose truth is known, finds the player, chooses keyframes, takes the marks
    kept in annotations/, reconstructs the motion and writes OUT/project/report.html. Golf renders
    a swing and fits the swing prior to it from six clicks. Needs no network and no display.

    Args:
        name: Which sequence.
        out: Folder for the video, the project and the report.
    """
    if name == "golf":
        run_golf_demo(out, show, print)
    else:
        demonstration.run_demo(name, out, show, print)


@app.command
def new(
    video: Positional[Path],
    project: Path,
    start: int = 0,
    end: int | None = None,
    slowmo: float = 1.0,
    skeleton: Path | None = None,
) -> None:
    """Start a project for a video.

    The project remembers the video by relative path and fingerprint; the video is not copied.

    Args:
        video: An mp4, mov, mkv or avi file.
        project: Folder to make.
        start: First frame to use.
        end: Frame after the last one to use.
        slowmo: How many times slower than life the video plays (240 fps shown at 30: 8).
        skeleton: A JSON file with joints and bones of your own.
    """
    print(work.start(video, project, (start, end), slowmo, skeleton))


@app.command
def pick(
    project: Positional[Path],
    frame: int,
    head: Points = (),
    foot: Points = (),
    region: Regions = (),
) -> None:
    """Click colours of the player: head, feet, clothing, skin.

    Adds to the picks there are; several frames make the colours surer. Give both feet and each
    part of the clothing, for example:

        keyrecon pick rally --frame 0 --head 640,210 --foot 610,540 --region shirt:640,290

    Args:
        project: Project folder.
        frame: Frame number the clicks are on, counted from 0.
        head: A point on the head.
        foot: A point on a shoe; give it twice for both.
        region: A point on a region of one colour, with the region's name.
    """
    picks = [Pick(frame, "head", *work.point(p, "--head")) for p in head]
    picks += [Pick(frame, "foot", *work.point(p, "--foot")) for p in foot]
    picks += [work.region_pick(frame, text) for text in region]
    print(work.add_picks(Workspace(project), picks))


@app.command
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
            (default 0.015 from half a minute on; a shorter video takes as many as half a minute,
            up to 0.06).
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


@app.command
def annotate(
    project: Positional[Path],
    port: int = 0,
    host: str = "127.0.0.1",
    browser: bool = True,
) -> None:
    """Open the page on which a person picks colours and marks the keyframes.

    The page runs on this machine and needs no network. Every edit is kept at once. Stop the
    command with Ctrl+C.

    Args:
        project: Project folder.
        port: Port of the address; any free one by default.
        host: Address to listen on; any other than this machine's own lets others in.
        browser: Open the address; --no-browser only prints it.
    """
    say = partial(print, flush=True)  # whoever starts this from a script waits for the address
    serve_annotator(Workspace(project), host, port, browser, say)


@app.command(name="import")
def import_(project: Positional[Path], file: Positional[Path], replace: bool = False) -> None:
    """Take joints from a COCO keypoints JSON, DeepLabCut CSV or CVAT XML file.

    Adds to the annotations there are; marks that differ from those in the project are refused
    unless --replace is given, and then the old file is kept beside the new one.

    Args:
        project: Project folder.
        file: The file; its kind is told by its content.
        replace: Let marks from the file replace different ones in the project.
    """
    print(work.import_annotations(Workspace(project), file, replace))


@app.command
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
    chosen = work.settings(workspace, options, height)
    print(work.run(workspace, chosen, show, partial, printed=method == "paper"))


@app.command
def export(
    project: Positional[Path],
    files: Positional[tuple[Path, ...]],
    frames: Annotated[str | None, arg(metavar="A-B")] = None,
    overlay: Annotated[OverlayOptions, arg(name="")] = OverlayOptions(),
) -> None:
    """Write the motion in other formats, told by suffix.

    .bvh .trc .c3d .csv .nc .npz .glb, .json (COCO keypoints of every frame), .mp4 (overlay).

    Args:
        project: Project folder.
        files: Files to write.
        frames: First and last frame to write; all by default.
        overlay: How the overlay video shows the motion.
    """
    for line in export_files(Workspace(project), files, show, frames, overlay):
        print(line)


@app.command
def evaluate(motion: Positional[Path], truth: Path) -> None:
    """Print the accuracy of a motion against a known truth.

    Args:
        motion: Project folder or motion.npz.
        truth: truth.npz with points3d, points2d, joint_names and fps.
    """
    print(work.evaluate(motion, truth))


@app.command
def synth(
    out: Path,
    mocap: UseAppendAction[tuple[Path, ...]] = (),
    options: OmitArgPrefixes[Annotated[SynthOptions, arg(name="")]] = SynthOptions(),
) -> None:
    """Render a sequence whose truth is known, from motion capture or built-in tennis.

    Args:
        out: Folder for video.mp4, truth.npz, picks.json and scene.json.
        mocap: A .bvh, .amc (with its .asf) or .c3d file; repeat to join several.
    """
    synthesize(out, mocap, options, show)
    print(f"Wrote {out}/video.mp4, truth.npz and picks.json.")


@app.command
def relink(project: Positional[Path], video: Positional[Path]) -> None:
    """Tell a project where its video has moved to.

    Args:
        project: Project folder.
        video: The same video in its new place.
    """
    Workspace(project).relink(video)
    print(f"{project} now uses {video}.")


@app.command
def depths(
    captures: Positional[tuple[Path, ...]],
    out: Path = Path("depths.npz"),
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


app.command(golf, name="golf", help="A model of whole golf swings: train it, fit it to a video.")


def main() -> None:
    """Run the command line."""
    try:
        app.cli(
            prog="keyrecon",
            description="3D motion of an athlete from one ordinary camera and a few keyframes.",
        )
    except KeyreconError as fault:
        sys.stderr.write(f"keyrecon: {fault}\n")
        sys.exit(1)
    except KeyboardInterrupt:
        sys.stderr.write("\nkeyrecon: stopped; finished stages are kept, run it again to go on.\n")
        sys.exit(130)


if __name__ == "__main__":
    main()
