"""Records of some of a video's frames, and of shots put end to end.

What changes from frame to frame is held in arrays whose first axis is time, so that frames are
taken, joined and put back alike in every record. Where a video has shots that are of no use, the
stages after tracking work on the others put end to end; what they make is then spread over
the frames of the file, unknown in between.
"""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float, Int

from keyrecon.records import (
    SOURCES,
    Annotations,
    CameraPath,
    Edges,
    FlowTracks,
    JointTracks,
    Keyframes,
    Motion,
    Pick,
    PoseDistances,
    Shots,
    Track,
    TrackAnchors,
    TrackVerification,
)

PerFrame = TypeVar("PerFrame", Track, FlowTracks, JointTracks, TrackVerification)
"""Records whose every value has one entry per frame."""


def take_frames(record: PerFrame, frames: slice | Int[np.ndarray, "n"]) -> PerFrame:
    """A record of some frames only."""
    own: dict[str, Any] = {field.name: getattr(record, field.name) for field in fields(record)}
    taken: dict[str, Any] = {n: None if v is None else v[frames] for n, v in own.items()}
    return type(record)(**taken)


def join_frames(records: Sequence[PerFrame]) -> PerFrame:
    """The frames of several records one after the other; of one, that itself."""
    if len(records) == 1:
        return records[0]
    joined: dict[str, Any] = {}
    for field in fields(records[0]):
        each = [getattr(record, field.name) for record in records]
        joined[field.name] = None if any(v is None for v in each) else np.concatenate(each)
    return type(records[0])(**joined)


def part_of_path(camera: CameraPath, frames: slice | Int[np.ndarray, "n"]) -> CameraPath:
    """How the camera moves in some frames of one shot or of several."""
    exposure = None if camera.exposure is None else camera.exposure[frames]
    return CameraPath(camera.to_reference[frames], camera.confidence[frames], exposure=exposure)


def part_of_marks(marks: Annotations, frames: Int[np.ndarray, "n"]) -> Annotations:
    """What was marked in some frames, ascending, which are numbered anew."""
    inside = np.isin(marks.frames, frames)
    row = {int(frame): number for number, frame in enumerate(frames)}
    return replace(
        marks,
        frames=np.searchsorted(frames, marks.frames[inside]),
        joints=marks.joints[inside],
        visible=marks.visible[inside],
        nearer=marks.nearer[inside],
        absent=tuple((row[t], name) for t, name in marks.absent if t in row),
    )


def part_of_anchors(anchors: TrackAnchors, part: slice) -> TrackAnchors:
    """Fixed points within a shot, whose frames count from 0."""
    inside = (anchors.frames >= part.start) & (anchors.frames < part.stop)
    own = TrackAnchors(*(getattr(anchors, field.name)[inside] for field in fields(anchors)))
    return replace(own, frames=own.frames - part.start)


def part_of_picks(picks: Sequence[Pick], part: slice) -> tuple[Pick, ...]:
    """Clicks within a shot, whose frames count from 0."""
    inside = (pick for pick in picks if part.start <= pick.frame < part.stop)
    return tuple(replace(pick, frame=pick.frame - part.start) for pick in inside)


def scatter_frames(record: PerFrame, frames: Int[np.ndarray, "n"], count: int) -> PerFrame:
    """A record of `frames` as one of `count` frames: those between have NaN, or 0."""
    values: dict[str, Any] = {}
    for field in fields(record):
        own: np.ndarray | None = getattr(record, field.name)
        values[field.name] = None if own is None else scatter_values(field.name, own, frames, count)
    return type(record)(**values)


SAYING_NOTHING = {"confidence": 0.0, "exchange_evidence": 0.0, "elsewhere": 0.0}
SAYING_NOTHING |= {"source": float(SOURCES.index("interpolated"))}
"""What some values are in frames of which nothing is known; others are NaN, or 0."""


def scatter_values(
    name: str, values: np.ndarray, frames: Int[np.ndarray, "n"], count: int
) -> np.ndarray:
    """Values of `frames` among `count`: NaN between them, or what says nothing."""
    unknown = np.nan if values.dtype.kind == "f" else 0
    whole = np.full((count, *values.shape[1:]), SAYING_NOTHING.get(name, unknown), values.dtype)
    whole[frames] = values
    return whole


def frames_before(frames: Int[np.ndarray, "n"], count: int) -> Int[np.ndarray, "T"]:
    """For each of `count` frames the place in `frames` of the last one up to it, or the first."""
    return np.clip(np.searchsorted(frames, np.arange(count), side="right") - 1, 0, None)


def scatter_track(track: Track, frames: Int[np.ndarray, "n"], count: int) -> Track:
    """The track of `frames` among `count`: between them the player is nowhere, and the rest stands
    as before, with no confidence."""
    spread = take_frames(track, frames_before(frames, count))
    known = np.isin(np.arange(count), frames)
    return replace(
        spread,
        box=np.where(known[:, None], spread.box, np.nan),
        confidence=np.where(known, spread.confidence, 0.0),
    )


def scatter_edges(
    edges: Sequence[Edges], frames: Int[np.ndarray, "n"], count: int
) -> tuple[Edges, ...]:
    """The edges of `frames` among `count`; none between them."""
    first = edges[0]
    none = Edges(*(getattr(first, field.name)[:0] for field in fields(Edges)))
    spread = [none] * count
    for frame, own in zip(frames.tolist(), edges, strict=True):
        spread[frame] = own
    return tuple(spread)


def without_steps_over_cuts(distances: PoseDistances, shots: Shots) -> PoseDistances:
    """Pose distances whose steps from one shot to the next are not known."""
    steps = distances.consecutive_distance.copy()
    steps[:, [first - 1 for first in shots.first[1:]]] = np.nan
    return replace(distances, consecutive_distance=steps)


def scatter_distances(
    distances: PoseDistances, frames: Int[np.ndarray, "n"], count: int
) -> PoseDistances:
    """Pose distances of `frames` among `count`: the others are like none, and not to be seen."""
    before = frames_before(frames, count)
    known = np.isin(np.arange(count), frames)
    farthest = np.array([[distances.upper.max()], [distances.lower.max()]])
    steps = distances.consecutive_distance
    usual = np.zeros((2, 1))
    if np.isfinite(steps).any():
        usual = np.nanmedian(steps, axis=1, keepdims=True)
    follows = np.minimum(before[:-1], max(steps.shape[1] - 1, 0))
    both = known[:-1] & known[1:]
    unknown = np.where(known[:-1] == known[1:], usual, np.nan)
    return PoseDistances(
        upper=distances.upper,
        lower=distances.lower,
        frames=frames[distances.frames],
        row=distances.row[before],
        exemplar_distance=np.where(known, distances.exemplar_distance[:, before], farthest).astype(
            distances.exemplar_distance.dtype
        ),
        consecutive_distance=np.where(both, steps[:, follows], unknown).astype(steps.dtype),
        visibility_score=np.where(known, distances.visibility_score[before], 0.0),
        seen=np.where(known, distances.seen[:, before], 0.0),
    )


def part_of_keyframes(keyframes: Keyframes, frames: Int[np.ndarray, "n"]) -> Keyframes:
    """Keyframes numbered anew within `frames`, which hold all of them."""
    upper, lower = (
        replace(
            half,
            frames=np.searchsorted(frames, half.frames),
            nearest=np.searchsorted(frames, half.nearest[frames]),
            represented=half.represented[frames],
            distance=half.distance[frames],
            gains=half.gains
            and replace(half.gains, order=np.searchsorted(frames, half.gains.order)),
        )
        for half in (keyframes.upper, keyframes.lower)
    )
    return replace(keyframes, upper=upper, lower=lower)


PER_FRAME = ("points3d", "points2d", "points2d_propagated", "confidence", "source", "scale", "time")
"""Values of a motion that have one entry per frame."""
OPTIONAL_PER_FRAME = ("expected_error", "exchange_evidence", "elsewhere")
"""Further ones, that some motions lack."""


def cut_motion(motion: Motion, part: slice) -> Motion:
    """Some frames of a motion; times stay those of the video, frames count from the new start."""
    optional = [name for name in OPTIONAL_PER_FRAME if getattr(motion, name) is not None]
    own: dict[str, Any] = {name: getattr(motion, name)[part] for name in (*PER_FRAME, *optional)}
    return replace(
        motion,
        **own,
        keyframes=_within(motion.keyframes, part),
        cuts=None if motion.cuts is None else _within(motion.cuts, part, beside=1),
    )


def _within(frames: Int[np.ndarray, "n"], part: slice, beside: int = 0) -> Int[np.ndarray, "m"]:
    inside = (frames >= part.start + beside) & (frames < part.stop)
    return frames[inside] - part.start


def motion_in_file(motion: Motion, shots: Shots, time: Float[np.ndarray, "T"]) -> Motion:
    """The motion of the usable shots, over the frames of the file; unknown in the others."""
    frames, count = shots.usable_frames, shots.n_frames

    optional = [name for name in OPTIONAL_PER_FRAME if getattr(motion, name) is not None]
    own: dict[str, Any] = {
        name: scatter_values(name, getattr(motion, name), frames, count)
        for name in (*PER_FRAME, *optional)
    }
    return replace(
        motion,
        **(own | {"time": time}),
        keyframes=frames[motion.keyframes],
        cuts=np.array(shots.first[1:]),
    )
