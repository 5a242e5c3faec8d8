"""Joints of a frame followed there by optical flow from the marks nearest in time.

Where a keyframe lies within a second of marked ones, its joints are often the same patches of the
picture a little moved, and flow finds them closer than templates of edges do. It is the flow that
the run uses (`tracking.mark_flow`), over no more of the video than lies between these marks. Of
the two places of a joint the one is suggested that is surer of itself.

On five real clips (72 half bodies marked one after the other, what is off by more than .02 of the
player's height corrected): actions for each half 4.49 -> 4.29 in the mean, on no clip more.
The better of both, which nobody knows beforehand, would give 3.67.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool

from keyrecon.annotate.assist.pose_suggestion import PoseSuggestion, take_rows
from keyrecon.io.video import Video
from keyrecon.records import Annotations, Shots
from keyrecon.tracking.mark_flow import FlowOptions, track_marked_joints

REACH = 1.0
"""Seconds within which marks are followed: what is read of the video for one suggestion."""


def nearest_marks(annotations: Annotations, frame: int, fps: float, shots: Shots) -> Annotations:
    """The marks that flow would follow to a frame: of each joint the last before it and the first
    after it in its shot."""
    away, number = annotations.frames - frame, shots.number
    marked = np.isfinite(annotations.joints[:, :, 0])
    marked &= (number[annotations.frames] == number[frame])[:, None]
    chosen = np.zeros(len(away), dtype=bool)
    for side in (away < 0, away > 0):
        near = marked & (side & (np.abs(away) <= REACH * fps))[:, None]
        distance = np.where(near, np.abs(away)[:, None], np.inf)
        close = near.any(axis=0)
        if close.any():
            chosen[distance.argmin(axis=0)[close]] = True
    return take_rows(annotations, chosen)


def surer_by_flow(
    suggestion: PoseSuggestion, video: Video, near: Annotations, frame: int
) -> PoseSuggestion:
    """A suggestion whose joints are replaced where flow from near marks is surer of them."""
    if not _shows_both_halves(near):
        return suggestion
    first, last = min(frame, int(near.frames.min())), max(frame, int(near.frames.max()))
    window = slice(first, last + 1)
    part = video.part(window)
    moved = replace(near, frames=near.frames - first, absent=())
    flow = track_marked_joints(part, moved, FlowOptions(longest=2 * REACH))
    surer = _surer(flow.confidence[frame - first], suggestion)
    away = np.abs(near.frames[:, None] - frame) + 1e9 * np.isnan(near.joints[:, :, 0])
    return PoseSuggestion(
        np.where(surer[:, None], flow.joints[frame - first], suggestion.joints),
        np.where(surer, flow.confidence[frame - first], suggestion.confidence),
        np.where(surer, near.frames[away.argmin(axis=0)], suggestion.source),
    )


def _shows_both_halves(near: Annotations) -> bool:
    """Whether each half of the body is wholly marked somewhere: flow takes its scale from that."""
    marked, lower = np.isfinite(near.joints[:, :, 0]), near.skeleton.is_lower
    return all(marked[:, half].all(axis=1).any() for half in (lower, ~lower))


def _surer(confidence: np.ndarray, suggestion: PoseSuggestion) -> Bool[np.ndarray, "J"]:
    """Where flow says anything, and believes it more than the suggestion believes itself."""
    believed = np.where(suggestion.source < 0, 0.0, suggestion.confidence)
    return confidence > believed
