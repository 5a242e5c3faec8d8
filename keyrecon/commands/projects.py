"""Commands around a project folder; each imports what it does when it is called."""

from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, UseAppendAction, arg

from keyrecon.commands.arguments import (
    MaybeFile,
    MaybeNumber,
    MaybeWhole,
    Project,
    Switch,
    VideoFile,
)

Points = Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="X,Y")]
Regions = Annotated[UseAppendAction[tuple[str, ...]], arg(metavar="NAME:X,Y")]


def demo(
    name: Positional[Literal["tennis", "golf"]] = "tennis",
    out: Annotated[Path, arg(metavar="FOLDER")] = Path("demo"),
) -> None:
    """Run the whole job on the built-in synthetic sequence and print its accuracy.

    Tennis renders 36 s whose truth is known, finds the player, chooses keyframes, takes the marks
    kept in annotations/, reconstructs the motion and writes OUT/project/report.html. Golf renders
    a swing and fits the swing prior to it from six clicks. Needs no network and no display.

    Args:
        name: Which sequence.
        out: Folder for the video, the project and the report.
    """
    from keyrecon.app.console import show
    from keyrecon.io.work_lock import lock_folder

    with lock_folder(out, "keyrecon demo"):
        if name == "golf":
            from keyrecon.app.golf_demo import run_golf_demo

            run_golf_demo(out, show, print)
        else:
            from keyrecon.app.demo import run_demo

            run_demo(name, out, show, print)


def new(
    video: VideoFile,
    project: Annotated[Path, arg(metavar="FOLDER")],
    start: int = 0,
    end: MaybeWhole = None,
    slowmo: MaybeNumber = None,
    skeleton: MaybeFile = None,
    golf: Switch = False,
) -> None:
    """Start a project for a video.

    The project remembers the video by relative path and fingerprint; the video is not copied.

    Args:
        video: An mp4, mov, mkv or avi file.
        project: Folder to make.
        start: First frame to use.
        end: Frame after the last one to use; all to the end by default.
        slowmo: How many times slower than life the video plays (240 fps shown at 30: 8).
        skeleton: A JSON file with joints and bones of your own instead of the usual 14 joints.
        golf: The video shows a golf swing, which the page asks six clicks for.
    """
    from keyrecon.app.project import start as start_project

    print(start_project(video, project, (start, end), slowmo, skeleton, golf))


def pick(
    project: Project,
    frame: int,
    head: Points = (),
    foot: Points = (),
    region: Regions = (),
) -> None:
    """Click colours of the player: head, feet, clothing, skin.

    Adds to the picks there are; several frames make the colours surer. Give both feet and each
    part of the clothing, for example:

        keyrecon pick rally --frame 0 --head 640,210 --foot 610,540 \\
            --foot 668,538 --region shirt:640,290

    Args:
        project: Project folder.
        frame: Frame number the clicks are on, counted from 0.
        head: A point on the head.
        foot: A point on a shoe; give it twice for both.
        region: A point on a region of one colour, with the region's name.
    """
    from keyrecon.app import project as work
    from keyrecon.io.work_lock import lock_project
    from keyrecon.io.workspace import Workspace
    from keyrecon.records import Pick

    picks = [Pick(frame, "head", *work.point(p, "--head")) for p in head]
    picks += [Pick(frame, "foot", *work.point(p, "--foot")) for p in foot]
    picks += [work.region_pick(frame, text) for text in region]
    with lock_project(project, "keyrecon pick"):
        print(work.add_picks(Workspace(project), picks))


def annotate(
    project: Project,
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
    from functools import partial

    from keyrecon.app.annotator import serve_annotator
    from keyrecon.io.workspace import Workspace

    say = partial(print, flush=True)  # whoever starts this from a script waits for the address
    serve_annotator(Workspace(project), host, port, browser, say)


def import_(
    project: Project,
    file: Positional[Annotated[Path, arg(metavar="FILE")]],
    replace: Switch = False,
) -> None:
    """Take joints from a COCO keypoints JSON, DeepLabCut CSV or CVAT XML file.

    Adds to the annotations there are; marks that differ from those in the project are refused
    unless --replace is given, and then the old file is kept beside the new one.

    Args:
        project: Project folder.
        file: The file; its kind is told by its content.
        replace: Let marks from the file replace different ones in the project.
    """
    from keyrecon.app.project import import_annotations
    from keyrecon.io.work_lock import lock_project
    from keyrecon.io.workspace import Workspace

    with lock_project(project, "keyrecon import"):
        print(import_annotations(Workspace(project), file, replace))


def evaluate(
    motion: Positional[Annotated[Path, arg(metavar="PROJECT")]],
    truth: Annotated[Path, arg(metavar="FILE")],
) -> None:
    """Print the accuracy of a motion against a known truth.

    Args:
        motion: Project folder or motion.npz.
        truth: truth.npz with points3d, points2d, joint_names and fps.
    """
    from keyrecon.app.project import evaluate as describe_accuracy

    print(describe_accuracy(motion, truth))


def add(
    video: VideoFile,
    project: Annotated[Path, arg(metavar="FOLDER")],
    start: int = 0,
    end: MaybeWhole = None,
    slowmo: float = 1.0,
) -> None:
    """Add another video of the same player to a project.

    Its frames are numbered on behind those that are there. Colours, body lengths and marks count
    for all files together, so that only poses are asked for that were not marked yet. The files
    must have pictures of one size and the same frame rate. The project's page must not be open.

    Args:
        video: An mp4, mov, mkv or avi file.
        project: Project folder.
        start: First frame of the file to use.
        end: Frame after the last one to use; all to the end by default.
        slowmo: How many times slower than life the video plays.
    """
    from keyrecon.app.project import add_video
    from keyrecon.io.work_lock import lock_project
    from keyrecon.io.workspace import Workspace

    with lock_project(project, "keyrecon add"):
        print(add_video(Workspace(project), video, (start, end), slowmo))


def relink(project: Project, video: VideoFile) -> None:
    """Tell a project where its video has moved to.

    Args:
        project: Project folder.
        video: The same video in its new place.
    """
    from keyrecon.io.work_lock import lock_project
    from keyrecon.io.workspace import Workspace

    with lock_project(project, "keyrecon relink"):
        Workspace(project).relink(video)
    print(f"{project} now uses {video}.")
