"""What the commands do to a project folder; each returns the text to show."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from keyrecon.annotate.store.cells import (
    Cells,
    annotations_from_cells,
    apply_in_place,
    cells_from_annotations,
)
from keyrecon.annotate.store.importing import compare_marks, name_conflicts
from keyrecon.app.preparing import prepare_project
from keyrecon.body import read_skeleton
from keyrecon.errors import KeyreconError, quoted
from keyrecon.io.durable import write_durably
from keyrecon.io.formats.annotation_checks import implausible_bones, joints_outside
from keyrecon.io.formats.annotations import missing_marks, read_annotations
from keyrecon.io.formats.coco import read_coco, write_coco
from keyrecon.io.formats.keyframes import read_keyframes
from keyrecon.io.formats.motion_file import read_motion, write_motion
from keyrecon.io.video import Video, open_video
from keyrecon.io.workspace import Workspace
from keyrecon.library import reconstruct
from keyrecon.metrics import evaluate_motion, read_truth
from keyrecon.pipeline import Options, as_printed, with_height
from keyrecon.progress import Progress
from keyrecon.records import Annotations, Keyframes, Motion, Pick, Preparation
from keyrecon.report.markup import ReportMaterial
from keyrecon.report.page import write_report
from keyrecon.uncertainty import uncertain_share, uncertain_stretches


def start(
    video: Path,
    folder: Path,
    trim: tuple[int, int | None] = (0, None),
    slow_motion: float = 1.0,
    skeleton: Path | None = None,
) -> str:
    """Make a project folder for a video; `trim` is the first frame and the one after the last."""
    first, end = trim
    opened = open_video(video, first, end, slow_motion)
    if skeleton is not None:
        read_skeleton(skeleton)
    told: dict[str, float | None] = {"start": first or None, "end": end}
    told["slow_motion"] = None if slow_motion == 1 else slow_motion
    Workspace.create(folder, opened, video, told)
    if skeleton is not None:
        write_durably(folder / "skeleton.json", skeleton.read_bytes())
    text = (
        f"{folder}: {counted(len(opened), 'frame')} of {opened.width}x{opened.height} at "
        f"{opened.fps:.4g} frames per second."
    )
    if opened.variable_rate:
        text += "\nThe frames are unevenly spaced in time; keyrecon uses their true times."
    return (
        f"{text}\nNext: keyrecon annotate {quoted(folder)} to mark one whole body on a page, or "
        f"mark it in another tool, then keyrecon import {quoted(folder)} FILE and keyrecon "
        f"keyframes {quoted(folder)}; keyrecon pick teaches the colours by clicks instead."
    )


def counted(number: int, what: str) -> str:
    """1 frame, 2 frames."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def point(text: str, flag: str) -> tuple[float, float]:
    """Parse X,Y."""
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError as fault:
        raise KeyreconError(
            f"{flag} needs X,Y in pixels, such as 640,210; got '{text}'."
        ) from fault
    return x, y


def region_pick(frame: int, text: str) -> Pick:
    """Parse NAME:X,Y."""
    name, colon, where = text.partition(":")
    if not colon or not name.strip():
        raise KeyreconError(f"--region needs NAME:X,Y, such as shirt:640,290; got '{text}'.")
    return Pick(frame, name.strip().lower(), *point(where, "--region"))


def add_picks(workspace: Workspace, picks: Sequence[Pick]) -> str:
    """Add clicks after checking that they are on the picture."""
    if not picks:
        raise KeyreconError("Nothing was picked; give --head, --foot or --region.")
    video = workspace.video()
    for p in picks:
        if not 0 <= p.frame < len(video):
            raise KeyreconError(
                f"Frame {p.frame} is outside the video, which has frames 0 to {len(video) - 1}."
            )
        if not (0 <= p.x < video.width and 0 <= p.y < video.height):
            raise KeyreconError(
                f"The {p.part} pick {p.x:g},{p.y:g} on frame {p.frame} is outside the picture of "
                f"{video.width}x{video.height}."
            )
    together = workspace.add_picks(picks)
    counts = {part: sum(p.part == part for p in together) for part in {p.part for p in together}}
    listed = ", ".join(f"{n} {part}" for part, n in sorted(counts.items()))
    return f"{workspace.picks_file}: {listed}.\nNext: keyrecon keyframes {quoted(workspace.folder)}"


def import_annotations(workspace: Workspace, file: Path, replacing: bool) -> str:
    """Add marks from a file to the project's annotations."""
    video, skeleton = workspace.video(), workspace.skeleton
    size = (video.width, video.height)
    imported = read_annotations(file, skeleton, len(video), size)
    with workspace.exclusive():
        cells: Cells = {}
        if workspace.annotations_file.is_file():
            cells = cells_from_annotations(load_annotations(workspace, video))
        comparison = compare_marks(cells, cells_from_annotations(imported))
        if comparison.conflicts and not replacing:
            raise _conflict_error(name_conflicts(comparison))
        if comparison.conflicts:
            workspace.put_aside(workspace.annotations_file)
        apply_in_place(cells, comparison.changes(replace=True))
        merged = annotations_from_cells(cells, skeleton)
        write_coco(workspace.annotations_file, merged, size)
    warnings = [*joints_outside(merged, size), *implausible_bones(merged)]
    return "\n".join(
        [
            f"{workspace.annotations_file}: marks on {len(merged.frames)} frames.",
            *(f"Warning: {text}" for text in warnings),
            f"Next: keyrecon run {quoted(workspace.folder)}",
        ]
    )


def _conflict_error(conflicts: list[str]) -> KeyreconError:
    listed = ", ".join(conflicts[:5]) + (" ..." if len(conflicts) > 5 else "")
    return KeyreconError(
        f"{len(conflicts)} marks differ from those in the project ({listed}); nothing was "
        "changed. Add --replace to take the new ones and keep the old file beside them."
    )


def load_annotations(workspace: Workspace, video: Video) -> Annotations:
    """The project's annotations, checked."""
    size = (video.width, video.height)
    return read_coco(workspace.annotations_file, workspace.skeleton, len(video), size)


def settings(workspace: Workspace, told: Options, height: float | None = None) -> Options:
    """The project's options and what is told now, with the height in metres."""
    if height is not None and not 0.5 < height < 2.6:
        raise KeyreconError(f"--height is the athlete's height in metres; {height:g} cannot be.")
    options = workspace.options(told, Options())
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
    that the paper prints. The project remembers its options, without those forms, when all is
    done: what is refused on the way leaves no trace.
    """
    started = time.perf_counter()
    told, options = options, as_printed(options) if printed else options
    annotations = annotated(workspace, partial)
    asked = asked_for(workspace)
    found = prepare_project(workspace, workspace.video(), annotations, options, progress)
    preparation = replace(found.preparation, keyframes=asked)
    motion = reconstruct(preparation, annotations, options, workspace.stages.keep, progress)
    write_motion(workspace.motion_file, motion)
    material = ReportMaterial(
        video=preparation.video,
        track=preparation.track,
        pose_distances=preparation.pose_distances,
        keyframes=preparation.keyframes,
        annotations=annotations,
        motion=motion,
        seconds=workspace.stages.seconds,
        truth=truth,
        options=options,
    )
    write_report(workspace.report_file, material, progress)
    workspace.remember(told, Options())
    return "\n".join(
        [
            f"{workspace.motion_file}: {len(motion.time)} frames, lengths in {motion.units}.",
            f"{workspace.report_file}: open it in a browser.",
            *found.contradictions(),
            *_describe_doubt(motion),
            *_other_choice(workspace, options, preparation.keyframes),
            f"Took {time.perf_counter() - started:.0f} s.",
        ]
    )


def _describe_doubt(motion: Motion) -> list[str]:
    """How much of the motion is uncertain, and the worst stretches."""
    stretches = uncertain_stretches(motion)
    if not stretches:
        return []
    share = (
        f"Arms, legs or head are uncertain in {uncertain_share(motion):.0%} of the frames. Worst:"
    )
    return [share, *(stretch.text for stretch in stretches)]


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
    asked = asked_for(workspace)
    found = prepare_project(workspace, workspace.video(), marks, options, progress)
    return replace(found.preparation, keyframes=asked)


def asked_for(workspace: Workspace) -> Keyframes:
    """The keyframes that the person was asked to annotate."""
    if not workspace.keyframes_file.is_file():
        workspace.picks()
        raise KeyreconError(
            f"No keyframes have been chosen yet; run: keyrecon keyframes {quoted(workspace.folder)}"
        )
    asked = read_keyframes(workspace.keyframes_file)
    n_frames = len(workspace.video())
    if len(asked.upper.nearest) != n_frames:
        raise KeyreconError(
            f"{workspace.keyframes_file} was made for {len(asked.upper.nearest)} frames and the "
            f"video has {n_frames}; run: keyrecon keyframes {quoted(workspace.folder)}"
        )
    return asked


def annotated(workspace: Workspace, partial: bool = False) -> Annotations:
    """The project's annotations; KeyreconError names the keyframes that lack theirs."""
    file, found = workspace.annotations_file, asked_for(workspace)
    annotations = load_annotations(workspace, workspace.video()) if file.is_file() else None
    missing = missing_marks(annotations, found.upper.frames, found.lower.frames)
    if annotations is None or (missing and not partial):
        folder = quoted(workspace.folder)
        named = [f"{frame} ({', '.join(halves)})" for frame, halves in missing.items()]
        listed = ", ".join(named[:8]) + (f" and {len(named) - 8} more" if len(named) > 8 else "")
        raise KeyreconError(
            f"{len(missing)} of {len(found.frames)} keyframes are not annotated: frame {listed}. "
            f"Mark them on the page of keyrecon annotate {folder}, or in another tool and keyrecon "
            f"import {folder} FILE, or go on with what there is: keyrecon run {folder} --partial"
        )
    return annotations


def load_motion(path: Path) -> Motion:
    """The motion of a project folder or file."""
    file = path / "motion.npz" if path.is_dir() else path
    if not file.is_file():
        raise KeyreconError(
            f"There is no motion at {file}; make it with: keyrecon run {quoted(path)}"
        )
    return read_motion(file)


def evaluate(path: Path, truth: Path) -> str:
    """Accuracy as a table."""
    return describe_scores(load_motion(path), truth)


def describe_scores(motion: Motion, truth: Path) -> str:
    """The measures of the literature, one to a line."""
    scores = evaluate_motion(motion, read_truth(truth))
    rows = [
        ("MPJPE", f"{scores.mpjpe:.1f} mm"),
        ("PA-MPJPE", f"{scores.pa_mpjpe:.1f} mm"),
        ("N-MPJPE", f"{scores.n_mpjpe:.1f} mm"),
        ("acceleration error", f"{scores.acceleration:.1f} mm/frame^2"),
        ("PCK@0.2 of the torso", f"{scores.pck:.1%}"),
        ("median 2D error", f"{scores.median_px:.1f} px"),
        ("limb-length variation", f"{scores.limb_variation:.4%}"),
    ]
    worst = sorted(scores.by_joint.items(), key=lambda item: -item[1])[:3]
    lines = [f"{name:<24}{value:>16}" for name, value in rows]
    lines.append("worst joints: " + ", ".join(f"{name} {error:.0f} mm" for name, error in worst))
    if scores.scaled:
        lines.append("The motion is in body heights; it was scaled to the truth by one factor.")
    return "\n".join(lines)
