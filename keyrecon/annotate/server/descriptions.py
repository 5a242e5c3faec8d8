"""A project as JSON for the page: video, skeleton, keyframes, marks, edits and jobs."""

from collections.abc import Callable, Iterable
from dataclasses import asdict
from typing import Any

import numpy as np

from keyrecon.annotate.server.jobs import Job
from keyrecon.annotate.server.page_words import in_page_words
from keyrecon.annotate.store.cells import Cells, Change, by_frame, of_body, of_kind, picks_of
from keyrecon.annotate.store.journal import Entry, JournalState
from keyrecon.annotate.store.kept_keyframes import halves_by_frame, join_halves
from keyrecon.annotation_budget import usual_budget
from keyrecon.body import Skeleton
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.camera_file import read_camera
from keyrecon.io.provenance import RunNotes, camera_digest, marks_digest, read_run
from keyrecon.io.video import Video
from keyrecon.io.workspace import Workspace
from keyrecon.lens import degrees_across, known_lens
from keyrecon.records import Keyframes

Json = dict[str, Any]


def describe_video(video: Video, name: str) -> Json:
    """Name, size and times."""
    return {
        "name": name,
        "n_frames": len(video),
        "usual_budget": usual_budget(len(video), video.fps),
        "fps": video.fps,
        "time": [round(t, 4) for t in video.time.tolist()],
        "width": video.width,
        "height": video.height,
    }


def describe_skeleton(skeleton: Skeleton) -> Json:
    """Joints, limbs named by their outer joint, halves, mirrored pairs, the order to mark in."""
    names, lower = skeleton.names, skeleton.is_lower
    return {
        "joints": list(names),
        "parents": list(skeleton.parents),
        "limbs": [
            {
                "name": names[child],
                "parent": names[parent],
                "child": names[child],
                "half": "lower" if lower[child] else "upper",
            }
            for parent, child in skeleton.bones.tolist()
        ],
        "order": [names[joint] for joint in marking_order(skeleton)],
        "halves": {
            half: [n for n, low in zip(names, lower, strict=True) if low == (half == "lower")]
            for half in ("upper", "lower")
        },
        "mirror": [[names[left], names[right]] for left, right in skeleton.mirrored],
    }


def marking_order(skeleton: Skeleton) -> list[int]:
    """Joints from the head down the arms, then down the legs, each limb from the trunk outwards."""
    chains = [
        _chain(skeleton, joint)
        for joint, parent in enumerate(skeleton.parents)
        if parent == skeleton.root
    ]
    chains.sort(key=lambda chain: (skeleton.is_lower[chain[0]], len(chain)))
    head = len(chains[0]) if chains and len(chains[0]) == 1 else 0
    order = [joint for chain in chains for joint in chain]
    return [*order[:head], skeleton.root, *order[head:]]


def _chain(skeleton: Skeleton, joint: int) -> list[int]:
    """A joint and all its descendants."""
    children = [c for c, parent in enumerate(skeleton.parents) if parent == joint]
    return [joint, *(outer for child in children for outer in _chain(skeleton, child))]


def halves_marked(cells: Cells, skeleton: Skeleton) -> dict[int, str]:
    """Which half of the body has marks on each frame that has any."""
    halves: dict[int, str] = {}
    for frame, joint in of_body(cells, "mark"):
        half = "lower" if skeleton.is_lower[skeleton.index(joint)] else "upper"
        halves[frame] = join_halves(halves.get(frame), half)
    return halves


WHY_A_BODY = "Here the program is least sure where the player is: a whole body teaches most."


def describe_keyframes(
    keyframes: Keyframes | None,
    cells: Cells,
    skeleton: Skeleton,
    details: dict[int, Json],
    bodies: Iterable[Json] = (),
) -> list[Json]:
    """All frames to annotate: those chosen, those a person added, and others that bear marks.

    `bodies` are asked for before keyframes are chosen. `details` replace what is said here.
    `listed` is the half that is asked for where the person's own keyframe is taken back.
    """
    chosen, marked = halves_by_frame(keyframes), halves_marked(cells, skeleton)
    for body in bodies:
        chosen[body["frame"]] = "both"
        details = {**details, body["frame"]: {"why": WHY_A_BODY, "box": body["box"]}}
    added = {int(key[1]): half for key, half in of_kind(cells, "own").items()}
    listed = marked | chosen
    counts, gains = _represented(keyframes), gains_of_frames(keyframes)
    return [
        {
            "frame": frame,
            "half": join_halves(listed.get(frame), added.get(frame)),
            "listed": listed.get(frame),
            "stands_for": counts.get(frame, 0),
            "brings": gains.get(frame),
            "why": "",
            "own": frame in added,
            "locked": ("lock", frame) in cells,
            **details.get(frame, {}),
        }
        for frame in sorted({*listed, *added})
    ]


def _represented(keyframes: Keyframes | None) -> dict[int, int]:
    """For how many frames with the player each keyframe stands, in either half."""
    if keyframes is None:
        return {}
    upper, lower = (
        np.where(np.isfinite(half.distance), half.nearest, -1)
        for half in (keyframes.upper, keyframes.lower)
    )
    return {
        frame: int(((upper == frame) | (lower == frame)).sum())
        for frame in keyframes.frames.tolist()
    }


def gains_of_frames(keyframes: Keyframes | None) -> dict[int, float]:
    """What each keyframe adds to the coverage of those that bring more, mean of both halves."""
    gains: dict[int, float] = {}
    halves = [keyframes.upper.gains, keyframes.lower.gains] if keyframes else []
    for half in halves:
        if half is not None:
            added = np.diff(half.coverage, prepend=0.0)
            for frame, gain in zip(half.order.tolist(), added.tolist(), strict=True):
                gains[frame] = gains.get(frame, 0.0) + gain / 2
    return gains


def describe_settings(workspace: Workspace, video: Video) -> Json:
    """Options of earlier runs that the page asks for, None where none was set; and the angle across
    the picture that a run takes where none is, with what tells it."""
    options = workspace.project.get("options", {})
    lift = options.get("lift", {})
    return {
        "budget": options.get("keyframes", {}).get("budget"),
        "height": lift.get("height"),
        "field_of_view": lift.get("field_of_view"),
        "lens": _describe_lens(workspace, video),
    }


def _describe_lens(workspace: Workspace, video: Video) -> Json | None:
    """What is known of the lens; None where nothing is, or a damaged file holds it: the step that
    needs the file says so."""
    try:
        lens, typed = known_lens(workspace, video), workspace.ground_marks().field_of_view
    except KeyreconError:
        return None
    if lens is None:
        return None
    source = lens.source if typed is None else "step 6 Ground"
    return {"degrees": degrees_across(lens, video), "told_by": source}


def describe_run(
    workspace: Workspace, revision: int, motion_digest: Callable[[], str | None] | None
) -> Json:
    """The notes of the run that made the motion, as JSON in the words of the page.

    What spoke against the track, what would make the motion better, whether it was made from the
    present marks, keyframes, picks, videos, options and lens (true where that is not known), and
    the origin of a camera, "court" or "ground", that is newer than the report. `motion_digest` is
    of the present input; notes of former versions have a digest of the marks alone.

    `revision` is that of the marks before their files are read: newer marks are not vouched for.
    """
    notes = read_run(workspace)
    if notes is None:
        return {
            "doubts": [],
            "advice": [],
            "is_current": True,
            "report_lacks": None,
            "revision": revision,
        }
    now = None if motion_digest is None else motion_digest()
    return {
        "doubts": [in_page_words(line) for line in notes.doubts],
        "advice": [in_page_words(line) for line in notes.advice],
        "is_current": notes.evidence in (now, marks_digest(workspace)),
        "report_lacks": _camera_not_in_report(workspace, notes),
        "revision": revision,
    }


def _camera_not_in_report(workspace: Workspace, notes: RunNotes) -> str | None:
    """What told a camera that was found after the report was written; None where none was."""
    there = camera_digest(workspace)
    if not there or notes.camera in (None, there) or not workspace.report_file.is_file():
        return None
    try:
        return read_camera(workspace.camera_file).origin
    except KeyreconError:  # the step that needs the file says so
        return None


def describe_state(state: JournalState) -> Json:
    """Everything that edits change."""
    cells = state.cells
    return {
        "revision": state.revision,
        "marks": by_frame(cells, "mark"),
        "nearer": by_frame(cells, "nearer"),
        "picks": picks_of(cells),
        "own": by_frame(cells, "own"),
        "locked": by_frame(cells, "lock"),
        "golf": by_frame(cells, "golf"),
        "clicks": by_frame(cells, "click"),
        "shafts": by_frame(cells, "shaft"),
        "keys": by_frame(cells, "key"),
        **describe_stacks(state),
    }


def describe_stacks(state: JournalState) -> Json:
    """How much can be taken back and done again."""
    return {"undo": len(state.undoable), "redo": len(state.redoable)}


def describe_entries(entries: Iterable[Entry], state: JournalState) -> Json:
    """Accepted edits, and what can be undone after them, as news."""
    edits = [
        {
            "revision": entry.revision,
            "id": entry.id,
            "role": entry.role,
            "kind": entry.label,
            "changes": describe_changes(entry.changes),
        }
        for entry in entries
    ]
    return {"revision": state.revision, "edits": edits, **describe_stacks(state)}


def describe_changes(changes: Iterable[Change]) -> list[Json]:
    """Cells as the page names them."""
    where: dict[str, Callable[[Any], Json]] = {
        "mark": lambda key: {"frame": key[1], "joint": key[2]},
        "nearer": lambda key: {"frame": key[1], "limb": key[2]},
        "pick": lambda key: {"id": key[1]},
        "own": lambda key: {"frame": key[1]},
        "lock": lambda key: {"frame": key[1]},
        "golf": lambda key: {"name": key[1]},
        "click": lambda key: {"joint": key[1]},
        "shaft": lambda key: {"frame": key[1]},
        "key": lambda key: {"name": key[1]},
    }
    return [
        {"kind": key[0], **where[str(key[0])](key), "from": before, "to": after}
        for key, before, after in changes
    ]


def describe_job(job: Job) -> Json:
    """How far a job is."""
    return asdict(job) | {"text": in_page_words(job.text)}
