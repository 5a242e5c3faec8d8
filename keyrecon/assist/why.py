"""Why a frame is worth annotating, in a sentence, and how many frames it stands for.

Every frame goes to the keyframe whose pose is nearest. What a keyframe alone covers, frames that
all others are farther from than beta, is what would be lost without it.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.matching.propagate import distances_to
from keyrecon.records import Comparison, Keyframes

HalfName = Literal["upper", "lower"]


@dataclass(frozen=True)
class Reason:
    """What a keyframe is good for."""

    stands_for: int
    """Frames of which it shows the pose of at least one half of the body best."""
    why: str


def explain_keyframes(
    comparison: Comparison, keyframes: Keyframes, own: dict[int, str]
) -> dict[int, Reason]:
    """A reason for every keyframe, those that the person added (`own`: frame to half) as well."""
    shares = {half: _share_out(comparison, keyframes, half, own) for half in ("upper", "lower")}
    reasons = {}
    for frame in sorted({*keyframes.frames.tolist(), *own}):
        served = np.zeros(len(comparison.row), dtype=bool)
        parts = []
        for half, (frames, apart, beta) in shares.items():
            if frame not in frames:
                continue
            place = int(np.searchsorted(frames, frame))
            mine = apart.argmin(axis=1) == place
            alone = (apart[:, place] < beta) & ((apart < beta).sum(axis=1) == 1)
            served |= mine
            parts.append(_describe(half, mine, int(alone.sum())))
        added = "You added it. " if frame in own else ""
        reasons[frame] = Reason(int(served.sum()), added + " ".join(parts))
    return reasons


def _share_out(
    comparison: Comparison, keyframes: Keyframes, half: HalfName, own: dict[int, str]
) -> tuple[Int[np.ndarray, "K"], Float[np.ndarray, "T K"], float]:
    """(keyframes of one half, pose distance of every frame to them, beta)."""
    asked = getattr(keyframes, half)
    added = [frame for frame, wanted in own.items() if wanted in (half, "both")]
    frames = np.union1d(asked.frames, np.array(added, dtype=np.int64))
    return frames, distances_to(comparison, half, frames), asked.beta


def _describe(half: HalfName, mine: Bool[np.ndarray, "T"], alone: int) -> str:
    """One half of the body in a sentence."""
    if not mine.any():
        return f"Other keyframes show the {half} body as well."
    first, last = _longest_stretch(mine)
    where = f"frame {first}" if first == last else f"frames {first}-{last}"
    count = int(mine.sum())
    frames = "1 frame" if count == 1 else f"{count} frames"
    text = f"Shows the {half} body of {frames} best, most in a row {where}"
    return f"{text}; {alone} of them no other keyframe covers." if alone else f"{text}."


def _longest_stretch(flags: Bool[np.ndarray, "T"]) -> tuple[int, int]:
    """First and last frame of the longest run of True."""
    ends = np.flatnonzero(np.diff(flags.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    first, end = ends[np.diff(ends, axis=1)[:, 0].argmax()]
    return int(first), int(end) - 1
