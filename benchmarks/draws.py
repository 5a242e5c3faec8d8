"""Accuracy on real clips over several draws of the keyframes that are asked for.

    python benchmarks/draws.py [--only NAME ...] [--draws 6] [--cost 0.06] [--work DIR]
        [--mirrored] [--lift] [--sheets]

One clip's figure in `benchmarks/real.py` is one draw of which frames are asked for. Here every
pose distance is multiplied by a random factor near one before the choice, other factors in every
draw, so that other keyframes are asked for that cost the same and serve as well; everything before
the choice is done once (with the `--work` of real.py what that stored is found again), choice and
propagation are done for each draw. Prints for every clip, mean and worst over the draws:

    PCK@0.2   joints in sight within 0.2 of the torso, as real.py has it
    action    the same within the strokes or the swing
    swaps     share of frames in which both legs, or both arms, are exchanged
    arms, legs, head    PCK@0.2 of these

and with `--lift`, of the refined joints,

    told      of those that are off by more than that, the share in parts of frames that are called
              uncertain
    called    share of all joints in such parts
    sure      of the joints in all other parts, the share that is off

Clips of `develop` unless others are named. `--sheets` writes a picture of the worst draw of each.
"""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import real

from keyrecon.app.console import show
from keyrecon.body import LSP14
from keyrecon.io import stages
from keyrecon.io.stages import StageStore
from keyrecon.keyframes.selection import choose_keyframes
from keyrecon.library import carry_joints, reconstruct
from keyrecon.pipeline import (
    Options,
    frames_off_marks,
    frames_to_mark,
    prepare,
    with_marked_keyframes,
)
from keyrecon.records import Annotations, Motion, PoseDistances, Preparation
from keyrecon.uncertainty import UNCERTAIN, body_parts, player_height

NOISE = 0.1
"""Spread of the logarithm of the factors on pose distances."""


def perturb(distances: PoseDistances, seed: int) -> PoseDistances:
    """Distances with noise; as they are for seed 0."""
    if not seed:
        return distances
    chance = np.random.default_rng(seed)

    def noisy(table: np.ndarray) -> np.ndarray:
        noise = np.triu(chance.normal(0, NOISE, table.shape), 1)
        return (table * np.exp(noise + noise.T)).astype(table.dtype)

    return replace(distances, upper=noisy(distances.upper), lower=noisy(distances.lower))


@dataclass(frozen=True, eq=False)
class Prepared:
    """A clip before keyframes are chosen."""

    clip: real.Clip
    preparation: Preparation
    first: np.ndarray
    """Rows of the truth in which whole bodies are marked."""
    store: StageStore
    options: Options


def prepare_clip(clip: real.Clip, cost: float, work: Path) -> Prepared:
    """Everything up to the choice, as real.py has it."""
    store = StageStore(work / clip.name / "cache")
    options = replace(Options(), keyframes=replace(Options().keyframes, budget=cost))
    first = real.choose_bodies(clip, 1)
    bodies = real.take(clip, first, first)
    preparation = prepare(clip.video, (), options, store.keep, show, bodies)
    unsure = frames_to_mark(preparation, clip.truth.frames[first], real.MORE_BODIES)
    first = np.union1d(first, real.nearest_rows(clip, unsure))
    bodies = real.take(clip, first, first)
    preparation = prepare(clip.video, (), options, store.keep, show, bodies)
    return Prepared(clip, preparation, first, store, options)


@dataclass(frozen=True, eq=False)
class Draw:
    """One choice of keyframes and what came out."""

    marks: Annotations
    joints: np.ndarray
    """(T, J, 2): propagated, px."""
    figures: dict[str, float]


def mark_draw(prepared: Prepared, seed: int) -> tuple[Preparation, Annotations]:
    """Choose with noise, mark."""
    clip, options, store = prepared.clip, prepared.options, prepared.store
    made, bodies = prepared.preparation, real.take(clip, prepared.first, prepared.first)
    noisy = perturb(made.pose_distances, seed)
    chosen = choose_keyframes(noisy, clip.video.fps, options=options.keyframes)
    made = with_marked_keyframes(replace(made, keyframes=chosen), bodies, options)
    marks = real.mark_keyframes(clip, made.keyframes, prepared.first)
    if len(frames_off_marks(made, marks)):
        made = prepare(clip.video, (), options, store.keep, show, marks)
    return made, marks


def draw_once(prepared: Prepared, seed: int, lifted: bool) -> Draw:
    """Choose with noise, mark, propagate."""
    clip, options, store = prepared.clip, prepared.options, prepared.store
    made, marks = mark_draw(prepared, seed)
    unknown = real.held_out(clip, marks) & clip.seen
    if not lifted:
        joints = carry_joints(made, marks, options, store.keep, show).joints
        return Draw(marks, joints, measure(clip, joints, unknown))
    motion = reconstruct(made, marks, options, store.keep, show)
    joints = motion.points2d_propagated
    figures = measure(clip, joints, unknown) | measure_sureness(clip, motion, unknown)
    return Draw(marks, joints, figures)


def measure(clip: real.Clip, joints: np.ndarray, unknown: np.ndarray) -> dict[str, float]:
    """All figures of the propagated joints."""
    near, action = real.hits(joints, clip, 0.2), clip.action[:, None]
    parts = body_parts(LSP14)
    figures = {
        "pck": near[unknown].mean(),
        "action": near[unknown & action].mean(),
        "swaps": real.count_swaps(joints, clip, unknown),
    }
    for name, members in parts.items():
        figures[name] = near[:, members][unknown[:, members]].mean()
    return figures


def measure_sureness(clip: real.Clip, motion: Motion, unknown: np.ndarray) -> dict[str, float]:
    """What is told of the joints that are off after the refinement."""
    frames = clip.truth.frames
    off = unknown & ~real.hits(motion.points2d, clip, 0.2)
    doubt = motion.expected_error[frames] / player_height(motion)[frames, None]
    told = np.zeros(off.shape, bool)
    for members in body_parts(LSP14).values():
        told[:, members] = (doubt[:, members].max(axis=1) > UNCERTAIN)[:, None]
    return {
        "told": (off & told).sum() / max(off.sum(), 1),
        "called": told[unknown].mean(),
        "sure": off[unknown & ~told].mean(),
    }


def describe(name: str, draws: list[Draw]) -> str:
    """Mean and worst of every figure."""
    text = f"{name:<34}"
    for figure in draws[0].figures:
        values = [draw.figures[figure] for draw in draws]
        worst = max if figure in ("swaps", "sure", "called") else min
        text += f"{np.mean(values):8.1%}{worst(values):7.1%}"
    return text


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", default=real.DEVELOP, help="names of clips")
    parser.add_argument("--draws", type=int, default=6)
    parser.add_argument("--cost", type=float, default=0.06, help="annotation cost asked for")
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work/real"))
    parser.add_argument("--lift", action="store_true", help="lift too, and judge what is told")
    parser.add_argument("--sheets", action="store_true", help="write contact sheets")
    parser.add_argument("--mirrored", action="store_true", help="show every clip in a mirror")
    words = parser.parse_args()
    every: list[list[Draw]] = []
    with patch.object(stages, "KEPT_RESULTS", words.draws + stages.KEPT_RESULTS):
        for name in words.only:
            clip = real.load_clip(name, words.mirrored)
            prepared = prepare_clip(clip, words.cost, words.work)
            draws = [draw_once(prepared, seed, words.lift) for seed in range(words.draws)]
            if not every:
                print(f"{'clip':<34}" + "".join(f"{f:>8}{'worst':>7}" for f in draws[0].figures))
            print(describe(prepared.clip.name, draws), flush=True)
            every.append(draws)
            if words.sheets:
                worst = min(draws, key=lambda draw: draw.figures["pck"])
                file = words.work / f"{prepared.clip.name}-draws.jpg"
                real.write_sheet(prepared.clip, worst.marks, worst.joints, file)
    print(describe("all draws", [draw for draws in every for draw in draws]))


if __name__ == "__main__":
    main()
