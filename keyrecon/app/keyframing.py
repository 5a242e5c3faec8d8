"""What `keyrecon keyframes` does to a project folder, and the lines that it prints."""

from collections import deque
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Int, UInt8

from keyrecon.annotation_budget import annotation_cost, check_budget
from keyrecon.app.preparing import (
    describe_shots,
    prepare_project,
    unlinked_stretches,
    with_chosen_shots,
)
from keyrecon.app.project import describe_never_marked, describe_unmarked, load_annotations
from keyrecon.errors import counted, quoted
from keyrecon.io.durable import make_folder, write_durably
from keyrecon.io.formats.keyframes import keyframes_to_json
from keyrecon.io.frame_reader import side_by_side
from keyrecon.io.held_video import hold_if_small, with_exposure
from keyrecon.io.option_tables import check_options
from keyrecon.io.video_writer import write_picture
from keyrecon.io.workspace import Workspace
from keyrecon.keyframes.absence import absent_frames, format_stretches
from keyrecon.keyframes.selection import KeyframeOptions
from keyrecon.numerics.runs import list_runs
from keyrecon.pipeline import Options, as_printed, marked_frames, with_marked_keyframes
from keyrecon.progress import Progress
from keyrecon.records import Annotations, HalfKeyframes, Keyframes, MarkGains, Preparation
from keyrecon.report.drawing import draw_brackets
from keyrecon.shots.following import HELD
from keyrecon.uncertainty import unsure_track

MOST_USEFUL = 3
"""Keyframes that are named in the order of what they bring; keyframes.json has all."""


@dataclass(frozen=True)
class KeyframeSettings:
    """The options of keyframes that commands and page offer; None leaves the project's."""

    budget: float | None = None
    coverage: float | None = None
    reach: int | None = None

    def applied_to(self, options: KeyframeOptions) -> KeyframeOptions:
        """Options with those that are given here in their place.

        Raises KeyreconError for what cannot be, named as it is typed.
        """
        if self.budget is not None:
            check_budget(self.budget)
        usual = KeyframeOptions()
        coverage = usual.coverage if self.coverage is None else self.coverage
        reach = usual.reach if self.reach is None else self.reach
        check_options(replace(usual, coverage=coverage, reach=reach), "--")
        return replace(
            options,
            budget=options.budget if self.budget is None else self.budget,
            coverage=options.coverage if self.coverage is None else self.coverage,
            reach=options.reach if self.reach is None else self.reach,
        )


def find_keyframes(
    workspace: Workspace,
    options: Options,
    chosen: KeyframeSettings,
    progress: Progress,
    printed: bool = False,
    typed: Collection[str] = (),
) -> str:
    """Run the automatic part; write keyframes.json and a picture of each keyframe.

    `typed` options, by dotted names, count also where their value is the default.
    `printed` takes the forms that the paper prints. The project remembers its options without
    them, so that a run by the same forms finds the same stages, and one by ours is not bound.
    """
    workspace.check_writable()
    choices = workspace.shot_choices()
    options = with_chosen_shots(workspace.options(options, Options(), typed=typed), choices)
    options = replace(options, keyframes=chosen.applied_to(options.keyframes))
    check_options(options)
    forms = as_printed(options) if printed else options
    video = hold_if_small(workspace.video(), HELD)  # camera, player and pictures read it
    marks = load_annotations(workspace, video) if workspace.annotations_file.is_file() else None
    with workspace.remembering(options, Options()):
        prepared = prepare_project(workspace, video, marks, forms, progress)
        preparation = prepared.preparation
        if marks is not None and not printed:
            preparation = with_marked_keyframes(preparation, marks, options, progress)
    workspace.forget_shot_choices(choices)
    write_durably(workspace.keyframes_file, keyframes_to_json(preparation.keyframes))
    write_keyframe_pictures(workspace, preparation, progress)
    return describe_keyframes(workspace, preparation, marks, prepared.warnings())


def describe_keyframes(
    workspace: Workspace,
    preparation: Preparation,
    marks: Annotations | None = None,
    warnings: Sequence[str] = (),
) -> str:
    """What was found, what of the person's does not fit it, and what to do next."""
    keyframes, frames = preparation.keyframes, len(preparation.video)
    unlinked = _unlinked_frames(preparation)
    unsure = [
        stretch
        for stretch in unsure_track(preparation.track, preparation.shots, keyframes.reach)
        if not unlinked[stretch.frame]
    ]
    usable = preparation.shots.usable_frames
    seen = float((preparation.track.confidence[usable] > 0).mean())
    halves = [
        f"{name} body: {counted(len(half.frames), 'keyframe')}; {half.coverage:.1%} of the frames "
        f"look like one of them (outlines at most {half.beta:.1%} of the player's height apart; "
        f"{_compare_with_printed(keyframes, half)})."
        for name, half in (("Upper", keyframes.upper), ("Lower", keyframes.lower))
    ]
    return "\n".join(
        [
            f"Player found in {seen:.1%} of {counted(len(usable), 'frame')}.",
            *describe_shots(preparation.shots),
            *warnings,
            *_describe_absence(preparation),
            *(stretch.text for stretch in unsure),
            *halves,
            *describe_gains(keyframes),
            f"Annotation cost {annotation_cost(keyframes, frames):.2%}: "
            f"{count_different(keyframes, marks)}, listed in {workspace.keyframes_file}, pictures "
            f"in {workspace.pictures}.",
            *describe_next(workspace, keyframes, marks),
        ]
    )


def describe_next(
    workspace: Workspace, keyframes: Keyframes, marks: Annotations | None
) -> list[str]:
    """What is left to mark before there can be a run, and the command for it."""
    folder, left = quoted(workspace.folder), describe_unmarked(marks, keyframes)
    nowhere = "" if marks is None else describe_never_marked(marks)
    if not left and not nowhere:
        return [f"All of them are marked. Next: keyrecon run {folder}"]
    return [
        *([left] if left and marks is not None else []),
        *([f"All of them are marked. {nowhere}"] if nowhere and not left else []),
        f"Next: keyrecon annotate {folder}, or mark the joints in another tool (COCO keypoints, "
        f"DeepLabCut or CVAT) and keyrecon import {folder} FILE",
    ]


def count_different(keyframes: Keyframes, marks: Annotations | None) -> str:
    """How many frames there are to mark; those marked already may exceed the budget."""
    frames = counted(len(keyframes.frames), "different frame")
    before = () if marks is None else np.concatenate(marked_frames(marks))
    count = len(np.intersect1d(keyframes.frames, before))
    if count == 0:
        return frames
    marked = "is marked already and comes" if count == 1 else "are marked already and come"
    stands = "it stands" if count == 1 else "they stand"
    return (
        f"{frames} ({count} of them {marked} on top of the budget, unless {stands} for one that "
        "would be asked for)"
    )


def _compare_with_printed(keyframes: Keyframes, half: HalfKeyframes) -> str:
    if keyframes.method == "paper":
        return "chosen by Eq. 2-4 as printed"
    return f"the choice printed in the paper would take {half.printed_count}"


def describe_gains(keyframes: Keyframes) -> list[str]:
    """What a person who stops early has, and what one mark more would bring."""
    lines = []
    for name, half in (("Upper", keyframes.upper), ("Lower", keyframes.lower)):
        gains = half.gains
        if gains is None:
            continue
        lines.append(f"{name} body, {_describe_order(half, gains)}")
    return lines


def _describe_order(half: HalfKeyframes, gains: MarkGains) -> str:
    """The most useful marks first, and what they cover at the distance that is near enough.

    Keyframes of a small budget are chosen for a larger distance and spread over all poses: one
    chosen for the smaller alone may bring more than any of them.
    """
    count, middle = len(gains.order), (len(gains.order) + 1) // 2
    some = "mark" if middle == 1 else f"{middle} marks"
    first = ", ".join(map(str, gains.order[:MOST_USEFUL].tolist()))
    more = ", ..." if count > MOST_USEFUL else ""
    within = f"of the frames to within {gains.beta:.1%} of the height"
    shown = (
        f"most useful first: {first}{more} (the whole order is in keyframes.json). The first "
        f"{some} will show the pose of {gains.coverage[middle - 1]:.0%} {within}, all {count} of "
        f"{gains.coverage[-1]:.0%}"
    )
    if count == 1:
        shown = f"frame {first} alone will show the pose of {gains.coverage[0]:.0%} {within}"
    if half.beta <= gains.beta:
        return f"{shown}; one more would add {gains.next_gain:.1%}."
    return (
        f"{shown} (to within {half.beta:.1%}, for which they are chosen, of {half.coverage:.0%}); "
        f"one more, chosen for {gains.beta:.1%} alone, would add {gains.next_gain:.1%}."
    )


def _describe_absence(preparation: Preparation) -> list[str]:
    """Stretches in which no keyframes are asked for."""
    reach = preparation.keyframes.reach
    absent = absent_frames(preparation.pose_distances, reach) & preparation.track.known
    absent &= ~_unlinked_frames(preparation)
    lines = []
    if stretches := list_runs(absent):
        listed = format_stretches(stretches)
        lines.append(f"Nobody seen in frames {listed}: no keyframe is asked for there.")
    legless = np.isnan(preparation.pose_distances.seen[1]) & preparation.track.known & ~absent
    if stretches := list_runs(legless):
        listed = format_stretches(stretches)
        lines.append(
            f"Both legs out of the picture in frames {listed}: no keyframe of the lower body is "
            "asked for there."
        )
    return lines


def _unlinked_frames(preparation: Preparation) -> Bool[np.ndarray, "T"]:
    """Frames whose track is not linked to the player, which the warnings say already."""
    unlinked = np.zeros(len(preparation.track.head), dtype=bool)
    if preparation.verification is not None:
        for first, last in unlinked_stretches(preparation.track, preparation.verification):
            unlinked[first : last + 1] = True
    return unlinked


def write_keyframe_pictures(
    workspace: Workspace, preparation: Preparation, progress: Progress
) -> None:
    """One PNG per keyframe, named by frame number as labelling tools keep it, and no others.

    The video is read once from the first to the last: to seek each by itself decodes as many
    frames before it as lie between two that stand alone, 250 in most files. Brackets and an
    arrow tell who is meant where there are several.
    """
    make_folder(workspace.pictures)
    frames = preparation.keyframes.frames
    pictures = with_exposure(preparation.video, None).part(frames).frames()
    shown = progress(pictures, "Writing keyframe pictures", len(frames))

    def write(entry: tuple[int, UInt8[np.ndarray, "h w 3"]]) -> None:
        frame, picture = entry
        track, path = preparation.track, workspace.pictures / f"frame_{frame:06d}.png"
        write_picture(path, draw_brackets(picture, track.box[frame], track.head[frame]))

    deque(side_by_side(write, zip(frames.tolist(), shown, strict=True)), maxlen=0)
    delete_other_pictures(workspace.pictures, frames)


def delete_other_pictures(folder: Path, frames: Int[np.ndarray, "K"]) -> None:
    """Delete pictures of frames that are no keyframes any more; a person's own files stay."""
    for path in folder.glob("frame_??????.png"):
        number = path.stem.removeprefix("frame_")
        if number.isdecimal() and int(number) not in frames:
            path.unlink()
