"""Marks that the rest of the marks, the pictures and the motion speak against, told after a run."""

from keyrecon.annotate.assist.body_estimate import estimate_body
from keyrecon.annotate.assist.checks import completed_halves, find_checks
from keyrecon.annotate.assist.mark_appearance import (
    SeenFrames,
    compare_appearance,
    describe_frames,
)
from keyrecon.annotate.assist.neighbours import find_neighbours
from keyrecon.annotate.assist.pose_suggestion import scene_of
from keyrecon.annotate.assist.side_checks import evidence_of_motion
from keyrecon.records import Annotations, Motion, Preparation

LISTED_SUSPICION = 0.8
"""Suspicion from which a mark is listed after a run; the page's list of checks has all from one
half on, and joints that were left out."""
MAX_LISTED = 8
"""Lines at most."""


def marks_to_see(preparation: Preparation, annotations: Annotations) -> SeenFrames:
    """What the checks look at: pictures of marked frames."""
    scene, completed = scene_of(preparation, annotations), completed_halves(annotations)
    return SeenFrames(preparation, scene.body_frame, completed.frames)


def describe_doubtful_marks(
    preparation: Preparation, annotations: Annotations, motion: Motion, seen: SeenFrames
) -> list[str]:
    """A line for each marked joint or limb that looks wrong, the most suspicious first.

    Pictures of marked frames that were not `seen` are read.
    """
    scene, completed = scene_of(preparation, annotations), completed_halves(annotations)
    described = describe_frames(preparation, scene.body_frame, completed.frames, seen.features)
    checks = find_checks(
        annotations,
        estimate_body(annotations, {}, preparation.track.height, preparation.video.fps).size,
        find_neighbours(preparation, completed),
        preparation.track,
        compare_appearance(preparation, scene.body_frame, completed, described),
        evidence_of_motion(annotations, motion),
    )
    suspicious = [
        check for check in checks if check.suspicion >= LISTED_SUSPICION and check.kind != "missing"
    ]
    lines = [
        f"Marks of frame {check.frame} look wrong: {check.text[0].lower()}{check.text[1:]}"
        for check in suspicious[:MAX_LISTED]
    ]
    if len(suspicious) > MAX_LISTED:
        more = len(suspicious) - MAX_LISTED
        lines.append(
            f"{more} more marks look wrong; the page of keyrecon annotate lists all under Checks."
        )
    return lines
