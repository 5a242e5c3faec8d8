"""A small panned sequence of another player than in the end-to-end test, held to honest bounds."""

from dataclasses import replace

import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.io.formats.picks import read_picks
from keyrecon.io.video import open_video
from keyrecon.keyframes.selection import KeyframeOptions
from keyrecon.lifting.lifting import LiftOptions, lift_motion
from keyrecon.metrics import acceleration_error, n_mpjpe, pa_mpjpe, pck, read_truth
from keyrecon.pipeline import Options, prepare
from keyrecon.propagation.propagation import propagate_joints
from keyrecon.synthetic.cameras import CameraPlanOptions, View
from keyrecon.synthetic.clips import JoinOptions
from keyrecon.synthetic.marks import MarkOptions, mark_from_truth
from keyrecon.synthetic.sequence import SceneOptions, SynthOptions, synthesize

FRAMES, FPS = 100, 30.0
HIPS = (LSP14.index("right_hip"), LSP14.index("left_hip"))


@pytest.fixture(scope="module")
def carried(tmp_path_factory):
    """A left-handed player filmed from behind by a panning camera, with joints carried over."""
    folder = tmp_path_factory.mktemp("sequence")
    camera = CameraPlanOptions(View.BACK, pan=True, width=480, height=270, player_px=140.0)
    scene = SceneOptions(seed=9, camera=camera, left_handed=True, workers=1)
    synthesize(folder, (), SynthOptions(scene, JoinOptions(seconds=FRAMES / FPS, fps=FPS)))
    truth = read_truth(folder / "truth.npz")
    options = replace(Options(), keyframes=KeyframeOptions(budget=0.06))
    prepared = prepare(open_video(folder / "video.mp4"), read_picks(folder / "picks.json"), options)
    known = truth["points2d"], truth["points3d"], truth["visible"]
    marks = mark_from_truth(prepared.keyframes, *known, MarkOptions(1.0))
    return prepared, marks, propagate_joints(prepared, marks), truth


def lift(carried, marks):
    """PA-MPJPE, N-MPJPE and acceleration error, mm."""
    prepared, _, tracks, truth = carried
    options = LiftOptions(height=float(truth["height_m"]))
    height = prepared.track.height
    found = lift_motion(tracks, marks, prepared.keyframes, height, FPS, options=options)
    points, known = 1000 * found.points3d, 1000 * truth["points3d"]
    scores = pa_mpjpe(points, known), n_mpjpe(points, known, HIPS)
    return *scores, acceleration_error(points, known, HIPS)


def test_carried_joints_lie_on_the_player(carried):
    *_, tracks, truth = carried
    torso = HIPS[0], LSP14.index("left_shoulder")
    assert pck(tracks.joints, truth["points2d"], torso) >= 0.95


def test_the_motion_with_depth_signs_is_near_the_truth(carried):
    prepared, marks, _, truth = carried
    known = truth["points2d"], truth["points3d"], truth["visible"]
    scores = [lift(carried, marks)]
    for seed in (1, 2):  # six marked bodies: other clicks on them move a score by a tenth
        others = mark_from_truth(prepared.keyframes, *known, MarkOptions(1.0, seed=seed))
        again = prepared, others, propagate_joints(prepared, others), truth
        scores.append(lift(again, others))
    pa, n, acceleration = np.mean(scores, axis=0)
    assert pa <= 65
    assert n <= 80
    assert acceleration <= 8


def test_the_motion_without_depth_signs_does_not_collapse(carried):
    marks = carried[1]
    pa, *_ = lift(carried, replace(marks, nearer=np.zeros_like(marks.nearer)))
    assert pa <= 85
