"""What `keyrecon keyframes` does to a project folder, and what it tells of the keyframes."""

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
from keyrecon.app.project import describe_unmarked, load_annotations
from keyrecon.errors import counted, quoted
from keyrecon.io.durable import make_folder, write_durably
from keyrecon.io.formats.keyframes import keyframes_to_json
from keyrecon.io.frame_reader import side_by_side
from keyrecon.io.held_video import hold_if_small, with_exposure
from keyrecon.io.option_tables import check_options
from keyrecon.io.video_writer import write_picture
from keyrecon.io.workspace import Workspace
from keyrecon.keyframes.absence import absent_frames, list_stretches, listed_stretches
from keyrecon.keyframes.selection import KeyframeOptions
from keyrecon.pipeline import Options, as_printed, with_marked_keyframes
from keyrecon.progress import Progress
from keyrecon.records import Annotations, HalfKeyframes, Keyframes, Preparation
from keyrecon.report.drawing import point_out
from keyrecon.shots.following import HELD
from keyrecon.uncertainty import unsure_track


@dataclass(frozen=True)
class KeyframeSettings:
    """The options of keyframes that commands and page offer; None leaves the project's."""

    budget: float | None = None
    coverage: float | None = None
    reach: int | None = None

    def over(self, options: KeyframeOptions) -> KeyframeOptions:
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
    told: Collection[str] = (),
) -> str:
    """Run the automatic part; write keyframes.json and a picture of each keyframe.

    Options `told` by dotted names count also where they are as usual.
    `printed` takes the forms that the paper prints. The project remembers its options without
    them, so that a run by the same forms finds the same stages, and one by ours is not bound.
    """
    workspace.check_writable()
    choices = workspace.shot_choices()
    options = with_chosen_shots(workspace.options(options, Options(), told=told), choices)
    options = replace(options, keyframes=chosen.over(options.keyframes))
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
    return describe_keyframes(workspace, preparation, marks, prepared.contradictions())


def describe_keyframes(
    workspace: Workspace,
    preparation: Preparation,
    marks: Annotations | None = None,
    contradictions: Sequence[str] = (),
) -> str:
    """What was found, what of the person's does not fit it, and what to do next."""
    keyframes, frames = preparation.keyframes, len(preparation.video)
    told = _told_to_be_unlinked(preparation)
    unsure = [
        stretch
        for stretch in unsure_track(preparation.track, preparation.shots, keyframes.reach)
        if not told[stretch.frame]
    ]
    folder, used = quoted(workspace.folder), preparation.shots.usable_frames
    seen = float((preparation.track.confidence[used] > 0).mean())
    left = describe_unmarked(marks, keyframes)
    halves = [
        f"{name} body: {counted(len(half.frames), 'keyframe')}; {half.coverage:.1%} of the frames "
        f"look like one of them (outlines at most {half.beta:.1%} of the player's height apart; "
        f"{_compare_with_printed(keyframes, half)})."
        for name, half in (("Upper", keyframes.upper), ("Lower", keyframes.lower))
    ]
    return "\n".join(
        [
            f"Player found in {seen:.1%} of {len(used)} frames.",
            *describe_shots(preparation.shots),
            *contradictions,
            *_describe_absence(preparation),
            *(stretch.text for stretch in unsure),
            *halves,
            *_describe_gains(keyframes),
            f"Annotation cost {annotation_cost(keyframes, frames):.2%}: {len(keyframes.frames)} "
            f"different frames, listed in {workspace.keyframes_file}, pictures in "
            f"{workspace.pictures}.",
            *([left] if marks is not None and left else []),
            f"Next: keyrecon annotate {folder}, or mark the joints in another tool (COCO "
            f"keypoints, DeepLabCut or CVAT) and keyrecon import {folder} FILE"
            if left
            else f"All of them are marked. Next: keyrecon run {folder}",
        ]
    )


def _compare_with_printed(keyframes: Keyframes, half: HalfKeyframes) -> str:
    if keyframes.method == "paper":
        return "chosen by Eq. 2-4 as printed"
    return f"the choice printed in the paper would take {half.printed_count}"


def _describe_gains(keyframes: Keyframes) -> list[str]:
    """What a person who stops early has, and what one mark more would bring."""
    lines = []
    for name, half in (("Upper", keyframes.upper), ("Lower", keyframes.lower)):
        gains = half.gains
        if gains is None:
            continue
        first, middle = gains.order[:3].tolist(), (len(gains.order) + 1) // 2
        lines.append(
            f"{name} body, most useful first: {', '.join(map(str, first))}, ... (the whole order "
            f"is in keyframes.json). The first {counted(middle, 'mark')} will show the pose of "
            f"{gains.coverage[middle - 1]:.0%} of the frames to within {gains.beta:.1%} of the "
            f"height, all {len(gains.order)} of {gains.coverage[-1]:.0%}; one more would add "
            f"{gains.next_gain:.1%}."
        )
    return lines


def _describe_absence(preparation: Preparation) -> list[str]:
    """Stretches in which no keyframes are asked for."""
    reach = preparation.keyframes.reach
    absent = absent_frames(preparation.pose_distances, reach) & preparation.track.known
    absent &= ~_told_to_be_unlinked(preparation)
    lines = []
    if stretches := list_stretches(absent):
        listed = listed_stretches(stretches)
        lines.append(f"Nobody seen in frames {listed}: no keyframe is asked for there.")
    legless = np.isnan(preparation.pose_distances.seen[1]) & preparation.track.known & ~absent
    if stretches := list_stretches(legless):
        listed = listed_stretches(stretches)
        lines.append(
            f"Both legs out of the picture in frames {listed}: no keyframe of the lower body is "
            "asked for there."
        )
    return lines


def _told_to_be_unlinked(preparation: Preparation) -> Bool[np.ndarray, "T"]:
    """Frames of which `contradictions` tell already that who is followed there may be anybody."""
    told = np.zeros(len(preparation.track.head), dtype=bool)
    if preparation.verification is not None:
        for first, last in unlinked_stretches(preparation.track, preparation.verification):
            told[first : last + 1] = True
    return told


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
        write_picture(path, point_out(picture, track.box[frame], track.head[frame]))

    deque(side_by_side(write, zip(frames.tolist(), shown, strict=True)), maxlen=0)
    delete_other_pictures(workspace.pictures, frames)


def delete_other_pictures(folder: Path, frames: Int[np.ndarray, "K"]) -> None:
    """Delete pictures of frames that are no keyframes any more; a person's own files stay."""
    for path in folder.glob("frame_??????.png"):
        number = path.stem.removeprefix("frame_")
        if number.isdecimal() and int(number) not in frames:
            path.unlink()
