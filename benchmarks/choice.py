"""Weights of the evidence that chooses among hypotheses (`keyrecon/propagation/evidence.py`).

    python benchmarks/choice.py [--work DIR] [--only NAME ...] [--rendered DIR]
        [--sequences NAME ...] [--draws 3]

Takes the real clips of `develop` as benchmarks/draws.py does, as they are and mirrored, with some
choices of marks each (with the same `--work` what real.py stored is found again), and the first
12 s of rendered sequences (`--rendered`, as benchmarks/accuracy.py left them), looks at frames of
known joints that nobody marked for the program, and fits the weights by which the right
pairs of limbs are most probable (a conditional logit). Prints

    frames     of every clip, frame by frame: the share of the arms' and legs' joints in sight that
               are within 0.2 of the torso in the best pair of states that there is, in the pair
               that weights from all other clips choose, and in the one that the present weights do
    PCK@0.2    of all joints, and within strokes and swings, after the choice through time and
               smoothing, with the weights that were fitted to the other clips
    table      fitted to all clips, to be put into evidence.py
"""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import real
from accuracy import Case, mark
from draws import mark_draw, prepare_clip
from scipy.optimize import minimize
from sequences import TENNIS
from variant import cut

from keyrecon.annotation_budget import LONG_SHARE
from keyrecon.app.console import show
from keyrecon.body import LSP14
from keyrecon.io.formats.model_file import read_side_model
from keyrecon.io.formats.picks import read_picks
from keyrecon.io.stages import StageStore
from keyrecon.io.video import open_video
from keyrecon.metrics import read_truth
from keyrecon.pipeline import Options, prepare
from keyrecon.propagation import evidence, selection
from keyrecon.propagation.appearance import regular_frames
from keyrecon.propagation.body_frame import stabilise_shots
from keyrecon.propagation.edge_template import EdgeTemplates
from keyrecon.propagation.hypotheses import MarkPredictions, PoseHypotheses
from keyrecon.propagation.propagation import propagate_joints
from keyrecon.propagation.silhouette import Silhouettes
from keyrecon.records import Annotations, FlowTracks, Preparation
from keyrecon.shots.following import follow_marks
from keyrecon.tracking.mark_flow import track_marked_joints

SEQUENCES = (
    "all-oblique-small",
    "ground-back-static",
    "mixed-side-pan",
    "serve-side-static",
    "serve-back-pan",
)
COST = 0.06
"""Budget of a real clip."""
LENGTH = 600
"""Frames of a rendered sequence."""
EVERY = 6
"""Of these, one in so many is looked at."""
RENDERED_WEIGHT = 0.35
"""What a frame of a rendered sequence counts for against one of a real clip: five have as many
frames as nine real clips twice over."""
RIDGE = 3.0
"""Pull of the weights to 0, in frames, per weight squared in units of SPREAD."""
SPREAD = {
    "residual": 3.0,
    "end residual": 3.0,
    "unexplained edges": 20.0,
    "unexplained silhouette": 20.0,
}
"""Usual weights; others have that of a likeness, 2 units."""
USED = {
    "upper": (
        "end residual",
        "unlikeness",
        "end unlikeness",
        "bone unlikeness",
        "color unlikeness",
        "other side",
        "off flow",
        "off lines",
        "unexplained edges",
        "unexplained silhouette",
        "together",
        "of two poses",
    ),
    "lower": (
        "residual",
        "end residual",
        "unlikeness",
        "end unlikeness",
        "bone unlikeness",
        "other side",
        "disagreement",
        "off flow",
        "off lines",
        "unexplained edges",
        "unexplained silhouette",
        "together",
        "of two poses",
    ),
}
"""Evidence that is weighed. With disagreement among the arms' fewer were right in other clips (88.0
% against 88.7)."""
PAIRED = "unexplained edges", "unexplained silhouette", "together", "of two poses"


@dataclass(frozen=True, eq=False)
class Known:
    """A clip with its marks and truth, ready to be propagated."""

    name: str
    preparation: Preparation
    marks: Annotations
    flow: FlowTracks
    truth: Annotations
    judged: np.ndarray
    """(K, J): joints in sight that nobody marked."""
    action: np.ndarray
    torso: float


@dataclass(frozen=True, eq=False)
class Sample:
    """Frames of one clip and half of the body, with all their states."""

    of_sides: np.ndarray
    """(n, 2, S, A)"""
    of_pairs: np.ndarray
    """(n, S, S, B)"""
    valid: np.ndarray
    """(n, S)"""
    wrong: np.ndarray
    """(n, S, S): joints of a pair that are in sight and off."""
    count: int
    """Joints that are judged."""
    names: tuple[str, ...]
    weight: float


def held_out(truth: Annotations, marks: Annotations) -> np.ndarray:
    """(K, J): truth that nobody marked for the program."""
    known = np.isfinite(truth.joints[..., 0])
    for row, frame in enumerate(marks.frames):
        known[truth.frames == frame] &= ~np.isfinite(marks.joints[row, :, 0])
    return known


def real_draws(name: str, draws: int, work: Path) -> Iterator[Known]:
    """A clip as benchmarks/draws.py has it marked, as it is and in a mirror."""
    for mirrored in (False, True):
        prepared = prepare_clip(real.load_clip(name, mirrored), COST, work)
        clip, options, keep = prepared.clip, prepared.options, prepared.store.keep
        for seed in range(draws):
            made, marks = mark_draw(prepared, seed)
            flow = follow_marks(clip.video, marks, made.shots, options.flow, keep, show)
            judged = held_out(clip.truth, marks) & clip.seen
            yield Known(name, made, marks, flow, clip.truth, judged, clip.action, clip.torso)


def rendered_clip(name: str, folder: Path, work: Path) -> Known:
    """The beginning of a rendered sequence, marked from its truth."""
    sequence = next(s for s in TENNIS if s.name == name)
    truth = read_truth(folder / name / "truth.npz")
    count = len(truth["points3d"])
    truth = {key: cut(values, LENGTH, count) for key, values in truth.items()}
    video = open_video(folder / name / "video.mp4", end=LENGTH)
    options = Options()
    options = replace(options, keyframes=replace(options.keyframes, budget=2 * LONG_SHARE))
    store = StageStore(work / f"{name}-{LENGTH}" / "cache")
    picks = tuple(p for p in read_picks(folder / name / "picks.json") if p.frame < LENGTH)
    preparation = prepare(video, picks, options, store.keep, show)
    marks = mark(Case(sequence, preparation, truth, store))
    flow = store.keep("flow", track_marked_joints, video, marks, options=options.flow)
    frames, joints = np.arange(0, LENGTH, EVERY), truth["points2d"][::EVERY]
    seen = np.ones(joints.shape[:2], bool)
    nearer = np.zeros((len(frames), len(LSP14.bones)), int)
    known = Annotations(LSP14, frames, joints, seen, nearer)
    trunk = joints[:, LSP14.index("right_hip")] - joints[:, LSP14.index("left_shoulder")]
    torso = float(np.median(np.linalg.norm(trunk, axis=1)))
    action = np.zeros(len(frames), bool)
    return Known(name, preparation, marks, flow, known, held_out(known, marks), action, torso)


def collect(known: Known, weight: float) -> dict[str, Sample]:
    """The evidence of one clip, as the choice comes by it."""
    samples: dict[str, Sample] = {}
    made = known.preparation
    body_frame = stabilise_shots(made.track, made.camera, made.shots, made.video.fps)
    looked_at = np.union1d(regular_frames(made.video), known.marks.frames)
    described = len(looked_at) / len(made.edges)

    def record(
        templates: EdgeTemplates,
        hypotheses: PoseHypotheses,
        trunk: np.ndarray,
        predictions: MarkPredictions | None,
        silhouettes: Silhouettes,
    ) -> evidence.LimbEvidence:
        found = original(templates, hypotheses, trunk, predictions, silhouettes)
        half, pairs = templates.half, list(found.of_pairs)
        free = half.joints[np.concatenate(half.sides)]
        rows = np.flatnonzero(
            known.judged[:, free].any(axis=1) & ~np.isin(known.truth.frames, templates.poses.frames)
        )
        frames = known.truth.frames[rows]
        alone = tuple(name for name in USED[half.name] if name not in PAIRED)
        # described frames count for those around them; here each is by itself
        scale = [described if "unlikeness" in name else 1.0 for name in alone]
        of_sides = np.stack(
            [
                np.stack([found.of_sides[n][name][frames] for name in alone], axis=-1) * scale
                for n in (0, 1)
            ],
            axis=1,
        )
        of_pairs = np.stack([values[frames] for name, values in pairs], axis=-1)
        wrong = []
        for side, members in zip(found.sides, half.sides, strict=True):
            own = half.joints[list(members)]
            places = body_frame.to_pixels(side.joints[frames], frames[:, None, None])
            off = np.linalg.norm(places - known.truth.joints[rows][:, None, own], axis=-1)
            judged = known.judged[rows][:, None, own]
            wrong.append((judged & ~(off < 0.2 * known.torso)).sum(axis=2))
        valid = np.tile(np.isfinite(hypotheses.prior_cost[frames]), (1, 2))
        samples[half.name] = Sample(
            of_sides,
            of_pairs,
            valid,
            wrong[0][:, :, None] + wrong[1][:, None],
            int(known.judged[rows][:, free].sum()),
            (*alone, *(name for name, _ in pairs)),
            weight,
        )
        return replace(found, of_pairs=iter(pairs))

    original = evidence.find_evidence
    with patch.object(selection, "find_evidence", record):
        propagate_joints(known.preparation, known.marks, known.flow, read_side_model())
    return samples


def weigh(name: str, draws: int) -> float:
    """What a frame counts for: every clip as much, however often it is drawn."""
    return RENDERED_WEIGHT if name in SEQUENCES else 1 / draws


def costs(sample: Sample, weights: np.ndarray) -> np.ndarray:
    """(n, S * S)"""
    split = sample.of_sides.shape[-1]
    alone = sample.of_sides @ weights[:split]
    alone = np.where(sample.valid[:, None], alone, 1e4)
    pairs = alone[:, 0][:, :, None] + alone[:, 1][:, None] + sample.of_pairs @ weights[split:]
    return pairs.reshape(len(pairs), -1)


def misfit(weights: np.ndarray, samples: list[Sample]) -> tuple[float, np.ndarray]:
    """Minus the logarithm of the probability of the best pairs, and its gradient."""
    total, gradient = 0.0, np.zeros(len(weights))
    for sample in samples:
        cost = costs(sample, weights)
        wrong = sample.wrong.reshape(len(cost), -1)
        best = wrong == wrong.min(axis=1, keepdims=True)
        told = ~best.all(axis=1)
        chance = np.exp(cost.min(axis=1, keepdims=True) - cost)
        chance /= chance.sum(axis=1, keepdims=True)
        right = np.where(best, chance, 0) + 1e-12 * best
        share = right.sum(axis=1, keepdims=True)
        total -= sample.weight * float(np.log(share[told]).sum())
        slope = sample.weight * (right / share - chance) * told[:, None]
        slope = slope.reshape(sample.wrong.shape)
        gradient += np.concatenate(
            [
                np.einsum("ns,nsf->f", slope.sum(axis=2), sample.of_sides[:, 0])
                + np.einsum("ns,nsf->f", slope.sum(axis=1), sample.of_sides[:, 1]),
                np.einsum("nab,nabf->f", slope, sample.of_pairs),
            ]
        )
    return total, gradient


def fit(samples: list[Sample]) -> np.ndarray:
    """Weights, none negative."""
    spread = np.array([SPREAD.get(n, 2.0 if "unlike" in n else 1.0) for n in samples[0].names])

    def objective(weights: np.ndarray) -> tuple[float, np.ndarray]:
        total, gradient = misfit(weights, samples)
        pull = RIDGE * weights / spread**2
        return total + float(pull @ weights), gradient + 2 * pull

    return minimize(
        objective,
        np.zeros(len(spread)),
        jac=True,
        method="L-BFGS-B",
        bounds=[(0, None)] * len(spread),
        options={"maxiter": 60},
    ).x


def share_right(sample: Sample, weights: np.ndarray) -> float:
    """Share of the joints that are right in the cheapest pairs."""
    cost = costs(sample, weights)
    wrong = sample.wrong.reshape(len(cost), -1)[np.arange(len(cost)), cost.argmin(axis=1)]
    return 1 - wrong.sum() / max(sample.count, 1)


def table_of(sample: Sample, weights: np.ndarray) -> dict[str, float]:
    """Weights by name."""
    return {name: round(float(w), 2) for name, w in zip(sample.names, weights, strict=True)}


def present(sample: Sample, half: str) -> np.ndarray:
    """The weights of the package."""
    return np.array([evidence.WEIGHTS[half].get(name, 0.0) for name in sample.names])


@contextmanager
def weighed(table: dict[str, dict[str, float]]) -> Iterator[None]:
    """With other weights in the package."""
    with patch.object(evidence, "WEIGHTS", table):
        yield


def pck(known: Known) -> tuple[float, float]:
    """PCK@0.2 of all joints that are judged, and within strokes and swings."""
    tracks = propagate_joints(known.preparation, known.marks, known.flow, read_side_model())
    off = np.linalg.norm(tracks.joints[known.truth.frames] - known.truth.joints, axis=2)
    near, action = off < 0.2 * known.torso, known.judged & known.action[:, None]
    inside = float(near[action].mean()) if action.any() else np.nan
    return float(near[known.judged].mean()), inside


def main() -> None:
    """Print everything."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work/real"))
    parser.add_argument("--only", nargs="*", help="names of real clips")
    parser.add_argument("--rendered", type=Path, default=Path("benchmarks/work"))
    parser.add_argument("--sequences", nargs="*", default=list(SEQUENCES))
    parser.add_argument("--draws", type=int, default=3, help="choices of marks of a real clip")
    words = parser.parse_args()
    names = words.only if words.only is not None else list(real.DEVELOP)
    if len(names) + len(words.sequences) < 2:
        raise SystemExit("A clip is chosen by weights from the others: name at least two.")
    clips = {name: list(real_draws(name, words.draws, words.work)) for name in names}
    for name in words.sequences:
        clips[name] = [rendered_clip(name, words.rendered, words.work)]
    samples = {
        name: [collect(k, weigh(name, len(every))) for k in every] for name, every in clips.items()
    }
    print(
        f"{'clip':<26}{'arms: best':>11}{'others':>8}{'now':>8}{'legs: best':>12}"
        f"{'others':>8}{'now':>8}{'PCK':>8}{'action':>8}"
    )
    for name, every in clips.items():
        line, table = f"{name:<26}", {}
        for half in ("upper", "lower"):
            own = [s[half] for s in samples[name]]
            weights = fit([s[half] for n, drawn in samples.items() if n != name for s in drawn])
            table[half] = table_of(own[0], weights)
            now = present(own[0], half)
            best = [1 - s.wrong.min(axis=(1, 2)).sum() / max(s.count, 1) for s in own]
            line += f"{np.mean(best):11.1%}{np.mean([share_right(s, weights) for s in own]):8.1%}"
            line += f"{np.mean([share_right(s, now) for s in own]):8.1%} "
        with weighed(table):
            whole, action = np.mean([pck(known) for known in every], axis=0)
        print(f"{line}{whole:7.1%}{action:8.1%}", flush=True)
    for half in ("upper", "lower"):
        every = [s[half] for drawn in samples.values() for s in drawn]
        print(half, table_of(every[0], fit(every)))


if __name__ == "__main__":
    main()
