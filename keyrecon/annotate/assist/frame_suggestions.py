"""Why a keyframe is one, and which frames would help most as further keyframes.

Every frame goes to the keyframe whose pose is nearest. What a keyframe alone covers, frames that
all others are farther from than beta, is what would be lost without it.

After a run every joint has an expected error. A frame is helped by an annotation elsewhere as far
as its joints are expected to be off and the nearest annotated pose comes closer. So the gain of
annotating frame f is, for each half of the body,

    sum over t of  u(t) * max(0, d(t) - C(t, f)),        d(t) = min over annotated k of C(t, k),

the gain of a medoid in weighted k-medoids, with the uncertainty u and the pose distance C of
Section 4.2. The best frame is taken, d is brought up to date, and so on: a suggestion takes the
gain from frames like it, which spreads suggestions out by itself.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.errors import counted
from keyrecon.propagation.marked_poses import LEAST_MARKED, distances_to
from keyrecon.records import Annotations, HalfName, Keyframes, Motion, PoseDistances
from keyrecon.uncertainty import player_height

HALVES: tuple[HalfName, ...] = ("upper", "lower")


@dataclass(frozen=True)
class Reason:
    """What a keyframe is good for."""

    stands_for: int
    """Frames of which it shows the pose of at least one half of the body best."""
    why: str


@dataclass(frozen=True, eq=False)
class _HalfCoverage:
    """How near the keyframes of one half of the body are to every frame."""

    half: HalfName
    frames: Int[np.ndarray, "K"]
    distance: Float[np.ndarray, "T K"]
    """Pose distance, player heights."""
    beta: float
    shown: Bool[np.ndarray, "T"]
    """Frames with the player."""

    @cached_property
    def nearest(self) -> Int[np.ndarray, "T"]:
        """Column of the keyframe that shows each frame best."""
        return self.distance.argmin(axis=1)

    @cached_property
    def covering(self) -> Int[np.ndarray, "T"]:
        """How many keyframes cover each frame."""
        return (self.distance < self.beta).sum(axis=1)

    def serves(self, column: int) -> Bool[np.ndarray, "T"]:
        """Frames that a keyframe shows best."""
        return (self.nearest == column) & self.shown

    def alone(self, column: int) -> Bool[np.ndarray, "T"]:
        """Frames that no other keyframe covers."""
        covered = self.distance[:, column] < self.beta
        return covered & (self.covering == 1) & self.shown


def explain_keyframes(
    distances: PoseDistances, keyframes: Keyframes, added: dict[int, str]
) -> dict[int, Reason]:
    """A reason for every keyframe, also for those that the person added (frame to half)."""
    coverages = [_cover_half(distances, keyframes, half, added) for half in HALVES]
    reasons = {}
    for frame in sorted({*keyframes.frames.tolist(), *added}):
        served = np.zeros(len(distances.row), dtype=bool)
        sentences = ["You added it."] if frame in added else []
        for coverage in coverages:
            if frame not in coverage.frames:
                continue
            column = int(np.searchsorted(coverage.frames, frame))
            nearest = coverage.serves(column)
            served |= nearest
            alone = int(coverage.alone(column).sum())
            sentences.append(_describe(coverage.half, nearest, alone))
        reasons[frame] = Reason(int(served.sum()), " ".join(sentences))
    return reasons


def _cover_half(
    distances: PoseDistances, keyframes: Keyframes, half: HalfName, added: dict[int, str]
) -> _HalfCoverage:
    chosen = getattr(keyframes, half)
    added_here = [frame for frame, wanted in added.items() if wanted in (half, "both")]
    frames = np.union1d(chosen.frames, np.array(added_here, dtype=np.int64))
    shown = np.isfinite(chosen.distance)
    return _HalfCoverage(half, frames, distances_to(distances, half, frames), chosen.beta, shown)


def _describe(half: HalfName, nearest: Bool[np.ndarray, "T"], alone: int) -> str:
    """What a keyframe does for one half of the body, in a sentence."""
    if not nearest.any():
        return f"Other keyframes show the {half} body as well."
    first, last = _longest_run(nearest)
    where = f"frame {first}" if first == last else f"frames {first}-{last}"
    count = int(nearest.sum())
    frames = "1 frame" if count == 1 else f"{count} frames"
    text = f"Shows the {half} body of {frames} best, the longest run {where}"
    return f"{text}; {alone} of them no other keyframe covers." if alone else f"{text}."


def _longest_run(flags: Bool[np.ndarray, "T"]) -> tuple[int, int]:
    """First and last frame of the longest run of True."""
    ends = np.flatnonzero(np.diff(flags.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    first, end = ends[np.diff(ends, axis=1)[:, 0].argmax()]
    return int(first), int(end) - 1


MAX_SUGGESTIONS = 5
"""At a time: what fits a list without scrolling."""
BOTH_HALVES_SHARE = 0.5
"""Share of a half's best gain from which it is marked along with the other half."""
MIN_GAIN = 0.002
"""Share of all uncertainty that a suggestion takes away at least."""
CLOSER_SHARE = 0.25
"""Share of its distance by which a frame must come closer to count as helped in the reason."""


@dataclass(frozen=True)
class Suggestion:
    """A frame to annotate next."""

    frame: int
    half: Literal["upper", "lower", "both"]
    why: str
    gain: float
    """Share of the uncertainty that it would take away, 0-1."""


@dataclass(frozen=True, eq=False)
class _HalfUncertainty:
    """How far one half of the body is from annotated poses, and how uncertain it is there."""

    half: HalfName
    distance: Float[np.ndarray, "M M"]
    """Between poses, player heights."""
    uncertainty: Float[np.ndarray, "M"]
    """Summed over the frames that each row stands for."""
    nearest: Float[np.ndarray, "M"]
    """Distance to the nearest annotated pose."""

    @property
    def total(self) -> float:
        """Uncertainty times distance, summed."""
        return float(self.uncertainty @ self.nearest)

    def gains(self) -> Float[np.ndarray, "M"]:
        """What annotating each row would take away, as a share of the total."""
        closer = np.maximum(self.nearest - self.distance, 0)
        return closer @ self.uncertainty / max(self.total, 1e-12)

    def with_row(self, row: int) -> "_HalfUncertainty":
        """The same once a row is annotated."""
        return replace(self, nearest=np.minimum(self.nearest, self.distance[row]))


def suggest_frames(
    distances: PoseDistances,
    motion: Motion,
    annotations: Annotations,
    taken: frozenset[int] = frozenset(),
    count: int = MAX_SUGGESTIONS,
) -> list[Suggestion]:
    """At most `count` frames, the most helpful first; never one that is `taken` already.

    `annotations` may hold more than the motion was made from: what is annotated needs no more help.
    A motion of another length than the video, to which a file was added since, tells nothing.
    """
    if len(motion.time) != len(distances.row):
        return []
    halves = [_measure_half(distances, motion, annotations, half) for half in HALVES]
    totals = [half.total for half in halves]
    open_rows = distances.visibility_score[distances.frames] * ~np.isin(
        distances.frames, list(taken)
    )
    suggestions: list[Suggestion] = []
    while len(suggestions) < count:
        gains = [
            half.gains() * open_rows * (half.total / max(total, 1e-12)) / len(halves)
            for half, total in zip(halves, totals, strict=True)
        ]
        row = int(sum(gains).argmax())
        gain = [float(one[row]) for one in gains]
        if sum(gain) < MIN_GAIN:
            break
        chosen = [one >= BOTH_HALVES_SHARE * max(gain) for one in gain]
        marked = [half for half, take in zip(halves, chosen, strict=True) if take]
        suggestions.append(
            Suggestion(
                frame=int(distances.frames[row]),
                half=marked[0].half if len(marked) == 1 else "both",
                why=_explain_gain(distances, motion, marked, row),
                gain=sum(one for one, take in zip(gain, chosen, strict=True) if take),
            )
        )
        halves = [
            half.with_row(row) if take else half for half, take in zip(halves, chosen, strict=True)
        ]
        open_rows[row] = 0
    return suggestions


def _measure_half(
    distances: PoseDistances, motion: Motion, annotations: Annotations, half: HalfName
) -> _HalfUncertainty:
    members = motion.skeleton.is_lower == (half == "lower")
    uncertainty = _doubt(motion)[:, members].mean(axis=1)
    marked = np.isfinite(annotations.joints[:, members, 0]).mean(axis=1) >= LEAST_MARKED
    table = distances.upper if half == "upper" else distances.lower
    rows = distances.row[annotations.frames[marked]]
    return _HalfUncertainty(
        half,
        table,
        np.bincount(distances.row, uncertainty, minlength=len(table)),
        table[rows].min(axis=0, initial=float(table.max())),
    )


def _doubt(motion: Motion) -> Float[np.ndarray, "T J"]:
    """How far off joints are expected to be, player heights, or how little is known of them where
    nothing is expected; 0 where there is no motion.

    Three marks more, where suggested for the one or the other: 98.5 and 98.0 % of the joints right
    in frames that neither had marked, 97.5 before, 97.1 with three marks anywhere (two choices of
    keyframes of four real clips).
    """
    if motion.expected_error is None:
        doubt = 1 - motion.confidence
    else:
        doubt = motion.expected_error / player_height(motion)[:, None]
    return np.where(motion.known[:, None], doubt, 0.0)


def _explain_gain(
    distances: PoseDistances, motion: Motion, halves: list[_HalfUncertainty], row: int
) -> str:
    """Which joints of how many frames would be helped, in a sentence."""
    helped = np.zeros(len(distances.row), dtype=bool)
    uncertainty = np.zeros(len(motion.skeleton.names))
    for half in halves:
        closer = np.maximum(half.nearest - half.distance[row], 0) > CLOSER_SHARE * half.nearest
        frames = closer[distances.row] & motion.known
        members = motion.skeleton.is_lower == (half.half == "lower")
        uncertainty[members] = _doubt(motion)[frames][:, members].sum(axis=0)
        helped |= frames
    worst = [motion.skeleton.names[j].replace("_", " ") for j in np.argsort(-uncertainty)[:2]]
    count = int(helped.sum())
    verb = "looks" if count == 1 else "look"
    return (
        f"{counted(count, 'frame')} {verb} more like this one than like any marked one; "
        f"{worst[0]} and {worst[1]} are the least sure there."
    )
