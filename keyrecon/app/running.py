"""`keyrecon run`: from marks to motion and report, in a project folder."""

import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from keyrecon.app.mark_checks import describe_doubtful_marks, marks_to_see
from keyrecon.app.placing import write_placed_motion
from keyrecon.app.preparing import describe_shots, prepare_project
from keyrecon.app.project import annotated, asked_for
from keyrecon.errors import KeyreconError, quoted
from keyrecon.hyperextension import hyperextended_stretches
from keyrecon.io.formats.shot_choices import ShotChoices
from keyrecon.io.held_video import with_exposure
from keyrecon.io.provenance import RunNotes, camera_digest, motion_digest, note_run
from keyrecon.io.video import Video
from keyrecon.io.workspace import Workspace
from keyrecon.keyframes.absence import format_stretches
from keyrecon.lens import describe_nearness, lens_advice, lens_caveat, with_known_lens
from keyrecon.library import read_models, reconstruct
from keyrecon.numerics.runs import list_runs
from keyrecon.pipeline import Options, as_printed, with_field_of_view, with_height
from keyrecon.progress import Progress
from keyrecon.ranges import SHORTEST, TALLEST
from keyrecon.records import Annotations, Keyframes, Motion, Preparation, Shots
from keyrecon.report.markup import ReportMaterial
from keyrecon.report.page import cut_report_pictures, write_page
from keyrecon.uncertainty import describe_uncertainty
from keyrecon.world.ground_marks import check_field_of_view


def run_options(
    workspace: Workspace,
    given: Options,
    height: float | None = None,
    typed: Collection[str] = (),
    fov: float | None = None,
) -> Options:
    """The project's options and what is told now: height in metres, angle of the camera in degrees.

    `typed` options, by dotted names, count also where their value is the default.
    """
    if height is not None and not SHORTEST <= height <= TALLEST:
        raise KeyreconError(f"--height is the athlete's height in metres; {height:g} cannot be.")
    if fov is not None:
        check_field_of_view(fov)
    options = workspace.options(given, Options(), typed=typed)
    options = options if fov is None else with_field_of_view(options, fov)
    return options if height is None else with_height(options, height)


def run(
    workspace: Workspace,
    options: Options,
    progress: Progress,
    partial: bool = False,
    truth: Mapping[str, np.ndarray] | None = None,
    printed: bool = False,
) -> str:
    """Everything after annotation; writes motion.npz and report.html.

    `partial` goes on with what is annotated, `truth` is for the report, `printed` takes the forms
    that the paper prints. The project remembers its options, without those forms, from the first
    stage on: what is interrupted goes on with them, what is refused on the way leaves no trace.
    """
    workspace.check_writable()
    read_models(options)  # a file that is none is told of before any stage
    started = time.perf_counter()
    given, video = options, workspace.video()
    options = with_known_lens(options, workspace, video)
    digest = motion_digest(workspace, options, Options())
    options = as_printed(options) if printed else options
    asked = asked_for(workspace, video)
    annotations = annotated(workspace, video, asked, partial)
    with workspace.remembering(given, Options()):
        automatic = prepare_project(workspace, video, annotations, options, progress)
        preparation = replace(automatic.preparation, keyframes=asked)
        motion = reconstruct(preparation, annotations, options, workspace.stages, progress)
    camera = camera_digest(workspace)
    placed = write_placed_motion(workspace, motion)
    doubts = automatic.warnings()
    shots = describe_shots(preparation.shots) + describe_unseen(motion, preparation.shots)
    near = _nearness(options, motion, video)
    advice = () if near is None else (lens_advice(workspace.folder, near),)
    material = ReportMaterial(
        video=with_exposure(preparation.video, None),
        track=preparation.track,
        pose_distances=preparation.pose_distances,
        keyframes=preparation.keyframes,
        annotations=annotations,
        motion=motion,
        seconds=workspace.stages.seconds,
        truth=truth,
        options=options,
        warnings=placed.doubts,
        court=placed.court,
        shots=shots,
        lens=None if near is None else lens_caveat(near),
    )
    wrong = _write_report(workspace.report_file, preparation, material, doubts, progress)
    note_run(workspace, RunNotes(digest, tuple(doubts), advice, camera))
    seconds = time.perf_counter() - started
    unsure = [*(one.text for one in hyperextended_stretches(motion)), *describe_uncertainty(motion)]
    lines = [*placed.lines, *shots, *doubts, *wrong, *unsure, *advice]
    choices = [*_waiting_choices(workspace), *_other_choice(workspace, options, asked)]
    files = _describe_files(workspace, motion)
    return "\n".join([*files, *lines, *choices, f"Took {seconds:.0f} s."])


def _write_report(
    path: Path,
    preparation: Preparation,
    material: ReportMaterial,
    doubts: Sequence[str],
    progress: Progress,
) -> list[str]:
    """Write the report with what is doubtful; returns the lines on marks that look wrong.

    These are found with the pictures that the report shows, so that the video is read once.
    """
    annotations = material.annotations
    seen = marks_to_see(preparation, annotations)
    pictures = cut_report_pictures(material, progress, seen.see)
    wrong = describe_doubtful_marks(preparation, annotations, material.motion, seen)
    warnings = [*doubts, *wrong, *material.warnings]
    write_page(path, replace(material, warnings=warnings), pictures)
    return wrong


def _nearness(options: Options, motion: Motion, video: Video) -> str | None:
    """That the player is near, where the lens is not known; the printed form asks for none."""
    if options.lift.field_of_view is not None or options.lift.method == "paper":
        return None
    return describe_nearness(motion, video)


def describe_unseen(motion: Motion, shots: Shots) -> list[str]:
    """A line where usable shots have frames without a figure."""
    hidden = ~motion.known
    hidden &= np.isin(np.arange(len(hidden)), shots.usable_frames)
    stretches = list_runs(hidden)
    if not stretches:
        return []
    return [
        f"Nobody seen in frames {format_stretches(stretches)}: there is no figure there. Where the "
        "player is there after all, mark the body."
    ]


def _describe_files(workspace: Workspace, motion: Motion) -> list[str]:
    """What was written."""
    return [
        f"{workspace.motion_file}: {len(motion.time)} frames, lengths in {motion.units}.",
        f"{workspace.report_file}: open it in a browser.",
    ]


def _waiting_choices(workspace: Workspace) -> list[str]:
    """That shots were chosen since the keyframes were."""
    if workspace.shot_choices() == ShotChoices():
        return []
    return [
        "Shots were chosen on the page that the keyframes do not know yet: "
        f"keyrecon keyframes {quoted(workspace.folder)}"
    ]


def _other_choice(workspace: Workspace, options: Options, asked: Keyframes) -> list[str]:
    """What a run by the printed forms says of keyframes that were not chosen by them."""
    if options.keyframes.method != "paper" or asked.method == "paper":
        return []
    return [
        "The keyframes of this project were not chosen by Eq. 2-4 as printed; for that: "
        f"keyrecon keyframes {quoted(workspace.folder)} --method paper, and mark what it asks for."
    ]


def prepared(
    workspace: Workspace,
    options: Options,
    progress: Progress,
    marks: Annotations | None = None,
) -> Preparation:
    """The automatic part, with the keyframes that the person was asked to annotate."""
    video = workspace.video()
    asked = asked_for(workspace, video)
    automatic = prepare_project(workspace, video, marks, options, progress)
    return replace(automatic.preparation, keyframes=asked)
