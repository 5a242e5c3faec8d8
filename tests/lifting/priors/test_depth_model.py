"""What depth bones usually have: learnt from motion, kept in files, asked about pictures."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from keyrecon import cli
from keyrecon.body import LSP14, Skeleton
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.model_file import read_depth_model, write_depth_model
from keyrecon.lifting.bone_directions import bone_vectors
from keyrecon.lifting.priors.depth_model import (
    DepthModel,
    DepthTrainingOptions,
    expected_depth,
    train_depth_model,
)
from keyrecon.synthetic.motion import MotionOptions, play_tennis

QUICK = DepthTrainingOptions(poses=20_000)


@pytest.fixture(scope="module")
def model():
    return train_depth_model([play_tennis(MotionOptions(20.0, seed=1))], "one player", QUICK)


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
    usual = expected_depth(model, vectors[..., :2], lengths, LSP14)
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
    captures = [play_tennis(MotionOptions(2.0, seed=3))]
    one, other = (train_depth_model(captures, "", QUICK) for _ in range(2))
    np.testing.assert_array_equal(one.coefficients, other.coefficients)


@pytest.mark.parametrize("wrong", [{"poses": 0}, {"ridge": 0.0}])
def test_options_with_which_nothing_is_learnt_are_refused(wrong):
    with pytest.raises(KeyreconError, match="must be above 0"):
        train_depth_model([play_tennis(MotionOptions(2.0))], "", replace(QUICK, **wrong))


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
    told = expected_depth(model, more, toed.lengths, toed)
    np.testing.assert_allclose(told[:, ours], expected_depth(model, vectors, LSP14.lengths, LSP14))
    assert np.isnan(told[:, child["right_toe"]]).all()


def test_without_a_model_nothing_is_usual():
    vectors = np.zeros((2, 13, 2))
    assert np.isnan(expected_depth(None, vectors, LSP14.lengths, LSP14)).all()


def test_a_bone_that_is_not_seen_leaves_the_others_their_depths(model):
    vectors = bone_vectors(filmed(seed=4, yaw=30.0)[:3, :, :2], LSP14)
    vectors[:, 5] = np.nan
    assert np.isfinite(expected_depth(model, vectors, LSP14.lengths, LSP14)).all()


def test_models_come_back_from_files(model, tmp_path):
    write_depth_model(tmp_path / "new" / "depths.npz", model)
    again = read_depth_model(tmp_path / "new" / "depths.npz")
    assert again.provenance == "one player"
    seen = np.random.default_rng(0).uniform(-0.7, 0.7, (50, 13, 2))
    np.testing.assert_allclose(again.depth_shares(seen), model.depth_shares(seen), atol=1e-3)


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


def test_a_model_with_other_terms_is_refused():
    with pytest.raises(KeyreconError, match="820 x 13 coefficients, this one 5 x 13"):
        DepthModel(np.zeros((5, 13)), "")


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
