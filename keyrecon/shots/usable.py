"""The usable shots end to end, as the stages after tracking take them, and back to the file."""

from dataclasses import replace

import numpy as np
from jaxtyping import Int

from keyrecon.io.video import Video
from keyrecon.keyframes.absence import restore_frames, select_frames
from keyrecon.records import (
    Annotations,
    CameraPath,
    Colors,
    Keyframes,
    PoseDistances,
    Preparation,
    Shots,
)
from keyrecon.shots.following import FollowedPlayer
from keyrecon.timeline import (
    part_of_keyframes,
    part_of_marks,
    part_of_path,
    scatter_distances,
    scatter_edges,
    scatter_track,
    take_frames,
)


def in_file(
    video: Video,
    camera: CameraPath,
    colors: Colors,
    followed: FollowedPlayer,
    distances: PoseDistances,
    keyframes: Keyframes,
) -> Preparation:
    """What was made of the usable shots, over the frames of the file."""
    shots, track, edges = followed.shots, followed.track, followed.edges
    if not all(shots.usable):
        frames, count = shots.usable_frames, len(video)
        track = scatter_track(track, frames, count)
        edges = scatter_edges(edges, frames, count)
        distances = scatter_distances(distances, frames, count)
        upper, lower = (
            restore_frames(half, frames, count) for half in (keyframes.upper, keyframes.lower)
        )
        keyframes = replace(keyframes, upper=upper, lower=lower)
    return Preparation(
        video, camera, colors, track, edges, distances, keyframes, shots, followed.verification
    )


def usable_part(preparation: Preparation) -> Preparation:
    """The usable shots end to end, as if the file held nothing else."""
    shots = preparation.shots
    if all(shots.usable):
        return preparation
    return part_of_preparation(preparation, shots.usable_frames)


def part_of_preparation(preparation: Preparation, frames: Int[np.ndarray, "n"]) -> Preparation:
    """Some frames of usable shots end to end, all keyframes among them.

    Frames that do not follow one another in the file belong to different shots.
    """
    number = preparation.shots.number[frames]
    cuts = np.flatnonzero((np.diff(frames) > 1) | (np.diff(number) > 0)) + 1
    return Preparation(
        preparation.video.part(frames),
        part_of_path(preparation.camera, frames),
        preparation.colors,
        take_frames(preparation.track, frames),
        tuple(preparation.edges[t] for t in frames),
        select_frames(preparation.pose_distances, frames),
        part_of_keyframes(preparation.keyframes, frames),
        Shots.between(tuple(cuts.tolist()), len(frames)),
    )


def marks_in_shots(marks: Annotations, shots: Shots) -> Annotations:
    """What was marked in usable shots, by the frames of the file."""
    frames = shots.usable_frames
    shot_marks = part_of_marks(marks, frames)
    absent = tuple((int(frames[frame]), name) for frame, name in shot_marks.absent)
    return replace(shot_marks, frames=frames[shot_marks.frames], absent=absent)
