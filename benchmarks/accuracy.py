"""Accuracy on rendered tennis with known truth, sequence by sequence: paper's form beside ours.

    python benchmarks/accuracy.py [--work DIR] [--mocap DIR] [--only NAME ...] [--second]
        [--other] [--mediapipe PYTHON]

Renders what is missing in the work folder, annotates the chosen keyframes from the truth with click
noise, reconstructs and prints a table. Depth and side model are learnt without the players of the
sequence. Nothing is asserted. `swaps` is the share of legs and arms that are exchanged before
refinement, `run` the frames of the longest such run. The last columns are those of `posture.py`:
peak speed of the hands over the true one (median and tenth percentile), errors of knees, elbows and
the angle between hips and shoulders, and by how much knees that are straight are bent, all in
degrees. With an interpreter that has mediapipe 0.10.21 installed, MediaPipe Pose is measured on the
same videos.
"""

import argparse
import resource
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import posture
from peer import score_mediapipe
from sequences import DATA, OTHER, SECOND, TENNIS, Sequence, render
from unseen import unseen_model, unseen_sides

from keyrecon.annotation_budget import LONG_SHARE, annotation_cost
from keyrecon.app.console import show
from keyrecon.io.formats.picks import read_picks
from keyrecon.io.stages import StageStore
from keyrecon.io.video import open_video
from keyrecon.library import reconstruct
from keyrecon.metrics import evaluate_motion, read_truth
from keyrecon.pipeline import Options, as_printed, prepare, with_height
from keyrecon.records import Annotations, Motion, Preparation
from keyrecon.synthetic.marks import MarkOptions, mark_from_truth

CLICK_NOISE = 3.0 / 400
"""Standard deviation of a click, player heights."""
HEIGHT_ERROR = 0.03
"""The height that a user types is off by up to this share."""
SHORT = 20.0
"""Seconds up to which a clip repeats too little for the usual budget; it gets twice as much."""


@dataclass(frozen=True, eq=False)
class Case:
    """A sequence that has been rendered and prepared."""

    sequence: Sequence
    preparation: Preparation
    truth: dict[str, np.ndarray]
    store: StageStore


def prepare_case(sequence: Sequence, folder: Path, options: Options) -> Case:
    """The automatic part."""
    store = StageStore(folder / "cache")
    video = open_video(folder / "video.mp4")
    picks = read_picks(folder / "picks.json")
    preparation = prepare(video, picks, options, store.keep, show)
    return Case(sequence, preparation, read_truth(folder / "truth.npz"), store)


def mark(case: Case, signs: bool = True) -> Annotations:
    """What a person would mark: the truth at the keyframes, with click noise."""
    truth = case.truth
    noise = CLICK_NOISE * float(np.median(case.preparation.track.height))
    return mark_from_truth(
        case.preparation.keyframes,
        truth["points2d"],
        truth["points3d"],
        truth.get("visible"),
        MarkOptions(noise, signs, case.sequence.seed),
    )


def solve(case: Case, options: Options, signs: bool = True) -> Motion:
    """The part after the person, with marks from the truth."""
    error = np.random.default_rng(case.sequence.seed).uniform(-HEIGHT_ERROR, HEIGHT_ERROR)
    options = with_height(options, float(case.truth["height_m"]) * (1 + error))
    return reconstruct(case.preparation, mark(case, signs), options, case.store.keep, show)


def judge_track(case: Case) -> float:
    """Share of frames with head and feet within a tenth of the height of the truth."""
    names = [str(n) for n in case.truth["joint_names"]]
    joint = {name: case.truth["points2d"][:, names.index(name)] for name in names}
    track = case.preparation.track
    head = (joint["neck"] + joint["head_top"]) / 2
    feet = np.stack([joint["left_ankle"], joint["right_ankle"]], axis=1)
    limit = 0.1 * track.height
    head_off = np.linalg.norm(track.head - head, axis=1)
    orders = [0, 1], [1, 0]
    one, other = (np.linalg.norm(track.feet - feet[:, o], axis=2).max(axis=1) for o in orders)
    return float(((head_off < limit) & (np.minimum(one, other) < limit)).mean())


def judge_carried(motion: Motion, truth: dict[str, np.ndarray]) -> tuple[float, float, float]:
    """Before refinement: PCK@0.2 of all joints and of the right wrist, median error in heights.

    A missing joint is no hit.
    """
    names = [str(n) for n in truth["joint_names"]]
    known, joints = truth["points2d"], motion.points2d_propagated
    torso = known[:, names.index("right_hip")] - known[:, names.index("left_shoulder")]
    off = np.linalg.norm(joints - known, axis=2)
    hit = off < 0.2 * np.linalg.norm(torso, axis=1)[:, None]
    tall = np.median(np.ptp(known[..., 1], axis=1))
    wrist = names.index("right_wrist")
    return float(hit.mean()), float(hit[:, wrist].mean()), float(np.nanmedian(off) / tall)


def judge_sides(motion: Motion, truth: dict[str, np.ndarray]) -> tuple[float, int]:
    """Share of legs and arms that are exchanged before refinement, and frames of the longest run.

    Exchanged as in `real.py`: the two outer joints of both sides are nearer to the other side's
    truth than to their own, by .4 torsos in sum.
    """
    names = [str(n) for n in truth["joint_names"]]
    known, joints = truth["points2d"], motion.points2d_propagated
    torso = known[:, names.index("right_hip")] - known[:, names.index("left_shoulder")]
    torso = float(np.median(np.linalg.norm(torso, axis=1)))
    share, longest = [], 0
    for limb in (("knee", "ankle"), ("elbow", "wrist")):
        right, left = ([names.index(f"{side}_{n}") for n in limb] for side in ("right", "left"))
        own, crossed = (
            np.linalg.norm(joints[:, right + left] - known[:, order], axis=2).sum(axis=1)
            for order in (right + left, left + right)
        )
        swapped = crossed + 0.4 * torso < own
        share.append(swapped.mean())
        ends = np.flatnonzero(np.diff(swapped.astype(int), prepend=0, append=0))
        longest = max(longest, int(np.diff(ends)[::2].max(initial=0)))
    return float(np.mean(share)), longest


FORMS = {
    "ours": (Options(), True),
    "ours, automatic signs": (Options(), False),
    "paper": (as_printed(), True),
}
COLUMNS = (
    f"{'sequence':<22}{'form':<23}{'cost':>6}{'cover':>7}{'track':>7}{'PCK':>7}{'wrist':>7}"
    f"{'median':>8}{'PA':>7}{'N':>7}{'accel':>7}{'limbs':>8}{'ms/fr':>7}"
    f"{'swaps':>7}{'run':>5}"
    f"{posture.COLUMNS}"
)


def report(sequence: Sequence, folder: Path, learnt: dict[str, str], forms: list[str]) -> None:
    """Print the rows of one sequence; `learnt` are files of models by their options' names."""
    for form in forms:
        options, signs = FORMS[form]
        used = {name: file for name, file in learnt.items() if getattr(options, name) != "none"}
        options = replace(options, **used)
        if sequence.seconds <= SHORT:
            budget = 2 * LONG_SHARE
            options = replace(options, keyframes=replace(options.keyframes, budget=budget))
        case = prepare_case(sequence, folder, options)
        motion = solve(case, options, signs)
        scores = evaluate_motion(motion, case.truth)
        carried, wrist, median = judge_carried(motion, case.truth)
        swaps, run = judge_sides(motion, case.truth)
        found, frames = case.preparation.keyframes, len(motion.time)
        cost = annotation_cost(found, frames)
        cover = min(found.upper.coverage, found.lower.coverage)
        spent = sum(case.store.seconds.values()) / frames * 1000
        print(
            f"{sequence.name:<22}{form:<23}{cost:6.2%}{cover:7.1%}{judge_track(case):7.1%}"
            f"{carried:7.1%}{wrist:7.1%}{median:8.2%}{scores.pa_mpjpe:7.1f}{scores.n_mpjpe:7.1f}"
            f"{scores.acceleration:7.1f}{scores.limb_variation_max:8.4%}{spent:7.1f}"
            f"{swaps:7.2%}{run:5d}"
            f"{posture.row(posture.judge_posture(motion, case.truth))}",
            flush=True,
        )


def report_mediapipe(sequence: Sequence, folder: Path, python: Path) -> None:
    """Print the row of MediaPipe Pose; `cost` is nothing, `track` the frames with a person."""
    peer = score_mediapipe(folder, python, read_truth(folder / "truth.npz"))
    print(
        f"{sequence.name:<22}{'MediaPipe Pose':<23}{'-':>6}{'-':>7}{peer.found:7.1%}{peer.pck:7.1%}"
        f"{'-':>7}{'-':>8}{peer.pa_mpjpe:7.1f}{peer.n_mpjpe:7.1f}{peer.acceleration:7.1f}",
        flush=True,
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work"))
    parser.add_argument("--mocap", type=Path, default=DATA / "mocap")
    parser.add_argument("--only", nargs="*", help="names of sequences")
    parser.add_argument("--form", nargs="*", default=list(FORMS), choices=list(FORMS))
    parser.add_argument("--second", action="store_true", help="other players, the second table")
    parser.add_argument("--other", action="store_true", help="motion other than tennis")
    parser.add_argument("--mediapipe", type=Path, help="an interpreter with mediapipe")
    words = parser.parse_args()
    print(COLUMNS)
    for sequence in OTHER if words.other else SECOND if words.second else TENNIS:
        if not words.only or sequence.name in words.only:
            folder = render(sequence, words.work, words.mocap)
            depths, _ = unseen_model(sequence, words.work, words.mocap)
            sides = unseen_sides(sequence, words.work, words.mocap)
            learnt = {"depths": str(depths), "sides": str(sides)}
            report(sequence, folder, learnt, words.form)
            if words.mediapipe:
                report_mediapipe(sequence, folder, words.mediapipe)
    print(f"Peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB.")


if __name__ == "__main__":
    main()
