import numpy as np
import pytest

from keyrecon import KeyreconError
from keyrecon.body import LSP14
from keyrecon.io.storage import load_record, save_record
from keyrecon.records import Annotations, Edges, Pick


def edges(count, seed):
    rng = np.random.default_rng(seed)
    points = rng.random((count, 2))
    return Edges(
        points, points[::-1], np.arange(count), np.ones(count, bool), np.zeros(count, bool)
    )


def test_a_record_comes_back_with_its_skeleton(tmp_path):
    joints = np.arange(28.0).reshape(1, 14, 2)
    marks = Annotations(
        LSP14, np.array([7]), joints, joints[..., 0] > 3, np.zeros((1, 13), dtype=np.int64)
    )
    save_record(tmp_path / "r.npz", marks)
    back = load_record(tmp_path / "r.npz")
    assert back.skeleton == LSP14
    assert np.array_equal(back.joints, joints)
    assert back.visible.dtype == bool


def test_ragged_tuples_come_back_frame_by_frame(tmp_path):
    frames = tuple(edges(n, n) for n in (3, 0, 5))
    save_record(tmp_path / "r.npz", (frames, Pick(1, "head", 2.0, 3.0), None, 0.5))
    back, pick, nothing, half = load_record(tmp_path / "r.npz")
    assert [len(f.points) for f in back] == [3, 0, 5]
    assert np.array_equal(back[2].tangent, frames[2].tangent)
    assert (pick, nothing, half) == (Pick(1, "head", 2.0, 3.0), None, 0.5)


def test_an_interrupted_write_leaves_the_old_result(tmp_path):
    save_record(tmp_path / "r.npz", 1.0)
    with pytest.raises(TypeError):
        save_record(tmp_path / "r.npz", object())
    assert load_record(tmp_path / "r.npz") == 1.0
    assert [p.name for p in tmp_path.iterdir()] == ["r.npz"]


def test_a_file_of_another_kind_is_refused(tmp_path):
    (tmp_path / "r.npz").write_bytes(b"PK not really")
    with pytest.raises(KeyreconError, match="delete it and run again"):
        load_record(tmp_path / "r.npz")


def test_a_pickle_is_never_loaded(tmp_path):
    np.savez(tmp_path / "r.npz", tree=np.array([{"a": 1}], dtype=object))
    with pytest.raises(KeyreconError, match="not a stored result"):
        load_record(tmp_path / "r.npz")
