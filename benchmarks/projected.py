"""The lift alone: joints of captured people projected, with errors like those of propagated ones.

    python benchmarks/projected.py [--work DIR] [--mocap DIR] [--only NAME ...] [--other] [--fps 25]
        [--lens 1]

Takes minutes where accuracy.py takes an hour, as nothing is drawn and nothing is looked for: the
first 12 s of the sequences of `sequences.py`, seen by their cameras. Joints are off by .9 % of the
player's height, which wanders within a quarter of a second, and by .3 % of noise, elbows and wrists
by 1.4 times as much; scale by 1 %. 3 % of the frames are marked, at even distances, with the click
noise of accuracy.py; with `--fps` as many a second, at another frame rate than 50. With `--lens`
the lift is told so many times the true focal length, and takes perspective out. The depth model
has not learnt from the players of the table; `--other` takes motion that is no tennis, and models
without it. Prints PA-MPJPE and N-MPJPE, mm, and what a coach would read (`posture.py`), with depth
signs from the person and without.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import posture
from accuracy import CLICK_NOISE, HEIGHT_ERROR
from sequences import DATA, OTHER, TENNIS, Sequence, mocap_files, options_of
from unseen import unseen_model

from keyrecon.body import LSP14
from keyrecon.body_models.depth_model import DepthModel
from keyrecon.lifting.lifting import LiftOptions, LiftPriors, lift_motion
from keyrecon.metrics import n_mpjpe, pa_mpjpe
from keyrecon.records import Annotations, HalfKeyframes, JointTracks, Keyframes
from keyrecon.synthetic.clips import JOINTS, join_with_toes
from keyrecon.synthetic.marks import MarkOptions, mark_from_truth
from keyrecon.synthetic.sequence import read_mocap, set_stage

SECONDS, MARKED, RATE = 12.0, 0.03, 50.0
WANDERING, NOISE, WANDER_SECONDS, FREE_ARMS = 0.009, 0.003, 0.25, 1.4
SCALE_ERROR = 0.01
HIPS = [LSP14.index("right_hip"), LSP14.index("left_hip")]


class Truth(NamedTuple):
    """Joints as a camera sees them."""

    points3d: np.ndarray
    """(T, 14, 3), camera axes, metres; `points2d` (T, 14, 2), px."""
    points2d: np.ndarray
    height: float
    """Stature, metres."""
    height_px: np.ndarray
    """Standing height in every frame."""
    focal: np.ndarray
    """(T,), px."""


def film(sequence: Sequence, mocap: Path) -> Truth:
    """The first seconds of a sequence, not drawn."""
    options = options_of(sequence)
    captures = read_mocap(mocap_files(sequence, mocap), options.trim)
    joined = join_with_toes(captures, options.clips)[:, :JOINTS]
    stage = set_stage(joined, sequence.fps, options.scene)
    points = stage.points[: round(SECONDS * sequence.fps)]
    whole = stage.move.to_camera(stage.points)[: len(points)]
    tall = stage.move.focal[: len(points)] if np.ndim(stage.move.focal) else stage.move.focal
    height_px = tall / whole[..., 2].mean(axis=1) * stage.pointers.stature
    flat = stage.move.project(stage.points)[: len(points)]
    focal = np.broadcast_to(tall, len(points))
    return Truth(whole, flat, float(stage.pointers.stature), height_px, focal)


def lift(
    sequence: Sequence, truth: Truth, model: DepthModel, signs: bool, lens: float | None
) -> np.ndarray:
    """Joints in space from joints in the picture that are off; `lens` as `--lens`."""
    frames, fps = len(truth.points2d), sequence.fps
    rng = np.random.default_rng(sequence.seed)
    tall = float(np.median(truth.height_px))
    count = max(round(MARKED * RATE / fps * frames), 4)
    marked = ((np.arange(count) + 0.5) / count * frames).astype(int)
    nearest = marked[np.abs(np.arange(frames)[:, None] - marked).argmin(axis=1)]
    even = HalfKeyframes(marked, nearest, np.ones(frames, bool), 1.0, 0.02, np.zeros(frames), count)
    keyframes = Keyframes(even, even, round(fps / 2), 0.95)
    options = MarkOptions(CLICK_NOISE * tall, signs, sequence.seed)
    marks: Annotations = mark_from_truth(keyframes, truth.points2d, truth.points3d, options=options)
    joints = truth.points2d + tall * errors(frames, fps, rng)
    tracks = JointTracks(joints, np.full(joints.shape[:2], 0.8))
    seen = truth.height_px * (1 + SCALE_ERROR * rng.standard_normal())
    typed = truth.height * (1 + rng.uniform(-HEIGHT_ERROR, HEIGHT_ERROR))
    given = tracks, marks, keyframes, seen, fps
    priors = LiftPriors(depth_model=model, focal=None if lens is None else lens * truth.focal)
    result = lift_motion(*given, priors, LiftOptions(height=typed))
    return result.points3d


def errors(frames: int, fps: float, rng: np.random.Generator) -> np.ndarray:
    """(T, 14, 2): what joints are off by, player heights."""
    keep = np.exp(-1 / (WANDER_SECONDS * fps))
    wander = rng.standard_normal((frames, len(LSP14.names), 2))
    for t in range(1, frames):
        wander[t] = keep * wander[t - 1] + np.sqrt(1 - keep**2) * wander[t]
    arms = [FREE_ARMS if name.endswith(("elbow", "wrist")) else 1.0 for name in LSP14.names]
    noise = rng.standard_normal(wander.shape)
    return np.array(arms)[:, None] * (WANDERING * wander + NOISE * noise)


def measure(listed: Sequence, words: argparse.Namespace) -> list[list[float]]:
    """Print and give the scores of one sequence, with signs and without."""
    (_, model) = unseen_model(listed, words.work, words.mocap)
    sequence, mocap = replace(listed, fps=words.fps or listed.fps), words.mocap
    truth = film(sequence, mocap)
    known = {"points3d": truth.points3d, "joint_names": np.array(LSP14.names)}
    rows = []
    for signs in (True, False):
        points = lift(sequence, truth, model, signs, words.lens)
        motion = SimpleNamespace(points3d=points, skeleton=LSP14, fps=sequence.fps)
        scores = posture.judge_posture(motion, known)  # type: ignore[arg-type]
        off = 1000 * pa_mpjpe(points, truth.points3d), 1000 * n_mpjpe(points, truth.points3d, HIPS)
        form = "signs" if signs else "none"
        print(f"{sequence.name:<22}{form:<7}{off[0]:7.1f}{off[1]:7.1f}{posture.row(scores)}")
        rows.append(list(off))
    return rows


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work"))
    parser.add_argument("--mocap", type=Path, default=DATA / "mocap")
    parser.add_argument("--only", nargs="*", help="names of sequences")
    parser.add_argument("--other", action="store_true", help="motion that is no tennis")
    parser.add_argument("--fps", type=float, help="frames per second in place of a sequence's own")
    parser.add_argument("--lens", type=float, help="tell so many times the true focal length")
    words = parser.parse_args()
    words.work.mkdir(parents=True, exist_ok=True)
    print(f"{'sequence':<22}{'told':<7}{'PA':>7}{'N':>7}{posture.COLUMNS}")
    table = [
        s for s in (OTHER if words.other else TENNIS) if not words.only or s.name in words.only
    ]
    rows = np.array([measure(listed, words) for listed in table])
    for form, mean in zip(("signs", "none"), rows.mean(axis=0), strict=True):
        print(f"{'mean':<22}{form:<7}{mean[0]:7.1f}{mean[1]:7.1f}")


if __name__ == "__main__":
    main()
