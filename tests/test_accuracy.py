"""Small sequences of other players than in the end-to-end test, held to honest bounds."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.io.formats.picks import read_picks
from keyrecon.io.video import open_video
from keyrecon.keyframes.selection import KeyframeOptions, choose_keyframes
from keyrecon.lifting.lifting import LiftOptions, lift_motion
from keyrecon.metrics import acceleration_error, n_mpjpe, pa_mpjpe, pck, read_truth
from keyrecon.pipeline import Options, prepare
from keyrecon.propagation.propagation import propagate_joints
from keyrecon.records import Annotations, JointTracks, Preparation
from keyrecon.synthetic.cameras import CameraPlanOptions, View
from keyrecon.synthetic.clips import JoinOptions
from keyrecon.synthetic.marks import MarkOptions, mark_from_truth
from keyrecon.synthetic.sequence import SceneOptions, SynthOptions, synthesize

FRAMES, FPS, DRAWS = 100, 30.0, 3
HIPS = (LSP14.index("right_hip"), LSP14.index("left_hip"))
SPREAD = 0.1
"""Of the logarithm of the factors on pose distances in all draws but the first."""


class Draw(NamedTuple):
    """One choice of keyframes of a sequence, with clicks of its own."""

    prepared: Preparation
    marks: Annotations
    tracks: JointTracks
    truth: dict[str, np.ndarray]


def with_others(distances, seed):
    """Pose distances by which other keyframes serve as well."""
    chance = np.random.default_rng(seed)

    def noisy(table):
        noise = np.triu(chance.normal(0, SPREAD * bool(seed), table.shape), 1)
        return (table * np.exp(noise + noise.T)).astype(table.dtype)

    return replace(distances, upper=noisy(distances.upper), lower=noisy(distances.lower))


@pytest.fixture(scope="module")
def draws(tmp_path_factory):
    """A left-handed player filmed from behind by a panning camera, and one from the side, with
    joints carried over.

    Six bodies are marked: other frames, or other clicks on them, move a score by a tenth, and which
    frames are asked for hangs on the last bits of sums. So all bounds are held by means of draws of
    both sequences.
    """
    camera = CameraPlanOptions(View.BACK, pan=True, width=480, height=270, player_px=140.0)
    behind = SceneOptions(seed=9, camera=camera, left_handed=True, workers=1)
    camera = replace(camera, view=View.SIDE, pan=False)
    beside = SceneOptions(seed=21, camera=camera, workers=1)
    return [
        *draw_keyframes(tmp_path_factory.mktemp("behind"), behind),
        *draw_keyframes(tmp_path_factory.mktemp("beside"), beside),
    ]


def draw_keyframes(folder, scene):
    """Keyframes of a rendered sequence, chosen several times."""
    synthesize(folder, (), SynthOptions(scene, JoinOptions(seconds=FRAMES / FPS, fps=FPS)))
    truth = read_truth(folder / "truth.npz")
    options = replace(Options(), keyframes=KeyframeOptions(budget=0.06))
    prepared = prepare(open_video(folder / "video.mp4"), read_picks(folder / "picks.json"), options)
    known = truth["points2d"], truth["points3d"], truth["visible"]
    for seed in range(DRAWS):
        distances = with_others(prepared.pose_distances, seed)
        chosen = choose_keyframes(distances, FPS, options=options.keyframes)
        marks = mark_from_truth(chosen, *known, MarkOptions(1.0, seed=seed))
        asked = replace(prepared, keyframes=chosen)
        yield Draw(asked, marks, propagate_joints(asked, marks), truth)


def lift(draw, signs=True):
    """PA-MPJPE, N-MPJPE and acceleration error, mm."""
    prepared, marks, tracks, truth = draw
    if not signs:
        marks = replace(marks, nearer=np.zeros_like(marks.nearer))
    options = LiftOptions(height=float(truth["height_m"]))
    height = prepared.track.height
    found = lift_motion(tracks, marks, prepared.keyframes, height, FPS, options=options)
    points, known = 1000 * found.points3d, 1000 * truth["points3d"]
    scores = pa_mpjpe(points, known), n_mpjpe(points, known, HIPS)
    return *scores, acceleration_error(points, known, HIPS)


def test_carried_joints_lie_on_the_player(draws):
    torso = HIPS[0], LSP14.index("left_shoulder")
    right = [pck(draw.tracks.joints, draw.truth["points2d"], torso) for draw in draws]
    assert np.mean(right) >= 0.95


def test_the_motion_with_depth_signs_is_near_the_truth(draws):
    pa, n, acceleration = np.mean([lift(draw) for draw in draws], axis=0)
    assert pa <= 65
    assert n <= 80
    assert acceleration <= 8


def test_the_motion_without_depth_signs_does_not_collapse(draws):
    assert np.mean([lift(draw, signs=False)[0] for draw in draws]) <= 85
