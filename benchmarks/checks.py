"""Warnings of the page about marks: how many are true, and how many planted mistakes are found.

    python benchmarks/checks.py [--work DIR] [--only NAME ...] [--half develop|report] [--sets 24]
        [--list]

Takes the marks by eye of real clips as benchmarks/real.py has them made (with the same `--work`
what it stored is found again). All of them are taken for right, so every warning about them as
they are is false. Then mistakes are planted, each in a frame of its own, in `--sets` sets for each
clip:

    legs      left and right of the legs exchanged (where both ankles are .05 heights apart or more)
    arms      left and right of the arms exchanged (where both wrists are .05 heights apart or more)
    joint     a joint .1 to .2 player heights from where it is
    frame     all marks of a frame that belong to the frame marked before or after it (where that
              moves them by .1 heights in the mean)

Two eyes put the same joint at most .05 heights apart in 99 of 100 cases (.08 where it is hidden;
`annotations/real/second`), so that all of these are mistakes: none is smaller than what two people
differ by.

A mistake is found when a warning names its frame and one of its joints; a warning that does is
true. Prints for every clip the false warnings about its marks as they are, and for each kind of
mistake how many were found of how many; `true` is the share of all warnings about sets with
mistakes that are true. `curve` has the same for warnings of at least some suspicion, with the
false warnings about the marks as they are per clip, and `joints` what was found of displaced joints
by joint, distance and whether they are seen. `--list` prints the false warnings.
"""

import argparse
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import real

from keyrecon.annotate.assist.body_estimate import estimate_body
from keyrecon.annotate.assist.checks import find_checks
from keyrecon.annotate.assist.mark_appearance import compare_appearance, describe_frames
from keyrecon.annotate.assist.neighbours import find_neighbours
from keyrecon.annotate.assist.pose_suggestion import scene_of
from keyrecon.annotate.assist.suspicion import Check
from keyrecon.app.console import show
from keyrecon.body import LSP14
from keyrecon.io.stages import StageStore
from keyrecon.pipeline import Options, frames_to_mark, prepare
from keyrecon.propagation.appearance import PlayerFeatures
from keyrecon.propagation.body_frame import BodyFrame
from keyrecon.records import Annotations, Preparation

LEGS = tuple(f"{side}_{part}" for side in ("right", "left") for part in ("hip", "knee", "ankle"))
ARMS = tuple(
    f"{side}_{part}" for side in ("right", "left") for part in ("shoulder", "elbow", "wrist")
)
CURVE = 0.5, 0.6, 0.7, 0.8, 0.9
"""Suspicions for the curve."""
APART = 0.05
"""Distance of ankles or wrists from which exchanging them is a mistake, player heights."""
MOVED = 0.1, 0.2
KINDS = ("legs", "arms", "joint", "frame")
COST = 0.06
SHARE = 4
"""One frame in so many gets a mistake."""

Mistake = tuple[str, int, frozenset[str]]


def prepare_clip(name: str, work: Path) -> tuple[Preparation, Annotations]:
    """The automatic part as whole bodies make it, and all marks, as benchmarks/real.py has them."""
    clip = real.load_clip(name)
    marks = real.solve(clip, COST, work).marks
    store = StageStore(work / name / "cache")
    first = real.choose_bodies(clip, 1)
    bodies = real.take(clip, first, first)
    options = replace(Options(), keyframes=replace(Options().keyframes, budget=COST))
    preparation = prepare(clip.video, (), options, store.keep, show, bodies)
    unsure = frames_to_mark(preparation, clip.truth.frames[first], real.MORE_BODIES)
    first = np.union1d(first, real.nearest_rows(clip, unsure))
    bodies = real.take(clip, first, first)
    return prepare(clip.video, (), options, store.keep, show, bodies), say_absent(marks)


def say_absent(marks: Annotations) -> Annotations:
    """Joints of a marked half that nobody could place are said to be absent, as on the page."""
    absent = []
    for half in (LSP14.is_lower, ~LSP14.is_lower):
        known = np.isfinite(marks.joints[..., 0]) & half
        for row, joint in np.argwhere(known.any(axis=1)[:, None] & half & ~known):
            absent.append((int(marks.frames[row]), LSP14.names[joint]))
    return replace(marks, absent=tuple(sorted(absent)))


def player_height(marks: Annotations) -> float:
    """Highest to lowest joint, median over whole bodies, px."""
    tall = np.ptp(marks.joints[..., 1], axis=1)
    return float(np.nanmedian(tall))


def plant(
    marks: Annotations, kind: str, row: int, random: np.random.Generator
) -> tuple[Annotations, frozenset[str]] | None:
    """The marks with one mistake in a row, and its joints; None where it would be none."""
    height, joints = player_height(marks), marks.joints.copy()
    if kind in ("legs", "arms"):
        names = LEGS if kind == "legs" else ARMS
        own = [LSP14.index(name) for name in names]
        twin = [int(LSP14.mirror[j]) for j in own]
        far = np.linalg.norm(joints[row, own] - joints[row, twin], axis=1)
        if not far[2] > APART * height:
            return None
        joints[row, own] = marks.joints[row, twin]
        return replace(marks, joints=joints), frozenset(names)
    if kind == "joint":
        known = np.flatnonzero(np.isfinite(joints[row, :, 0]))
        joint, turn = int(random.choice(known)), random.uniform(0, 2 * np.pi)
        step = random.uniform(*MOVED) * height
        joints[row, joint] += step * np.array([np.cos(turn), np.sin(turn)])
        return replace(marks, joints=joints), frozenset([LSP14.names[joint]])
    other = row + 1 if row + 1 < len(joints) else row - 1
    both = np.isfinite(joints[row, :, 0]) & np.isfinite(joints[other, :, 0])
    if both.sum() < 6:
        return None
    moved = np.linalg.norm(joints[row] - joints[other], axis=1)[both].mean()
    if moved < MOVED[0] * height:
        return None
    joints[row, both] = marks.joints[other, both]
    return replace(marks, joints=joints), frozenset(np.array(LSP14.names)[both])


def plant_several(
    marks: Annotations, random: np.random.Generator
) -> tuple[Annotations, list[Mistake]]:
    """A mistake of some kind in one row of SHARE, each in a row of its own."""
    mistakes: list[Mistake] = []
    for row in random.permutation(len(marks.frames)):
        if len(mistakes) >= max(1, len(marks.frames) // SHARE):
            break
        kind = KINDS[random.integers(len(KINDS))]
        planted = plant(marks, kind, int(row), random)
        if planted is not None:
            marks, joints = planted
            mistakes.append((kind, int(marks.frames[row]), joints))
    return marks, mistakes


def review_marks(
    preparation: Preparation, marks: Annotations, body_frame: BodyFrame, features: PlayerFeatures
) -> list[Check]:
    """The warnings that the page shows."""
    body = estimate_body(marks, {}, preparation.track.height, preparation.video.fps)
    neighbours = find_neighbours(preparation, marks)
    appearance = compare_appearance(preparation, body_frame, marks, features)
    return find_checks(marks, body.size, neighbours, preparation.track, appearance)


def is_about(check: Check, mistake: Mistake) -> bool:
    """Whether a warning names the frame and a joint of a mistake."""
    return check.frame == mistake[1] and bool({*check.joints} & mistake[2])


def measure(name: str, work: Path, sets: int, listed: bool) -> Counter:
    """One line of the table, and what the curve and the table of joints need."""
    preparation, marks = prepare_clip(name, work)
    body_frame = scene_of(preparation, marks).body_frame
    features = describe_frames(preparation, body_frame, marks.frames)
    random = np.random.default_rng(0)
    counts: Counter = Counter()
    for check in review_marks(preparation, marks, body_frame, features):
        counts.update(f"as they are{least}" for least in CURVE if check.suspicion >= least)
        if listed:
            print(f"    {check.frame} {check.kind} {check.suspicion:.2f} {check.text}")
    for _ in range(sets):
        changed, mistakes = plant_several(marks, random)
        checks = review_marks(preparation, changed, body_frame, features)
        for least in CURVE:
            sure = [check for check in checks if check.suspicion >= least]
            counts[f"warnings{least}"] += len(sure)
            counts[f"true{least}"] += sum(any(is_about(c, m) for m in mistakes) for c in sure)
            for mistake in mistakes:
                found = any(is_about(c, mistake) for c in sure)
                counts[f"{mistake[0]} found{least}"] += found
                if least == CURVE[0]:
                    counts[mistake[0]] += 1
                    for group in list_groups(marks, changed, mistake):
                        counts[f"group {group}"] += 1
                        counts[f"found {group}"] += found
    return counts


def list_groups(marks: Annotations, changed: Annotations, mistake: Mistake) -> list[str]:
    """What a displaced joint is counted under."""
    if mistake[0] != "joint":
        return []
    row, joint = int(np.searchsorted(marks.frames, mistake[1])), LSP14.index(min(mistake[2]))
    off = np.linalg.norm(changed.joints[row, joint] - marks.joints[row, joint])
    apart = int(40 * off / player_height(marks)) / 40
    seen = "seen" if marks.visible[row, joint] else "hidden"
    return [LSP14.names[joint].split("_")[-1], f"from {apart:.3f}", seen]


def describe(name: str, counts: Counter) -> str:
    """Counts as a line."""
    least = CURVE[0]
    found = "".join(f"{counts[f'{kind} found{least}']:>6}/{counts[kind]:<4}" for kind in KINDS)
    share, true = measure_shares(counts, least)
    return f"{name:<26}{counts[f'as they are{least}']:>11}{found}{share:8.0%}{true:8.0%}"


def measure_shares(counts: Counter, least: float) -> tuple[float, float]:
    """Of mistakes that are found, and of warnings that are true."""
    planted = sum(counts[kind] for kind in KINDS)
    found = sum(counts[f"{kind} found{least}"] for kind in KINDS) / max(planted, 1)
    return found, counts[f"true{least}"] / max(counts[f"warnings{least}"], 1)


def describe_curve(counts: Counter, clips: int) -> str:
    """Found against false, and found of displaced joints, as lines."""
    lines = ["curve  suspicion  false per clip   found    true"]
    for least in CURVE:
        found, true = measure_shares(counts, least)
        false = counts[f"as they are{least}"] / max(clips, 1)
        lines.append(f"{least:16.1f}{false:16.2f}{found:8.0%}{true:8.0%}")
    groups = sorted(key.removeprefix("group ") for key in counts if key.startswith("group "))
    each = [f"{name} {counts[f'found {name}']}/{counts[f'group {name}']}" for name in groups]
    return "\n".join([*lines, "joints  " + ", ".join(each)])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work/real"))
    parser.add_argument("--only", nargs="*", help="names of clips")
    parser.add_argument("--half", choices=("develop", "report"), default="develop")
    parser.add_argument("--sets", type=int, default=24)
    parser.add_argument("--list", action="store_true", help="print the false warnings")
    words = parser.parse_args()
    names = [file.stem for file in sorted(real.TRUTH.glob("*.json"))]
    chosen = [n for n in names if (n in real.DEVELOP) == (words.half == "develop")]
    heads = "".join(f"{kind:>9}  " for kind in KINDS)
    print(f"{'clip':<26}{'as they are':>11}{heads}{'found':>8}{'true':>8}")
    total: Counter = Counter()
    used = [n for n in chosen if not words.only or n in words.only]
    for name in used:
        counts = measure(name, words.work, words.sets, words.list)
        total.update(counts)
        print(describe(name, counts), flush=True)
    print(describe("all", total))
    print(describe_curve(total, len(used)))


if __name__ == "__main__":
    main()
