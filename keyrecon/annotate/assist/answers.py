"""The annotator's help, put together: records in, what the page reads out.

Joints, limbs (named by their outer joint) and frames are told by name and number, unknown ones are
left out, and depths have the camera's axes in body heights.
"""

from collections.abc import Iterable
from dataclasses import asdict, replace
from functools import partial

import numpy as np
from jaxtyping import Float, Int, UInt8

from keyrecon.annotate.assist.body_estimate import BodyEstimate
from keyrecon.annotate.assist.checks import EVEN_EXCESS, find_checks, measure_excess
from keyrecon.annotate.assist.frame_suggestions import explain_keyframes, suggest_frames
from keyrecon.annotate.assist.pose_reading import Alternative, PoseReading, Sighting, read_pose
from keyrecon.annotate.assist.preview import find_player, tint_part
from keyrecon.annotate.assist.project_cache import ProjectCache
from keyrecon.annotate.store.assistant import Assistant, Json, Marks, Signs
from keyrecon.body import Skeleton
from keyrecon.io.workspace import Workspace
from keyrecon.records import Annotations, Pick

SURE = 0.8
"""Depth signs that a ghost tells are at least so sure: nine in ten are right."""


def make_assistant(workspace: Workspace) -> Assistant:
    """Help for a project; what needs the automatic part says nothing before it was run."""
    study = ProjectCache(workspace)
    return Assistant(
        keyframes=partial(describe_keyframes, study),
        ghost=partial(describe_suggestion, study),
        pose=partial(describe_pose, study),
        checks=partial(describe_checks, study),
        suggest=partial(describe_suggestions, study),
        preview=partial(describe_preview, study),
        backprojection=partial(show_part, study),
    )


def describe_keyframes(study: ProjectCache, own: dict[int, str]) -> Json:
    """Why each keyframe is one, and where the player is on it."""
    preparation = study.preparation()
    if preparation is None:
        return {}
    reasons = explain_keyframes(preparation.pose_distances, preparation.keyframes, own)
    boxes = preparation.track.box
    frames = {
        frame: {
            "stands_for": reason.stands_for,
            "why": reason.why,
            "box": [round(float(c), 1) for c in boxes[frame]],
        }
        for frame, reason in reasons.items()
    }
    return {"frames": frames, "height_px": float(np.median(preparation.track.height))}


def describe_suggestion(study: ProjectCache, annotations: Annotations, frame: int) -> Json:
    """Joints with confidence, the frames they come from, and depth signs that are sure."""
    ghost = study.ghost(annotations, frame)
    if ghost is None:
        return {}
    skeleton = annotations.skeleton
    joints = {
        skeleton.names[j]: [*_rounded(ghost.joints[j], 2), round(float(ghost.confidence[j]), 3)]
        for j in np.flatnonzero(np.isfinite(ghost.joints[:, 0]))
    }
    sources = sorted({int(source) for source in ghost.source if source >= 0})
    return {"joints": joints, "from": sources, "nearer": _sure_signs(study, annotations, frame)}


def _sure_signs(study: ProjectCache, annotations: Annotations, frame: int) -> Signs:
    """Depth signs that the marks and the ghost of a frame leave little doubt about."""
    knowledge, names = study.knowledge(annotations), _limb_names(annotations.skeleton)
    sighting = _sight(study, knowledge, annotations, frame, ({}, {}))
    reading = read_pose(sighting, knowledge.size, annotations.skeleton, knowledge.votes(frame))
    return {names[b]: int(reading.nearer[b]) for b in np.flatnonzero(reading.sure >= SURE)}


def describe_pose(
    study: ProjectCache, annotations: Annotations, frame: int, marks: Marks, nearer: Signs
) -> Json:
    """The pose in space, how sure its signs are, and what else it could be."""
    knowledge, skeleton = study.knowledge(annotations), annotations.skeleton
    if knowledge is None:
        return {}
    sighting = _sight(study, knowledge, annotations, frame, (marks, nearer))
    reading = read_pose(sighting, knowledge.size, skeleton, knowledge.votes(frame))
    itself = Alternative(reading.nearer, reading.points3d, 0.0)
    points = _points(skeleton, reading.points3d)
    marked = {name for name, place in marks.items() if place[2]}
    return {
        "points3d": points,
        "limbs": _limbs(skeleton, sighting, reading),
        "alternatives": [
            {
                "nearer": _signs(skeleton, reading, other.nearer),
                "points3d": _points(skeleton, other.points3d),
                "cost": round(other.cost, 2),
            }
            for other in (itself, *reading.alternatives)
        ],
        "stretched": _stretched(skeleton, reading, knowledge, marked),
        "foreseen": sorted({*points} - marked),
    }


def _sight(
    study: ProjectCache,
    knowledge: BodyEstimate,
    annotations: Annotations,
    frame: int,
    told: tuple[Marks, Signs],
) -> Sighting:
    """What is marked on a frame, and its ghost where nothing is."""
    skeleton, (marks, signs) = annotations.skeleton, told
    joints = np.full((len(skeleton.names), 2), np.nan)
    for name, (x, y, seen) in marks.items():
        if seen:
            joints[skeleton.index(name)] = x, y
    names = _limb_names(skeleton)
    nearer = np.array([signs.get(name, 0) for name in names])
    return knowledge.sighting(frame, joints, nearer, study.any_ghost(annotations, frame))


def _limbs(skeleton: Skeleton, sighting: Sighting, reading: PoseReading) -> Json:
    """Sign of every limb whose ends are known, how sure it is, and whether a person gave it."""
    names = _limb_names(skeleton)
    return {
        names[b]: {
            "sign": int(reading.nearer[b]),
            "certainty": round(float(reading.sure[b]), 3),
            "given": bool(sighting.nearer[b] != 0),
        }
        for b in np.flatnonzero(np.isfinite(reading.stretch))
    }


def _stretched(
    skeleton: Skeleton, reading: PoseReading, knowledge: BodyEstimate, marked: set[str]
) -> Json:
    """Limbs between marked joints that look longer than they can be, and how many times."""
    names, lengths = _limb_names(skeleton), knowledge.size.lengths
    ends = [{skeleton.names[j] for j in bone} for bone in skeleton.bones]
    excess = measure_excess(reading.stretch, lengths)
    return {
        names[b]: round(float(reading.stretch[b]), 2)
        for b in np.flatnonzero(np.nan_to_num(excess) > EVEN_EXCESS)
        if ends[b] <= marked
    }


def _signs(skeleton: Skeleton, reading: PoseReading, nearer: Int[np.ndarray, "B"]) -> Signs:
    names = _limb_names(skeleton)
    return {names[b]: int(nearer[b]) for b in np.flatnonzero(np.isfinite(reading.stretch))}


def _points(skeleton: Skeleton, points: Float[np.ndarray, "J 3"]) -> Json:
    """Known joints by name."""
    known = np.flatnonzero(np.isfinite(points).all(axis=1))
    return {skeleton.names[j]: _rounded(points[j], 4) for j in known}


def _limb_names(skeleton: Skeleton) -> list[str]:
    return [skeleton.names[child] for _, child in skeleton.bones]


def _rounded(values: Iterable[float], digits: int) -> list[float]:
    return [round(float(value), digits) for value in values]


def describe_checks(study: ProjectCache, annotations: Annotations) -> list[Json]:
    """Marks to look at again, the most suspicious first."""
    preparation, knowledge = study.preparation(), study.knowledge(annotations, wait=True)
    if preparation is None or knowledge is None:
        return []
    looks = study.lookalikes(_decided(annotations))
    return [
        {
            "frame": check.frame,
            "joint": check.joint,
            "kind": check.kind,
            "suspicion": round(float(check.suspicion), 3),
            "text": check.text,
        }
        for check in find_checks(annotations, knowledge.size, looks)
    ]


def _decided(annotations: Annotations) -> Annotations:
    """Halves of the body of which every joint is marked or said to be absent.

    A frame in the middle of being marked is not compared with others yet.
    """
    skeleton, joints = annotations.skeleton, annotations.joints.copy()
    open_, absent = np.isnan(joints[:, :, 0]), {*annotations.absent}
    for row, joint in np.argwhere(open_):
        open_[row, joint] = (annotations.frames[row], skeleton.names[joint]) not in absent
    for half in (skeleton.is_lower, ~skeleton.is_lower):
        joints[np.ix_(open_[:, half].any(axis=1), half)] = np.nan
    return replace(annotations, joints=joints)


def describe_suggestions(
    study: ProjectCache, annotations: Annotations, taken: frozenset[int]
) -> list[Json]:
    """Frames to annotate next, once there is a result to judge."""
    preparation, motion = study.preparation(), study.motion()
    if preparation is None or motion is None:
        return []
    found = suggest_frames(preparation.pose_distances, motion, annotations, taken)
    return [{**asdict(one), "gain": round(one.gain, 4)} for one in found]


def describe_preview(study: ProjectCache, picks: tuple[Pick, ...], frames: tuple[int, ...]) -> Json:
    """Head, feet and box that these picks find on some frames; no places where unseen."""
    strip, camera = study.strip(frames)
    found = find_player(strip, study.colors(picks), camera, frames)
    rows = zip(found.frames.tolist(), found.head, found.feet, found.box, strict=True)
    strip_rows = [
        {
            "frame": frame,
            "head": _rounded(head, 1) if np.isfinite(head).all() else None,
            "feet": [_rounded(foot, 1) for foot in feet] if np.isfinite(feet).all() else [],
            "box": _rounded(box, 1),
        }
        for frame, head, feet, box in rows
    ]
    return {"frames": strip_rows, "confidence": round(found.confidence, 3)}


def show_part(
    study: ProjectCache, picks: tuple[Pick, ...], frame: int, part: str
) -> UInt8[np.ndarray, "h w 4"]:
    """How much each pixel of a frame looks like a part."""
    colors = study.colors(picks)
    return tint_part(study.video.frame(frame), colors, part)
