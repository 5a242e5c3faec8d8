"""How many frames a person marks: what is usual, and what was asked for."""

from keyrecon.errors import KeyreconError
from keyrecon.records import Keyframes

LONG_SHARE, LONG_SECONDS = 0.015, 30.0
"""Share of frames that the paper marks (ECCV 2004, Section 4), in videos of half a minute."""
SHORT_SHARE = 0.06
"""Share of frames that are marked at most, unless more is asked for."""


def check_budget(share: float) -> None:
    """Raise KeyreconError for what is no share of the frames."""
    if not 0 < share <= 1:
        raise KeyreconError(f"--budget is a share of the frames, 0.015 for 1.5 %, not {share:g}.")


def usual_budget(n_frames: int, fps: float) -> float:
    """Share of the frames to mark in a video of this length.

    1.5 % from half a minute on. What is shorter repeats less and takes as many marks as half a
    minute would, up to 6 % of the frames; each half of the body takes one.
    """
    share = LONG_SHARE * max(LONG_SECONDS * fps / n_frames, 1.0)
    return min(max(min(share, SHORT_SHARE), 1 / n_frames), 1.0)


def least_labels(fps: float) -> int:
    """Half-body labels of half a minute: a longer video is not asked for fewer."""
    return int(2 * LONG_SHARE * LONG_SECONDS * fps)


def annotation_cost(keyframes: Keyframes, frames: int) -> float:
    """Share of frames that a person marked; one half of the body counts half, as in the paper."""
    return (len(keyframes.upper.frames) + len(keyframes.lower.frames)) / 2 / frames
