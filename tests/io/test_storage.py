import numpy as np
import pytest

from keyrecon import KeyreconError, reading
from keyrecon.body import LSP14
from keyrecon.io.storage import is_mapped, load_record, save_record
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


def many_edges(frames=600):
    return tuple(edges(400, seed) for seed in range(frames))


def test_a_large_result_is_mapped_and_the_same_as_it_was(tmp_path):
    frames = (*many_edges(), edges(0, 0))
    save_record(tmp_path / "r.npz", frames)
    back = load_record(tmp_path / "r.npz")
    assert is_mapped(tmp_path / "r.npz")
    assert not back[0].points.flags.owndata
    assert not back[0].points.flags.writeable
    assert len(back[-1].points) == 0
    for one, other in zip(frames, back, strict=True):
        for name in ("points", "tangent", "color", "upper", "lower"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
            assert getattr(one, name).dtype == getattr(other, name).dtype
            assert getattr(other, name).flags.aligned


def test_a_mapped_result_outlives_its_file(tmp_path):
    save_record(tmp_path / "r.npz", many_edges())
    back = load_record(tmp_path / "r.npz")
    (tmp_path / "r.npz").unlink()
    np.testing.assert_array_equal(back[7].points, edges(400, 7).points)


def test_results_are_read_where_no_more_files_may_be_open(tmp_path, monkeypatch):
    save_record(tmp_path / "r.npz", many_edges())
    monkeypatch.setattr(reading, "open_files_allowed", lambda: 4)
    back = load_record(tmp_path / "r.npz")
    np.testing.assert_array_equal(back[7].points, edges(400, 7).points)
    (tmp_path / "r.npz").write_bytes(b"")
    np.testing.assert_array_equal(back[8].points, edges(400, 8).points)


@pytest.mark.parametrize("place", [0.02, 0.3, 0.7, 0.999])
def test_a_large_result_with_a_wrong_byte_or_without_its_end_is_refused(tmp_path, place):
    file = tmp_path / "r.npz"
    save_record(file, many_edges())
    data = bytearray(file.read_bytes())
    at = int(place * len(data))
    (tmp_path / "torn.npz").write_bytes(data[:at] + bytes(6 << 20) * (at > 5 << 20))
    data[at] ^= 1
    file.write_bytes(data)
    for damaged in (file, tmp_path / "torn.npz"):
        with pytest.raises(KeyreconError, match="delete it and run again"):
            load_record(damaged)


def test_what_numpy_reads_is_what_was_stored(tmp_path):
    save_record(tmp_path / "r.npz", (np.arange(6.0).reshape(2, 3), np.array(3.5), np.zeros((0, 4))))
    with np.load(tmp_path / "r.npz") as stored:
        np.testing.assert_array_equal(stored["a0"], np.arange(6.0).reshape(2, 3))
        assert stored["a1"] == 3.5
        assert stored["a2"].shape == (0, 4)
