"""An `Assistant` for a project: marks in, answers for JSON out.

Joints and limbs go by name (a limb by that of its outer joint), frames by number; what is unknown
is left out, and points in space have the camera's axes in body heights.
"""

from collections.abc import Iterable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int, UInt8

from keyrecon.annotate.assist.body_estimate import BodyEstimate
from keyrecon.annotate.assist.checks import (
    EVEN_EXCESS,
    completed_halves,
    find_checks,
    measure_excess,
)
from keyrecon.annotate.assist.court_views import (
    describe_court,
    describe_court_view,
    keep_court_point,
)
from keyrecon.annotate.assist.frame_suggestions import explain_keyframes, suggest_frames
from keyrecon.annotate.assist.ground_views import (
    describe_ground,
    describe_ground_view,
    drop_ground_mark,
    keep_field_of_view,
    keep_ground_mark,
)
from keyrecon.annotate.assist.pose_estimate import (
    Alternative,
    FrameObservation,
    PoseEstimate,
    estimate_pose,
)
from keyrecon.annotate.assist.preview import find_player_in_strip, tint_part
from keyrecon.annotate.assist.project_cache import ProjectCache
from keyrecon.annotate.assist.shot_strip import choose_shot, project_shots
from keyrecon.annotate.assist.side_checks import evidence_of_motion
from keyrecon.annotate.assistant import Assistant, Json, Marks, Signs
from keyrecon.body import Skeleton
from keyrecon.errors import KeyreconError
from keyrecon.hyperextension import HyperextendedStretch, hyperextended_stretches
from keyrecon.io.provenance import motion_digest
from keyrecon.io.video import Video
from keyrecon.io.workspace import Workspace
from keyrecon.lens import with_known_lens
from keyrecon.pipeline import Options, frames_to_mark, marked_frames
from keyrecon.records import Annotations, Pick
from keyrecon.uncertainty import UncertainStretch, uncertain_stretches, unsure_track

MIN_CERTAINTY = 0.8
"""Of the depth signs that come with a suggestion: nine in ten are right."""


def make_assistant(workspace: Workspace) -> Assistant:
    """What needs the automatic part answers with nothing before that was run."""
    cache = ProjectCache(workspace)
    return Assistant(
        ready=cache.is_ready,
        keyframes=partial(describe_reasons, cache),
        bodies=partial(describe_bodies, cache),
        motion_digest=partial(project_motion_digest, workspace.folder),
        suggestion=partial(describe_suggestion, cache),
        pose=partial(describe_pose, cache),
        checks=partial(describe_checks, cache),
        next_frames=partial(describe_next_frames, cache),
        stretches=partial(describe_stretches, cache),
        preview=partial(describe_preview, cache),
        backprojection=partial(show_part, cache),
        shots=partial(project_shots, cache, workspace),
        choose_shot=partial(choose_shot, cache, workspace),
        court=partial(describe_court, workspace),
        court_view=partial(describe_court_view, workspace),
        court_point=partial(keep_court_point, workspace),
        ground=partial(describe_ground, workspace),
        ground_view=partial(describe_ground_view, workspace),
        ground_mark=partial(keep_ground_mark, workspace),
        ground_removal=partial(drop_ground_mark, workspace),
        field_of_view=partial(keep_field_of_view, workspace),
        swing=partial(_describe_swing, workspace),
    )


def _describe_swing(workspace: Workspace, *marked: Any) -> Json:
    """A golf swing; its modules are loaded when one is asked for."""
    from keyrecon.annotate.assist.swing_answers import describe_swing

    return describe_swing(workspace, *marked)


def describe_reasons(cache: ProjectCache, added: dict[int, str]) -> Json:
    """Why each keyframe is one, and where the player is on it."""
    preparation = cache.preparation()
    if preparation is None:
        return {}
    reasons = explain_keyframes(preparation.pose_distances, preparation.keyframes, added)
    boxes = preparation.track.box
    frames = {
        frame: {
            "stands_for": reason.stands_for,
            "why": reason.why,
            "box": [round(float(c), 1) for c in boxes[frame]],
        }
        for frame, reason in reasons.items()
    }
    return {
        "frames": frames,
        "height_px": float(np.median(preparation.track.height)),
        "boxes": [
            box if known else None
            for box, known in zip(
                np.round(boxes).tolist(), np.isfinite(boxes).all(axis=1).tolist(), strict=True
            )
        ],
    }


MORE_BODIES = 3
"""Whole bodies asked for where the program is least sure, before the keyframes; as measured by
benchmarks/real.py."""


def describe_bodies(cache: ProjectCache) -> list[Json] | None:
    """Where a whole body, marked next, would teach the track most, and where the player is there.

    None before the player was followed with a marked body.
    """
    preparation, marked = cache.preparation(), cache.prepared_bodies()
    if preparation is None or not len(marked):
        return None
    track = preparation.track
    frames = frames_to_mark(preparation, marked, MORE_BODIES)
    return [{"frame": int(t), "box": _rounded(track.box[t], 1)} for t in frames]


def project_motion_digest(folder: Path, video: Video) -> str | None:
    """What a motion would be made from now; None while options or camera cannot be read."""
    try:
        workspace = Workspace(folder)
        options = with_known_lens(workspace.options(Options(), Options()), workspace, video)
    except KeyreconError:  # the next step that needs them says what is wrong
        return None
    return motion_digest(workspace, options, Options())


def describe_suggestion(cache: ProjectCache, annotations: Annotations, frame: int) -> Json:
    """Joints with confidence, the frames they come from, and depth signs that are sure."""
    suggestion = cache.suggestion(annotations, frame)
    if suggestion is None:
        return {}
    skeleton, places = annotations.skeleton, suggestion.joints
    joints = {
        skeleton.names[j]: [*_rounded(places[j], 2), round(float(suggestion.confidence[j]), 3)]
        for j in np.flatnonzero(np.isfinite(places[:, 0]))
    }
    sources = sorted({int(source) for source in suggestion.source if source >= 0})
    return {"joints": joints, "from": sources, "nearer": _certain_signs(cache, annotations, frame)}


def _certain_signs(cache: ProjectCache, annotations: Annotations, frame: int) -> Signs:
    """Depth signs that are nearly certain from the suggestion for a frame."""
    body, names = cache.body(annotations), _limb_names(annotations.skeleton)
    if body is None:
        return {}
    observation = _observe(cache, body, annotations, frame, {}, {})
    pose = estimate_pose(observation, body.size, annotations.skeleton, body.exemplars(frame))
    certain = np.flatnonzero(pose.certainty >= MIN_CERTAINTY)
    return {names[b]: int(pose.nearer[b]) for b in certain}


def describe_pose(
    cache: ProjectCache, annotations: Annotations, frame: int, marks: Marks, nearer: Signs
) -> Json:
    """The pose in space, how certain its signs are, and what else it could be."""
    body, skeleton = cache.body(annotations), annotations.skeleton
    if body is None:
        return {}
    observation = _observe(cache, body, annotations, frame, marks, nearer)
    pose = estimate_pose(observation, body.size, skeleton, body.exemplars(frame))
    itself = Alternative(pose.nearer, pose.points3d, 0.0)
    points = _points(skeleton, pose.points3d)
    marked = {name for name, place in marks.items() if place[2]}
    return {
        "points3d": points,
        "limbs": _limbs(skeleton, observation, pose),
        "alternatives": [
            {
                "nearer": _signs(skeleton, pose, other.nearer),
                "points3d": _points(skeleton, other.points3d),
                "cost": round(other.cost, 2),
            }
            for other in (itself, *pose.alternatives)
        ],
        "stretched": _stretched(skeleton, pose, body, marked),
        "predicted": sorted({*points} - marked),
    }


def _observe(
    cache: ProjectCache,
    body: BodyEstimate,
    annotations: Annotations,
    frame: int,
    marks: Marks,
    signs: Signs,
) -> FrameObservation:
    """What is marked on a frame, and the suggestion where nothing is."""
    skeleton = annotations.skeleton
    joints = np.full((len(skeleton.names), 2), np.nan)
    for name, (x, y, visibility) in marks.items():
        if visibility:
            joints[skeleton.index(name)] = x, y
    names = _limb_names(skeleton)
    nearer = np.array([signs.get(name, 0) for name in names])
    return body.observe(frame, joints, nearer, cache.any_suggestion(annotations, frame))


def _limbs(skeleton: Skeleton, observation: FrameObservation, pose: PoseEstimate) -> Json:
    """Sign of every limb whose ends are known, how certain it is, and whether a person gave it."""
    names = _limb_names(skeleton)
    return {
        names[b]: {
            "sign": int(pose.nearer[b]),
            "certainty": round(float(pose.certainty[b]), 3),
            "given": bool(observation.nearer[b] != 0),
        }
        for b in np.flatnonzero(np.isfinite(pose.stretch))
    }


def _stretched(
    skeleton: Skeleton, pose: PoseEstimate, body: BodyEstimate, marked: set[str]
) -> Json:
    """Limbs between marked joints that look longer than they can be, and how many times."""
    names, lengths = _limb_names(skeleton), body.size.lengths
    ends = [{skeleton.names[j] for j in bone} for bone in skeleton.bones]
    excess = measure_excess(pose.stretch, lengths)
    return {
        names[b]: round(float(pose.stretch[b]), 2)
        for b in np.flatnonzero(np.nan_to_num(excess) > EVEN_EXCESS)
        if ends[b] <= marked
    }


def _signs(skeleton: Skeleton, pose: PoseEstimate, nearer: Int[np.ndarray, "B"]) -> Signs:
    names = _limb_names(skeleton)
    return {names[b]: int(nearer[b]) for b in np.flatnonzero(np.isfinite(pose.stretch))}


def _points(skeleton: Skeleton, points: Float[np.ndarray, "J 3"]) -> Json:
    """Known joints by name."""
    known = np.flatnonzero(np.isfinite(points).all(axis=1))
    return {skeleton.names[j]: _rounded(points[j], 4) for j in known}


def _limb_names(skeleton: Skeleton) -> list[str]:
    return [skeleton.names[child] for _, child in skeleton.bones]


def _rounded(values: Iterable[float], digits: int) -> list[float]:
    return [round(float(value), digits) for value in values]


def describe_checks(cache: ProjectCache, annotations: Annotations) -> list[Json] | None:
    """Marks that look wrong, the most suspicious first; None where nothing can be checked yet."""
    preparation, body = cache.preparation(), cache.body(annotations, wait=True)
    if preparation is None or body is None:
        return None
    completed = completed_halves(annotations)
    neighbours, appearance = cache.neighbours(completed), cache.appearance(completed)
    evidence = evidence_of_motion(annotations, cache.motion())
    found = find_checks(annotations, body.size, neighbours, preparation.track, appearance, evidence)
    return [
        {
            "frame": check.frame,
            "joint": check.joint,
            "kind": check.kind,
            "suspicion": round(float(check.suspicion), 3),
            "text": check.text,
        }
        for check in found
    ]


def describe_next_frames(
    cache: ProjectCache, annotations: Annotations, taken: frozenset[int]
) -> list[Json]:
    """Frames to annotate next, once there is a motion."""
    preparation, motion = cache.preparation(), cache.motion()
    if preparation is None or motion is None:
        return []
    suggestions = suggest_frames(preparation.pose_distances, motion, annotations, taken)
    return [{**asdict(one), "gain": round(one.gain, 4)} for one in suggestions]


def describe_stretches(cache: ProjectCache, annotations: Annotations) -> list[Json]:
    """The worst stretches, as the command line tells them; those that were marked since are out."""
    preparation, motion = cache.preparation(), cache.motion()
    upper, lower = marked_frames(annotations)
    stretches: list[HyperextendedStretch | UncertainStretch] = []
    if motion is not None:
        stretches += hyperextended_stretches(motion, np.array(lower, int))
        stretches += uncertain_stretches(motion, np.union1d(upper, lower))
    elif preparation is not None:
        reach = preparation.keyframes.reach
        stretches += unsure_track(preparation.track, preparation.shots, reach)
    return [
        {
            "first": stretch.first,
            "last": stretch.last,
            "text": stretch.text,
            "frame": stretch.frame,
            "half": stretch.half,
        }
        for stretch in stretches
    ]


def describe_preview(cache: ProjectCache, picks: tuple[Pick, ...], frames: tuple[int, ...]) -> Json:
    """Head, feet and box that these picks find on some frames; no places where not found."""
    strip, camera = cache.strip(frames)
    player = find_player_in_strip(strip, cache.colors(picks), camera, frames)
    rows = zip(player.frames.tolist(), player.head, player.feet, player.box, strict=True)
    strip_rows = [
        {
            "frame": frame,
            "head": _rounded(head, 1) if np.isfinite(head).all() else None,
            "feet": [_rounded(foot, 1) for foot in feet] if np.isfinite(feet).all() else [],
            "box": _rounded(box, 1),
        }
        for frame, head, feet, box in rows
    ]
    return {"frames": strip_rows, "confidence": round(player.confidence, 3)}


def show_part(
    cache: ProjectCache, picks: tuple[Pick, ...], frame: int, part: str
) -> UInt8[np.ndarray, "h w 4"]:
    """How much each pixel of a frame looks like a part."""
    colors = cache.colors(picks)
    return tint_part(cache.video.frame(frame), colors, part)
