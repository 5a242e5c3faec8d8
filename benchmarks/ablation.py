"""Where the error in space comes from: the lift with one thing after another made perfect.

    python benchmarks/ablation.py [--work DIR] [--mocap DIR] [--only NAME ...] [--second]

Rendered sequences as in accuracy.py, with `--second` those of other players; the mean over them is
printed last. Perfect means taken from the truth: `2D` every joint in every frame, of arms alone, or
of elbows and wrists alone where they are hidden; `signs` which end of a bone is nearer in every
frame; `lengths` of bones and breadths; `scale` of every frame; `all of these` leaves the solver
alone. Where it lies in the result as it is, tell the rows `bones`: the result with bones replaced
by the true ones in one respect (true signs of depth, true size of depth, true depth, true place in
the picture). Then what a person may leave out or get wrong: depth signs, half of the keyframes, 3 %
of the carried joints thrown anywhere on the player. `signs` in the table: share of limb bones whose
depth sign is right at the keyframes.
"""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
from accuracy import HEIGHT_ERROR, Case, mark, prepare_case
from sequences import DATA, SECOND, TENNIS, render
from unseen import unseen_model

from keyrecon.annotation_budget import LONG_SHARE
from keyrecon.app.console import show
from keyrecon.body_models.depth_model import DepthModel
from keyrecon.keyframes.selection import KeyframeOptions
from keyrecon.lifting import lifting, motion_fitting
from keyrecon.lifting.depth_evidence import DepthSigns
from keyrecon.lifting.lifting import LiftOptions, LiftPriors, LiftResult, lift_motion
from keyrecon.lifting.limb_lengths import BodySize
from keyrecon.metrics import acceleration_error, n_mpjpe, pa_mpjpe
from keyrecon.numerics.bone_directions import bone_vectors
from keyrecon.pipeline import Options
from keyrecon.propagation.propagation import PropagateOptions, propagate_joints
from keyrecon.records import Annotations, JointTracks, Keyframes
from keyrecon.tracking.mark_flow import track_marked_joints

OUTLIERS = 0.03
"""Share of carried joints that are replaced."""
LIMBS = ("knee", "ankle", "elbow", "wrist")


@dataclass(frozen=True, eq=False)
class Trial:
    """What the lift is given, and the truth to hold it against."""

    tracks: JointTracks
    marks: Annotations
    keyframes: Keyframes
    height_px: np.ndarray
    fps: float
    truth: dict[str, np.ndarray]
    height: float
    """Stature as typed, metres."""
    model: DepthModel
    """Learnt without these players."""


def carry(case: Case, model: DepthModel) -> Trial:
    """Joints of a sequence carried from its keyframes, as the pipeline does."""
    prepared, truth = case.preparation, case.truth
    marks = mark(case)
    flow = case.store.keep(
        "flow",
        track_marked_joints,
        prepared.video,
        marks,
        options=Options().flow,
        progress=show,
    )
    tracks = case.store.keep(
        "propagate",
        propagate_joints,
        prepared,
        marks,
        flow,
        options=PropagateOptions(),
        progress=show,
    )
    error = np.random.default_rng(case.sequence.seed).uniform(-HEIGHT_ERROR, HEIGHT_ERROR)
    height = float(truth["height_m"]) * (1 + error)
    seen, fps = prepared.track.height, prepared.video.fps
    return Trial(tracks, marks, prepared.keyframes, seen, fps, truth, height, model)


def lift_trial(trial: Trial) -> LiftResult:
    """The lift as it is."""
    given = trial.tracks, trial.marks, trial.keyframes, trial.height_px, trial.fps
    return lift_motion(
        *given,
        priors=LiftPriors(depth_model=trial.model),
        options=LiftOptions(height=trial.height),
    )


def true_signs(trial: Trial) -> np.ndarray:
    """1 where the child end of a bone is farther from the camera, else -1."""
    depth = bone_vectors(trial.truth["points3d"], trial.marks.skeleton)[..., 2]
    return np.where(depth > 0, 1, -1)


def true_size(trial: Trial) -> BodySize:
    """Lengths, breadths and scale of the truth."""
    points, skeleton = trial.truth["points3d"] / trial.height, trial.marks.skeleton
    lengths = np.median(np.linalg.norm(bone_vectors(points, skeleton), axis=-1), axis=0)
    across = [points[:, pair.left] - points[:, pair.right] for pair in skeleton.breadths]
    broad = np.median(np.linalg.norm(across, axis=-1), axis=1)
    return BodySize(skeleton, lengths, broad, trial.truth["focal"] / points[..., 2].mean(axis=1))


@contextmanager
def perfect_size(trial: Trial, lengths: bool = True, scale: bool = True) -> Iterator[None]:
    """Proportions of the body or the scale of every frame, or both, from the truth.

    Only the product of lengths and scale shows in the picture: where one is found, the other is
    brought to the same size of the whole body.
    """
    estimate, true = lifting.estimate_lengths, true_size(trial)

    def know(*given: object) -> BodySize:
        found = estimate(*given)
        bones, seen = true if lengths else found, true if scale else found
        factor = seen.lengths.sum() / bones.lengths.sum()
        return BodySize(bones.skeleton, bones.lengths, bones.breadths, seen.scale * factor)

    keep = patch.object(lifting, "correct_lengths", lambda size, *_: size)
    with patch.object(lifting, "estimate_lengths", know), keep:
        yield


@contextmanager
def perfect_signs(trial: Trial) -> Iterator[None]:
    """Depth signs of every frame from the truth."""
    signs = true_signs(trial)
    known = DepthSigns(signs, np.ones(signs.shape))
    with patch.object(motion_fitting, "track_depth_signs", lambda *given: known):
        yield


def with_true_joints(trial: Trial) -> Trial:
    """Every joint of every frame at its place in the picture."""
    joints = trial.truth["points2d"]
    return replace(trial, tracks=replace(trial.tracks, joints=joints.copy()))


def with_true_arms(trial: Trial, hidden: bool) -> Trial:
    """Elbows and wrists at their places, in all frames or where they are hidden."""
    names = [name.split("_")[-1] for name in trial.marks.skeleton.names]
    known = np.broadcast_to(np.isin(names, ("elbow", "wrist")), trial.tracks.confidence.shape)
    known = known & ~trial.truth["visible"] if hidden else known
    joints = np.where(known[..., None], trial.truth["points2d"], trial.tracks.joints)
    return replace(trial, tracks=replace(trial.tracks, joints=joints))


def with_outliers(trial: Trial) -> Trial:
    """Some carried joints thrown anywhere within the player's height of their place."""
    rng = np.random.default_rng(0)
    joints = trial.tracks.joints.copy()
    thrown = rng.random(joints.shape[:2]) < OUTLIERS
    thrown[trial.marks.frames] = False
    reach = np.median(trial.height_px) / 2
    joints[thrown] += rng.uniform(-reach, reach, (int(thrown.sum()), 2))
    return replace(trial, tracks=replace(trial.tracks, joints=joints))


def _under(trial: Trial, *perfect: object) -> LiftResult:
    if not perfect:
        return lift_trial(trial)
    with perfect[0]:
        return _under(trial, *perfect[1:])


CONDITIONS: dict[str, Callable[[Trial], LiftResult]] = {
    "perfect 2D": lambda t: lift_trial(with_true_joints(t)),
    "perfect 2D of hidden arms": lambda t: lift_trial(with_true_arms(t, hidden=True)),
    "perfect 2D of arms": lambda t: lift_trial(with_true_arms(t, hidden=False)),
    "perfect signs": lambda t: _under(t, perfect_signs(t)),
    "perfect lengths": lambda t: _under(t, perfect_size(t, scale=False)),
    "perfect scale": lambda t: _under(t, perfect_size(t, lengths=False)),
    "perfect lengths and scale": lambda t: _under(t, perfect_size(t)),
    "all of these": lambda t: _under(with_true_joints(t), perfect_size(t), perfect_signs(t)),
    "3 % outliers": lambda t: lift_trial(with_outliers(t)),
}


def judge(trial: Trial, found: LiftResult) -> list[float]:
    """PA-MPJPE, N-MPJPE, acceleration error (mm) and the share of limb signs right."""
    skeleton, frames = trial.marks.skeleton, trial.marks.frames
    root = [skeleton.index("right_hip"), skeleton.index("left_hip")]
    points, truth = 1000 * found.points3d, 1000 * trial.truth["points3d"]
    right = -found.signs == true_signs(trial)[frames]
    marked = np.isfinite(trial.marks.joints[:, skeleton.bones, 0]).all(axis=2)
    limb = [skeleton.names[child].split("_")[-1] in LIMBS for _, child in skeleton.bones]
    scores = pa_mpjpe(points, truth), n_mpjpe(points, truth, root)
    return [*scores, acceleration_error(points, truth, root), right[marked & limb].mean()]


def replace_bones(trial: Trial, found: LiftResult) -> Iterator[tuple[str, LiftResult]]:
    """The result with one respect of all bones from the truth."""
    skeleton = trial.marks.skeleton
    ours, true = (bone_vectors(p, skeleton) for p in (found.points3d, trial.truth["points3d"]))
    depth, known = ours[..., 2], true[..., 2]
    for name, flat, deep in (
        ("true signs", ours, np.copysign(depth, known)),
        ("true size of depth", ours, np.copysign(known, depth)),
        ("true depth", ours, known),
        ("true picture", true, depth),
    ):
        vectors = np.concatenate([flat[..., :2], deep[..., None]], axis=-1)
        points = np.einsum("jb,tbi->tji", skeleton.ancestry, vectors)
        yield f"bones: {name}", replace(found, points3d=points)


def measure(folder: Path, case: Case, model: DepthModel) -> dict[str, list[float]]:
    """Scores of one sequence under every condition."""
    trial = carry(case, model)
    found = lift_trial(trial)
    rows = {"as it is": judge(trial, found)}
    rows |= {name: judge(trial, result) for name, result in replace_bones(trial, found)}
    rows |= {name: judge(trial, run(trial)) for name, run in CONDITIONS.items()}
    blind = replace(trial, marks=replace(trial.marks, nearer=0 * trial.marks.nearer))
    rows["no signs from the person"] = judge(blind, lift_trial(blind))
    half = replace(Options(), keyframes=KeyframeOptions(budget=LONG_SHARE / 2))
    fewer = carry(prepare_case(case.sequence, folder, half), model)
    rows["half the keyframes"] = judge(fewer, lift_trial(fewer))
    return rows


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work"))
    parser.add_argument("--mocap", type=Path, default=DATA / "mocap")
    parser.add_argument("--only", nargs="*", help="names of sequences")
    parser.add_argument("--second", action="store_true", help="other players, the second table")
    words = parser.parse_args()
    print(f"{'sequence':<22}{'condition':<28}{'PA':>7}{'N':>7}{'accel':>7}{'signs':>8}")
    every: dict[str, list[list[float]]] = {}
    for sequence in SECOND if words.second else TENNIS:
        if not words.only or sequence.name in words.only:
            folder = render(sequence, words.work, words.mocap)
            _, model = unseen_model(sequence, words.work, words.mocap)
            case = prepare_case(sequence, folder, Options())
            for name, row in measure(folder, case, model).items():
                every.setdefault(name, []).append(row)
                print_row(sequence.name, name, row)
    for name, rows in every.items():
        print_row("mean", name, np.mean(rows, axis=0))


def print_row(sequence: str, condition: str, row: list[float] | np.ndarray) -> None:
    """One line of the table."""
    pa, n, acceleration, right = row
    print(
        f"{sequence:<22}{condition:<28}{pa:7.1f}{n:7.1f}{acceleration:7.1f}{right:8.1%}", flush=True
    )


if __name__ == "__main__":
    main()
