"""Joints in every frame from joints on a few (Section 5).

`method="paper"` is the paper's: the keyframe assigned to a frame is laid over it, each joint moves
with the edge elements around it, and appearance and apparent limb lengths refine the result
(`keyrecon.paper.joint_transfer`). The default goes further with the same edges and annotations.
For each half of the body, the lower first, it

1. fits the edge templates of several annotated frames to every frame, limbs turning as they must,
   and tracks annotated poses through time from both sides (`hypotheses`);
2. chooses among these hypotheses by the cheapest path through time (`selection`);
3. decides over the whole clip which limb is the left one (`limb_identity`);
4. smooths all trajectories in one least squares over edges, bone shape and acceleration, in which
   the annotated frames are fixed (`trajectory_smoothing`).
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from jaxtyping import Bool, Complex, Float

from keyrecon.body_models.side_model import SideModel
from keyrecon.errors import KeyreconError
from keyrecon.paper.joint_transfer import transfer_joints
from keyrecon.progress import Progress, silent
from keyrecon.propagation.appearance import (
    JointAppearance,
    PlayerFeatures,
    describe_player,
    learn_appearance,
    regular_frames,
)
from keyrecon.propagation.body_frame import (
    BodyFrame,
    PlayerMarks,
    ground_path,
    stabilise_shots,
)
from keyrecon.propagation.bone_bounds import bound_bones
from keyrecon.propagation.bone_color import BoneColors, learn_bone_colors
from keyrecon.propagation.correspondence import ElementIndex, index_elements, joint_confidence
from keyrecon.propagation.edge_template import (
    AnnotatedPoses,
    EdgeTemplates,
    feet_in_sight,
    learn_foot_offsets,
    make_edge_templates,
)
from keyrecon.propagation.evidence import COLOR_EVIDENCE, WEIGHTS
from keyrecon.propagation.flow_agreement import with_flow
from keyrecon.propagation.half_body import split_body
from keyrecon.propagation.hypotheses import (
    MarkPredictions,
    PoseHypotheses,
    fit_limbs,
    fit_mark_predictions,
    fit_poses,
    fit_similar,
    join_hypotheses,
    track_from_keyframes,
)
from keyrecon.propagation.limb_identity import (
    ArmEvidence,
    IdentityEvidence,
    appearance_log_odds,
    identify_in_shots,
    template_log_odds,
)
from keyrecon.propagation.limb_search import search_by_appearance, search_by_edges
from keyrecon.propagation.marked_poses import distances_to, gather_poses, predict_from_marks
from keyrecon.propagation.registration import ChosenHypotheses
from keyrecon.propagation.selection import choose_limbs
from keyrecon.propagation.silhouette import (
    Silhouettes,
    gather_silhouettes,
    search_by_silhouette,
)
from keyrecon.propagation.trajectory_smoothing import smooth_trajectories
from keyrecon.ranges import within
from keyrecon.records import (
    Annotations,
    FlowTracks,
    JointTracks,
    Preparation,
)

LIMB_HYPOTHESES = 3
"""Limbs of other annotated frames that are fitted on each side of a frame: as many as there may be
places for one. Halved or doubled: no change on one clip."""


@dataclass(frozen=True)
class PropagateOptions:
    """How joints are propagated to the frames that nobody annotated."""

    method: Literal["fused", "paper"] = "fused"
    """'fused' carries joints from several keyframes and both neighbours in time; 'paper' from the
    assigned keyframe alone, without what is hidden there.

    'fused' gives every joint a place and a confidence.
    """
    similar: Annotated[int, within(1, 40)] = 3
    """Keyframes fitted to each frame; more take longer.

    Halved or doubled, others with it: at most 0.1 points, 0.3 mm on one clip.
    """
    elements: Annotated[int, within(8, 2000)] = 96
    """Edge elements per frame and half of the body at most; more take longer.

    A quarter more or less: at most 0.4 points, 0.4 mm on one clip.
    """
    rounds: Annotated[int, within(1, 100)] = 3
    """Times that edges are matched anew in the last fit; more take longer.

    Two or four: at most 0.6 mm on three of four clips, 3.9 on one, which other clicks change as
    much.
    """


@dataclass(frozen=True, eq=False)
class PlayerEvidence:
    """What both halves of the body are propagated with."""

    preparation: Preparation
    flow: FlowTracks | None
    body_frame: BodyFrame
    marks: PlayerMarks
    bounds: Float[np.ndarray, "J J"]
    """Greatest distance of any two joints, as `bound_bones` has it, player heights."""
    features: PlayerFeatures
    """What the player looks like in every frame."""
    silhouettes: Silhouettes
    ground: Complex[np.ndarray, "T"] | None
    """Way of the player over the ground, player heights; of legs, which stand on it."""


@dataclass(frozen=True, eq=False)
class HalfStart:
    """What is known of one half of the body before it is propagated."""

    player: PlayerEvidence
    shift: Complex[np.ndarray, "T K"]
    """From an annotated pose to the same pose in another frame, by head or feet."""
    distance: Float[np.ndarray, "T K"]
    """Pose distance of every frame to the annotated ones, player heights."""
    fixed: Complex[np.ndarray, "T G"]
    """Joints that the other half has estimated."""
    predictions: MarkPredictions
    """Where flow and straight lines lead from marks."""
    arms: ArmEvidence | None = None
    """What the whole body says of its arms, which are propagated after the legs."""


@dataclass(frozen=True, eq=False)
class PropagatedHalf:
    """One half of the body in every frame."""

    joints: Complex[np.ndarray, "T J"]
    confidence: Float[np.ndarray, "T J"]
    elsewhere: Float[np.ndarray, "T J"]
    """As in `JointTracks`."""
    exchange_evidence: Float[np.ndarray, "T"]
    """What motion says for left and right being exchanged in the marks, nats."""


def propagate_joints(
    preparation: Preparation,
    annotations: Annotations,
    flow: FlowTracks | None = None,
    sides: SideModel | None = None,
    options: PropagateOptions = PropagateOptions(),
    progress: Progress = silent,
) -> JointTracks:
    """Joints in px and confidence of every joint in every frame.

    Where `flow` between two marks is surer of a joint than edges are, flow has it. `sides` helps to
    tell the arms apart.
    Annotated joints come back as they were marked, with confidence 1; those said to be absent are
    missing there. Raises KeyreconError when a joint is marked nowhere.
    """
    marked = np.isfinite(annotations.joints).all(axis=2)
    _require_marks(annotations)
    if options.method == "paper":
        tracks = transfer_joints(preparation, annotations, progress)
        return _with_marks(annotations, annotations.visible, tracks)
    tracks = _propagate_fused(preparation, annotations, flow, sides, options, progress)
    return _with_marks(annotations, marked, tracks)


def _require_marks(annotations: Annotations) -> None:
    if annotations.never_marked:
        raise KeyreconError(
            f"No marked frame has {', '.join(annotations.never_marked)}; mark each joint on at "
            "least one keyframe, where it is hidden by the best guess."
        )


def _propagate_fused(
    preparation: Preparation,
    annotations: Annotations,
    flow: FlowTracks | None,
    sides: SideModel | None,
    options: PropagateOptions,
    progress: Progress,
) -> JointTracks:
    """Both halves of the body over the whole video."""
    player = _gather_evidence(preparation, annotations, flow)
    index = index_elements(preparation.edges, player.body_frame)
    frames = np.arange(len(preparation.edges))
    joints = np.full((len(frames), annotations.joints.shape[1]), np.nan + 0j)
    confidence, elsewhere = np.zeros((2, *joints.shape))
    exchanged: list[Float[np.ndarray, "T"]] = []
    halves = split_body(annotations.skeleton)
    for half in progress(halves, "Propagating joints", len(halves)):
        fixed = joints[:, half.joints[half.fixed]]
        poses = gather_poses(player.marks, player.bounds, half, fixed)
        templates = _half_templates(player, poses, options.elements)
        start = _start_half(player, poses, fixed)
        if sides is not None and half.name == "upper":
            start = replace(start, arms=ArmEvidence(sides, annotations.skeleton, half, joints))
        result = propagate_half(templates, index, start, options.similar, options.rounds)
        free = half.joints[half.free]
        joints[:, free] = result.joints[:, half.free]
        confidence[:, free] = result.confidence[:, half.free]
        elsewhere[:, free] = result.elsewhere[:, half.free]
        exchanged.append(result.exchange_evidence)
    places = player.body_frame.to_pixels(joints, frames[:, None])
    evidence = np.stack(exchanged, axis=1)
    tracks = JointTracks(places, confidence, evidence, elsewhere)
    return with_flow(tracks, flow, preparation.track.height, player.bounds)


def _gather_evidence(
    preparation: Preparation, annotations: Annotations, flow: FlowTracks | None
) -> PlayerEvidence:
    video, camera, shots = preparation.video, preparation.camera, preparation.shots
    body_frame = stabilise_shots(preparation.track, camera, shots, video.fps)
    marks = body_frame.of_marks(annotations)
    frames = np.union1d(regular_frames(video), annotations.frames)
    return PlayerEvidence(
        preparation,
        flow,
        body_frame,
        marks,
        bound_bones(marks),
        describe_player(video, body_frame, frames),
        gather_silhouettes(preparation.edges, body_frame),
        ground_path(body_frame, camera, shots),
    )


def _half_templates(player: PlayerEvidence, poses: AnnotatedPoses, most: int) -> EdgeTemplates:
    """Edge templates of one half of the body; of the lower one with where its feet are tracked."""
    edges, body_frame = player.preparation.edges, player.body_frame
    templates = make_edge_templates(edges, body_frame, poses, most)
    if poses.half.name != "lower":
        return templates
    track = player.preparation.track
    tracked = body_frame.from_pixels(track.feet, np.arange(len(track.feet))[:, None])
    feet = learn_foot_offsets(poses, tracked, feet_in_sight(player.preparation))
    return replace(templates, feet=feet)


def _start_half(
    player: PlayerEvidence, poses: AnnotatedPoses, fixed: Complex[np.ndarray, "T G"]
) -> HalfStart:
    preparation, half = player.preparation, poses.half
    anchor = preparation.track.head if half.name == "upper" else preparation.track.mid_feet
    at = player.body_frame.from_pixels(anchor, np.arange(len(anchor)))
    return HalfStart(
        player,
        at[:, None] - at[poses.frames],
        distances_to(preparation.pose_distances, half.name, poses.frames),
        fixed,
        predict_from_marks(player.marks, player.flow, player.body_frame, half, fixed, preparation),
    )


def propagate_half(
    templates: EdgeTemplates,
    index: ElementIndex,
    start: HalfStart,
    similar: int,
    rounds: int,
) -> PropagatedHalf:
    """Joints of one half in all frames from `similar` templates each: hypotheses, choice, fit."""
    half, poses, player = templates.half, templates.poses, start.player
    shots, fps = player.preparation.shots, player.preparation.video.fps
    fitted = fit_similar(templates, index, start.distance, start.shift, similar)
    nearest = fitted.template[:, 0]
    with ThreadPoolExecutor(1) as beside:
        tracked = beside.submit(track_from_keyframes, templates, index, nearest, shots, fps)
        appearance = learn_appearance(player.features, poses, fitted.joints[:, 0])
        colors = learn_bone_colors(player.features, poses, fitted.joints[:, 0])
        trunk, count = fitted.best_joints, LIMB_HYPOTHESES
        limbs = search_by_edges(templates, index, trunk, count)
        parts = [fit_limbs(templates, index, fitted, limbs)]
        parts.append(fit_mark_predictions(templates, index, start.predictions, nearest))
        searched = [search_by_silhouette(player.silhouettes, poses, trunk)]
        if half.middle:
            searched.append(search_by_appearance(appearance, colors, poses, trunk, count))
        parts += [fit_poses(templates, index, p, nearest) for p in searched if p.shape[1]]
    hypotheses = join_hypotheses(fitted, tracked.result(), *parts)
    hypotheses = _with_appearance(hypotheses, appearance, colors)
    limbs_chosen = choose_limbs(
        templates, hypotheses, shots, fps, start.predictions, player.silhouettes
    )
    limbs_chosen.joints[:, half.fixed] = start.fixed
    log_odds = template_log_odds(half, limbs_chosen.joints, fitted.joints, fps)
    if half.name == "upper":
        log_odds += appearance_log_odds(half, limbs_chosen.unlikeness, fps)
    evidence = IdentityEvidence(
        log_odds, player.ground if half.name == "lower" else None, start.arms
    )
    identity = identify_in_shots(half, limbs_chosen.joints, evidence, poses.frames, shots, fps)
    chosen = ChosenHypotheses(identity.apply(half, limbs_chosen.joints), nearest)
    joints = smooth_trajectories(templates, index, chosen, shots, fps, rounds)
    confidence = joint_confidence(templates, index, chosen.joints, joints, identity.probability)
    elsewhere = limbs_chosen.elsewhere(identity.apply(half, joints))
    return PropagatedHalf(
        joints, confidence, identity.apply(half, elsewhere), identity.exchange_evidence
    )


def _with_appearance(
    hypotheses: PoseHypotheses, appearance: JointAppearance, colors: BoneColors
) -> PoseHypotheses:
    """The same with how unlike marks they look."""
    joints = hypotheses.joints
    looked_at = replace(
        hypotheses,
        unlikeness=appearance.unlikeness(joints),
        bone_unlikeness=appearance.bone_unlikeness(joints),
    )
    if COLOR_EVIDENCE not in WEIGHTS[colors.half.name]:
        return looked_at
    return replace(looked_at, color_unlikeness=colors.unlikeness(joints))


def _with_marks(
    annotations: Annotations, kept: Bool[np.ndarray, "K J"], tracks: JointTracks
) -> JointTracks:
    """Annotated joints exactly as they were marked, absent ones nowhere."""
    row, joint = np.nonzero(kept)
    frame = annotations.frames[row]
    joints, confidence = tracks.joints.copy(), tracks.confidence.copy()
    for at, name in annotations.absent:
        joints[at, annotations.skeleton.index(name)] = np.nan
        confidence[at, annotations.skeleton.index(name)] = 0
    joints[frame, joint] = annotations.joints[row, joint]
    confidence[frame, joint] = 1
    tracks = replace(tracks, joints=joints, confidence=confidence)
    if tracks.elsewhere is None:
        return tracks
    elsewhere = tracks.elsewhere.copy()
    elsewhere[frame, joint] = 0
    return replace(tracks, elsewhere=elsewhere)
