"""Joints in every frame from joints on a few (Section 5).

`method="paper"` is the paper's: the keyframe assigned to a frame is laid over it, each joint moves
with the edge elements around it, and appearance and apparent limb lengths refine the result
(`transfer.py`). The default goes further with the same edges and annotations. For each half of
the body, the lower first, it

1. brings several annotated figures onto every frame, limbs turning as they must, and carries the
   annotated figures through time from both sides (`candidates.py`);
2. chooses among these proposals by the cheapest path through time (`choose.py`);
3. settles all frames in one least squares over edges, bone shape and smooth motion, in which the
   annotated frames are held (`settle.py`).
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from keyrecon.errors import KeyreconError
from keyrecon.paper.joint_transfer import transfer_joints
from keyrecon.progress import Progress, silent
from keyrecon.propagation.body_frame import BodyFrame, stabilise_player
from keyrecon.propagation.correspondence import index_elements
from keyrecon.propagation.edge_template import AnnotatedPoses, make_edge_templates
from keyrecon.propagation.foot_evidence import learn_foot_offsets
from keyrecon.propagation.half_body import BodyHalf, split_body
from keyrecon.propagation.half_propagation import FrameEvidence, InitialHypotheses, propagate_half
from keyrecon.records import Annotations, HalfName, JointTracks, PoseDistances, Preparation

LEAST_MARKED = 0.5
"""Share of a half's joints that must be marked for a frame to serve as a figure."""


@dataclass(frozen=True)
class PropagateOptions:
    """How joints are carried to the frames that nobody annotated."""

    method: Literal["fused", "paper"] = "fused"
    """'paper': from the assigned keyframe alone; joints hidden there are missing. 'fused': from
    several keyframes and both neighbours in time; every joint gets a place and a confidence."""
    similar: int = 3
    """Keyframes brought onto each frame; more take longer."""
    elements: int = 96
    """Edge elements per frame and half of the body at most; more take longer."""
    rounds: int = 3
    """Times that edges are matched anew in the final least squares."""


def propagate_joints(
    preparation: Preparation,
    annotations: Annotations,
    options: PropagateOptions = PropagateOptions(),
    progress: Progress = silent,
) -> JointTracks:
    """Joints in px, confidence and source keyframe of every joint in every frame.

    Annotated joints come back as they were marked, with confidence 1. Raises KeyreconError when a
    joint is marked nowhere.
    """
    _require_marks(annotations)
    if options.method == "paper":
        carried = transfer_joints(preparation, annotations, progress)
        return _with_marks(annotations, annotations.visible, carried)
    return _fuse(preparation, annotations, options, progress)


def _require_marks(annotations: Annotations) -> None:
    marked = np.isfinite(annotations.joints).all(axis=2).any(axis=0)
    if not marked.all():
        names = [annotations.skeleton.names[j] for j in np.flatnonzero(~marked)]
        raise KeyreconError(
            f"No annotated frame has {', '.join(names)}; mark each joint on at least one keyframe, "
            "where it is hidden by the best guess."
        )


def _fuse(
    preparation: Preparation,
    annotations: Annotations,
    options: PropagateOptions,
    progress: Progress,
) -> JointTracks:
    """Both halves of the body over the whole video."""
    window = stabilise_player(preparation.track, preparation.camera)
    edges = preparation.contours.edges
    scene = FrameEvidence(index_elements(edges, window), preparation.video.fps)
    count, every = len(edges), np.arange(len(edges))
    joints = np.full((count, len(annotations.skeleton.names)), np.nan + 0j)
    confidence, source = np.zeros(joints.shape), np.zeros(joints.shape, dtype=np.int64)
    halves = split_body(annotations.skeleton)
    for half in progress(halves, "carrying joints", len(halves)):
        settled = joints[:, half.joints[half.given]]
        poses = gather_poses(annotations, window, half, settled)
        puppets = make_edge_templates(edges, window, poses, options.elements)
        if half.name == "lower":
            tracked = window.from_pixels(preparation.track.feet, every[:, None])
            puppets = replace(
                puppets, feet=learn_foot_offsets(half, poses.frames, poses.joints, tracked)
            )
        distance = distances_to(preparation.pose_distances, half.name, poses.frames)
        anchor = preparation.track.head if half.name == "upper" else preparation.track.mid_feet
        at = window.from_pixels(anchor, every)
        start = InitialHypotheses(at[:, None] - at[poses.frames], distance, settled)
        own = half.joints[half.own]
        followed = propagate_half(puppets, scene, start, options.similar, options.rounds)
        joints[:, own] = followed.joints[:, half.own]
        confidence[:, own] = followed.confidence[:, half.own]
        source[:, own] = poses.frames[followed.which[:, half.own]]
    tracks = JointTracks(window.to_pixels(joints, every[:, None]), confidence, source)
    return _with_marks(annotations, np.isfinite(annotations.joints).all(axis=2), tracks)


def gather_poses(
    annotations: Annotations,
    window: BodyFrame,
    half: BodyHalf,
    settled: Complex[np.ndarray, "T G"],
) -> AnnotatedPoses:
    """Annotated figures of one half: every frame on which at least half of its joints are marked.

    A joint that is not marked there stands as it usually does beside its parent.
    """
    marks = window.from_pixels(annotations.joints[:, half.joints], annotations.frames[:, None])
    known = np.isfinite(marks)
    rows = np.flatnonzero(known[:, half.own].mean(axis=1) >= LEAST_MARKED)
    frames, poses, known = annotations.frames[rows], marks[rows], known[rows]
    poses[:, half.given], known[:, half.given] = settled[frames], True
    # from the joints that are there outwards, back for parents that are not, and out from these
    for parent, child in [*half.bones, *half.bones[::-1, ::-1], *half.bones]:
        usual = np.nanmedian(poses[:, child] - poses[:, parent]) if rows.size else np.nan
        missing = np.isnan(poses[:, child])
        poses[missing, child] = poses[missing, parent] + usual
    if not np.isfinite(poses).all() or not rows.size:
        raise KeyreconError(
            f"Too few joints of the {half.name} body are marked to carry them to other "
            "frames; mark all of them on at least one keyframe."
        )
    return AnnotatedPoses(half, frames, poses, known)


def distances_to(
    comparison: PoseDistances, name: HalfName, frames: Int[np.ndarray, "K"]
) -> Float[np.ndarray, "T K"]:
    """Pose distance of every frame to a few, player heights; by way of their exemplars."""
    table = comparison.upper if name == "upper" else comparison.lower
    detour = comparison.detour[0 if name == "upper" else 1]
    apart = table[comparison.row[:, None], comparison.row[frames]]
    apart = apart + detour[:, None] + detour[frames]
    apart[frames, np.arange(len(frames))] = 0
    return apart


def _with_marks(
    annotations: Annotations, kept: Bool[np.ndarray, "K J"], tracks: JointTracks
) -> JointTracks:
    """Annotated joints exactly as they were marked."""
    row, joint = np.nonzero(kept)
    frame = annotations.frames[row]
    joints, confidence, source = (
        values.copy() for values in (tracks.joints, tracks.confidence, tracks.keyframe)
    )
    joints[frame, joint] = annotations.joints[row, joint]
    confidence[frame, joint] = 1
    source[frame, joint] = frame
    return JointTracks(joints, confidence, source)
