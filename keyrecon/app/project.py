"""What the commands do to a project folder; each returns the text to show."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from keyrecon.annotate.store.cells import (
    Cells,
    annotations_from_cells,
    apply_in_place,
    cells_from_annotations,
)
from keyrecon.annotate.store.edits import Limits
from keyrecon.annotate.store.importing import compare_marks, name_conflicts
from keyrecon.app.pick_checks import implausible_picks, missing_parts
from keyrecon.body import read_skeleton
from keyrecon.errors import KeyreconError, counted, quoted
from keyrecon.io.durable import put_aside, write_durably
from keyrecon.io.formats.annotation_checks import far_outside, implausible_bones, joints_outside
from keyrecon.io.formats.annotations import missing_marks, read_marks_file
from keyrecon.io.formats.coco import read_coco, write_coco
from keyrecon.io.formats.keyframes import read_keyframes
from keyrecon.io.formats.motion_file import read_whole_motion
from keyrecon.io.video import Video, open_video
from keyrecon.io.work_lock import lock_annotation
from keyrecon.io.workspace import Workspace
from keyrecon.metrics import evaluate_motion, read_truth
from keyrecon.records import Annotations, Keyframes, Motion, Pick

CLOSE_PAGE = (
    "its page knows the video as it was. Stop that keyrecon annotate, add the file, and start it "
    "again"
)
"""What helps where the video of an open project would become another."""


def start(
    video: Path,
    folder: Path,
    trim: tuple[int, int | None] = (0, None),
    slow_motion: float | None = None,
    skeleton: Path | None = None,
    golf: bool = False,
) -> str:
    """Make a project folder for a video; `trim` is the first frame and the one after the last.

    A slow motion that is told, 1 also, is kept: of a golf swing it is searched for otherwise.
    """
    first, end = trim
    if golf and skeleton is not None:
        raise KeyreconError("A golf swing has its own skeleton; leave --skeleton or --golf out.")
    opened = open_video(video, first, end, 1.0 if slow_motion is None else slow_motion)
    if skeleton is not None:
        read_skeleton(skeleton)
    trim_of_video = {"start": first or None, "end": end, "slow_motion": slow_motion}
    Workspace.create(folder, opened, video, trim_of_video, "golf" if golf else None)
    if skeleton is not None:
        write_durably(folder / "skeleton.json", skeleton.read_bytes())
    text = (
        f"{folder}: {counted(len(opened), 'frame')} of {opened.width}x{opened.height} at "
        f"{opened.fps:.4g} frames per second."
    )
    if opened.variable_rate:
        text += (
            "\nThe frames are unevenly spaced in time; keyrecon uses their true times, but on a "
            "court or the ground, where flight and feet count as if they were even."
        )
    if golf:
        return (
            f"{text}\nNext: keyrecon annotate {quoted(folder)} to click six joints on a page, and "
            "fit the swing there."
        )
    return (
        f"{text}\nNext: keyrecon annotate {quoted(folder)} to mark one whole body on a page, or "
        f"mark it in another tool, then keyrecon import {quoted(folder)} FILE and keyrecon "
        f"keyframes {quoted(folder)}; keyrecon pick teaches the colours by clicks instead."
    )


def add_video(
    workspace: Workspace, video: Path, trim: tuple[int, int | None], slow_motion: float = 1.0
) -> str:
    """Go on with another file of the same player; what was marked stays.

    Raises KeyreconError while the project's page is open, which would take what is marked in the
    new frames for damage.
    """
    if workspace.is_golf:
        raise KeyreconError("A golf swing is one video; start a project for each swing.")
    before = len(workspace.video())
    first, end = trim
    settings: dict[str, float | None] = {"start": first or None, "end": end}
    settings["slow_motion"] = None if slow_motion == 1 else slow_motion
    lock = lock_annotation(workspace.folder, CLOSE_PAGE)
    try:
        together = workspace.add_video(video, {n: v for n, v in settings.items() if v is not None})
    finally:
        lock.release()
    folder = quoted(workspace.folder)
    return (
        f"{workspace.folder}: {counted(len(together) - before, 'frame')} of {video} were added, "
        f"numbered from {before} on; {len(together)} in all. What was marked stays.\n"
        f"Next: keyrecon keyframes {folder}, which asks for what is new, then keyrecon annotate "
        f"{folder}"
    )


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
    missing, folder = missing_parts(together), quoted(workspace.folder)
    following = (
        f"Still missing: {', '.join(missing)}. Add them with: keyrecon pick {folder} --frame N ..."
        if missing
        else f"Next: keyrecon keyframes {folder}"
    )
    return "\n".join(
        [f"{workspace.picks_file}: {listed}.", *implausible_picks(together), following]
    )


def import_annotations(workspace: Workspace, file: Path, replacing: bool) -> str:
    """Add marks from a file to the project's annotations, and to what a golf fit must hold."""
    from keyrecon.annotate.store.golf_files import marks_form  # loads what golf needs

    video, skeleton = workspace.video(), workspace.skeleton
    size = (video.width, video.height)
    read = read_marks_file(file, skeleton, len(video), size)
    found = cells_from_annotations(read.marks)
    if not found:
        raise KeyreconError(f"{file} holds no marks; nothing was changed.")
    swing = marks_form(workspace, Limits(skeleton, len(video), size))
    with workspace.exclusive():
        files = [f for f in (workspace.annotations_file, swing.path) if f.is_file()]
        cells: Cells = {}
        if workspace.annotations_file in files:
            cells = cells_from_annotations(load_annotations(workspace, video))
        if swing.path in files:
            cells |= swing.read(cells)
        comparison = compare_marks(cells, found)
        if comparison.conflicts and not replacing:
            raise _conflict_error(name_conflicts(comparison))
        if comparison.conflicts:
            for changed in files:
                put_aside(changed)
        apply_in_place(cells, comparison.changes(replace=True))
        merged = annotations_from_cells(cells, skeleton)
        write_coco(workspace.annotations_file, merged, size)
        if swing.path in files:
            write_durably(swing.path, swing.write(cells))
    warnings = [*joints_outside(merged, size), *implausible_bones(merged)]
    return "\n".join(
        [
            f"{workspace.annotations_file}: marks on {counted(len(merged.frames), 'frame')}.",
            *_describe_names(read.pictures),
            *_describe_unasked(workspace, video, read.marks),
            *(f"Warning: {text}" for text in warnings),
            _after_marks(workspace, video, merged),
        ]
    )


def _describe_names(pictures: Mapping[int, str]) -> list[str]:
    """Which frames only the names of pictures tell; nothing where the file says all."""
    if not pictures:
        return []
    named = _first_few([f"{frame} ({name[:60]})" for frame, name in sorted(pictures.items())])
    return [
        f"{counted(len(pictures), 'frame')} {'was' if len(pictures) == 1 else 'were'} taken from "
        f"the pictures' names: {named}."
    ]


def _describe_unasked(workspace: Workspace, video: Video, marks: Annotations) -> list[str]:
    """A warning where most frames are no keyframes: they may be counted in another way."""
    try:
        asked = asked_for(workspace, video).frames
    except KeyreconError:  # none are chosen yet, or for another video
        return []
    others = np.setdiff1d(marks.frames, asked).tolist()
    if 2 * len(others) <= len(marks.frames):
        return []
    return [
        f"Warning: {len(others)} of {counted(len(marks.frames), 'marked frame')} "
        f"{'is no keyframe that was' if len(others) == 1 else 'are no keyframes that were'} asked "
        f"for: {_first_few([str(frame) for frame in others])}; if the file counts frames otherwise "
        "than the video (from 0, all of them), take these marks out on the page of keyrecon "
        f"annotate {quoted(workspace.folder)}, mend the file and import it again."
    ]


def _first_few(words: Sequence[str]) -> str:
    return ", ".join(words[:8]) + (f" and {len(words) - 8} more" if len(words) > 8 else "")


def _after_marks(workspace: Workspace, video: Video, marks: Annotations) -> str:
    """To mend what would spoil the rest, what is left to mark, or the command that uses marks
    first."""
    folder = quoted(workspace.folder)
    if spoilt := far_outside(marks, (video.width, video.height)):
        return (
            f"Next: mend the marks far outside the picture (frame "
            f"{', '.join(map(str, spoilt[:8]))}), then import them again with --replace."
        )
    if workspace.is_golf and not workspace.keyframes_file.is_file():
        return f"Next: keyrecon golf fit {folder}"
    try:
        asked = asked_for(workspace, video)
    except KeyreconError:  # none are chosen yet, or their file does not fit: they are chosen anew
        return f"Next: keyrecon keyframes {folder}"
    left, nowhere = describe_unmarked(marks, asked), describe_never_marked(marks)
    if not left and not nowhere:
        return f"Next: keyrecon run {folder}"
    if nowhere:  # not even --partial can do without
        return "\n".join([*([left] if left else []), nowhere, "Next: mark these and import them"])
    return (
        f"{left}\nNext: mark these too and import them, or go on with what there is: keyrecon run "
        f"{folder} --partial"
    )


def _conflict_error(conflicts: list[str]) -> KeyreconError:
    listed = ", ".join(conflicts[:5]) + (" ..." if len(conflicts) > 5 else "")
    return KeyreconError(
        f"{counted(len(conflicts), 'mark')} {'differs' if len(conflicts) == 1 else 'differ'} from "
        f"what the project has ({listed}); nothing was "
        "changed. Add --replace to take the new ones and keep the old file beside them."
    )


def load_annotations(workspace: Workspace, video: Video) -> Annotations:
    """The project's annotations, checked."""
    file, size = workspace.annotations_file, (video.width, video.height)
    try:
        return read_coco(file, workspace.skeleton, len(video), size)
    except KeyreconError as fault:
        if fault.__cause__ is None:  # a whole file with marks that do not fit
            raise
        raise KeyreconError(f"{fault} {_remedy(workspace)}") from fault


def _remedy(workspace: Workspace) -> str:
    """What restores annotations.json."""
    file, folder = workspace.annotations_file, quoted(workspace.folder)
    older = sorted(file.parent.glob(f"{file.stem}.old-*.json"), key=lambda f: f.stat().st_mtime)
    copy = f"copy {quoted(older[-1])} over it, or " if older else ""
    return f"To restore it, {copy}delete it and take the marks anew: keyrecon import {folder} FILE"


def asked_for(workspace: Workspace, video: Video) -> Keyframes:
    """The keyframes of the project's video that the person was asked to annotate."""
    if not workspace.keyframes_file.is_file():
        workspace.picks()
        raise KeyreconError(
            f"No keyframes have been chosen yet; run: keyrecon keyframes {quoted(workspace.folder)}"
        )
    asked = read_keyframes(workspace.keyframes_file)
    if len(asked.upper.nearest) != len(video):
        raise KeyreconError(
            f"{workspace.keyframes_file} was made for {len(asked.upper.nearest)} frames and the "
            f"video has {len(video)}; run: keyrecon keyframes {quoted(workspace.folder)}"
        )
    return asked


def annotated(
    workspace: Workspace, video: Video, asked: Keyframes, partial: bool = False
) -> Annotations:
    """The project's annotations; KeyreconError names the `asked` keyframes that lack theirs."""
    there = workspace.annotations_file.is_file()
    annotations = load_annotations(workspace, video) if there else None
    left = describe_unmarked(annotations, asked)
    if annotations is None or (left and not partial):
        folder = quoted(workspace.folder)
        raise KeyreconError(
            f"{left} "
            f"Mark them on the page of keyrecon annotate {folder}, or in another tool and keyrecon "
            f"import {folder} FILE, or go on with what there is: keyrecon run {folder} --partial"
        )
    if nowhere := describe_never_marked(annotations):
        raise KeyreconError(nowhere)
    return annotations


def describe_never_marked(annotations: Annotations) -> str:
    """Joints that cannot be carried anywhere; empty where there are none."""
    if not annotations.never_marked:
        return ""
    return (
        f"No marked frame has {', '.join(annotations.never_marked)}; mark each joint on at least "
        "one keyframe, where it is hidden by the best guess."
    )


def describe_unmarked(annotations: Annotations | None, asked: Keyframes) -> str:
    """Which keyframes lack marks, and of which half; empty where none does."""
    missing = missing_marks(annotations, asked.upper.frames, asked.lower.frames)
    if not missing:
        return ""
    named = [f"{frame} ({', '.join(halves)})" for frame, halves in missing.items()]
    return (
        f"{len(missing)} of {counted(len(asked.frames), 'keyframe')} "
        f"{'is' if len(missing) == 1 else 'are'} not marked yet: frame "
        f"{_first_few(named)}."
    )


def load_motion(path: Path) -> Motion:
    """The motion of a project folder or file."""
    return load_whole_motion(path)[0]


def load_whole_motion(path: Path) -> tuple[Motion, dict[str, np.ndarray]]:
    """The same, and what else its file holds."""
    file = path / "motion.npz" if path.is_dir() else path
    if not file.is_file():
        raise KeyreconError(
            f"There is no motion at {file}; make it with: keyrecon run {quoted(path)}"
        )
    return read_whole_motion(file)


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
