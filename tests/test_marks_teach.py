"""Every mark teaches: joints are carried the better the more bodies are marked, in any order."""

from dataclasses import replace

import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.io.video import open_video
from keyrecon.library import carry_joints
from keyrecon.metrics import read_truth
from keyrecon.pipeline import Options, prepare
from keyrecon.records import Annotations
from keyrecon.synthetic.cameras import CameraPlanOptions, View
from keyrecon.synthetic.clips import JoinOptions
from keyrecon.synthetic.sequence import SceneOptions, SynthOptions, synthesize

FRAMES, FPS = 75, 25.0
COUNTS = {"by time": (2, 8), "at random": (2, 4, 8)}
OPTIONS = replace(Options(), keyframes=replace(Options().keyframes, budget=0.1))


@pytest.fixture(scope="module")
def rally(tmp_path_factory):
    """A small rendered clip and its truth."""
    folder = tmp_path_factory.mktemp("rally")
    camera = CameraPlanOptions(View.OBLIQUE, width=480, height=270, player_px=140.0)
    scene = SceneOptions(seed=5, camera=camera, workers=1)
    synthesize(folder, (), SynthOptions(scene, JoinOptions(seconds=FRAMES / FPS, fps=FPS)))
    return open_video(folder / "video.mp4"), read_truth(folder / "truth.npz")


@pytest.fixture(scope="module")
def score(rally):
    """PCK@0.2 on some frames with others marked as a careful person would."""
    known = {}  # all marks are the same marks in any order

    def once(frames, left_out):
        key = tuple(np.sort(frames).tolist())
        if key not in known:
            known[key] = carried_pck(*rally, np.array(key), left_out)
        return known[key]

    return once


def carried_pck(video, truth, frames, left_out):
    """Share of the joints of some frames that are right when others are marked."""
    points = truth["points2d"]
    noise = np.random.default_rng(0).normal(0, 1.0, points.shape)
    joints = (points + noise)[frames]
    seen = np.ones(joints.shape[:2], dtype=bool)
    signs = np.zeros((len(frames), len(LSP14.bones)), dtype=np.int64)
    marks = Annotations(LSP14, frames, joints, seen, signs)
    preparation = prepare(video, (), OPTIONS, marks=marks)
    found = carry_joints(preparation, marks, OPTIONS).joints
    torso = points[:, LSP14.index("right_hip")] - points[:, LSP14.index("left_shoulder")]
    limit = 0.2 * np.linalg.norm(torso, axis=1)[:, None]
    return (np.linalg.norm(found - points, axis=2) < limit)[left_out].mean()


@pytest.mark.parametrize("order", COUNTS)
def test_more_marked_bodies_carry_joints_better_in_any_order(rally, score, order):
    count = len(rally[1]["points2d"])
    candidates = np.arange(4, count, 9)[: max(COUNTS[order])]
    if order == "at random":
        candidates = np.random.default_rng(3).permutation(candidates)
    left_out = np.setdiff1d(np.arange(count), candidates)
    scores = [score(candidates[:n], left_out) for n in COUNTS[order]]
    assert (np.diff(scores) > -0.01).all(), scores
    assert scores[-1] >= 0.97
    assert scores[-1] > scores[0] or scores[0] > 0.99
