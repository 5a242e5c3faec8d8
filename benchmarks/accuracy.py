"""Accuracy on rendered tennis with known truth, sequence by sequence: paper's form beside ours.

    python benchmarks/accuracy.py [--work DIR] [--mocap DIR] [--only NAME ...] [--other]

Renders what is missing in the work folder, annotates the chosen keyframes from the truth with
click noise, reconstructs and prints a table. Nothing is asserted.
"""

import argparse
import resource
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from sequences import DATA, OTHER, TENNIS, Sequence, mocap_files

from keyrecon.console import show
from keyrecon.formats.picks import read_picks
from keyrecon.metrics import evaluate_motion, median_distance, pck, read_truth
from keyrecon.pipeline import Options, Preparation, as_printed, prepare, reconstruct, with_height
from keyrecon.records import JointTracks, Motion
from keyrecon.stages import StageStore
from keyrecon.synthetic.cameras import CameraOptions
from keyrecon.synthetic.clips import JoinOptions
from keyrecon.synthetic.marks import MarkOptions, mark_from_truth
from keyrecon.synthetic.sequence import SceneOptions, SynthOptions, synthesize
from keyrecon.video import open_video

CLICK_NOISE = 3.0 / 400
"""Standard deviation of a click, player heights."""
HEIGHT_ERROR = 0.03
"""The height that a user types is off by up to this share."""


@dataclass(frozen=True, eq=False)
class Case:
    """A sequence that has been rendered and prepared."""

    sequence: Sequence
    preparation: Preparation
    truth: dict[str, np.ndarray]
    store: StageStore


def render(sequence: Sequence, work: Path, mocap: Path) -> Path:
    """The folder of the rendered sequence; rendered if it is not there."""
    folder = work / sequence.name
    if not (folder / "truth.npz").is_file():
        camera = CameraOptions(
            sequence.camera, sequence.pan, sequence.width, sequence.height, sequence.player
        )
        options = SynthOptions(
            SceneOptions(sequence.seed, camera), JoinOptions(seconds=sequence.seconds)
        )
        synthesize(folder, mocap_files(sequence, mocap), options, show)
    return folder


def prepare_case(sequence: Sequence, folder: Path, options: Options) -> Case:
    """The automatic part."""
    store = StageStore(folder / "cache")
    video = open_video(folder / "video.mp4")
    picks = read_picks(folder / "picks.json")
    preparation = prepare(video, picks, options, store.keep, show)
    return Case(sequence, preparation, read_truth(folder / "truth.npz"), store)


def solve(case: Case, options: Options, signs: bool = True) -> Motion:
    """The part after the person, with marks from the truth."""
    truth = case.truth
    seed = case.sequence.seed
    noise = CLICK_NOISE * float(np.median(case.preparation.track.height))
    marks = mark_from_truth(
        case.preparation.keyframes,
        truth["points2d"],
        truth["points3d"],
        truth.get("visible"),
        MarkOptions(noise, signs, seed),
    )
    error = np.random.default_rng(seed).uniform(-HEIGHT_ERROR, HEIGHT_ERROR)
    options = with_height(options, float(truth["height_m"]) * (1 + error))
    return reconstruct(case.preparation, marks, options, case.store.keep, show)


def judge_track(case: Case) -> float:
    """Share of frames with head and feet within a tenth of the height of the truth."""
    names = [str(n) for n in case.truth["joint_names"]]
    joint = {name: case.truth["points2d"][:, names.index(name)] for name in names}
    track = case.preparation.track
    head = (joint["neck"] + joint["head_top"]) / 2
    feet = np.stack([joint["left_ankle"], joint["right_ankle"]], axis=1)
    limit = 0.1 * track.height
    head_off = np.linalg.norm(track.head - head, axis=1)
    off = [
        np.linalg.norm(track.feet - feet[:, order], axis=2).max(axis=1) for order in ([0, 1], [1, 0])
    ]
    return float(((head_off < limit) & (np.minimum(*off) < limit)).mean())


def judge_tracks(joints: np.ndarray, truth: dict[str, np.ndarray]) -> dict[str, float]:
    """2D accuracy before refinement: PCK@0.2 of all joints and of the wrists, median error."""
    names = [str(n) for n in truth["joint_names"]]
    torso = (names.index("right_hip"), names.index("left_shoulder"))
    known = truth["points2d"]
    size = np.linalg.norm(known[:, torso[0]] - known[:, torso[1]], axis=1)
    off = np.linalg.norm(joints - known, axis=2)
    hit = off < 0.2 * size[:, None]  # a missing joint is no hit
    wrists = [names.index("right_wrist"), names.index("left_wrist")]
    return {
        "pck": float(hit.mean()),
        "wrists": float(hit[:, wrists[0]].mean()),
        "median": float(np.nanmedian(off)),
        "missing": float(np.isnan(off).mean()),
    }
