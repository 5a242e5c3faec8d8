"""Joints carried through a long video in groups of shots, so that memory does not grow with it.

What carries joints to a frame are the annotated frames, wherever they are, and the frames beside
it. So a group of shots is worked on by itself, together with all annotated frames and the few
frames beside each that its place in the picture is smoothed over. A shot that is longer than a
group is worked on in pieces that overlap. Each group is a stage result of its own: an interrupted
run goes on with the next one.

Memory: 125 kB per frame on looped videos of 1800 and 5400 frames of 640x360, 280 kB in matches of
1280x720; a group takes 1.3 GB, and groups are worked on side by side, as shots are, but no more
than two at a time unless somebody asks for more workers.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Int

from keyrecon.body_models.side_model import SideModel
from keyrecon.keeping import Keep, work_on_each
from keyrecon.progress import Progress
from keyrecon.propagation.propagation import PropagateOptions, propagate_joints
from keyrecon.records import Annotations, FlowTracks, JointTracks, Preparation, Shots
from keyrecon.shots.usable import part_of_preparation
from keyrecon.timeline import join_frames, part_of_marks, take_frames

MOST_FRAMES = 4500
"""Of a group, the annotated frames of others apart: a minute and a half at 50 frames a second,
three at 25. What is shorter is worked on as a whole."""
BESIDE_SECONDS = 0.125
"""Before and after an annotated frame of another group: 2.5 standard deviations of the smoothing of
the place in the picture (`propagation.body_frame`)."""
OVERLAP_SECONDS = 2.0
"""That pieces of one shot reach into one another: longer than a stroke."""


@dataclass(frozen=True, eq=False)
class ShotGroup:
    """Some frames of a video that are worked on together."""

    own: slice
    """Frames whose result counts."""
    frames: Int[np.ndarray, "n"]
    """All that are worked on, ascending."""


def group_shots(
    shots: Shots, annotated: Int[np.ndarray, "K"], fps: float, most: int = MOST_FRAMES
) -> list[ShotGroup]:
    """Groups of at most `most` frames that follow one another; one for a video that is shorter."""
    if shots.n_frames <= most:
        return [ShotGroup(slice(0, shots.n_frames), np.arange(shots.n_frames))]
    beside, overlap = (int(np.ceil(s * fps)) for s in (BESIDE_SECONDS, OVERLAP_SECONDS))
    around = [_within(shots, slice(t, t + 1), beside) for t in annotated.tolist()]
    groups = []
    for own in _join(list(_pieces(shots, most)), most):
        worked_on = np.zeros(shots.n_frames, dtype=bool)
        for part in (_within(shots, own, overlap), *around):
            worked_on[part] = True
        groups.append(ShotGroup(own, np.flatnonzero(worked_on)))
    return groups


def _pieces(shots: Shots, most: int) -> Iterator[slice]:
    """Shots, and even pieces of those that are too long."""
    for part in shots.parts:
        count = -(-(part.stop - part.start) // most)
        ends = np.linspace(part.start, part.stop, count + 1).round().astype(int).tolist()
        yield from (slice(*span) for span in pairwise(ends))


def _join(pieces: Sequence[slice], most: int) -> list[slice]:
    """Pieces put together as long as they are no more than `most` frames."""
    joined = [pieces[0]]
    for piece in pieces[1:]:
        if piece.stop - joined[-1].start <= most:
            joined[-1] = slice(joined[-1].start, piece.stop)
        else:
            joined.append(piece)
    return joined


def _within(shots: Shots, part: slice, beside: int) -> slice:
    """A part with some frames of its first and last shot on either side."""
    first, last = shots.number[part.start], shots.number[part.stop - 1]
    start, stop = shots.parts[first].start, shots.parts[last].stop
    return slice(max(start, part.start - beside), min(stop, part.stop + beside))


def propagate_in_groups(
    preparation: Preparation,
    annotations: Annotations,
    flow: FlowTracks | None,
    sides: SideModel | None,
    options: PropagateOptions,
    keep: Keep,
    progress: Progress,
    most: int = MOST_FRAMES,
) -> JointTracks:
    """The annotated joints in every frame, as `propagate_joints` has them; all shots are usable.

    The paper's form goes through the video as a whole.
    """
    if options.method == "paper":
        most = preparation.shots.n_frames
    fps = preparation.video.fps
    groups = group_shots(preparation.shots, annotations.frames, fps, most)
    if len(groups) == 1:
        return keep(
            "propagate", propagate_joints, preparation, annotations, flow, sides,
            options=options, progress=progress,
        )  # fmt: skip

    def carry(group: ShotGroup) -> JointTracks:
        tracks = keep(
            f"propagate@{group.own.start}",
            propagate_joints,
            part_of_preparation(preparation, group.frames),
            part_of_marks(annotations, group.frames),
            flow and take_frames(flow, group.frames),
            sides,
            options=options,
        )
        span = np.searchsorted(group.frames, (group.own.start, group.own.stop)).tolist()
        return take_frames(tracks, slice(*span))

    carried = work_on_each(keep, carry, groups, large=True)
    return join_frames([*progress(carried, "Propagating joints", len(groups))])
