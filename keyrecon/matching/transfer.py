"""The paper's way to the joints of a frame (Section 5).

The keyframe assigned to the frame is aligned with it by head or feet and corresponded with it edge
element by edge element (`distance.match_edges`). The elements around a joint define its
translation: the geometric median of theirs, near ones counting more. Where too few of them find a
match the joint is missing, and so is a joint that is hidden in the keyframe. Appearance and the
keyframe's apparent limb lengths then refine the estimates (`patches.py`).

Each half of the body has its own keyframes, so a bone between two halves is not compared.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from keyrecon.matching.distance import Half as HalfName
from keyrecon.matching.distance import align_edges, match_edges
from keyrecon.matching.patches import Scenery, Sought, crop_scenery, refine_joints
from keyrecon.progress import Progress, silent
from keyrecon.records import Annotations, Edges, HalfKeyframes, JointTracks, Survey
from keyrecon.video import Video

AROUND = 0.12
"""Elements this close to a joint move it, player heights: about a thigh's width."""
NEAR = 0.06
"""Spread of the weight of elements around a joint, player heights."""
LEAST_ELEMENTS, LEAST_SHARE = 5, 0.3
"""Matched elements, and weighted share of the elements around, below which a joint is missing."""
ROUNDS = 20
"""Of Weiszfeld's iteration, which has converged to a hundredth of the spread by then."""


@dataclass(frozen=True, eq=False)
class Model:
    """An annotated keyframe of one half of the body, aligned by head or feet."""

    edges: Edges
    joints: Float[np.ndarray, "J 2"]
    """Player heights; NaN where missing or hidden."""
    scenery: Scenery


def transfer_joints(
    video: Video, survey: Survey, annotations: Annotations, progress: Progress = silent
) -> JointTracks:
    """Joints from the assigned keyframe of each half; NaN where missing.

    Confidence falls with the pose distance to the keyframe and with the share of elements around
    the joint that find no match.
    """
    models = _gather_models(video, survey, annotations)
    shape = (len(survey.track.height), len(annotations.skeleton.names))
    joints, confidence = np.full((*shape, 2), np.nan), np.zeros(shape)
    source = np.zeros(shape, dtype=np.int64)
    bones, is_lower = annotations.skeleton.bones, annotations.skeleton.is_lower
    frames = progress(_sceneries(video, survey), "carrying joints", shape[0])
    for t, scenery in enumerate(frames):
        for name, members in (("upper", ~is_lower), ("lower", is_lower)):
            keyframes = getattr(survey.keyframes, name)
            source[t, members] = keyframes.nearest[t]
            model = models.get((name, int(keyframes.nearest[t])))
            if model is None:
                continue
            edges = align_edges(survey.figures.edges[t], survey.track, t, name)
            sought, share = _shift_joints(model, edges, bool(keyframes.represented[t]))
            found = refine_joints(model.scenery, scenery, sought, bones, _anchor(survey, t, name))
            joints[t, members] = found[members]
            likeness = np.exp(-keyframes.distance[t] / keyframes.beta)
            confidence[t, members] = np.where(np.isnan(found[:, 0]), 0, share * likeness)[members]
    return JointTracks(joints, confidence, source)


def _anchor(survey: Survey, frame: int, name: HalfName) -> Float[np.ndarray, "2"]:
    """Where aligned coordinates have their origin, px."""
    return (survey.track.head if name == "upper" else survey.track.mid_feet)[frame]


def _sceneries(video: Video, survey: Survey) -> Iterator[Scenery]:
    """Grey pictures of all frames in one size of the player."""
    width = Scenery.width_for(video, survey.track.height)
    for t, picture in enumerate(video.frames(width=width)):
        yield crop_scenery(picture, video.width, float(survey.track.height[t]))


def _gather_models(
    video: Video, survey: Survey, annotations: Annotations
) -> dict[tuple[HalfName, int], Model]:
    """Annotated keyframes by half and frame number."""
    models = {}
    width = Scenery.width_for(video, survey.track.height)
    for row, frame in enumerate(annotations.frames.tolist()):
        height = float(survey.track.height[frame])
        scenery = crop_scenery(video.frame(frame, width), video.width, height)
        seen = np.where(annotations.visible[row][:, None], annotations.joints[row], np.nan)
        for name in ("upper", "lower"):
            half: HalfKeyframes = getattr(survey.keyframes, name)
            if frame not in half.frames:
                continue
            origin = _anchor(survey, frame, name)
            edges = align_edges(survey.figures.edges[frame], survey.track, frame, name)
            members = annotations.skeleton.is_lower == (name == "lower")
            joints = np.where(members[:, None], (seen - origin) / height, np.nan)
            models[name, frame] = Model(edges, joints, scenery.around(origin))
    return models


def _shift_joints(
    model: Model, edges: Edges, represented: bool
) -> tuple[Sought, Float[np.ndarray, "J"]]:
    """(estimates from local translation, share of the elements around that found a match)."""
    match, _ = match_edges(model.edges, edges)
    found = match >= 0
    moved = edges.points[match] - model.edges.points if len(edges.points) else np.zeros((0, 2))
    joints = np.full(model.joints.shape, np.nan)
    spread, share = np.full(len(joints), NEAR), np.zeros(len(joints))
    for j in np.flatnonzero(np.isfinite(model.joints[:, 0])):
        away = np.linalg.norm(model.edges.points - model.joints[j], axis=1)
        weight = np.where(away < AROUND, np.exp(-0.5 * (away / NEAR) ** 2), 0)
        share[j] = weight[found].sum() / max(weight.sum(), 1e-9)
        used = found & (weight > 0)
        if used.sum() < LEAST_ELEMENTS or share[j] < LEAST_SHARE:
            share[j] = 0
            continue
        shift = geometric_median(moved[used], weight[used])
        joints[j] = model.joints[j] + shift
        spread[j] = np.average(np.linalg.norm(moved[used] - shift, axis=1), weights=weight[used])
    return Sought(model.joints, joints, spread, represented), share


def geometric_median(
    points: Float[np.ndarray, "N 2"], weight: Float[np.ndarray, "N"]
) -> Float[np.ndarray, "2"]:
    """Point with the least weighted sum of distances (Weiszfeld 1937)."""
    center = np.average(points, axis=0, weights=weight)
    for _ in range(ROUNDS):
        near = weight / np.maximum(np.linalg.norm(points - center, axis=1), 1e-4)
        center = near @ points / near.sum()
    return center
