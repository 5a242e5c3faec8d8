"""The tables of keyrecon/uncertainty.py, from real clips whose joints were marked by eye.

    python benchmarks/expected_error.py [--work DIR] [--only NAME ...] [--half develop|report]
        [--draws N]

Takes every clip as benchmarks/real.py does (with the same `--work` what it stored is found again),
with `--draws` with so many choices of marks as benchmarks/draws.py, and holds the refined joints
against the marks by eye that nobody made for the program. Prints

    reliability    joints by the error that was expected of them, in eight groups of like size: what
                   was expected and what it was, in player heights. Each clip is predicted by
                   tables that were fitted to the other clips
    clips          the same for each clip
    others         the same with fewer and with other predictors, the time to the nearest mark among
                   them: mean of log p + error / p, smaller is better, and the rank correlation
    reported       arms, legs and heads of frames that would be reported (expected error of a joint
                   above UNCERTAIN): how many of them have a joint that is off by more than .2 of
                   the trunk, and how many of those that have are reported; the same for whole
                   frames, of all clips and of each
    shipped        the same as `reliability` for the tables that are there, by groups and by the
                   confidence of joints: what it was over what was expected
    told           frames with a joint off by more than .2 of the trunk that lie in one of the three
                   worst stretches that `keyrecon run` tells, and in any that it names, and how many
                   of the frames in these are off
    tables         to be put into keyrecon/uncertainty.py

With `--half report` nothing is fitted: the tables that are there are measured on those clips.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import real
from draws import mark_draw, prepare_clip
from scipy.optimize import isotonic_regression
from scipy.stats import spearmanr

from keyrecon.app.console import show
from keyrecon.body import LSP14
from keyrecon.library import reconstruct
from keyrecon.records import Annotations, Motion
from keyrecon.uncertainty import (
    ERROR_TABLES,
    MAX_ERROR,
    UNCERTAIN,
    body_parts,
    error_predictors,
    find_bins,
    player_height,
    predict_error,
    uncertain_stretches,
)

EDGES = {
    "correction": (0.0, 0.004, 0.008, 0.012, 0.02, 0.03, 0.05),
    "part_correction": (0.0, 0.004, 0.006, 0.009, 0.013, 0.02, 0.03),
    "part_confidence": (0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7),
    "speed": (0.0, 0.03, 0.09, 0.24, 0.6, 1.2),
    "elsewhere": (0.0, 0.01, 0.03, 0.1, 0.2, 0.4, 0.6),
    "confidence": (0.0, 0.001, 0.1, 0.2, 0.3, 0.5, 0.7, 0.8),
    "time": (0.0, 0.1, 0.2, 0.4),
}
"""Lower ends of the bins: about equal numbers of joints, more of them where errors are large."""
FALLS = "confidence", "part_confidence"
USED = "correction", "part_correction", "part_confidence", "speed", "elsewhere"
PRIOR = 20
"""Joints of the mean error that every bin is begun with, so that a rare one is not overrated."""
GROUPS = 8
CLASSES = 0.0, 0.1, 0.3, 0.5, 0.7, 1.01
"""Confidences of joints."""
COST = 0.06
APART = 1_000_000
"""Between the numbers of frames of two choices of marks, which are not the same frames."""
OFF = 0.2
"""Error that counts as off, in trunks: as in PCK@0.2."""

Sample = dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Solved:
    """A clip, the marks that the program got, and its motion."""

    clip: real.Clip
    marks: Annotations
    motion: Motion


def solve(name: str, work: Path, draws: int) -> Iterator[Solved]:
    """As benchmarks/real.py has it, or with some choices of marks."""
    clip = real.load_clip(name)
    if not draws:
        result = real.solve(clip, COST, work)
        yield Solved(clip, result.marks, result.motion)
        return
    prepared = prepare_clip(clip, COST, work)
    for seed in range(draws):
        made, marks = mark_draw(prepared, seed)
        keep = prepared.store.keep
        yield Solved(clip, marks, reconstruct(made, marks, prepared.options, keep, show))


def collect(solved: Solved) -> Sample:
    """Errors and what may tell of them, for all joints of a clip that can be seen and were not
    marked for the program."""
    clip, marks, motion = solved.clip, solved.marks, solved.motion
    frames = clip.truth.frames
    height = player_height(motion)[:, None]
    used = real.held_out(clip, marks) & clip.seen
    rows, joints = np.nonzero(used)
    at = frames[rows], joints
    error = np.linalg.norm(motion.points2d[frames] - clip.truth.joints, axis=2) / height[frames]
    predictors = error_predictors(motion)
    marked = np.isfinite(marks.joints[..., 0])
    away = [np.abs(marks.frames[marked[:, j]] - t).min() for t, j in zip(*at, strict=True)]
    return {
        "clip": np.full(len(rows), clip.name),
        "frame": at[0],
        "joint": at[1],
        "error": np.minimum(error[rows, joints], MAX_ERROR),
        **{name: values[at] for name, values in predictors.items()},
        "confidence": motion.confidence[at],
        "trunk": clip.torso / height[frames][rows, 0],
        "time": np.array(away) / clip.video.fps,
    }


def fit(sample: Sample, used: tuple[str, ...]) -> tuple[float, dict[str, np.ndarray]]:
    """Mean error and a monotone table of factors for each predictor; clips weigh the same."""
    error = sample["error"]
    _, clip, count = np.unique(sample["clip"], return_inverse=True, return_counts=True)
    weight = 1 / count[clip]
    weight /= weight.mean()
    mean = float((weight * error).mean())
    bins = {name: find_bins(sample[name], EDGES[name]) for name in used}
    tables = {name: np.ones(len(EDGES[name])) for name in used}
    for _ in range(30):
        for name in used:
            others = mean * np.prod([tables[n][bins[n]] for n in used if n != name], axis=0)
            size = len(tables[name])
            actual = np.bincount(bins[name], weight * error, size) + PRIOR * mean
            expected = np.bincount(bins[name], weight * others, size) + PRIOR * mean
            tables[name] = isotonic_regression(
                actual / expected, weights=expected, increasing=name not in FALLS
            ).x
        product = np.prod([tables[n][bins[n]] for n in used], axis=0)
        mean = float((weight * error).sum() / (weight * product).sum())
    return mean, tables


def predict(sample: Sample, model: tuple[float, dict[str, np.ndarray]]) -> np.ndarray:
    """Expected errors, player heights."""
    mean, tables = model
    factors = [table[find_bins(sample[name], EDGES[name])] for name, table in tables.items()]
    return np.minimum(mean * np.prod(factors, axis=0), MAX_ERROR)


def leave_one_out(sample: Sample, used: tuple[str, ...]) -> np.ndarray:
    """Expected errors, those of each clip by tables from the others."""
    expected = np.zeros(len(sample["error"]))
    for name in np.unique(sample["clip"]):
        own = sample["clip"] == name
        others = {key: values[~own] for key, values in sample.items()}
        expected[own] = predict({k: v[own] for k, v in sample.items()}, fit(others, used))
    return expected


def print_reliability(sample: Sample, expected: np.ndarray) -> None:
    """Expected and actual errors in groups and by clip."""
    error = sample["error"]
    order = np.array_split(np.argsort(expected, kind="stable"), GROUPS)
    print("reliability (heights)" + "".join(f"{n + 1:>8}" for n in range(GROUPS)))
    print("  expected           " + "".join(f"{expected[rows].mean():8.3f}" for rows in order))
    print("  actual             " + "".join(f"{error[rows].mean():8.3f}" for rows in order))
    for name in np.unique(sample["clip"]):
        own = sample["clip"] == name
        actual, mean = error[own].mean(), expected[own].mean()
        print(f"  {name:<26}{own.sum():>6} joints: actual {actual:.3f}, expected {mean:.3f}")


def print_reported(sample: Sample, expected: np.ndarray) -> None:
    """Of arms, legs and heads, and of frames, that are reported, how many are off, and the other
    way about."""
    part = np.zeros(len(LSP14.names), int)
    for number, members in enumerate(body_parts(LSP14).values()):
        part[members] = number
    off = sample["error"] > OFF * sample["trunk"]
    clip, frame = sample["clip"], sample["frame"]
    for what, keys in (("parts", (clip, frame, part[sample["joint"]])), ("frames", (clip, frame))):
        told, wrong = any_of_group(keys, expected, off)
        print(
            f"{told.mean():.1%} of {len(told)} {what} reported, {wrong.mean():.1%} have a joint "
            f"off by more than a fifth of the trunk: {wrong[told].mean():.0%} of those reported, "
            f"and {told[wrong].mean():.0%} of those that have are reported"
        )
    for name in np.unique(clip):
        own = clip == name
        told, wrong = any_of_group((frame[own],), expected[own], off[own])
        print(f"  {name:<26}frames reported {told.mean():4.0%}, off {wrong.mean():4.0%}")


def print_shipped(sample: Sample) -> None:
    """Actual over expected errors by the tables that are there."""
    expected, error = predict_error({name: sample[name] for name in ERROR_TABLES}), sample["error"]
    order = np.array_split(np.argsort(expected, kind="stable"), GROUPS)
    ratios = "".join(f"{error[rows].mean() / expected[rows].mean():8.2f}" for rows in order)
    print(f"shipped: actual / expected by groups{ratios}")
    for least, most in pairwise(CLASSES):
        own = (sample["confidence"] >= least) & (sample["confidence"] < most)
        if own.any():
            ratio = error[own].mean() / expected[own].mean()
            print(f"  confidence {least:.1f}-{most:.1f} {own.sum():>6} joints: {ratio:.2f}")


def print_told(samples: list[Sample], motions: list[Motion]) -> None:
    """Frames that are off and lie in stretches that a run tells, and the other way about."""
    total = np.zeros(6, int)
    for sample, motion in zip(samples, motions, strict=True):
        off = sample["error"] > OFF * sample["trunk"]
        frames, group = np.unique(sample["frame"] % APART, return_inverse=True)
        wrong = np.bincount(group, off) > 0
        inside = [
            np.any([(frames >= s.first) & (frames <= s.last) for s in stretches], axis=0)
            if stretches
            else np.zeros(len(frames), bool)
            for stretches in (
                uncertain_stretches(motion),
                uncertain_stretches(motion, count=len(motion.time)),
            )
        ]
        counts = [len(frames), wrong.sum()]
        counts += [number for told in inside for number in (told.sum(), (told & wrong).sum())]
        total += np.array(counts)
    print(
        f"told: of {total[1]} frames (of {total[0]}) that are off, {total[3]} lie in the three "
        f"worst stretches and {total[5]} in any; of {total[2]} and {total[4]} frames in them "
        f"{total[3] / max(total[2], 1):.0%} and {total[5] / max(total[4], 1):.0%} are off"
    )


def any_of_group(
    keys: tuple[np.ndarray, ...], expected: np.ndarray, off: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(whether a joint is reported, whether one is off), by group."""
    numbers = np.stack([np.unique(key, return_inverse=True)[1] for key in keys])
    groups, group = np.unique(numbers, axis=1, return_inverse=True)
    told, wrong = np.zeros((2, groups.shape[1]), bool)
    np.logical_or.at(told, group.ravel(), expected > UNCERTAIN)
    np.logical_or.at(wrong, group.ravel(), off)
    return told, wrong


def read_words() -> argparse.Namespace:
    """What was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work/real"))
    parser.add_argument("--only", nargs="*", help="names of clips")
    parser.add_argument("--draws", type=int, default=0, help="choices of marks of each clip")
    parser.add_argument("--half", choices=("develop", "report"), default="develop")
    return parser.parse_args()


def main() -> None:
    """Print everything."""
    words = read_words()
    names = [file.stem for file in sorted(real.TRUTH.glob("*.json"))]
    chosen = [n for n in names if (n in real.DEVELOP) == (words.half == "develop")]
    every = [
        solved
        for n in chosen
        if not words.only or n in words.only
        for solved in solve(n, words.work, words.draws)
    ]
    samples = [collect(solved) for solved in every]
    for number, one in enumerate(samples):
        one["frame"] = one["frame"] + number * APART
    sample = {key: np.concatenate([one[key] for one in samples]) for key in samples[0]}
    if words.half == "report":
        expected = predict_error({name: sample[name] for name in ERROR_TABLES})
        print_reliability(sample, expected)
        print_reported(sample, expected)
        return
    print_shipped(sample)
    print_told(samples, [solved.motion for solved in every])
    left_out = leave_one_out(sample, USED)
    print_reliability(sample, left_out)
    print_reported(sample, left_out)
    pair = ("confidence", "correction")
    for more in (("confidence",), pair, (*pair, "speed"), USED[:-1], USED, (*USED, "time")):
        expected = leave_one_out(sample, more)
        score = float((np.log(expected) + sample["error"] / expected).mean())
        rank = spearmanr(expected, sample["error"])[0]
        print(f"{' '.join(more):<64} score {score:7.3f}   rank correlation {rank:.3f}")
    mean, tables = fit(sample, USED)
    print(f"MEAN_ERROR = {mean:.4f}\nERROR_TABLES = {{")
    for name in USED:
        factors = ", ".join(f"{value:.2f}" for value in tables[name])
        print(f'    "{name}": ({EDGES[name]}, ({factors})),')
    print("}")


if __name__ == "__main__":
    main()
