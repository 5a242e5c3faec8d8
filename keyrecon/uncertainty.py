"""How far off each joint probably is, and the stretches that are worst.

Two things tell of the error of a joint in a frame: the confidence with which it was propagated, and
the correction, how far the refinement had to move it in the picture. Each has a monotone table of
factors; the expected error, in player heights, is their product times a mean,

    E|error| = mean * f(confidence) * g(correction),

cut at `MAX_ERROR`: a joint that is farther off is lost, by how much does not matter.

The tables were fitted to joints marked by eye on real clips. `python benchmarks/expected_error.py`
makes them and prints what they are worth, every clip predicted from the others alone.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from keyrecon.body import Skeleton
from keyrecon.records import HalfName, Motion, Track

MEAN_ERROR = 0.0453
"""Player heights. Fitted, as the tables below, to 2634 joints of nine clips. With every clip
predicted from the others, eight groups of joints expected to be off by .010, .013, .014, .017,
.020, .025, .035 and .109 heights were off by .010, .013, .011, .019, .019, .022, .037 and .129, and
clips by .6 to 1.8 of what was expected. Tried besides: with speed in heights per frame the score
(mean of log p + error / p) was -2.854 in place of -2.838, with the time to the nearest mark -2.835:
neither is worth a table."""
CONFIDENCE_EDGES = (0.0, 0.001, 0.1, 0.2, 0.3, 0.5, 0.7, 0.8)
"""Lower ends of the bins of confidence."""
CONFIDENCE_FACTORS = (1.39, 1.36, 1.30, 0.99, 0.92, 0.92, 0.72, 0.66)
CORRECTION_EDGES = (0.0, 0.005, 0.01, 0.015, 0.02, 0.03, 0.05)
"""Lower ends of the bins of the correction, player heights."""
CORRECTION_FACTORS = (0.30, 0.42, 0.58, 0.73, 0.82, 1.77, 3.11)
MAX_ERROR = 0.25
"""Expected error of a joint that is lost, player heights: the length of a thigh."""
UNCERTAIN = 0.04
"""Mean expected error of arms, legs or head from which a stretch is reported, player heights. Of
such parts of frames marked by eye 71 % had a joint that was off by more than .08, and 78 % of those
that had one were reported; at .05 it was 79 and 65 %, at .03 51 and 83 %."""
MERGED_SECONDS = 0.2
"""Uncertain frames that are nearer to each other than this make one stretch."""
LEAST_SECONDS = 0.1
"""Shorter stretches are not worth a line."""
TAUGHT_SECONDS = 0.5
"""A mark teaches the frames within this time most."""
MIN_CONFIDENCE = 0.3
"""Confidence under which a track is a guess: two responses of a fifth of the usual strength."""


@dataclass(frozen=True)
class UncertainStretch:
    """Frames in which something is probably wrong, and where a mark would help most."""

    first: int
    last: int
    what: str
    """Parts of the body, such as 'arms' or 'arms and legs'."""
    error: float
    """Mean expected error of these parts, px; NaN where only the track is known."""
    frame: int
    """The frame whose marks would help most."""
    half: HalfName | str
    """Half of the body to mark there: 'upper', 'lower' or 'both'."""

    @property
    def text(self) -> str:
        """One line for a person."""
        off = f", about {self.error:.0f} px" if np.isfinite(self.error) else ""
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
    """How far the refinement moved each joint in the picture, player heights; infinite where the
    joint was not propagated."""
    moved = np.linalg.norm(motion.points2d - motion.points2d_propagated, axis=2)
    correction = moved / player_height(motion)[:, None]
    return np.where(np.isfinite(correction), correction, np.inf)


def expected_error(motion: Motion) -> Float[np.ndarray, "T J"]:
    """Expected distance of `points2d` from where a person would mark the joints, px."""
    share = predict_error(motion.confidence, measure_correction(motion))
    return share * player_height(motion)[:, None]


def predict_error(
    confidence: Float[np.ndarray, "*n"], correction: Float[np.ndarray, "*n"]
) -> Float[np.ndarray, "*n"]:
    """Expected error in player heights."""
    by_confidence = np.array(CONFIDENCE_FACTORS)[find_bins(confidence, CONFIDENCE_EDGES)]
    by_correction = np.array(CORRECTION_FACTORS)[find_bins(correction, CORRECTION_EDGES)]
    return np.minimum(MEAN_ERROR * by_confidence * by_correction, MAX_ERROR)


def find_bins(values: Float[np.ndarray, "*n"], edges: tuple[float, ...]) -> Int[np.ndarray, "*n"]:
    """Number of the bin of each value; `edges` are the lower ends of all bins."""
    return np.clip(np.digitize(values, edges) - 1, 0, len(edges) - 1)


def uncertain_stretches(
    motion: Motion, marked: Int[np.ndarray, "n"] | None = None, count: int = 3
) -> list[UncertainStretch]:
    """The worst stretches of a motion, in the order of time.

    Stretches whose best frame is among `marked` were helped already since the motion was made.
    Nothing for a motion without expected errors.
    """
    if motion.expected_error is None:
        return []
    height, fps = player_height(motion), motion.fps
    done = np.setdiff1d(np.array([] if marked is None else marked, int), motion.keyframes)
    parts = body_parts(motion.skeleton)
    doubt = {
        name: motion.expected_error[:, members].mean(axis=1) / height
        for name, members in parts.items()
    }
    uncertain = np.max([*doubt.values()], axis=0) > UNCERTAIN
    found = []
    for first, last in _runs(uncertain, round(MERGED_SECONDS * fps)):
        if last - first + 1 < LEAST_SECONDS * fps:
            continue
        inside = slice(first, last + 1)
        means = {name: float(values[inside].mean()) for name, values in doubt.items()}
        bad = [name for name in parts if means[name] > UNCERTAIN]
        bad = bad or [max(parts, key=lambda name: means[name])]
        members = np.concatenate([parts[name] for name in bad])
        total = np.sum([doubt[name] for name in bad], axis=0)
        frame = first + int(_taught(total, round(TAUGHT_SECONDS * fps))[inside].argmax())
        lower = motion.skeleton.is_lower[members]
        half = "both" if lower.any() and not lower.all() else "lower" if lower.all() else "upper"
        error = float(motion.expected_error[inside][:, members].mean())
        stretch = UncertainStretch(first, last, " and ".join(bad), error, frame, half)
        if frame not in done:
            found.append((float(total[inside].sum()), stretch))
    worst = sorted(found, key=lambda row: -row[0])[:count]
    return sorted((stretch for _, stretch in worst), key=lambda s: s.first)


def unsure_track(track: Track, reach: int, count: int = 3) -> list[UncertainStretch]:
    """The longest stretches in which the track is a guess, before there is a motion."""
    runs = [r for r in _runs(track.confidence < MIN_CONFIDENCE, 0) if r[1] - r[0] >= reach]
    longest = sorted(runs, key=lambda run: run[0] - run[1])[:count]
    return [
        UncertainStretch(first, last, "the player's place", np.nan, (first + last) // 2, "both")
        for first, last in sorted(longest)
    ]


def worst_frames(motion: Motion, count: int = 10) -> list[tuple[int, list[tuple[str, float]]]]:
    """Frames with the largest expected errors, at least half a second apart: the number of each
    and its three worst joints with their expected errors, px."""
    if motion.expected_error is None:
        return []
    left = motion.expected_error.mean(axis=1)
    apart = round(TAUGHT_SECONDS * motion.fps)
    found: list[tuple[int, list[tuple[str, float]]]] = []
    while len(found) < count and np.isfinite(left).any():
        frame = int(np.nanargmax(left))
        errors = motion.expected_error[frame]
        worst = np.argsort(-errors)[:3]
        found.append((frame, [(motion.skeleton.names[j], float(errors[j])) for j in worst]))
        left[max(0, frame - apart) : frame + apart + 1] = np.nan
    return found


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


def _runs(flags: Bool[np.ndarray, "T"], gap: int) -> list[tuple[int, int]]:
    """First and last frames of runs of True that are more than `gap` frames apart."""
    frames = np.flatnonzero(flags)
    if not len(frames):
        return []
    breaks = np.flatnonzero(np.diff(frames) > gap + 1)
    firsts, lasts = frames[np.r_[0, breaks + 1]], frames[np.r_[breaks, len(frames) - 1]]
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))


def _taught(doubt: Float[np.ndarray, "T"], reach: int) -> Float[np.ndarray, "T"]:
    """Doubt that a mark in each frame would help with: of the frames around it, the nearer the
    more."""
    window = np.bartlett(2 * max(1, reach) + 1)
    return np.convolve(doubt, window, mode="full")[max(1, reach) : -max(1, reach)]
