"""What the marks tell of one half of the body: its poses, and where its joints can be between them.

All of it in the player's own frame (`body_frame`), in player heights.
"""

import numpy as np
from jaxtyping import Complex, Float, Int

from keyrecon.errors import KeyreconError
from keyrecon.propagation.body_frame import BodyFrame, PlayerMarks
from keyrecon.propagation.edge_template import AnnotatedPoses
from keyrecon.propagation.half_body import BodyHalf
from keyrecon.propagation.hypotheses import MarkPredictions
from keyrecon.records import FlowTracks, HalfName, PoseDistances, Preparation

LEAST_MARKED = 0.5
"""Share of a half's joints that must be marked for a frame to serve as a template. Halved or
doubled: no change on one clip."""


def gather_poses(
    marks: PlayerMarks,
    bounds: Float[np.ndarray, "A A"],
    half: BodyHalf,
    fixed: Complex[np.ndarray, "T G"],
) -> AnnotatedPoses:
    """Annotated poses of one half: every frame on which at least half of its joints are marked.

    A joint that is not marked there stands at its median place beside its parent. `bounds` has the
    lengths that bones between any two joints of the skeleton can have.
    """
    places = marks.joints[:, half.joints]
    known = np.isfinite(places)
    rows = np.flatnonzero(known[:, half.free].mean(axis=1) >= LEAST_MARKED)
    frames, poses, known = marks.frames[rows], places[rows], known[rows]
    poses[:, half.fixed], known[:, half.fixed] = fixed[frames], True
    # from the joints that are there outwards, back for parents that are not, and out from these
    for parent, child in [*half.bones, *half.bones[::-1, ::-1], *half.bones]:
        bone, missing = poses[:, child] - poses[:, parent], np.isnan(poses[:, child])
        bone = bone[np.isfinite(bone)]
        if bone.size:
            usual = np.median(bone.real) + 1j * np.median(bone.imag)
            poses[missing, child] = poses[missing, parent] + usual
    if not np.isfinite(poses).all() or not rows.size:
        raise KeyreconError(
            f"Too few joints of the {half.name} body are marked to propagate them to other "
            "frames; mark all of them on at least one keyframe."
        )
    one, other = half.joints[half.bones].T
    return AnnotatedPoses(half, frames, poses, known, bounds[one, other])


def distances_to(
    distances: PoseDistances, name: HalfName, frames: Int[np.ndarray, "K"]
) -> Float[np.ndarray, "T K"]:
    """Pose distance of every frame to a few, player heights; by way of their exemplars."""
    table = distances.upper if name == "upper" else distances.lower
    exemplar_distance = distances.exemplar_distance[0 if name == "upper" else 1]
    result = table[distances.row[:, None], distances.row[frames]]
    result = result + exemplar_distance[:, None] + exemplar_distance[frames]
    result[frames, np.arange(len(frames))] = 0
    return result


def predict_from_marks(
    marks: PlayerMarks,
    flow: FlowTracks | None,
    body_frame: BodyFrame,
    half: BodyHalf,
    fixed: Complex[np.ndarray, "T G"],
    preparation: Preparation,
) -> MarkPredictions:
    """Joints of one half where flow and straight lines in time lead from the marks of a shot.

    Without a mark in its shot a joint is where the nearest one in another is, and that is worth
    nothing.
    """
    frames, number = np.arange(len(fixed)), preparation.shots.number
    lines = np.zeros((len(frames), len(half.joints)), complex)
    seconds, followed, confidence = np.zeros(lines.shape), lines.copy(), np.zeros(lines.shape)
    for joint, places in enumerate(marks.joints[:, half.joints].T):
        known = np.isfinite(places)
        lines[:, joint] = np.interp(frames, marks.frames[known], places[known])
        seconds[:, joint] = np.inf
        for shot, part in enumerate(preparation.shots.parts):
            inside = known & (number[marks.frames] == shot)
            at = marks.frames[inside]
            if len(at):
                lines[part, joint] = np.interp(frames[part], at, places[inside])
                away = nearest_distance(frames[part], at)
                seconds[part, joint] = away / preparation.video.fps
    lines[:, half.fixed] = fixed
    if flow is not None:
        flowed = body_frame.from_pixels(flow.joints, frames[:, None])[:, half.joints]
        sure = np.isfinite(flowed) & flow.joined[:, half.joints]
        followed[sure] = flowed[sure]
        confidence[sure] = flow.confidence[:, half.joints][sure]
    return MarkPredictions(followed, confidence, lines, seconds)


def nearest_distance(
    frames: Int[np.ndarray, "T"], marked: Int[np.ndarray, "k"]
) -> Int[np.ndarray, "T"]:
    """Frames to the nearest marked one; `marked` ascends."""
    after = np.clip(np.searchsorted(marked, frames), 0, len(marked) - 1)
    before = np.maximum(after - 1, 0)
    return np.minimum(np.abs(frames - marked[after]), np.abs(frames - marked[before]))
