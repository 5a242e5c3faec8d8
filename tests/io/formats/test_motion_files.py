import json
import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from small_motion import FPS, make_motion

from keyrecon.body import LSP14, Skeleton
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.conventions import stand_on_floor
from keyrecon.io.formats.export import SUFFIXES, check_suffix, export_motion
from keyrecon.io.formats.motion_file import read_motion, write_motion

SIZE = (1280, 720)


@pytest.fixture(scope="module")
def motion():
    return make_motion()


def test_a_motion_comes_back_from_npz_unchanged(tmp_path, motion):
    write_motion(tmp_path / "motion.npz", motion)
    back = read_motion(tmp_path / "motion.npz")
    assert back.skeleton == motion.skeleton
    assert (back.fps, back.units) == (motion.fps, motion.units)
    for name in ("points3d", "points2d", "points2d_propagated", "confidence", "source", "scale",
                 "time", "keyframes"):  # fmt: skip
        assert np.array_equal(
            getattr(back, name), getattr(motion, name), equal_nan=name.startswith("points")
        )


def test_expected_errors_come_back_and_a_file_without_them_is_read(tmp_path, motion):
    errors = np.abs(motion.points2d[..., 0]) / 100
    write_motion(tmp_path / "new.npz", replace(motion, expected_error=errors))
    assert np.array_equal(read_motion(tmp_path / "new.npz").expected_error, errors)
    write_motion(tmp_path / "former.npz", replace(motion, expected_error=None))
    assert read_motion(tmp_path / "former.npz").expected_error is None


def test_npz_holds_the_promised_arrays_without_pickles(tmp_path, motion):
    write_motion(tmp_path / "motion.npz", motion)
    with np.load(tmp_path / "motion.npz", allow_pickle=False) as stored:
        assert {
            "points3d", "points2d", "points2d_propagated", "confidence", "source", "source_names",
            "joint_names", "parents", "fps", "time", "units", "scale", "keyframes",
            "keyrecon_version",
        } <= set(stored.files)  # fmt: skip
        assert stored["source_names"].tolist()[0] == "annotated"
        assert stored["units"] == "m"


def test_files_that_are_no_motion_are_refused(tmp_path, motion):
    path = tmp_path / "motion.npz"
    with pytest.raises(KeyreconError, match="is not a motion"):
        read_motion(path)
    path.write_bytes(b"")
    with pytest.raises(KeyreconError, match="is not a motion"):
        read_motion(path)
    np.savez(path, time=np.zeros(3))
    with pytest.raises(KeyreconError, match="no 'joint_names'"):
        read_motion(path)
    write_motion(path, motion)
    with np.load(path) as stored:
        data = dict(stored)
    np.savez(path, **{**data, "confidence": np.zeros((2, 14))})
    with pytest.raises(KeyreconError, match=r"confidence has shape \(2, 14\)"):
        read_motion(path)
    np.savez(path, **{**data, "source": data["source"] + 9})
    with pytest.raises(KeyreconError, match="a source is not one of 0 to 3"):
        read_motion(path)
    write_motion(path, motion)
    path.write_bytes(path.read_bytes()[:2000])
    with pytest.raises(KeyreconError, match="is not a motion"):
        read_motion(path)


def two_joints(motion, skeleton):
    names = ("points3d", "points2d", "points2d_propagated", "confidence", "source")
    return replace(motion, skeleton=skeleton, **{n: getattr(motion, n)[:, :2] for n in names})


def read_trc(path):
    lines = path.read_text().split("\n")
    names = [word for word in lines[3].split("\t")[2:] if word]
    meta = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=True))
    assert lines[5] == ""
    rows = np.array([line.split("\t") for line in lines[6:] if line], dtype=float)
    return names, meta, rows


def test_joints_come_back_from_trc(tmp_path, motion):
    export_motion(tmp_path / "a.trc", motion, SIZE)
    names, meta, rows = read_trc(tmp_path / "a.trc")
    assert names == list(LSP14.names)
    assert (meta["Units"], meta["DataRate"], meta["NumFrames"]) == ("m", "50", "60")
    assert rows[:, 0].tolist() == list(range(1, 61))
    assert np.allclose(rows[:, 1], motion.time)
    points = stand_on_floor(motion).points
    assert np.allclose(rows[:, 2:].reshape(60, 14, 3), points, atol=1e-6)


def test_joints_come_back_from_c3d_by_another_reader(tmp_path, motion):
    ezc3d = pytest.importorskip("ezc3d")
    export_motion(tmp_path / "a.c3d", motion, SIZE)
    file = ezc3d.c3d(str(tmp_path / "a.c3d"))
    group = file["parameters"]["POINT"]
    assert [n.strip() for n in group["LABELS"]["value"]] == list(LSP14.names)
    assert group["UNITS"]["value"][0].strip() == "mm"
    assert group["RATE"]["value"][0] == FPS
    points = file["data"]["points"][:3].transpose(2, 1, 0)
    x, y, z = 1000 * stand_on_floor(motion).points.transpose(2, 0, 1)
    assert np.allclose(points, np.stack([x, -z, y], axis=2), atol=0.01)
    assert group["Y_SCREEN"]["value"] == ["+Z"]


def test_units_without_a_height_are_said_aloud(tmp_path):
    motion = make_motion(units="body heights")
    export_motion(tmp_path / "a.trc", motion, SIZE)
    assert read_trc(tmp_path / "a.trc")[1]["Units"] == "body_heights"
    export_motion(tmp_path / "a.csv", motion, SIZE)
    assert "body heights" in (tmp_path / "a.csv").read_text()[:300]


def test_the_table_reads_with_pandas(tmp_path, motion):
    pandas = pytest.importorskip("pandas")
    export_motion(tmp_path / "a.csv", motion, SIZE)
    table = pandas.read_csv(tmp_path / "a.csv", comment="#")
    assert len(table) == 60
    assert np.allclose(
        table["left_wrist_z"], motion.points3d[:, LSP14.index("left_wrist"), 2], rtol=1e-5
    )
    assert table["neck_source"].isin(["annotated", "propagated", "interpolated", "refined"]).all()
    assert np.allclose(table["neck_confidence"], motion.confidence[:, 12], atol=1e-5)


def test_netcdf_has_the_layout_of_movement(tmp_path, motion):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    export_motion(tmp_path / "a.nc", motion, SIZE)
    with xarray.open_dataset(tmp_path / "a.nc", engine="h5netcdf") as data:
        assert data["position"].dims == ("time", "space", "keypoint", "individual")
        assert data["confidence"].dims == ("time", "keypoint", "individual")
        wrist = data["position"].sel(keypoint="left_wrist", individual="athlete")
        assert np.allclose(wrist, motion.points3d[:, LSP14.index("left_wrist")])
        assert data.attrs["ds_type"] == "poses"
        assert data.attrs["fps"] == FPS


def test_coco_of_all_frames_holds_the_projected_joints(tmp_path, motion):
    export_motion(tmp_path / "a.json", motion, SIZE)
    data = json.loads((tmp_path / "a.json").read_text())
    assert len(data["images"]) == len(data["annotations"]) == 60
    row = np.array(data["annotations"][7]["keypoints"]).reshape(14, 3)
    assert np.allclose(row[:, :2], motion.points2d[7], atol=0.006)
    assert np.array_equal(row[:, 2] == 2, motion.source[7] < 2)


def uneven_time(frames):
    return np.cumsum(np.random.default_rng(3).uniform(0.5, 1.5, frames)) / FPS


def count_frames(path):
    """Frames in an exported file, by what its own format says."""
    if path.suffix == ".bvh":
        return int(re.search(r"Frames: (\d+)", path.read_text())[1])
    if path.suffix == ".trc":
        _, meta, rows = read_trc(path)
        assert meta["NumFrames"] == meta["OrigNumFrames"] == str(len(rows))
        return len(rows)
    if path.suffix == ".c3d":
        file = pytest.importorskip("ezc3d").c3d(str(path))
        return file["data"]["points"].shape[2]
    if path.suffix == ".csv":
        return sum(line[0].isdigit() for line in path.read_text().splitlines())
    if path.suffix == ".json":
        return len(json.loads(path.read_text())["images"])
    with pytest.importorskip("xarray").open_dataset(path, engine="h5netcdf") as data:
        return data.sizes["time"]


@pytest.mark.parametrize("suffix", [".bvh", ".trc", ".c3d", ".csv", ".nc", ".json"])
@pytest.mark.parametrize("frames", [60, 61, 97])
def test_every_format_has_as_many_frames_as_the_video(tmp_path, suffix, frames):
    export_motion(tmp_path / f"a{suffix}", make_motion(frames, time=uneven_time(frames)), SIZE)
    assert count_frames(tmp_path / f"a{suffix}") == frames


@pytest.mark.parametrize(
    ("suffix", "words"),
    [
        (".trc", "as many as in the video, moved from its uneven times to even ones"),
        (".c3d", "as many as in the video, moved from its uneven times to even ones"),
        (".csv", "those of the video, at its own uneven times"),
        (".glb", "those of the video, at its own uneven times"),
        (".nc", "those of the video, at its own uneven times"),
    ],
)
def test_a_file_says_what_was_done_to_uneven_times(tmp_path, suffix, words):
    export_motion(tmp_path / f"a{suffix}", make_motion(time=uneven_time(60)), SIZE)
    assert words.encode() in (tmp_path / f"a{suffix}").read_bytes()


@pytest.mark.parametrize("suffix", [".trc", ".c3d", ".glb"])
def test_a_file_says_where_its_floor_and_origin_are(tmp_path, motion, suffix):
    export_motion(tmp_path / f"a{suffix}", motion, SIZE)
    data = (tmp_path / f"a{suffix}").read_bytes()
    assert b"feet on the floor at 0" in data
    assert b"Z up" in data if suffix == ".c3d" else b"Y up" in data


def test_trc_of_uneven_times_lasts_as_long_as_the_video(tmp_path):
    motion = make_motion(time=uneven_time(60))
    export_motion(tmp_path / "a.trc", motion, SIZE)
    _, meta, rows = read_trc(tmp_path / "a.trc")
    assert rows[-1, 1] == pytest.approx(motion.time[-1] - motion.time[0])
    assert float(meta["DataRate"]) == pytest.approx(59 / rows[-1, 1])
    assert float(meta["OrigDataRate"]) == FPS


@pytest.mark.parametrize("suffix", [".trc", ".bvh", ".c3d", ".glb"])
def test_formats_that_need_every_joint_name_the_missing_one(tmp_path, motion, suffix):
    points = motion.points3d.copy()
    points[5, 7] = np.nan
    with pytest.raises(KeyreconError, match="Frame 5 has no right_elbow"):
        export_motion(tmp_path / f"a{suffix}", replace(motion, points3d=points), SIZE)
    assert not (tmp_path / f"a{suffix}").exists()


@pytest.mark.parametrize("suffix", [".csv", ".nc", ".npz"])
def test_other_formats_take_missing_joints(tmp_path, motion, suffix):
    points = motion.points3d.copy()
    points[5, 7] = np.nan
    export_motion(tmp_path / f"a{suffix}", replace(motion, points3d=points), SIZE)


@pytest.mark.parametrize(
    ("suffix", "library", "extra"),
    [(".c3d", "c3d", r"keyrecon\[c3d\]"), (".nc", "xarray", r"keyrecon\[netcdf\]")],
)
def test_a_missing_library_is_named_with_the_way_to_install_it(
    tmp_path, motion, monkeypatch, suffix, library, extra
):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(KeyreconError, match=f"pip install '{extra}'"):
        export_motion(tmp_path / f"a{suffix}", motion, SIZE)


def test_a_suffix_that_is_not_known_is_refused(tmp_path, motion):
    with pytest.raises(KeyreconError, match=r"no export to '\.fbx'"):
        export_motion(tmp_path / "a.fbx", motion, SIZE)
    with pytest.raises(KeyreconError, match="size of the pictures"):
        export_motion(tmp_path / "a.json", motion)
    check_suffix(tmp_path / "a.MP4", (".mp4",))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_format_takes_a_motion_of_one_frame(tmp_path, suffix):
    export_motion(tmp_path / f"a{suffix}", make_motion(frames=1), SIZE)


def test_c3d_holds_more_frames_than_a_header_can_count(tmp_path):
    ezc3d = pytest.importorskip("ezc3d")
    few = make_motion(2)
    frames = 66_000
    repeat = {name: np.resize(getattr(few, name), (frames, *getattr(few, name).shape[1:]))
              for name in ("points3d", "points2d", "points2d_propagated", "confidence", "source",
                           "scale")}  # fmt: skip
    stick = Skeleton(("a", "b"), (-1, 0), (), (0.0, 1.0), ())
    long = two_joints(replace(few, time=np.arange(frames) / FPS, **repeat), stick)
    export_motion(tmp_path / "a.c3d", long, SIZE)
    assert ezc3d.c3d(str(tmp_path / "a.c3d"))["data"]["points"].shape[2] == frames
