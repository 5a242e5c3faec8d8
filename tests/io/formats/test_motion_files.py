import json
import struct
import sys
from dataclasses import replace

import numpy as np
import pytest
from small_motion import FPS, make_motion

from keyrecon.body import LSP14, Skeleton
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.bvh import read_bvh
from keyrecon.io.formats.conventions import at_constant_rate, y_up
from keyrecon.io.formats.export import SUFFIXES, check_suffix, export_motion
from keyrecon.io.formats.mocap import read_capture
from keyrecon.io.formats.motion_file import read_motion, write_motion
from keyrecon.io.formats.rigs import find_joints

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


@pytest.mark.parametrize("wildness", [0.0, 0.3, 1.0])
def test_joints_come_back_from_bvh(tmp_path, wildness):
    motion = make_motion(wildness=wildness)
    export_motion(tmp_path / "a.bvh", motion, SIZE)
    figure = read_bvh(tmp_path / "a.bvh")
    joints, _ = find_joints(figure)
    error = np.abs(joints - y_up(motion.points3d)).max()
    # Offsets stand for lengths that vary by up to 0.1 %, at most 0.6 mm on a hip.
    assert error < 0.001
    assert figure.fps == FPS


def test_our_bvh_is_a_person_to_the_motion_capture_reader(tmp_path):
    motion = make_motion(wildness=0.2)
    export_motion(tmp_path / "a.bvh", motion, SIZE)
    capture = read_capture(tmp_path / "a.bvh")
    assert np.abs(capture.joints - y_up(motion.points3d)).max() < 0.001


def test_the_rest_pose_of_bvh_is_a_t_pose_that_faces_plus_z(tmp_path, motion):
    export_motion(tmp_path / "a.bvh", motion, SIZE)
    lines = (tmp_path / "a.bvh").read_text().splitlines()
    start = lines.index("MOTION")
    width = sum(int(line.split()[1]) for line in lines if line.strip().startswith("CHANNELS"))
    # Without position channels, offsets alone are the rest pose.
    hierarchy = [line.replace("CHANNELS 6 Xposition Yposition Zposition", "CHANNELS 3")
                 for line in lines[:start]]  # fmt: skip
    width = sum(int(line.split()[1]) for line in hierarchy if line.strip().startswith("CHANNELS"))
    zeros = " ".join(["0"] * width)
    rest = [*hierarchy, "MOTION", "Frames: 1", "Frame Time: 0.02", zeros]
    (tmp_path / "rest.bvh").write_text("\n".join(rest))
    joints, toes = find_joints(read_bvh(tmp_path / "rest.bvh"))
    at = {name: joints[0, j] for j, name in enumerate(LSP14.names)}
    assert np.allclose(at["right_wrist"][1:], at["right_shoulder"][1:], atol=1e-5)
    assert at["right_wrist"][0] < at["right_shoulder"][0] < 0 < at["left_wrist"][0]
    assert np.allclose(at["left_ankle"][[0, 2]], at["left_hip"][[0, 2]], atol=1e-5)
    assert at["head_top"][1] > at["neck"][1] > at["left_hip"][1] > at["left_ankle"][1]
    assert (toes[0, :, 2] > 0).all()


def test_angles_in_bvh_do_not_jump_by_full_turns(tmp_path):
    frames = 120
    motion = make_motion(frames, wildness=0.05)
    turn = np.linspace(0, 4 * np.pi, frames)
    spun = motion.points3d - [0.2, -0.5, 12]
    spun = np.stack(
        [
            spun[..., 0] * np.cos(turn)[:, None] + spun[..., 2] * np.sin(turn)[:, None],
            spun[..., 1],
            spun[..., 2] * np.cos(turn)[:, None] - spun[..., 0] * np.sin(turn)[:, None],
        ],
        axis=2,
    )
    export_motion(tmp_path / "a.bvh", replace(motion, points3d=spun), SIZE)
    text = (tmp_path / "a.bvh").read_text()
    values = np.array([line.split() for line in text.splitlines() if line[:1] in "-0123456789"])
    hips = values[:, 3:6].astype(float)
    assert np.abs(np.diff(hips, axis=0)).max() < 90
    assert np.ptp(hips[:, 2]) > 600


def two_joints(motion, skeleton):
    names = ("points3d", "points2d", "points2d_propagated", "confidence", "source")
    return replace(motion, skeleton=skeleton, **{n: getattr(motion, n)[:, :2] for n in names})


def test_bvh_needs_a_person(tmp_path, motion):
    stick = Skeleton(("a", "b"), (-1, 0), (), (0.0, 1.0), ())
    short = two_joints(motion, stick)
    with pytest.raises(KeyreconError, match="has no right_hip"):
        export_motion(tmp_path / "a.bvh", short, SIZE)


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
    assert np.allclose(rows[:, 2:].reshape(60, 14, 3), y_up(motion.points3d), atol=1e-6)


def test_joints_come_back_from_c3d_by_another_reader(tmp_path, motion):
    ezc3d = pytest.importorskip("ezc3d")
    export_motion(tmp_path / "a.c3d", motion, SIZE)
    file = ezc3d.c3d(str(tmp_path / "a.c3d"))
    group = file["parameters"]["POINT"]
    assert [n.strip() for n in group["LABELS"]["value"]] == list(LSP14.names)
    assert group["UNITS"]["value"][0].strip() == "mm"
    assert group["RATE"]["value"][0] == FPS
    points = file["data"]["points"][:3].transpose(2, 1, 0)
    assert np.allclose(points, 1000 * y_up(motion.points3d), atol=0.01)


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


def read_glb(path):
    data = path.read_bytes()
    magic, version, total = struct.unpack_from("<4sII", data)
    assert (magic, version, total) == (b"glTF", 2, len(data))
    length, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    document = json.loads(data[20 : 20 + length])
    size, kind = struct.unpack_from("<I4s", data, 20 + length)
    assert kind == b"BIN\0"
    return document, data[28 + length : 28 + length + size]


def accessor(document, binary, number):
    entry = document["accessors"][number]
    view = document["bufferViews"][entry["bufferView"]]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[entry["type"]]
    kind = {5126: "<f4", 5123: "<u2"}[entry["componentType"]]
    assert view["byteOffset"] % 4 == 0
    raw = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
    return np.frombuffer(raw, kind).reshape(entry["count"], width)


def test_the_animated_figure_holds_joints_and_bones(tmp_path, motion):
    export_motion(tmp_path / "a.glb", motion, SIZE)
    document, binary = read_glb(tmp_path / "a.glb")
    assert document["buffers"][0]["byteLength"] == len(binary)
    animation = document["animations"][0]
    tracks = {}
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        times = accessor(document, binary, sampler["input"])
        assert (np.diff(times, axis=0) > 0).all()
        name = document["nodes"][channel["target"]["node"]]["name"]
        tracks[name, channel["target"]["path"]] = accessor(document, binary, sampler["output"])
    points = y_up(motion.points3d)
    for joint, name in enumerate(LSP14.names):
        assert np.allclose(tracks[name, "translation"], points[:, joint], atol=1e-5)
    for parent, child in LSP14.bones:
        name = f"{LSP14.names[parent]} to {LSP14.names[child]}"
        x, y, z, w = tracks[name, "rotation"].T
        up = np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], axis=1)
        tip = tracks[name, "translation"] + tracks[name, "scale"][:, 1:2] * up
        assert np.allclose(tip, points[:, child], atol=1e-5)


def test_meshes_of_the_figure_face_outwards(tmp_path, motion):
    export_motion(tmp_path / "a.glb", motion, SIZE)
    document, binary = read_glb(tmp_path / "a.glb")
    for mesh in document["meshes"]:
        primitive = mesh["primitives"][0]
        vertices = accessor(document, binary, primitive["attributes"]["POSITION"])
        normals = accessor(document, binary, primitive["attributes"]["NORMAL"])
        faces = accessor(document, binary, primitive["indices"]).reshape(-1, 3)
        assert faces.max() < len(vertices)
        a, b, c = vertices[faces].transpose(1, 0, 2)
        facing = (np.cross(b - a, c - a) * normals[faces].mean(axis=1)).sum(axis=1)
        assert facing.min() > -1e-9


def uneven_time(frames):
    return np.cumsum(np.random.default_rng(3).uniform(0.5, 1.5, frames)) / FPS


def test_an_even_motion_keeps_its_frames(motion):
    assert np.array_equal(at_constant_rate(motion), y_up(motion.points3d))


def test_resampling_keeps_bone_lengths(motion):
    uneven = make_motion(time=uneven_time(60))
    points = at_constant_rate(uneven)
    lengths = np.linalg.norm(points[:, LSP14.bones[:, 1]] - points[:, LSP14.bones[:, 0]], axis=2)
    assert np.allclose(lengths, 1.8 * LSP14.lengths)


def test_resampling_takes_joints_to_where_they_are_at_even_times():
    time = uneven_time(60)
    still = make_motion(time=time, wildness=0.0)
    shift = (time - time[0])[:, None, None] * np.array([1.0, 0, 0])
    points = at_constant_rate(replace(still, points3d=still.points3d + shift))
    expected = y_up(still.points3d[:1]) + np.arange(len(points))[:, None, None] / FPS * np.array(
        [1.0, 0, 0]
    )
    assert np.allclose(points, expected)


@pytest.mark.parametrize("suffix", [".trc", ".bvh", ".c3d"])
def test_formats_of_constant_rate_take_uneven_motions(tmp_path, suffix):
    export_motion(tmp_path / f"a{suffix}", make_motion(time=uneven_time(60)), SIZE)
    assert (tmp_path / f"a{suffix}").stat().st_size > 1000


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
