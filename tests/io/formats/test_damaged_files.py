"""Whatever is wrong with a file, its reader says so in one line that names the file."""

import json
import struct
import zipfile
from fractions import Fraction
from functools import partial

import av
import numpy as np
import pytest
from bvh_files import bvh_text
from small_motion import make_motion

from keyrecon import KeyreconError
from keyrecon.body import LSP14, read_skeleton
from keyrecon.io.formats.annotations import read_annotations
from keyrecon.io.formats.c3d import write_c3d
from keyrecon.io.formats.clicks import read_clicks
from keyrecon.io.formats.ground_marks import read_ground_marks
from keyrecon.io.formats.mocap import read_capture
from keyrecon.io.formats.model_file import (
    BUILT_IN_DEPTH_MODEL,
    BUILT_IN_SWING_PRIOR,
    read_depth_model,
    read_motion_model,
)
from keyrecon.io.formats.motion_file import read_motion, write_motion
from keyrecon.io.formats.picks import read_picks
from keyrecon.io.storage import load_record, save_record
from keyrecon.io.video import open_video
from keyrecon.metrics import read_truth

read_marks = partial(read_annotations, skeleton=LSP14, n_frames=100, size=(640, 480))


def refused(read, path, words=""):
    """What a reader says of a file that it does not take."""
    with pytest.raises(KeyreconError) as told:
        read(path)
    said = str(told.value)
    assert path.name in said and "\n" not in said and len(said) < 600, said
    assert words in said, said
    return said


COCO = {
    "images": [{"id": 1, "frame": 3, "width": 640, "height": 480}],
    "annotations": [{"image_id": 1, "category_id": 1, "keypoints": [5, 5, 2]}],
    "categories": [{"id": 1, "keypoints": ["neck"], "skeleton": []}],
}
DLC = "scorer,me,me\nbodyparts,neck,neck\ncoords,x,y\nimg3.png,5,5\n"
CVAT = (
    '<annotations><image name="f_3.png" width="640" height="480"><skeleton label="p">'
    '<points label="neck" points="5,5"/></skeleton></image></annotations>'
)
CLICKED = {"head_top": [50, 10], "root": [50, 60], "right_knee": [45, 80], "left_knee": [55, 80]}
CLICKED |= {"right_ankle": [45, 100], "left_ankle": [55, 100]}
CLICKS = {"keyrecon_golf_clicks": 1, "frame": 0, "size": [200, 200], "joints": CLICKED}
PICKS = {"picks": [{"frame": 0, "part": "head", "x": 1.5, "y": 2}]}
POST = {"kind": "vertical", "frame": 3, "ends": [[2.5, 1.0], [2.5, 9.0]], "metres": 2.44}
GROUND = {"field_of_view": None, "marks": [POST]}
SKELETON = {
    "joints": [
        {"name": "neck", "parent": None, "length": 0},
        {"name": "hip", "parent": "neck", "length": 0.3},
    ],
    "lower": ["hip"],
}
TEXTS = {
    "coco": (read_marks, json.dumps(COCO)),
    "dlc": (read_marks, DLC),
    "cvat": (read_marks, CVAT),
    "clicks": (read_clicks, json.dumps(CLICKS)),
    "picks": (read_picks, json.dumps(PICKS)),
    "skeleton": (read_skeleton, json.dumps(SKELETON)),
    "ground": (read_ground_marks, json.dumps(GROUND)),
}


@pytest.mark.parametrize("name", TEXTS)
def test_the_whole_files_are_read(tmp_path, name):
    read, text = TEXTS[name]
    (tmp_path / name).write_text(text)
    assert read(tmp_path / name) is not None


@pytest.mark.parametrize("number", ["1e999", "9" * 400, "NaN", "-Infinity", '"x"', "null", "[" * 9])
@pytest.mark.parametrize("name", ["coco", "clicks", "picks", "skeleton", "ground"])
def test_a_number_in_json_that_is_none_is_refused(tmp_path, name, number):
    read, text = TEXTS[name]
    places = {"coco": "[5, 5", "clicks": "[45, 80]", "picks": "1.5", "skeleton": "0.3"}
    place = (places | {"ground": "9.0"})[name]
    (tmp_path / name).write_text(text.replace(place, number, 1))
    refused(read, tmp_path / name)


@pytest.mark.parametrize("damage", [b"\xff", b"[" * 10**5, b"", b"\x00" * 50, b"{", b'{"a": 1}'])
@pytest.mark.parametrize("name", TEXTS)
def test_a_text_that_is_another_is_refused(tmp_path, name, damage):
    read, text = TEXTS[name]
    (tmp_path / name).write_bytes(text.encode()[:20] + damage)
    refused(read, tmp_path / name)
    (tmp_path / name).write_bytes(damage)
    refused(read, tmp_path / name)


@pytest.mark.parametrize("size", ["1e999", "9" * 400, "640.5", "true"])
def test_a_size_of_pictures_that_is_none_is_refused(tmp_path, size):
    (tmp_path / "a.json").write_text(json.dumps(COCO).replace("640", size, 1))
    refused(read_marks, tmp_path / "a.json")


def test_a_row_of_deeplabcut_that_names_no_picture_is_told(tmp_path):
    (tmp_path / "a.csv").write_text(DLC.replace("img3.png,5,5", ",5,5"))
    refused(read_marks, tmp_path / "a.csv", "names no picture")


def test_an_encoding_that_nobody_knows_is_told(tmp_path):
    (tmp_path / "a.xml").write_text(f'<?xml version="1.0" encoding="klingon"?>{CVAT}')
    refused(read_marks, tmp_path / "a.xml", "is not a CVAT XML 1.1 file")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"length": float("nan")}, "NaN is not a number"),
        ({"length": -0.3}, "-0.3 statures"),
        ({"length": 0}, "0 statures"),
        ({"name": "neck"}, "is there twice"),
        ({"name": 5}, "5 is not the name of a joint"),
        ({"name": " "}, "is not the name of a joint"),
        ({"parent": "knee"}, "is not a skeleton file"),
        ({"parent": "hip"}, "one tree"),
    ],
)
def test_a_skeleton_that_nobody_has_is_refused(tmp_path, change, words):
    joints = [SKELETON["joints"][0], SKELETON["joints"][1] | change]
    lower = [joints[1]["name"]]
    (tmp_path / "s.json").write_text(json.dumps({"joints": joints, "lower": lower}))
    refused(read_skeleton, tmp_path / "s.json", words)


@pytest.mark.parametrize("lower", [[], ["neck", "hip"], ["toe"], 5])
def test_a_skeleton_has_an_upper_and_a_lower_body(tmp_path, lower):
    (tmp_path / "s.json").write_text(json.dumps(SKELETON | {"lower": lower}))
    refused(read_skeleton, tmp_path / "s.json")


def test_pipes_and_folders_are_no_files(tmp_path):
    import os

    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    readers = [read for read, _ in TEXTS.values()]
    for read in (*readers, read_motion, read_truth, read_depth_model, read_capture, open_video):
        refused(read, tmp_path / "pipe")
        refused(read, tmp_path / "folder")


# --- arrays


@pytest.fixture(scope="module")
def arrays(tmp_path_factory):
    """Files of arrays and their readers."""
    folder = tmp_path_factory.mktemp("arrays")
    motion = make_motion(20)
    write_motion(folder / "motion.npz", motion)
    truth = {"points3d": motion.points3d, "points2d": motion.points2d, "fps": np.array(50.0)}
    np.savez(folder / "truth.npz", joint_names=np.array(LSP14.names), **truth)
    save_record(folder / "cache.npz", motion)
    for name, file in (("depths", BUILT_IN_DEPTH_MODEL), ("prior", BUILT_IN_SWING_PRIOR)):
        (folder / f"{name}.npz").write_bytes(file.read_bytes())
    return folder


ARRAYS = {
    "motion": read_motion,
    "truth": read_truth,
    "cache": load_record,
    "depths": read_depth_model,
    "prior": read_motion_model,
}


def encrypted(data):
    places = [m for m in range(len(data) - 4) if data[m : m + 4] == b"PK\x01\x02"]
    for place in places:
        data[place + 8] |= 1


def method_99(data):
    for start, offset in ((b"PK\x01\x02", 10), (b"PK\x03\x04", 8)):
        place = data.find(start)
        data[place + offset : place + offset + 2] = struct.pack("<H", 99)


def flipped(data):
    data[len(data) // 2] ^= 0x55
    data[200] ^= 0x55


def cut(data):
    del data[len(data) // 3 :]


@pytest.mark.parametrize("damage", [encrypted, method_99, flipped, cut])
@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_that_are_damaged_are_refused(arrays, tmp_path, name, damage):
    data = bytearray((arrays / f"{name}.npz").read_bytes())
    damage(data)
    (tmp_path / "a.npz").write_bytes(data)
    refused(ARRAYS[name], tmp_path / "a.npz")


@pytest.mark.parametrize("name", ARRAYS)
def test_one_array_alone_and_a_header_of_eight_gigabytes_are_refused(arrays, tmp_path, name):
    np.save(tmp_path / "a.npy", np.zeros(3))
    refused(ARRAYS[name], (tmp_path / "a.npy").rename(tmp_path / "a.npz"), "another format")
    header = str({"descr": "<f8", "fortran_order": False, "shape": (1 << 30,)}).encode()
    member = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header) + 1) + header + b"\n" + b"\0" * 80
    with zipfile.ZipFile(arrays / f"{name}.npz") as whole:
        names = whole.namelist()
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        for one in names:
            archive.writestr(one, member)
    refused(ARRAYS[name], tmp_path / "a.npz", "not as long as it says")


@pytest.mark.parametrize(
    ("name", "array", "value"),
    [
        ("motion", "points3d", np.nan),
        ("motion", "points2d", np.inf),
        ("motion", "scale", 0.0),
        ("motion", "time", 0.0),
        ("motion", "fps", np.nan),
        ("motion", "keyframes", 99),
        ("motion", "parents", 3),
        ("motion", "points3d", "x"),
        ("motion", "source", 0.5),
        ("motion", "units", "yards"),
        ("truth", "points3d", np.nan),
        ("truth", "fps", -1.0),
        ("truth", "joint_names", 3.0),
        ("motion", "joint_names", 3.0),
        ("motion", "joint_names", "neck"),
        ("motion", "mirrored", 99),
        ("depths", "weights1", np.nan),
        ("prior", "mean", np.inf),
        ("prior", "centre", 0.0),
        ("prior", "keys", 0.5),
    ],
)
def test_values_that_nothing_has_are_refused(arrays, tmp_path, name, array, value):
    with np.load(arrays / f"{name}.npz") as stored:
        content = dict(stored)
    content[array] = np.full_like(content[array], value, dtype=np.asarray(value).dtype)
    np.savez(tmp_path / "a.npz", **content)
    refused(ARRAYS[name], tmp_path / "a.npz")


@pytest.mark.parametrize(("name", "array"), [("depths", "weights1"), ("prior", "components")])
def test_models_of_another_shape_are_refused(arrays, tmp_path, name, array):
    with np.load(arrays / f"{name}.npz") as stored:
        content = dict(stored)
    content[array] = content[array][..., :-1]
    np.savez(tmp_path / "a.npz", **content)
    refused(ARRAYS[name], tmp_path / "a.npz")


# --- motion capture


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("CHANNELS 6", "CHANNELS -2", "CHANNELS -2"),
        ("CHANNELS 6", "CHANNELS 99999999999", "is not a whole BVH file"),
        ("Zrotation Xrotation Yrotation", "Zrotation Zrotation Yrotation", "cannot have"),
        ("Frame Time: 0.0083333", "Frame Time: 1e300", "cannot take"),
        ("OFFSET 0.0 53.0", "OFFSET nan 53.0", "no numbers"),
    ],
)
def test_a_bvh_that_is_damaged_is_refused(tmp_path, old, new, words):
    text, _ = bvh_text()
    assert old in text
    (tmp_path / "a.bvh").write_text(text.replace(old, new))
    refused(read_capture, tmp_path / "a.bvh", words)


ASF = """:version 1.10
:root
 order TX TY TZ RX RY RZ
:bonedata
 begin
  name hip
  direction 0 1 0
  length 5
  axis 0 0 0 XYZ
  dof rx
 end
:hierarchy
 begin
  root hip
 end
"""
AMC = ":DEGREES\n1\nroot 0 0 0 0 0 0\nhip 5\n"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (" order TX TY TZ RX RY RZ\n", "", "no 'order'"),
        ("TX TY TZ RX RY RZ", "TX TY", "no 'order'"),
        ("root hip", "hip hip", "before its parent"),
        ("length 5", "length nan", "numbers"),
        ("axis 0 0 0 XYZ", "axis 0 0 0", "is not a whole ASF/AMC pair"),
    ],
)
def test_an_asf_that_is_damaged_is_refused(tmp_path, old, new, words):
    (tmp_path / "a.amc").write_text(AMC)
    (tmp_path / "a.asf").write_text(ASF.replace(old, new))
    refused(read_capture, tmp_path / "a.amc", words)


@pytest.fixture(scope="module")
def c3d_file(tmp_path_factory):
    pytest.importorskip("c3d")
    path = tmp_path_factory.mktemp("c3d") / "a.c3d"
    write_c3d(path, make_motion(200))
    return path


@pytest.mark.parametrize("size", [0, 3, 511, 750, 1500, 0.2, 0.9])
def test_a_c3d_that_was_cut_off_is_refused(c3d_file, tmp_path, size):
    data = c3d_file.read_bytes()
    short = data[: size if isinstance(size, int) else round(size * len(data))]
    (tmp_path / "a.c3d").write_bytes(short)
    said = refused(read_capture, tmp_path / "a.c3d", "is not a whole C3D file")
    assert isinstance(size, int) or "it tells of 200 frames and holds" in said


def test_a_c3d_whose_bytes_are_flipped_is_refused_or_read(c3d_file, tmp_path):
    data = c3d_file.read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(60):
        damaged = bytearray(data)
        damaged[rng.integers(1500)] ^= 1 << rng.integers(8)
        (tmp_path / "a.c3d").write_bytes(damaged)
        refused(read_capture, tmp_path / "a.c3d")  # it has not the markers of a captured person


# --- video


def test_a_picture_is_no_video(tmp_path):
    import cv2

    for suffix in ("jpg", "png"):
        picture = cv2.imencode(f".{suffix}", np.zeros((64, 64, 3), np.uint8))[1]
        path = tmp_path / f"a.{suffix}"
        path.write_bytes(picture.tobytes())
        refused(open_video, path, "picture")
        refused(open_video, path.rename(tmp_path / f"{suffix}.mp4"), "picture")


def test_an_end_of_zero_leaves_no_frame(write_numbered):
    with pytest.raises(KeyreconError, match="up to before frame 0"):
        open_video(write_numbered("v.mp4", list(range(0, 240, 12))), end=0)


def test_pictures_that_all_have_one_time_are_no_video(write_numbered, tmp_path):
    data = bytearray(write_numbered("v.mp4", list(range(0, 240, 12)), {"bf": "0"}).read_bytes())
    durations = data.find(b"stts")  # of the frames: version, number of entries, (count, duration)
    data[durations + 16 : durations + 20] = bytes(4)
    path = tmp_path / "still.mp4"
    path.write_bytes(data)
    refused(open_video, path, "have a time of their own")


def encode(width, first):
    """Packets of six pictures of a width, from a frame on."""
    options = {"tune": "zerolatency"}
    encoder = av.CodecContext.create("libx264", "w")
    encoder.width, encoder.height, encoder.pix_fmt = width, 64, "yuv420p"
    encoder.time_base, encoder.framerate, encoder.options = Fraction(1, 25), Fraction(25), options
    for number in range(first, first + 6):
        picture = np.full((64, width, 3), 10 * number, np.uint8)
        frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
        frame.pts, frame.time_base = number, Fraction(1, 25)
        yield from encoder.encode(frame)
    yield from encoder.encode()


def test_a_video_whose_pictures_change_size_says_from_where_on(tmp_path):
    with av.open(str(tmp_path / "sizes.ts"), "w", format="mpegts") as container:
        stream = container.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 64, "yuv420p"
        for packet in (*encode(64, 0), *encode(128, 6)):
            packet.stream = stream
            container.mux(packet)
    video = open_video(tmp_path / "sizes.ts")
    assert len(list(video.frames(0, 6))) == 6
    with pytest.raises(KeyreconError, match=r"from frame 6 on the pictures are 128x64"):
        list(video.frames())


def test_a_video_changed_anywhere_is_another(tmp_path):
    from keyrecon.io.fingerprint import fingerprint_file, has_fingerprint

    data = bytearray(np.random.default_rng(0).bytes(5 << 20))
    (tmp_path / "a").write_bytes(data)
    before = fingerprint_file(tmp_path / "a")
    assert has_fingerprint(tmp_path / "a", before)
    for place in (0, 2_500_000, len(data) - 1):
        changed = data.copy()
        changed[place] ^= 1
        (tmp_path / "b").write_bytes(changed)
        assert not has_fingerprint(tmp_path / "b", before)


def test_an_avi_whose_index_is_damaged_is_read_or_refused(tmp_path, write_numbered):
    whole = write_numbered("v.avi", list(range(0, 240, 12)), {"g": "5"}, codec="mpeg4")
    data = bytearray(whole.read_bytes())
    place = data.rfind(b"idx1")
    rng = np.random.default_rng(1)
    for _ in range(10):
        damaged = data.copy()
        for where in rng.integers(place + 8, len(data), 12):
            damaged[where] = rng.integers(256)
        (tmp_path / "d.avi").write_bytes(damaged)
        try:
            list(open_video(tmp_path / "d.avi").frames())
        except KeyreconError as fault:
            assert "d.avi" in str(fault)
