import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.annotation_checks import (
    canonical_name,
    frame_of_picture,
    implausible_bones,
    joints_outside,
)
from keyrecon.io.formats.annotations import read_annotations, read_marks_file
from keyrecon.io.formats.coco import annotations_to_coco, read_coco, write_coco
from keyrecon.records import Annotations

SIZE = (640, 360)
FRAMES = 200

FIGURE = np.array(  # a standing player 200 px tall, LSP14, seen from the front
    [[285, 300], [285, 250], [281, 200], [319, 200], [315, 250], [315, 300], [260, 215], [262, 175],
     [274, 138], [326, 138], [338, 175], [340, 215], [300, 136], [300, 102]], dtype=float
)  # fmt: skip


@pytest.fixture
def marked():
    rng = np.random.default_rng(0)
    frames = np.array([3, 50, 121])
    joints = FIGURE + rng.normal(0, 1, (3, 14, 2))
    joints[0, :6] = np.nan
    joints[1, 7] = np.nan
    visible = np.isfinite(joints).all(axis=2) & (rng.random((3, 14)) > 0.3)
    nearer = rng.integers(-1, 2, (3, 13))
    return Annotations(LSP14, frames, joints, visible, nearer)


def read(path):
    return read_annotations(path, LSP14, FRAMES, SIZE)


def assert_same(ours, theirs, tolerance=0.0):
    assert np.array_equal(ours.frames, theirs.frames)
    assert np.allclose(ours.joints, theirs.joints, atol=tolerance, rtol=0, equal_nan=True)


def test_marks_come_back_from_coco_unchanged(tmp_path, marked):
    write_coco(tmp_path / "a.json", marked, SIZE)
    back = read(tmp_path / "a.json")
    assert_same(back, marked)
    assert np.array_equal(back.visible, marked.visible)
    assert np.array_equal(back.nearer, marked.nearer)


def test_joints_that_a_person_looked_for_in_vain_come_back_from_coco(tmp_path, marked):
    said = ((3, "right_ankle"), (3, "right_knee"), (77, "neck"))
    write_coco(tmp_path / "a.json", replace(marked, absent=said), SIZE)
    back = read(tmp_path / "a.json")
    assert back.absent == said
    assert_same(back, marked)
    assert np.array_equal(back.nearer, marked.nearer)
    write_coco(tmp_path / "b.json", marked, SIZE)
    assert "absent" not in (tmp_path / "b.json").read_text()


def test_a_joint_that_is_placed_is_not_absent(tmp_path, marked):
    write_coco(tmp_path / "a.json", replace(marked, absent=((121, "neck"),)), SIZE)
    back = read(tmp_path / "a.json")
    assert back.absent == ()
    assert_same(back, marked)


def test_coco_holds_what_other_readers_expect(marked):
    data = annotations_to_coco(marked, SIZE)
    row = data["annotations"][0]
    v = row["keypoints"][2::3]
    assert row["num_keypoints"] == sum(n > 0 for n in v) == 8
    assert row["keypoints"][:3] == [0, 0, 0]
    assert len(row["attributes"]["nearer"]) == len(data["categories"][0]["skeleton"])
    for parent, child in data["categories"][0]["skeleton"]:
        assert LSP14.parents[child - 1] == parent - 1
    assert data["images"][2]["frame"] == 121


def spoilt(marked, path, change):
    """A COCO file of `marked` after `change` to its structure."""
    data = annotations_to_coco(marked, SIZE)
    change(data)
    path.write_text(json.dumps(data))
    return path


def set_in(*keys, value):
    def change(data):
        for key in keys[:-1]:
            data = data[key]
        data[keys[-1]] = value

    return change


FAULTS = {
    "frame 200 is outside the video, which has frames 0 to 199": set_in(
        "images", 0, "frame", value=200
    ),
    "frame -1 is outside": set_in("images", 0, "frame", value=-1),
    "'3' is not a frame number": set_in("images", 0, "frame", value="3"),
    "frame 3: the joint 'tail' is not in the skeleton": set_in(
        "categories", 0, "keypoints", 13, value="tail"
    ),
    "frame 50: 41 numbers in keypoints, but 14 joints need 42": lambda d: d["annotations"][1][
        "keypoints"
    ].pop(),
    "frame 50: right_ankle has visibility 3": set_in("annotations", 1, "keypoints", 2, value=3),
    "frame 50: right_ankle is at .*far outside": set_in(
        "annotations", 1, "keypoints", 0, value=9e4
    ),
    "frame 3: the joint 'tail' is not in": set_in(
        "annotations", 0, "attributes", "absent", value=["tail"]
    ),
    "NaN is not a number": set_in("annotations", 1, "keypoints", 0, value=float("nan")),
    "Infinity is not a number": set_in("annotations", 1, "keypoints", 0, value=float("inf")),
    "not a COCO keypoints file": set_in("annotations", 1, "keypoints", 0, value="x"),
    "no 'images'": lambda d: d.pop("images"),
    "image 77, which is not": set_in("annotations", 0, "image_id", value=77),
    "made on pictures of 1280x720, the video has 640x360": set_in(
        "images", 0, value={"id": 3, "frame": 3, "width": 1280, "height": 720}
    ),
    "frame 3: 1 numbers in nearer": set_in("annotations", 0, "attributes", "nearer", value=[1]),
    "nearer of neck - right_hip is 5": set_in("annotations", 0, "attributes", "nearer", 0, value=5),
    "the limb 99-1 names joints": set_in("categories", 0, "skeleton", 0, value=[99, 1]),
    "frame 50: right_ankle is marked twice": lambda d: d["annotations"].append(
        {**d["annotations"][1], "keypoints": [5, 5, 2, *d["annotations"][1]["keypoints"][3:]]}
    ),
}


@pytest.mark.parametrize("message", FAULTS)
def test_a_fault_in_coco_is_named(tmp_path, marked, message):
    path = spoilt(marked, tmp_path / "a.json", FAULTS[message])
    with pytest.raises(KeyreconError, match=message):
        read(path)


@pytest.mark.parametrize("text", ["{", '{"images": 3}', "{" + '"a":[' * 100_000, '{"a": 1e999}'])
def test_json_of_another_kind_is_refused(tmp_path, text):
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(KeyreconError, match="not a COCO keypoints file"):
        read(tmp_path / "a.json")


def test_the_end_of_the_picture_name_is_the_frame_where_none_is_given(tmp_path, marked):
    def rename(data):
        for image in data["images"]:
            image["file_name"] = f"somewhere/img{image.pop('frame'):04d}.png"

    assert_same(read(spoilt(marked, tmp_path / "a.json", rename)), marked)


@pytest.mark.parametrize(
    ("name", "frame"),
    [
        ("somewhere/img0123.png", 123),
        ("frame_22_v2.png", 22),
        ("frame_000022 (1).png", 22),
        ("frame2_000022.png", 22),
        ("frame30fps_0022.png", 22),
        ("frame_000022_png.rf.7f3a9b12.jpg", 22),
        ("22.png.rf.7f3a9b12.jpg", 22),
        ("IMG_20240512_22.jpeg", 22),
        ("rally_1280x720_3.png", 3),
        (r"C:\marks\keyframe_7.PNG", 7),
    ],
)
def test_a_pictures_name_tells_its_frame(name, frame):
    assert frame_of_picture(name, Path("a.json")) == frame


def renamed(marked, path, *names):
    def rename(data):
        for image, name in zip(data["images"], names, strict=True):
            del image["frame"]
            image["file_name"] = name

    return spoilt(marked, path, rename)


def test_names_of_pictures_that_tell_one_frame_are_blamed(tmp_path, marked):
    path = renamed(marked, tmp_path / "a.json", "rally_3_v2.png", "rally_50_v2.png", "x_3.png")
    with pytest.raises(
        KeyreconError, match=r"'rally_3_v2\.png' and 'rally_50_v2\.png' both say frame 2"
    ):
        read(path)
    extra = [["labeled-data", "vid", "003.png", *["5.0"] * 28]]
    with pytest.raises(KeyreconError, match=r"'img0003\.png' and '003\.png' both say frame 3"):
        read(write_dlc(tmp_path / "c.csv", marked, extra=extra))


def test_a_frame_that_the_video_lacks_is_named_with_the_picture_that_says_it(tmp_path, marked):
    path = renamed(marked, tmp_path / "a.json", "a_3.png", "IMG_20240512.png", "a_4.png")
    with pytest.raises(
        KeyreconError, match=r"frame 20240512 \(so says 'IMG_20240512\.png'\) is outside the video"
    ):
        read(path)


def test_frames_that_the_file_itself_tells_are_not_from_names(tmp_path, marked):
    write_coco(tmp_path / "a.json", marked, SIZE)
    assert read_marks_file(tmp_path / "a.json", LSP14, FRAMES, SIZE).pictures == {}
    path = renamed(marked, tmp_path / "b.json", "x/a3.png", "x/a50.png", "a121.png")
    pictures = read_marks_file(path, LSP14, FRAMES, SIZE).pictures
    assert pictures == {3: "a3.png", 50: "a50.png", 121: "a121.png"}


def test_signs_follow_their_limb_when_the_file_names_it_child_first(tmp_path, marked):
    def reverse(data):
        limbs = data["categories"][0]["skeleton"]
        data["categories"][0]["skeleton"] = [limb[::-1] for limb in limbs]
        for row in data["annotations"]:
            row["attributes"]["nearer"] = [-n for n in row["attributes"]["nearer"]]

    back = read(spoilt(marked, tmp_path / "a.json", reverse))
    assert np.array_equal(back.nearer, marked.nearer)


def test_joints_are_matched_by_name_in_any_order(tmp_path, marked):
    def shuffle(data):
        category = data["categories"][0]
        order = np.random.default_rng(1).permutation(14)
        place = np.argsort(order) + 1
        category["keypoints"] = [category["keypoints"][j] for j in order]
        category["skeleton"] = [
            [int(place[a - 1]), int(place[b - 1])] for a, b in category["skeleton"]
        ]
        for row in data["annotations"]:
            triples = np.array(row["keypoints"]).reshape(-1, 3)[order].tolist()
            row["keypoints"] = [n for x, y, v in triples for n in (x, y, int(v))]

    back = read(spoilt(marked, tmp_path / "a.json", shuffle))
    assert_same(back, marked)
    assert np.array_equal(back.nearer, marked.nearer)


def test_a_joint_that_nobody_marked_may_be_unknown(tmp_path, marked):
    def add_nose(data):
        data["categories"][0]["keypoints"].append("nose")
        for row in data["annotations"]:
            row["keypoints"] += [0, 0, 0]

    assert_same(read(spoilt(marked, tmp_path / "a.json", add_nose)), marked)


def test_writing_never_leaves_half_a_file(tmp_path, marked, monkeypatch):
    path = tmp_path / "a.json"
    write_coco(path, marked, SIZE)
    before = path.read_bytes()

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("keyrecon.io.durable.os.fsync", fail)
    with pytest.raises(KeyreconError, match="No space left"):
        write_coco(path, replace(marked, joints=marked.joints + 1), SIZE)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.json"]


@pytest.mark.parametrize(
    "spelling", ["right_knee", "RightKnee", "RKnee", "knee_right", "Right Knee", "r-knee", "knee R"]
)
def test_common_spellings_of_a_joint_are_one(spelling):
    assert canonical_name(spelling) == "right_knee"


def write_dlc(path, marked, single_column=False, individuals=None, extra=()):
    names = marked.skeleton.names
    lead = 1 if single_column else 3
    heading = [["scorer", *[""] * (lead - 1), *["me"] * (2 * len(names))]]
    if individuals:
        heading.append(["individuals", *[""] * (lead - 1), *individuals])
    heading.append(["bodyparts", *[""] * (lead - 1), *(n for n in names for _ in "xy")])
    heading.append(["coords", *[""] * (lead - 1), *["x", "y"] * len(names)])
    rows = []
    for frame, joints in zip(marked.frames, marked.joints, strict=True):
        where = ["labeled-data", "vid", f"img{frame:04d}.png"]
        values = ["" if np.isnan(n) else f"{n:.4f}" for n in joints.ravel()]
        rows.append(["/".join(where), *values] if single_column else where + values)
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([*heading, *rows, *extra])
    return path


@pytest.mark.parametrize("single_column", [False, True])
def test_marks_come_back_from_deeplabcut(tmp_path, marked, single_column):
    back = read(write_dlc(tmp_path / "CollectedData_me.csv", marked, single_column))
    assert_same(back, marked, 1e-4)
    assert np.array_equal(back.visible, np.isfinite(marked.joints).all(axis=2))
    assert not back.nearer.any()


def test_one_individual_of_deeplabcut_is_read_and_two_are_refused(tmp_path, marked):
    one = write_dlc(tmp_path / "one.csv", marked, individuals=["anna"] * 28)
    assert_same(read(one), marked, 1e-4)
    two = write_dlc(tmp_path / "two.csv", marked, individuals=["anna"] * 14 + ["ben"] * 14)
    with pytest.raises(KeyreconError, match="2 individuals"):
        read(two)


def test_unlikely_predictions_of_deeplabcut_are_no_marks(tmp_path):
    path = tmp_path / "predictions.csv"
    path.write_text(
        "scorer,net,net,net,net,net,net\nbodyparts,neck,neck,neck,RHip,RHip,RHip\n"
        "coords,x,y,likelihood,x,y,likelihood\n7,10,20,0.99,30,40,0.1\n"
    )
    back = read(path)
    assert back.frames.tolist() == [7]
    assert back.joints[0, LSP14.index("neck")].tolist() == [10, 20]
    assert np.isfinite(back.joints).sum() == 2


def test_faults_in_deeplabcut_files_are_named(tmp_path, marked):
    path = tmp_path / "c.csv"
    path.write_text("scorer,me,me\nbodyparts,neck,neck\n1,2,3\n")
    with pytest.raises(KeyreconError, match="no row coords"):
        read(path)
    path.write_text("scorer,me,me\nbodyparts,neck,neck\ncoords,x,y\npicture.png,2,3\n")
    with pytest.raises(KeyreconError, match=r"'picture.png' does not say which frame"):
        read(path)
    path.write_text("scorer,me,me\nbodyparts,neck,neck\ncoords,x,y\n1,2,three\n")
    with pytest.raises(KeyreconError, match="three"):
        read(path)
    path.write_text("scorer,me,me\nbodyparts,neck,neck\ncoords,x,y\n5,2,inf\n")
    with pytest.raises(KeyreconError, match="frame 5: neck is at"):
        read(path)


def cvat_points(annotations, row):
    lines = []
    for joint, name in enumerate(annotations.skeleton.names):
        x, y = annotations.joints[row, joint]
        outside, hidden = int(np.isnan(x)), int(not annotations.visible[row, joint])
        place = "0,0" if outside else f"{x:.2f},{y:.2f}"
        lines.append(
            f'<points label="{name}" outside="{outside}" occluded="{hidden}" keyframe="1" '
            f'points="{place}"/>'
        )
    return "".join(lines)


def write_cvat(path, marked, extra="", size=SIZE):
    figures = "".join(
        f'<skeleton frame="{frame}" keyframe="1">{cvat_points(marked, row)}</skeleton>'
        for row, frame in enumerate(marked.frames)
    )
    path.write_text(
        '<?xml version="1.0" encoding="utf-8"?><annotations><version>1.1</version><meta><task>'
        f"<original_size><width>{size[0]}</width><height>{size[1]}</height></original_size></task>"
        f'</meta><track id="0" label="person" source="manual">{figures}{extra}</track>'
        "</annotations>"
    )
    return path


def test_marks_come_back_from_cvat_tracks(tmp_path, marked):
    back = read(write_cvat(tmp_path / "a.xml", marked))
    assert_same(back, marked, 0.006)
    assert np.array_equal(back.visible, marked.visible)


def test_what_cvat_interpolated_is_no_mark(tmp_path, marked):
    between = (
        '<skeleton frame="60" keyframe="0"><points label="neck" outside="0" occluded="0" '
        'keyframe="0" points="1,2"/></skeleton>'
    )
    assert_same(read(write_cvat(tmp_path / "a.xml", marked, between)), marked, 0.006)


def test_marks_come_back_from_cvat_pictures(tmp_path, marked):
    images = "".join(
        f'<image id="{row}" name="frame_{frame:06d}.png" width="640" height="360">'
        f'<skeleton label="person">{cvat_points(marked, row)}</skeleton></image>'
        for row, frame in enumerate(marked.frames)
    )
    (tmp_path / "a.xml").write_text(f"<annotations>{images}</annotations>")
    assert_same(read(tmp_path / "a.xml"), marked, 0.006)


def test_faults_in_cvat_files_are_named(tmp_path, marked):
    path = tmp_path / "a.xml"
    with pytest.raises(KeyreconError, match="1920x1080, the video has 640x360"):
        read(write_cvat(path, marked, size=(1920, 1080)))
    path.write_text("<annotations>")
    with pytest.raises(KeyreconError, match="not a CVAT XML"):
        read(path)
    path.write_text("<html></html>")
    with pytest.raises(KeyreconError, match="holds <html>"):
        read(path)
    path.write_text("<annotations></annotations>")
    with pytest.raises(KeyreconError, match="no skeletons"):
        read(path)
    path.write_text('<!DOCTYPE a [<!ENTITY x "y">]><annotations>&x;</annotations>')
    with pytest.raises(KeyreconError, match="not a CVAT XML"):
        read(path)


def test_other_files_are_told_apart(tmp_path):
    path = tmp_path / "a"
    with pytest.raises(KeyreconError, match="is not a file that can be read"):
        read(path)
    path.write_text("hello")
    with pytest.raises(KeyreconError, match="no annotations that keyrecon knows"):
        read(path)
    path.write_bytes(b"\x89HDF\r\n")
    with pytest.raises(KeyreconError, match="HDF5"):
        read(path)


def standing(frames):
    joints = np.repeat(FIGURE[None], frames, axis=0)
    shape = joints.shape[:2]
    return Annotations(
        LSP14, np.arange(frames) * 10, joints, np.ones(shape, bool), np.zeros((frames, 13), int)
    )


def test_a_standing_figure_has_no_implausible_bones():
    assert implausible_bones(standing(5)) == []
    assert joints_outside(standing(5), SIZE) == []


def test_a_misplaced_joint_is_found_by_the_bones_it_stretches():
    marks = standing(5)
    marks.joints[2, LSP14.index("left_elbow")] += [90, 0]
    found = implausible_bones(marks)
    assert len(found) == 2
    assert all(text.startswith("frame 20: ") and "left_elbow" in text for text in found)


def test_marks_of_a_small_player_may_be_off_by_a_pixel():
    marks = standing(5)
    marks.joints[:] = marks.joints * 100 / np.ptp(FIGURE[:, 1])
    head, neck = LSP14.index("head_top"), LSP14.index("neck")
    trunk = marks.joints[:, neck] - marks.joints[:, head]
    marks.joints[2, head] -= 0.48 * trunk[2]  # nearly as long a head and neck as there may be
    marks.joints[2, head, 1] -= 1
    marks.joints[2, neck, 1] += 1
    assert implausible_bones(marks) == []


def test_foreshortened_limbs_do_not_make_the_others_look_long():
    marks = standing(5)
    marks.joints[2, [0, 1, 4, 5, 6, 7, 10, 11]] = FIGURE[[2, 2, 3, 3, 8, 8, 9, 9]]
    assert implausible_bones(marks) == []


def test_joints_outside_the_picture_are_named():
    marks = standing(2)
    marks.joints[1, LSP14.index("left_wrist")] = [700, 100]
    assert joints_outside(marks, SIZE) == ["frame 10: left_wrist is 61 px outside the picture."]


def test_the_reader_of_the_projects_own_file_is_the_same(tmp_path, marked):
    write_coco(tmp_path / "annotations.json", marked, SIZE)
    assert_same(read_coco(tmp_path / "annotations.json", LSP14, FRAMES, SIZE), marked)


@pytest.mark.parametrize("read_file", [read_coco, read_annotations])
def test_a_file_may_be_named_by_a_text(tmp_path, marked, read_file):
    write_coco(tmp_path / "marks.json", marked, SIZE)
    found = read_file(str(tmp_path / "marks.json"), LSP14, FRAMES, SIZE)
    assert (found.frames == marked.frames).all()
