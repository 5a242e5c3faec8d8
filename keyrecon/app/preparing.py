"""The automatic part of a project, made with what a person told and doubting what does not fit.

A click on the wrong place spoils colours and sizes for the whole video, and nothing that comes
later shows which click it was. So each click on a head or foot is held against the track that was
made with it; where some lie elsewhere, the track is made without them too, and kept where
it is as sure of the player.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from keyrecon.io.durable import write_durably
from keyrecon.io.formats.coco import coco_text, read_coco
from keyrecon.io.video import Video
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options, frames_off_marks, prepare
from keyrecon.progress import Progress
from keyrecon.records import Annotations, Pick, Preparation, Shots
from keyrecon.segmentation.marked_bodies import anchors_from_bodies
from keyrecon.tracking.anchors import distance_to_track, misplaced_marks

MAX_PICK_DISTANCE = 0.25
"""A click lies off its part where the track passes it farther away than this, player heights: a
head is .13 high, a shoe .15 long, and a track that is right lies within .1 of both."""
AS_SURE = 0.01
"""Tracks whose confidences differ by less in the mean are equally sure of the player. One wrong
click in eleven on a real rally: .77 with it, .99 without."""


@dataclass(frozen=True, eq=False)
class ProjectPreparation:
    """The automatic part, and what a person told that does not fit it."""

    preparation: Preparation
    set_aside: tuple[Pick, ...] = ()
    """Clicks without which the player was found more surely: they were left out."""
    doubtful: tuple[Pick, ...] = ()
    """Clicks that lie off the track, which is no surer without them."""
    marks: Annotations | None = None

    def contradictions(self) -> list[str]:
        """A line for every click or mark that does not fit the rest."""
        track = self.preparation.track
        lines = [
            f"{_named(pick)} lies {distance_to_track(track, pick):.1f} body heights from where the "
            f"player's {pick.part} was found, and was left aside: without it the player is found "
            "as surely or more so. Click it anew."
            for pick in self.set_aside
        ]
        lines += [
            f"{_named(pick)} lies {distance_to_track(track, pick):.1f} body heights from where the "
            f"player's {pick.part} was found: one of the two is wrong; look at that frame."
            for pick in self.doubtful
        ]
        if self.marks is not None:
            lines += [
                f"The {mark.part} marked in frame {mark.frame}: {mark.distance:.1f} body heights "
                "off the way through the frames before and after; look at that mark."
                for mark in misplaced_marks(
                    track,
                    anchors_from_bodies(self.marks),
                    self.preparation.video.fps,
                    self.preparation.shots,
                )
            ]
        return lines


MOST_LISTED = 12
"""Shots that are listed one by one."""


def describe_shots(shots: Shots) -> list[str]:
    """How many shots there are, which of them show the player, and what the others show."""
    if len(shots.parts) == 1:
        return []
    used = sum(shots.usable)
    listed = [
        f"{number} ({part.start}-{part.stop - 1}) {shown}"
        for number, (part, shown) in enumerate(zip(shots.parts, shots.shows, strict=True), 1)
    ]
    more = f"; and {len(listed) - MOST_LISTED} more" if len(listed) > MOST_LISTED else ""
    return [
        f"{len(listed)} shots, {used} usable (frames): {'; '.join(listed[:MOST_LISTED])}{more}. "
        "Nothing is made of the others; where this is wrong, say so with --shots.use or "
        "--shots.skip and their numbers, or mark the player there."
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
    """The automatic part; made with the marks where there are no picks, or where it was off.

    What was made before is found again while no mark contradicts its track. The printed forms know
    picks alone, where there are any.
    """
    if marks is not None and not np.isfinite(marks.joints).any():
        marks = None  # a file without a mark tells nothing
    if options.track.method == "paper" and workspace.picks_file.is_file():
        return _without_misplaced(workspace, video, options, None, progress)
    used, file = None, workspace.prepared_marks_file
    if file.is_file() and not workspace.stages.force:
        used = read_coco(file, workspace.skeleton, len(video), (video.width, video.height))
    if used is None and marks is not None and not workspace.picks_file.is_file():
        used = marks
    found = _without_misplaced(workspace, video, options, used, progress)
    if marks is not None and len(frames_off_marks(found.preparation, marks)):
        used = marks
        found = _without_misplaced(workspace, video, options, used, progress)
    if used is not None:
        size = (video.width, video.height)
        write_durably(file, coco_text(used, size).encode())
    return ProjectPreparation(found.preparation, found.set_aside, found.doubtful, marks)


def _without_misplaced(
    workspace: Workspace,
    video: Video,
    options: Options,
    marks: Annotations | None,
    progress: Progress,
) -> ProjectPreparation:
    """With all picks, or without those that lie off the track where it is surer without them."""
    keep = workspace.stages.keep
    asked = marks is None or workspace.picks_file.is_file()
    picks = list(workspace.picks()) if asked else []
    first = prepare(video, picks, options, keep, progress, marks)
    off = misplaced_picks(first, picks)
    if options.track.method == "paper":
        return ProjectPreparation(first, doubtful=tuple(off))
    tried: list[list[Pick]] = [[]]
    track = first
    while off not in tried:  # a track that one click misled may miss others, which come back
        tried.append(off)
        others = [pick for pick in picks if pick not in off]
        if marks is None and not {"head", "foot"} <= {pick.part for pick in others}:
            return ProjectPreparation(first, doubtful=tuple(off))
        track = prepare(video, others, options, keep, progress, marks)
        off = misplaced_picks(track, picks)
    if track.track.confidence.mean() < first.track.confidence.mean() - AS_SURE:
        return ProjectPreparation(first, doubtful=tuple(misplaced_picks(first, picks)))
    return ProjectPreparation(track, set_aside=tuple(off))


def misplaced_picks(preparation: Preparation, picks: Sequence[Pick]) -> list[Pick]:
    """Clicks on heads and feet that lie far from those of the track."""
    track = preparation.track
    return [
        pick
        for pick in picks
        if pick.part in ("head", "foot") and distance_to_track(track, pick) > MAX_PICK_DISTANCE
    ]
