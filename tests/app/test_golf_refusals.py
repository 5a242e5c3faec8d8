"""What `keyrecon golf fit` and `train` refuse, in one line, before any work is done."""

import json
import subprocess
import sys

import numpy as np
import pytest

from keyrecon.app.golf import fit_file
from keyrecon.app.golf_training import train
from keyrecon.errors import KeyreconError
from keyrecon.golf.fit.fitting import FitOptions
from keyrecon.golf.prior.training import TrainOptions
from keyrecon.golf.prior.variation import VariationOptions
from keyrecon.golf.swing_fit import GolfOptions
from keyrecon.io.video_writer import write_video
from keyrecon.progress import silent

JOINTS = {
    "head_top": (160, 40), "root": (160, 142), "right_knee": (142, 192), "left_knee": (178, 192),
    "right_ankle": (138, 240), "left_ankle": (182, 240),
}  # fmt: skip


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    path = tmp_path_factory.mktemp("v") / "swing.mp4"
    write_video(path, (np.zeros((270, 320, 3), np.uint8) for _ in range(24)), 30.0)
    return path


def clicks_of(folder, **changes):
    path = folder / "clicks.json"
    content = {"keyrecon_golf_clicks": 1, "frame": 0, "size": [320, 270], "joints": JOINTS}
    path.write_text(json.dumps(content | changes))
    return path


@pytest.mark.parametrize(
    ("changes", "more", "message"),
    [
        ({"stature": -1}, {}, "the stature is -1"),
        ({"focal": 0}, {}, "the focal length is 0 px"),
        ({"size": [640, 540]}, {}, "pictures of 640 x 540 px, but this video has 320 x 270"),
        ({"frame": 24}, {}, "on frame 24, but the video has frames 0 to 23"),
        ({"frame": -1}, {}, "on frame -1"),
        ({}, {"slow_motion": float("nan")}, "slow-motion factor is nan"),
        ({}, {"slow_motion": float("inf")}, "slow-motion factor is inf"),
        ({}, {"slow_motion": 0.0}, "slow-motion factor is 0"),
        ({}, {"slow_motion": 8.0}, r"lasts 0.10 s \(8 times slower than life\)"),
        ({}, {"options": GolfOptions(fit=FitOptions(components=0))}, "fit.components cannot be 0"),
    ],
)
def test_a_fit_that_cannot_be_leaves_nothing_behind(video, tmp_path, changes, more, message):
    with pytest.raises(KeyreconError, match=message):
        fit_file(video, clicks_of(tmp_path, **changes), tmp_path / "out", **more)
    assert not (tmp_path / "out").exists()


def test_knees_exchanged_are_told_before_anything_is_made(video, tmp_path):
    joints = {**JOINTS, "right_knee": JOINTS["left_knee"], "left_knee": JOINTS["right_knee"]}
    with pytest.raises(KeyreconError, match="seem to be exchanged"):
        fit_file(video, clicks_of(tmp_path, joints=joints), tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("out", "options", "message"),
    [
        ("no/folder/p.npz", TrainOptions(), "There is no folder"),
        ("p.bvh", TrainOptions(), "cannot hold a prior"),
        ("p.npz", TrainOptions(components=0), "components cannot be 0"),
        (
            "p.npz",
            TrainOptions(variation=VariationOptions(count=-1)),
            "variation.count cannot be -1",
        ),
        (
            "p.npz",
            TrainOptions(variation=VariationOptions(plane=float("nan"))),
            "plane cannot be nan",
        ),
        ("p.npz", TrainOptions(), "does not exist"),
    ],
)
def test_a_prior_that_cannot_be_is_not_learnt(tmp_path, out, options, message):
    with pytest.raises(KeyreconError, match=message):
        train([tmp_path / "swings"], tmp_path / out, options, silent)


def test_the_help_of_a_fit_fits_on_a_page():
    told = subprocess.run(
        [sys.executable, "-m", "keyrecon", "golf", "fit", "--help"], capture_output=True, text=True,
        check=True, env={"COLUMNS": "100", "PATH": "", "PYTHONPATH": ":".join(sys.path)},
    ).stdout  # fmt: skip
    assert len(told.splitlines()) <= 50
    for word in ("--clicks", "--out", "--prior", "--slowmo", "--method", "--force", "right_knee"):
        assert word in told
