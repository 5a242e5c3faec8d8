"""Why a frame is worth annotating, in a sentence, and how many frames it stands for.

Every frame goes to the keyframe whose pose is nearest. What a keyframe alone covers, frames that
all others are farther from than beta, is what would be lost without it.

Where one more annotation would help most.

After a run every joint has a confidence, 0 where it was taken for a slip. A frame is in need as far
as its joints are unsure, and an annotation elsewhere helps it as far as it brings the nearest
annotated pose closer. So the gain of annotating frame f is, for each half of the body,

    sum over t of  doubt(t) * max(0, d(t) - C(t, f)),        d(t) = min over annotated k of C(t, k),

the gain of a medoid in weighted k-medoids, with the pose distance C of Section 4.2. The best frame
is taken, d is brought up to date, and so on: a suggestion makes its likes worthless, which spreads
suggestions out by itself.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.propagation.propagation import LEAST_MARKED, distances_to
from keyrecon.records import Annotations, HalfName, Keyframes, Motion, PoseDistances


@dataclass(frozen=True)
class Reason:
    """What a keyframe is good for."""

    stands_for: int
    """Frames of which it shows the pose of at least one half of the body best."""
    why: str


def explain_keyframes(
    comparison: PoseDistances, keyframes: Keyframes, own: dict[int, str]
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
    comparison: PoseDistances, keyframes: Keyframes, half: HalfName, own: dict[int, str]
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


COUNT = 5
"""Suggestions at a time."""
BOTH = 0.5
"""Share of a half's best gain from which it is marked along with the other half."""
LEAST_GAIN = 0.002
"""Share of all need that a suggestion takes away at least."""


@dataclass(frozen=True)
class Suggestion:
    """A frame to annotate next."""

    frame: int
    half: Literal["upper", "lower", "both"]
    why: str
    gain: float
    """Share of what is in need that it would settle, 0-1."""


@dataclass(frozen=True, eq=False)
class _Need:
    """How far one half of the body is from annotated poses, and how much that matters."""

    half: Literal["upper", "lower"]
    apart: Float[np.ndarray, "M M"]
    """Pose distances, player heights."""
    doubt: Float[np.ndarray, "M"]
    """Summed over the frames that each row stands for."""
    nearest: Float[np.ndarray, "M"]
    """Distance to the nearest annotated pose."""

    @property
    def total(self) -> float:
        """What is in need."""
        return float(self.doubt @ self.nearest)

    def gains(self) -> Float[np.ndarray, "M"]:
        """What annotating each row would settle, as a share of all need."""
        closer = np.maximum(self.nearest - self.apart, 0)
        return closer @ self.doubt / max(self.total, 1e-12)

    def with_row(self, row: int) -> "_Need":
        """The same once a row is annotated."""
        return replace(self, nearest=np.minimum(self.nearest, self.apart[row]))


def suggest_frames(
    comparison: PoseDistances,
    motion: Motion,
    annotations: Annotations,
    taken: frozenset[int] = frozenset(),
    count: int = COUNT,
) -> list[Suggestion]:
    """At most `count` frames, the most helpful first; never one that is `taken` already.

    `annotations` may hold more than the motion was made from: what is annotated needs no more help.
    """
    needs = [_need(comparison, motion, annotations, half) for half in ("upper", "lower")]
    whole = [need.total for need in needs]
    open_rows = comparison.clarity[comparison.frames] * ~np.isin(comparison.frames, list(taken))
    found: list[Suggestion] = []
    while len(found) < count:
        gains = [
            need.gains() * open_rows * (need.total / max(all_, 1e-12)) / len(needs)
            for need, all_ in zip(needs, whole, strict=True)
        ]
        row = int(sum(gains).argmax())
        settled = [float(gain[row]) for gain in gains]
        if sum(settled) < LEAST_GAIN:
            break
        chosen = [share >= BOTH * max(settled) for share in settled]
        half = "both" if all(chosen) else needs[chosen.index(True)].half
        frame = int(comparison.frames[row])
        why = _say_why(comparison, motion, (needs, chosen), row)
        gain = sum(share for share, take in zip(settled, chosen, strict=True) if take)
        found.append(Suggestion(frame, half, why, gain))
        needs = [n.with_row(row) if take else n for n, take in zip(needs, chosen, strict=True)]
        open_rows[row] = 0
    return found


def _need(comparison: PoseDistances, motion: Motion, annotations: Annotations, half: str) -> _Need:
    members = motion.skeleton.is_lower == (half == "lower")
    doubt = 1 - motion.confidence[:, members].mean(axis=1)
    marked = np.isfinite(annotations.joints[:, members, 0]).mean(axis=1) >= LEAST_MARKED
    table = comparison.upper if half == "upper" else comparison.lower
    rows = comparison.row[annotations.frames[marked]]
    return _Need(
        half,
        table,
        np.bincount(comparison.row, doubt, minlength=len(table)),
        table[rows].min(axis=0, initial=float(table.max())),
    )


def _say_why(
    comparison: PoseDistances, motion: Motion, wanted: tuple[list[_Need], list[bool]], row: int
) -> str:
    """Which joints of how many frames it would settle, in a sentence."""
    needs, chosen = wanted
    helped = np.zeros(len(comparison.row), dtype=bool)
    doubt = np.zeros(len(motion.skeleton.names))
    for need, take in zip(needs, chosen, strict=True):
        if take:
            closer = np.maximum(need.nearest - need.apart[row], 0) > 0.25 * need.nearest
            frames = closer[comparison.row]
            members = motion.skeleton.is_lower == (need.half == "lower")
            doubt[members] = (1 - motion.confidence[frames][:, members]).sum(axis=0)
            helped |= frames
    worst = [motion.skeleton.names[j].replace("_", " ") for j in np.argsort(-doubt)[:2]]
    return (
        f"{int(helped.sum())} frames look more like this one than like any annotated one; "
        f"{worst[0]} and {worst[1]} are the least sure there."
    )
