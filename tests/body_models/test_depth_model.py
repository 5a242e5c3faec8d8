"""What depth bones usually have: learnt from motion, kept in files, asked about pictures."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from keyrecon import cli
from keyrecon.body import LSP14, Skeleton
from keyrecon.body_models import depth_training
from keyrecon.body_models.depth_model import INPUTS, DepthModel, expected_depth
from keyrecon.body_models.depth_training import (
    DepthTrainingOptions,
    draw_windows,
    gather,
    train_depth_model,
)
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.model_file import read_depth_model, write_depth_model
from keyrecon.numerics.bone_directions import bone_vectors
from keyrecon.synthetic.motion import MotionOptions, play_tennis

FPS = 50.0
QUICK = DepthTrainingOptions(poses=200_000, units=64)


@pytest.fixture(scope="module")
def model():
    return train_depth_model([play_tennis(MotionOptions(20.0, seed=1))], FPS, "one player", QUICK)


def filmed(seed, yaw, down=8.0):
    """Built-in tennis in the axes of a camera: x right, y down, z away."""
    points = play_tennis(MotionOptions(10.0, seed=seed))
    c, s = np.cos(np.radians([yaw, down])), np.sin(np.radians([yaw, down]))
    turned = points @ np.array([[c[0], 0, s[0]], [0, 1, 0], [-s[0], 0, c[0]]]).T
    tilt = np.array([[1, 0, 0], [0, -c[1], s[1]], [0, -s[1], -c[1]]])
    return turned @ tilt.T


def right_signs(model, points):
    """Share of bones off the image plane whose usual depth has the right sign."""
    vectors = bone_vectors(points, LSP14)
    lengths = np.linalg.norm(vectors, axis=-1).mean(axis=0)
    usual = expected_depth(model, vectors[..., :2], lengths, LSP14, FPS)
    deep = np.abs(vectors[..., 2]) > 0.3 * lengths
    return (np.sign(usual) == np.sign(vectors[..., 2]))[deep].mean()


@pytest.mark.parametrize("yaw", [0.0, 70.0, 200.0, 300.0])
def test_most_depth_signs_of_other_points_are_told_from_any_side(model, yaw):
    assert right_signs(model, filmed(seed=2, yaw=yaw)) > 0.85


def test_left_handers_are_told_as_well(model):
    mirrored = filmed(seed=2, yaw=70.0)[:, LSP14.mirror] * [-1, 1, 1]
    assert right_signs(model, mirrored) > 0.85


def test_the_built_in_model_knows_the_built_in_tennis():
    assert right_signs(read_depth_model(), filmed(seed=40, yaw=130.0)) > 0.85


def test_the_same_captures_give_the_same_model():
    captures, few = [play_tennis(MotionOptions(2.0, seed=3))], replace(QUICK, poses=3000)
    one, other = (train_depth_model(captures, FPS, "", few) for _ in range(2))
    for first, second in zip(one.weights, other.weights, strict=True):
        np.testing.assert_array_equal(first, second)


def test_the_weights_of_a_model_are_the_mean_of_its_last_draws(monkeypatch):
    class Counting:
        """Its weights are the number of draws that it was shown, changed in place as Adam does."""

        coefs_, intercepts_ = [np.zeros((INPUTS, 20))], [np.zeros(20)]

        def partial_fit(self, inputs, targets):
            for layer in (*self.coefs_, *self.intercepts_):
                layer += 1

    monkeypatch.setattr(depth_training, "_network", lambda options: Counting())
    monkeypatch.setattr(depth_training, "_DRAWN", 20)
    ten_draws = replace(QUICK, poses=200)
    model = train_depth_model([play_tennis(MotionOptions(2.0, seed=3))], FPS, "", ten_draws)
    last = [10, 9, 8, 7][: round(10 * depth_training._AVERAGED)]
    np.testing.assert_allclose(model.weights[0], np.mean(last))


def test_what_a_model_learns_from_are_unit_bones_and_what_the_picture_leaves_of_them():
    exact = DepthTrainingOptions(length_error=0.0, joint_error=0.0)
    source = gather([play_tennis(MotionOptions(4.0, seed=3))])
    windows = draw_windows(source, FPS, 50, np.random.default_rng(0), exact)
    depth, now = windows.depth_shares, windows.inputs.reshape(50, -1, 39)[:, 3]
    flat, left = now[:, :26].reshape(50, 13, 2), now[:, 26:]
    np.testing.assert_allclose((flat**2).sum(axis=-1) + depth**2, 1, atol=1e-5)
    np.testing.assert_allclose(left, np.abs(depth), atol=2e-3)


def test_motion_around_a_frame_tells_more_than_the_frame():
    model, points = read_depth_model(), filmed(seed=45, yaw=110.0)
    vectors = bone_vectors(points, LSP14)
    lengths = np.linalg.norm(vectors, axis=-1).mean(axis=0)
    moving = expected_depth(model, vectors[..., :2], lengths, LSP14, FPS)
    held = np.concatenate(
        [expected_depth(model, frame[None], lengths, LSP14, FPS) for frame in vectors[..., :2]]
    )
    off = [np.sqrt(((told - vectors[..., 2]) ** 2).mean()) for told in (moving, held)]
    assert off[0] < 0.8 * off[1]


def test_joints_besides_change_nothing_and_have_no_usual_depth(model):
    vectors = bone_vectors(filmed(seed=4, yaw=30.0)[:3, :, :2], LSP14)
    toed = Skeleton(
        (*LSP14.names, "right_toe"),
        (*LSP14.parents, LSP14.index("right_ankle")),
        LSP14.mirrored,
        (*LSP14.proportions, 0.1),
        (*LSP14.lower, 14),
    )
    child = {toed.names[c]: bone for bone, (_, c) in enumerate(toed.bones)}
    ours = [child[LSP14.names[c]] for _, c in LSP14.bones]
    more = np.zeros((3, 14, 2))
    more[:, ours] = vectors
    told = expected_depth(model, more, toed.lengths, toed, FPS)
    alone = expected_depth(model, vectors, LSP14.lengths, LSP14, FPS)
    np.testing.assert_allclose(told[:, ours], alone)
    assert np.isnan(told[:, child["right_toe"]]).all()


def test_without_a_model_nothing_is_usual():
    vectors = np.zeros((2, 13, 2))
    assert np.isnan(expected_depth(None, vectors, LSP14.lengths, LSP14, FPS)).all()


def test_a_bone_that_is_not_seen_leaves_the_others_their_depths(model):
    vectors = bone_vectors(filmed(seed=4, yaw=30.0)[:3, :, :2], LSP14)
    vectors[:, 5] = np.nan
    assert np.isfinite(expected_depth(model, vectors, LSP14.lengths, LSP14, FPS)).all()


def test_models_come_back_from_files(model, tmp_path):
    write_depth_model(tmp_path / "new" / "depths.npz", model)
    again = read_depth_model(tmp_path / "new" / "depths.npz")
    assert again.provenance == "one player"
    seen = np.random.default_rng(0).uniform(-0.7, 0.7, (50, 13, 2))
    told = model.depth_shares(seen, FPS)
    np.testing.assert_allclose(again.depth_shares(seen, FPS), told, atol=1e-3)


def test_files_that_are_no_depth_models_are_refused(model, tmp_path):
    file = tmp_path / "depths.npz"
    with pytest.raises(KeyreconError, match=r"No such file.*keyrecon depths"):
        read_depth_model(file)
    file.write_text("hello")
    with pytest.raises(KeyreconError, match=r"is not a depth model \(another format\)"):
        read_depth_model(file)
    np.savez(file, points3d=np.zeros(3))
    with pytest.raises(KeyreconError, match="is not a depth model"):
        read_depth_model(file)
    write_depth_model(file, replace(model, version=99))
    with pytest.raises(KeyreconError, match="version 99"):
        read_depth_model(file)


def test_a_model_whose_layers_do_not_fit_is_refused():
    with pytest.raises(
        KeyreconError, match=f"{INPUTS} inputs to 13 depths and 7 lengths.* are 5x13"
    ):
        DepthModel((np.zeros((5, 13)),), (np.zeros(13),), "")


def test_learning_without_scikit_learn_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn.neural_network", None)
    with pytest.raises(KeyreconError, match=r"pip install 'keyrecon\[learn\]'"):
        train_depth_model([play_tennis(MotionOptions(2.0))], FPS, "", QUICK)


def test_the_command_learns_from_files_what_run_can_use(tmp_path, monkeypatch, capsys):
    from bvh_files import bvh_text

    out = tmp_path / "mine.npz"
    call = ["keyrecon", "depths", str(tmp_path), "--out", str(out)]
    monkeypatch.setattr(sys, "argv", [*call, "--poses", "2000"])
    (tmp_path / "walk.bvh").write_text(bvh_text(frames=12)[0])
    with pytest.raises(SystemExit):
        cli.main()
    assert "walk.bvh lasts 0.1 s, too short" in capsys.readouterr().err
    (tmp_path / "walk.bvh").write_text(bvh_text(frames=200)[0])
    cli.main()
    assert "1 captures (walk)" in capsys.readouterr().out
    assert "walk" in read_depth_model(out).provenance


def test_an_empty_folder_holds_no_captures(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["keyrecon", "depths", str(tmp_path)])
    with pytest.raises(SystemExit):
        cli.main()
    assert "There is no capture" in capsys.readouterr().err
