"""The automatic part of a project, made with a person's clicks and marks but without outliers.

A click on the wrong place spoils colours and sizes for the whole video, and nothing that comes
later shows which click it was. So each click on a head or foot is compared with the track that was
made with it. Where some lie elsewhere, the track is made without them too; that track is kept if
its confidence is as high.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Int

from keyrecon.app.prepared_marks import marks_of_last_preparation, teach_more
from keyrecon.io.durable import write_durably
from keyrecon.io.formats.coco import coco_text
from keyrecon.io.formats.picks import write_picks
from keyrecon.io.formats.shot_choices import ShotChoices
from keyrecon.io.video import Video
from keyrecon.io.workspace import Workspace
from keyrecon.keyframes.absence import MOST_STRETCHES, format_stretches
from keyrecon.numerics.runs import list_runs
from keyrecon.pipeline import Options, prepare
from keyrecon.progress import Progress
from keyrecon.records import (
    PERHAPS,
    Annotations,
    CameraPath,
    Pick,
    Preparation,
    Shots,
    Track,
    TrackVerification,
)
from keyrecon.segmentation.marked_bodies import anchors_from_bodies
from keyrecon.tracking.anchors import distance_to_track, outlier_marks
from keyrecon.tracking.tracklets import MAX_STEP_SECONDS, find_jumps
from keyrecon.tracking.verification import find_meetings

MAX_PICK_DISTANCE = 0.25
"""A click lies off its part where the track passes it farther away than this, player heights: a
head is .13 high, a shoe .15 long, and a track that is right lies within .1 of both."""
AS_SURE = 0.01
"""Tracks whose confidences differ by less in the mean are equally sure of the player. One wrong
click in eleven on a real rally: .77 with it, .99 without."""


CUT_OFF, HIDDEN = 0.1, 0.05
"""Shares of the frames from which feet that the picture cuts off are told of, and a player who is
hidden."""
LIGHT_CHANGE = 1.25
"""Brightest by darkest frame from which a change of the light is told of: one that is seen."""


@dataclass(frozen=True, eq=False)
class ProjectPreparation:
    """The automatic part, and the clicks and marks that do not agree with it."""

    preparation: Preparation
    rejected_picks: tuple[Pick, ...] = ()
    """Outliers that were left out: without them the track is as sure or surer."""
    suspect_picks: tuple[Pick, ...] = ()
    """Outliers that were kept: without them the track is less sure."""
    prepared_picks: tuple[Pick, ...] = ()
    """Clicks that the automatic part was made with."""
    marks: Annotations | None = None
    picks: tuple[Pick, ...] = ()

    def warnings(self) -> list[str]:
        """Lines on the video, the track, and every click or mark that does not agree with it."""
        track = self.preparation.track
        made, lines = self.preparation, []
        lines += describe_light(made.camera, made.shots)
        if made.verification is not None:
            lines += describe_truncation(made.verification)
            lines += describe_hiding(made.verification)
            lines += describe_identity(
                made.track,
                made.camera,
                made.video.fps,
                made.shots,
                made.verification,
                self._known_frames(),
            )
        lines += [
            f"{_named(pick)} lies {distance_to_track(track, pick):.1f} body heights from where the "
            f"player's {pick.part} was found, and was left aside: without it the player is found "
            "as surely or more so. Click it anew."
            for pick in self.rejected_picks
        ]
        lines += [
            f"{_named(pick)} lies {distance_to_track(track, pick):.1f} body heights from where the "
            f"player's {pick.part} was found: one of the two is wrong; look at that frame."
            for pick in self.suspect_picks
        ]
        if self.marks is not None:
            lines += [
                f"The {mark.part} marked in frame {mark.frame}: {mark.distance:.1f} body heights "
                "off the way on which the player was followed: one of the two is wrong. Look at "
                f"that mark; if it is right, mark a body in frame {mark.around[0]} or "
                f"{mark.around[1]} too."
                for mark in outlier_marks(
                    track,
                    anchors_from_bodies(self.marks),
                    self.preparation.video.fps,
                    self.preparation.shots,
                )
            ]
        return lines

    def _known_frames(self) -> list[int]:
        """Frames in which a person told where the player is, and the track is there."""
        off = {pick.frame for pick in self.suspect_picks}
        known = {pick.frame for pick in self.picks if pick.part == "head"} - off
        if self.marks is not None:
            marked = np.isfinite(self.marks.joints).all(axis=2).mean(axis=1) > 0.5
            known |= {*self.marks.frames[marked].tolist()}
        return sorted(known)


def with_chosen_shots(options: Options, choices: ShotChoices) -> Options:
    """Options with the shots that a person chose on the page; these stand over former ones."""
    if choices == ShotChoices():
        return options
    kept = options.shots
    use, skip = ({*text.replace(",", " ").split()} for text in (kept.use, kept.skip))
    used, skipped = ({str(number) for number in part} for part in (choices.use, choices.skip))
    return replace(
        options,
        shots=replace(kept, use=_listed(use - skipped | used), skip=_listed(skip - used | skipped)),
    )


def _listed(numbers: set[str]) -> str:
    return ",".join(sorted(numbers, key=lambda word: (len(word), word)))


def describe_light(camera: CameraPath, shots: Shots) -> list[str]:
    """Lines where usable shots are dark, and where the light changes in one so that it is seen."""
    used = np.flatnonzero(shots.usable)
    if camera.exposure is None or not len(used):
        return []
    parts = [(shots.parts[number], camera.exposure[shots.parts[number]]) for number in used]
    gain, lines = max(1 / float(np.median(light)) for _, light in parts), []
    if gain > LIGHT_CHANGE:
        lines.append(f"The video is dark: frames are compared as if {gain:.1f} times as bright.")
    part, light = max(parts, key=lambda one: one[1].max() / one[1].min())
    change = light.max() / light.min()
    if change < LIGHT_CHANGE:
        return lines
    darkest, brightest = part.start + int(light.argmin()), part.start + int(light.argmax())
    return [
        *lines,
        f"The light changes: frame {brightest} is {change:.1f} times as bright as frame "
        f"{darkest}. Frames are compared as if it had not; if the overlay shows that the player "
        "was lost there, mark a frame of each light.",
    ]


def describe_truncation(verification: TrackVerification) -> list[str]:
    """A line where the lower edge of the picture cuts the feet off."""
    often = _how_often(verification.frames, verification.truncated, CUT_OFF)
    line = (
        f"The lower edge of the picture cuts the player's feet off {often}: what was taken for "
        "feet there is none, and legs come out wrong. Film with the feet in the picture, or use a "
        "part of the video that shows them."
    )
    return [line] if often else []


def describe_hiding(verification: TrackVerification) -> list[str]:
    """A line where something laid over the picture hides the player."""
    often = _how_often(verification.frames, verification.hidden, HIDDEN)
    line = (
        "Something laid over the picture, such as a score, hides a part of the player "
        f"{often}: joints behind it are guessed from the marks before and after. Mark them in "
        "some of these frames as hidden ones."
    )
    return [line] if often else []


def _how_often(frames: Int[np.ndarray, "n"], flags: Bool[np.ndarray, "n"], least: float) -> str:
    """In how many of the frames, and in which longest; nothing below the least share."""
    share = float(flags.mean())
    if share < least:
        return ""
    turns = np.flatnonzero(np.diff(flags, prepend=False, append=False)).reshape(-1, 2)
    first, end = max(turns.tolist(), key=lambda run: run[1] - run[0])
    return f"in about {share:.0%} of the frames (longest: {frames[first]}-{frames[end - 1]})"


def describe_identity(
    track: Track,
    camera: CameraPath,
    fps: float,
    shots: Shots,
    verification: TrackVerification,
    known: Sequence[int],
) -> list[str]:
    """Lines where the track may have changed from the player to somebody alike.

    Nothing where a person told who is meant (`known` frames) on both sides.
    """
    meetings = find_meetings(verification, track, fps)
    jumps = find_jumps(track, camera, shots, fps)
    turns = [0, *(round((first + last) / 2) for first, last in meetings), len(track.head)]
    stretches = [s for s in pairwise(turns) if s[1] - s[0] > fps / 2]
    unsure = [s for s in stretches if not any(s[0] <= frame < s[1] for frame in known)]
    lines = []
    if meetings and unsure:
        where = ", ".join(f"{first}-{last}" for first, last in meetings[:8])
        mark = ", ".join(str((first + end) // 2) for first, end in unsure[:8])
        lines.append(
            f"Another figure that looks like the player comes close in frames {where}: the track "
            f"may go on with the wrong one. Mark the player's body in frame {mark} to be sure."
        )
    apart = unlinked_stretches(track, verification)
    if apart:
        mark = ", ".join(str((first + last) // 2) for first, last in apart[:MOST_STRETCHES])
        lines.append(
            "The player found jumps to another place, farther than anybody moves: nothing joins "
            f"frames {format_stretches(apart)} to the player who was marked, so they are left "
            "out, and no keyframe is asked for there. Where the player is to be seen there, mark "
            f"the body: frame {mark}."
        )
    lines += [
        f"The player found jumps to another place in frame {frame}, farther than anybody moves: "
        "on one side of it that is not the player. Look there, and mark the player's body where "
        "it is somebody else."
        for frame in [f for f in jumps if not _is_beside(f, apart, fps)][:4]
    ]
    return lines


def unlinked_stretches(track: Track, verification: TrackVerification) -> list[tuple[int, int]]:
    """First and last frames of stretches in which somebody was followed who may not be the player,
    those about them included in which nobody was seen."""
    if verification.unlinked is None:
        return []
    frames = verification.frames[verification.unlinked]
    unseen = list_runs(track.confidence == 0)
    return [s for s in unseen if ((s[0] <= frames) & (frames <= s[1])).any()]


def _is_beside(frame: int, stretches: Sequence[tuple[int, int]], fps: float) -> bool:
    """Whether a jump leads into one of the stretches, or out of it."""
    near = MAX_STEP_SECONDS * fps
    return any(first - near <= frame <= last + near for first, last in stretches)


MOST_LISTED = 12
"""Shots that are listed one by one."""


def describe_shots(shots: Shots) -> list[str]:
    """How many shots there are, which of them show the player, and what the others show."""
    if len(shots.parts) == 1:
        return []
    named = _named_shots(shots)
    listed = [f"{name} {shown}" for name, shown in zip(named, shots.shows, strict=True)]
    more = f"; and {len(listed) - MOST_LISTED} more" if len(listed) > MOST_LISTED else ""
    listing = f"{'; '.join(listed[:MOST_LISTED])}{more}"
    if all(shots.usable):
        return [f"{len(listed)} shots, all usable (frames): {listing}."]
    return [
        f"{len(listed)} shots, {sum(shots.usable)} usable (frames): {listing}. "
        "Nothing is made of the others; where this is wrong, say so with --shots.use or "
        "--shots.skip and their numbers, or mark the player there.",
        *_describe_unsure(shots),
    ]


def _named_shots(shots: Shots) -> list[str]:
    """Number and frames of each."""
    parts = enumerate(shots.parts, 1)
    return [f"{number} ({part.start}-{part.stop - 1})" for number, part in parts]


def _describe_unsure(shots: Shots) -> list[str]:
    """Which shots a person must tell of."""
    named = zip(_named_shots(shots), shots.shows, strict=True)
    unsure = [name for name, shown in named if shown == PERHAPS]
    if not unsure:
        return []
    more = f" and {len(unsure) - MOST_LISTED} more" if len(unsure) > MOST_LISTED else ""
    which = f"shot{'s' if len(unsure) > 1 else ''} {', '.join(unsure[:MOST_LISTED])}{more}"
    return [
        f"Perhaps the player, or somebody dressed alike: {which}. Look, and if it is the player, "
        "say so with --shots.use or by a click in the strip of shots on the page."
    ]


def _named(pick: Pick) -> str:
    return f"The {pick.part} clicked in frame {pick.frame} ({pick.x:g}, {pick.y:g})"


def prepare_project(
    workspace: Workspace,
    video: Video,
    marks: Annotations | None,
    options: Options,
    progress: Progress,
) -> ProjectPreparation:
    """The automatic part, made with the picks, if any, and with marks where the track needs them.

    The track is made with the marks where there are no picks, or where a track without them has
    marked heads or feet elsewhere. The stored track is used again as long as no new mark disagrees
    with it and none of those it was made with was deleted or moved. The printed forms use picks
    alone, where there are any.
    """
    if marks is not None and not np.isfinite(marks.joints).any():
        marks = None  # a file without a mark tells nothing
    if options.track.method == "paper" and workspace.picks_file.is_file():
        prepared = _without_outlier_picks(workspace, video, options, None, progress)
        write_picks(workspace.prepared_picks_file, prepared.prepared_picks)
        return _with_marks_and_picks(workspace, prepared, marks)
    file = workspace.prepared_marks_file
    track_marks = marks_of_last_preparation(workspace, video, marks)
    if track_marks is None and marks is not None and not workspace.picks_file.is_file():
        track_marks = marks
    prepared = _without_outlier_picks(workspace, video, options, track_marks, progress)
    if marks is not None and teach_more(marks, track_marks, prepared.preparation):
        track_marks = marks
        prepared = _without_outlier_picks(workspace, video, options, track_marks, progress)
    if track_marks is None:
        file.unlink(missing_ok=True)  # what was made without marks is not recalled with any
    else:
        size = (video.width, video.height)
        write_durably(file, coco_text(track_marks, size).encode())
    write_picks(workspace.prepared_picks_file, prepared.prepared_picks)
    return _with_marks_and_picks(workspace, prepared, marks)


def _with_marks_and_picks(
    workspace: Workspace, prepared: ProjectPreparation, marks: Annotations | None
) -> ProjectPreparation:
    """With the marks, and with the clicks that were not rejected."""
    picks = workspace.picks() if workspace.picks_file.is_file() else ()
    kept = tuple(pick for pick in picks if pick not in prepared.rejected_picks)
    return replace(prepared, marks=marks, picks=kept)


def _without_outlier_picks(
    workspace: Workspace,
    video: Video,
    options: Options,
    marks: Annotations | None,
    progress: Progress,
) -> ProjectPreparation:
    """Made with all picks, or without the outliers where the track is at least as sure then."""
    keep = workspace.stages
    asked = marks is None or workspace.picks_file.is_file()
    picks = list(workspace.picks()) if asked else []
    first = prepare(video, picks, options, keep, progress, marks)
    off = outlier_picks(first, picks)
    if options.track.method == "paper":
        return ProjectPreparation(first, suspect_picks=tuple(off), prepared_picks=tuple(picks))
    tried: list[list[Pick]] = [[]]
    track, others = first, picks
    while off not in tried:  # a track that one click misled may miss others, which come back
        tried.append(off)
        others = [pick for pick in picks if pick not in off]
        if marks is None and not {"head", "foot"} <= {pick.part for pick in others}:
            return ProjectPreparation(first, suspect_picks=tuple(off), prepared_picks=tuple(picks))
        track = prepare(video, others, options, keep, progress, marks)
        off = outlier_picks(track, picks)
    if track.track.confidence.mean() < first.track.confidence.mean() - AS_SURE:
        off = outlier_picks(first, picks)
        return ProjectPreparation(first, suspect_picks=tuple(off), prepared_picks=tuple(picks))
    aside = tuple(pick for pick in picks if pick not in others)
    return ProjectPreparation(track, rejected_picks=aside, prepared_picks=tuple(others))


def outlier_picks(preparation: Preparation, picks: Sequence[Pick]) -> list[Pick]:
    """Clicks on heads and feet that lie far from those of the track."""
    track = preparation.track
    return [
        pick
        for pick in picks
        if pick.part in ("head", "foot") and distance_to_track(track, pick) > MAX_PICK_DISTANCE
    ]
