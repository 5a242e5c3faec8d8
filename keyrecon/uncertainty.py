"""How far off each joint probably is, and the stretches that are worst.

Five things tell of the error of a joint in a frame: the correction, how far the refinement had
to move it in the picture; the mean correction of its part of the body (arms, legs, head); the
mean confidence with which that part was propagated; the speed of the joint; and how probable the
limbs are that have it elsewhere, of all that the frame might show. Each has a monotone table of
factors; the expected error, in player heights, is their product times a mean, cut at `MAX_ERROR`:
a joint that is farther off is lost, by how much does not matter. Where nothing of a part was seen
there was nothing to correct, and what moved is a guess: its joints are at least as far off as
straight lines in time from the nearest marks are (`UNSEEN_ERRORS`).

The tables were fitted to joints marked by eye on real clips. `python benchmarks/expected_error.py
--draws 2` makes them and prints what they are worth, every clip predicted from the others alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.body import Skeleton
from keyrecon.numerics.runs import list_runs
from keyrecon.records import SOURCES, HalfName, Motion, Shots, Track

MEAN_ERROR = 0.0213
"""Player heights. Fitted, as the tables, to 5298 joints of nine clips, two choices of marks each
(`benchmarks/draws.py` has them). With every clip predicted from the others, eight groups of joints
expected to be off by .008, .010, .011, .013, .015, .019, .024 and .050 heights were off by .007,
.009, .010, .014, .016, .020, .026 and .047, and clips by .93 to 1.11 of what was expected. The
score (mean of log p + error / p) was -3.171, without what limbs elsewhere tell -3.147. Tried as
further predictors, no better (score within .005): kind of joint, acceleration, change of the bones'
lengths, corrections and confidence of each limb, the joint's own confidence, how far limbs scatter,
and the worst of its part in that."""
ERROR_TABLES: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "correction": (
        (0.0, 0.004, 0.008, 0.012, 0.02, 0.03, 0.05),
        (0.75, 0.85, 0.92, 1.0, 1.18, 1.31, 1.81),
    ),
    "part_correction": (
        (0.0, 0.004, 0.006, 0.009, 0.013, 0.02, 0.03),
        (0.87, 0.92, 1.07, 1.13, 1.26, 1.26, 1.26),
    ),
    "part_confidence": (
        (0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7),
        (1.20, 1.20, 1.18, 1.02, 0.96, 0.89, 0.85),
    ),
    "speed": (
        (0.0, 0.03, 0.09, 0.24, 0.6, 1.2),
        (0.72, 0.85, 1.0, 1.11, 1.11, 1.31),
    ),
    "elsewhere": (
        (0.0, 0.01, 0.03, 0.1, 0.2, 0.4, 0.6),
        (0.68, 0.84, 0.84, 1.15, 1.15, 1.45, 1.67),
    ),
}
"""By predictor the lower ends of its bins, and their factors."""
MAX_ERROR = 0.25
"""Expected error of a joint that is lost, player heights: the length of a thigh."""
NOTHING_SEEN = 0.02
"""Mean confidence of a part's joints below which nothing of it was seen."""
UNSEEN_SECONDS = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2)
"""Lower ends of the bins of time to the nearest mark of a joint."""
UNSEEN_ERRORS: dict[str, tuple[float, ...]] = {
    "arms": (0.063, 0.094, 0.131, 0.194, 0.206, 0.220, 0.269, 0.338),
    "legs": (0.019, 0.034, 0.053, 0.090, 0.110, 0.152, 0.198, 0.249),
    "head": (0.020, 0.039, 0.061, 0.095, 0.122, 0.155, 0.206, 0.271),
}
"""How far straight lines in time between two marks are off, player heights: marks by eye on six
clips, three frames at a time, the clips' means."""
UNCERTAIN = 0.055
"""Expected error of the worst joint of arms, legs or head from which the part is uncertain, player
heights. Chosen so that as many parts are called uncertain as have a joint off by more than a fifth
of the trunk: in nine clips marked by eye, each predicted from the others, 7.8 % of the parts of
frames are called so and 8.2 % are off (18 and 19 % of the frames); of those called so 63 % are off,
and of those off 60 % are called so (58 and 42 % without what limbs elsewhere tell)."""
MERGED_SECONDS = 0.2
"""Uncertain frames that are nearer to each other than this make one stretch."""
LEAST_SECONDS = 0.1
"""Shorter stretches are not worth a line."""
MOST_TOLD = 3
"""Of the worst stretches, each with a line of its own."""
MAX_LISTED = 12
"""Stretches that are named in one line after the worst. Of 53 frames of nine real clips that have a
joint off by more than a fifth of the trunk 35 lie in the three worst stretches of their clips, 43
in any (benchmarks/expected_error.py)."""
TAUGHT_SECONDS = 0.5
"""A mark teaches the frames within this time most."""
MIN_CONFIDENCE = 0.4
"""Confidence under which a track is a guess: head and feet were right in 38 of 100 such frames
(108 of 2212, marked by eye in 18 real clips, `benchmarks/standing_still.py`), up to .6 in 77."""


@dataclass(frozen=True)
class UncertainStretch:
    """Frames in which something is probably wrong, and where a mark would help most."""

    first: int
    last: int
    what: str
    """Parts of the body, such as 'arms' or 'arms and legs'."""
    error: float
    """Expected error of the worst joint of these parts, mean of the frames, px; NaN where only the
    track is known."""
    frame: int
    """The frame whose marks would help most."""
    half: HalfName | str
    """Half of the body to mark there: 'upper', 'lower' or 'both'."""

    @property
    def text(self) -> str:
        """One line for a person."""
        return self.in_words(f"{self.error:.0f} px")

    def in_words(self, error: str) -> str:
        """One line for a person, with the error in other units."""
        off = f", about {error}" if np.isfinite(self.error) else ""
        one = self.first == self.last
        where = f"Frame {self.first}" if one else f"Frames {self.first}-{self.last}"
        return f"{where}: {self.what} uncertain{off}; marking frame {self.frame} would help most."


def player_height(motion: Motion) -> Float[np.ndarray, "T"]:
    """Stature of the player in the picture, px, from the bones and their known proportions."""
    skeleton = motion.skeleton
    ends = motion.points3d[:, skeleton.bones]
    lengths = np.nanmedian(np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2), axis=0)
    return motion.scale * float(lengths.sum() / skeleton.lengths.sum())


def measure_correction(motion: Motion) -> Float[np.ndarray, "T J"]:
    """How far the refinement moved each joint in the picture, player heights, at most `MAX_ERROR`,
    which stands for joints that were not propagated."""
    moved = np.linalg.norm(motion.points2d - motion.points2d_propagated, axis=2)
    correction = moved / player_height(motion)[:, None]
    return np.minimum(np.where(np.isfinite(correction), correction, MAX_ERROR), MAX_ERROR)


def error_predictors(motion: Motion) -> dict[str, Float[np.ndarray, "T J"]]:
    """What tells of each joint's error: `correction` and `part_correction` in player heights,
    `part_confidence`, `speed` in player heights per second, and `elsewhere` where it is known."""
    correction, confidence = measure_correction(motion), motion.confidence
    part_correction, part_confidence = np.zeros_like(correction), np.zeros_like(correction)
    for members in body_parts(motion.skeleton).values():
        part_correction[:, members] = correction[:, members].mean(axis=1, keepdims=True)
        part_confidence[:, members] = confidence[:, members].mean(axis=1, keepdims=True)
    velocity = np.zeros_like(motion.points2d)
    for part in motion.stretches:
        if part.stop - part.start > 1:
            velocity[part] = np.gradient(motion.points2d[part], motion.time[part], axis=0)
    predictors = {
        "correction": correction,
        "part_correction": part_correction,
        "part_confidence": part_confidence,
        "speed": np.linalg.norm(velocity, axis=2) / player_height(motion)[:, None],
    }
    return predictors if motion.elsewhere is None else {**predictors, "elsewhere": motion.elsewhere}


def expected_error(motion: Motion) -> Float[np.ndarray, "T J"]:
    """Expected distance of `points2d` from where a person would mark the joints, px."""
    predicted = predict_error(error_predictors(motion))
    return np.maximum(predicted, unseen_error(motion)) * player_height(motion)[:, None]


def unseen_error(motion: Motion) -> Float[np.ndarray, "T J"]:
    """Least error of joints of parts of which nothing was seen, player heights; 0 of all others."""
    since_mark = _seconds_to_marks(motion)
    error = np.zeros_like(motion.confidence)
    for name, members in body_parts(motion.skeleton).items():
        unseen = motion.confidence[:, members].mean(axis=1, keepdims=True) < NOTHING_SEEN
        table = np.array(UNSEEN_ERRORS[name])[find_bins(since_mark[:, members], UNSEEN_SECONDS)]
        error[:, members] = np.where(unseen & (since_mark[:, members] > 0), table, 0.0)
    return np.minimum(error, MAX_ERROR)


def _seconds_to_marks(motion: Motion) -> Float[np.ndarray, "T J"]:
    """From each frame to the nearest one in which each joint is marked; infinite without any."""
    apart = np.full(motion.source.shape, np.inf)
    for joint, marked in enumerate((motion.source == SOURCES.index("annotated")).T):
        if marked.any():
            times = motion.time[marked]
            after = np.searchsorted(times, motion.time).clip(0, len(times) - 1)
            nearest = np.minimum(
                np.abs(times[after] - motion.time), np.abs(times[after - 1] - motion.time)
            )
            apart[:, joint] = nearest
    return apart


def predict_error(predictors: Mapping[str, Float[np.ndarray, "*n"]]) -> Float[np.ndarray, "*n"]:
    """Expected error in player heights; `elsewhere` may be missing."""
    factors = [
        np.array(table)[find_bins(predictors[name], edges)]
        for name, (edges, table) in ERROR_TABLES.items()
        if name in predictors
    ]
    return np.minimum(MEAN_ERROR * np.prod(factors, axis=0), MAX_ERROR)


def find_bins(values: Float[np.ndarray, "*n"], edges: tuple[float, ...]) -> Int[np.ndarray, "*n"]:
    """Number of the bin of each value; `edges` are the lower ends of all bins."""
    return np.clip(np.digitize(values, edges) - 1, 0, len(edges) - 1)


def uncertain_stretches(
    motion: Motion, marked: Int[np.ndarray, "n"] | None = None, count: int = MOST_TOLD
) -> list[UncertainStretch]:
    """The worst stretches of a motion, in the order of time (`rank_stretches`)."""
    return _in_time(rank_stretches(motion, marked)[:count])


def _in_time(stretches: Sequence[UncertainStretch]) -> list[UncertainStretch]:
    return sorted(stretches, key=lambda s: s.first)


def rank_stretches(
    motion: Motion, marked: Int[np.ndarray, "n"] | None = None
) -> list[UncertainStretch]:
    """All uncertain stretches of a motion, the worst first.

    None is longer than what the marks of one frame help (`TAUGHT_SECONDS` to either side), and
    none goes on over frames without a motion or into another shot. Those whose best frame is among
    `marked` were helped already since the motion was made. Nothing for a motion without expected
    errors.
    """
    if motion.expected_error is None:
        return []
    done = np.setdiff1d(np.array([] if marked is None else marked, int), motion.keyframes)
    height = player_height(motion)
    doubt = _doubt_by_part(motion, height)
    least, gap = LEAST_SECONDS * motion.fps, round(MERGED_SECONDS * motion.fps)
    uncertain, stretches = _is_uncertain(doubt), []
    open_runs = [
        (shot, shot.start + first, shot.start + last)
        for shot in motion.stretches
        for first, last in list_runs(uncertain[shot], gap)
    ]
    while open_runs:
        shot, first, last = open_runs.pop()
        if last - first + 1 < least:
            continue
        stretch, weight = _worst_stretch(motion, doubt, height, shot, slice(first, last + 1))
        open_runs += [(shot, first, stretch.first - 1), (shot, stretch.last + 1, last)]
        if stretch.frame not in done:
            stretches.append((weight, stretch))
    return [stretch for _, stretch in sorted(stretches, key=lambda row: -row[0])]


def uncertain_parts(motion: Motion, frames: Sequence[int]) -> list[str]:
    """What is uncertain in each of some frames, such as 'arms and legs'; '' where nothing is."""
    stretches = rank_stretches(motion)
    return [next((s.what for s in stretches if s.first <= f <= s.last), "") for f in frames]


def uncertain_share(motion: Motion) -> float:
    """Share of the frames in which arms, legs or head are uncertain."""
    if motion.expected_error is None:
        return 0.0
    doubt = _doubt_by_part(motion, player_height(motion))
    return float(_is_uncertain(doubt)[motion.known].mean())


def describe_uncertainty(motion: Motion) -> list[str]:
    """How much of a motion is uncertain, the worst stretches, a line each, and where the others
    are; nothing where all is certain."""
    ranked = rank_stretches(motion)
    if not ranked:
        return []
    worst, others = _in_time(ranked[:MOST_TOLD]), _in_time(ranked[MOST_TOLD:])
    share = uncertain_share(motion)
    lines = [f"Arms, legs or head are uncertain in {share:.0%} of the frames. Worst:"]
    lines += [stretch.text for stretch in worst]
    if others:
        more = f" and {len(others) - MAX_LISTED} more" if len(others) > MAX_LISTED else ""
        listed = ", ".join(f"{s.first}-{s.last} ({s.what})" for s in others[:MAX_LISTED])
        lines.append(f"Also uncertain: frames {listed}{more}.")
    return lines


def _doubt_by_part(
    motion: Motion, height: Float[np.ndarray, "T"]
) -> dict[str, Float[np.ndarray, "T"]]:
    """Expected error of the worst joint of each part, player heights; 0 without motion."""
    errors = motion.expected_error
    assert errors is not None  # callers ask first
    known = motion.known
    errors, height = np.where(known[:, None], errors, 0.0), np.where(known, height, 1.0)
    return {
        name: errors[:, members].max(axis=1) / height
        for name, members in body_parts(motion.skeleton).items()
    }


def _is_uncertain(doubt: Mapping[str, Float[np.ndarray, "T"]]) -> Bool[np.ndarray, "T"]:
    return np.max([*doubt.values()], axis=0) > UNCERTAIN


def _worst_stretch(
    motion: Motion,
    doubt: Mapping[str, Float[np.ndarray, "T"]],
    height: Float[np.ndarray, "T"],
    shot: slice,
    run: slice,
) -> tuple[UncertainStretch, float]:
    """The part of an uncertain run of a shot that marks of one frame would help most, and by how
    much; of a player of a `height` in each frame, px."""
    reach = round(TAUGHT_SECONDS * motion.fps)
    bad = _bad_parts(doubt, run)
    around = slice(max(shot.start, run.start - reach), min(shot.stop, run.stop + reach))
    taught = _taught(np.sum([doubt[name][around] for name in bad], axis=0), reach)
    frame = run.start + int(taught[run.start - around.start :][: run.stop - run.start].argmax())
    first, last = max(run.start, frame - reach), min(run.stop - 1, frame + reach)
    inside = slice(first, last + 1)
    bad = _bad_parts(doubt, inside)
    parts = body_parts(motion.skeleton)
    members = np.concatenate([parts[name] for name in bad])
    lower = motion.skeleton.is_lower[members]
    half = "both" if lower.any() and not lower.all() else "lower" if lower.all() else "upper"
    error = float(np.mean([doubt[name][inside] * height[inside] for name in bad]))
    total = float(np.sum([doubt[name][inside] for name in bad]))
    return UncertainStretch(first, last, " and ".join(bad), error, frame, half), total


def _bad_parts(doubt: Mapping[str, Float[np.ndarray, "T"]], inside: slice) -> list[str]:
    """Parts that are uncertain in the mean of some frames; the worst where none is."""
    means = {name: float(values[inside].mean()) for name, values in doubt.items()}
    bad = [name for name, mean in means.items() if mean > UNCERTAIN]
    return bad or [max(means, key=lambda name: means[name])]


def unsure_track(track: Track, shots: Shots, reach: int, count: int = 3) -> list[UncertainStretch]:
    """The longest stretches of shots in which the track is a guess, before there is a motion."""
    guessed = (track.confidence < MIN_CONFIDENCE) & track.known
    runs = [
        (shot.start + first, shot.start + last)
        for shot in shots.parts
        for first, last in list_runs(guessed[shot])
        if last - first >= reach
    ]
    longest = sorted(runs, key=lambda run: run[0] - run[1])[:count]
    return [
        UncertainStretch(first, last, "the player's place", np.nan, (first + last) // 2, "both")
        for first, last in sorted(longest)
    ]


def worst_frames(motion: Motion, count: int = 10) -> list[tuple[int, list[tuple[str, float]]]]:
    """Frames whose three worst joints have the largest expected errors by the player's size, at
    least half a second apart: the number of each and these joints with their errors, px."""
    if motion.expected_error is None:
        return []
    left = np.sort(motion.expected_error, axis=1)[:, -3:].mean(axis=1) / motion.scale
    apart = round(TAUGHT_SECONDS * motion.fps)
    asked: list[tuple[int, list[tuple[str, float]]]] = []
    while len(asked) < count and np.isfinite(left).any():
        frame = int(np.nanargmax(left))
        errors = motion.expected_error[frame]
        worst = np.argsort(-errors)[:3]
        asked.append((frame, [(motion.skeleton.names[j], float(errors[j])) for j in worst]))
        left[max(0, frame - apart) : frame + apart + 1] = np.nan
    return asked


def body_parts(skeleton: Skeleton) -> dict[str, Int[np.ndarray, "_"]]:
    """Joints of the arms, of the legs and of the rest; no part is empty."""
    joints = np.arange(len(skeleton.names))
    paired = skeleton.mirror != joints
    parts = {
        "arms": joints[paired & ~skeleton.is_lower],
        "legs": joints[paired & skeleton.is_lower],
        "head": joints[~paired],
    }
    return {name: members for name, members in parts.items() if len(members)}


def _taught(doubt: Float[np.ndarray, "T"], reach: int) -> Float[np.ndarray, "T"]:
    """Doubt that a mark in each frame would help with: of the frames around it, the nearer the
    more."""
    window = np.bartlett(2 * max(1, reach) + 1)
    return np.convolve(doubt, window, mode="full")[max(1, reach) : -max(1, reach)]
