"""Clicks and marks of a golf swing: kept, undone, and in the files that the fit reads."""

import json

import pytest
from annotator_edits import edit, golf, golf_click, key_posture, mark, shaft, submit

from keyrecon.annotate.store.journal import NotSaved
from keyrecon.errors import KeyreconError
from keyrecon.golf.clicks import GolfClicks
from keyrecon.io.formats.clicks import read_some_clicks, write_clicks
from keyrecon.io.workspace import Workspace

JOINTS = {
    "head_top": (60.0, 4.0), "root": (60.0, 30.0), "right_knee": (55.0, 45.0),
    "left_knee": (66.0, 45.0), "right_ankle": (54.0, 60.0), "left_ankle": (67.0, 60.0),
}  # fmt: skip


@pytest.fixture
def bare(bare):
    """The folder of a golf project."""
    file = bare / "project.toml"
    file.write_text(f'kind = "golf"\n{file.read_text()}')
    return bare


def click_all(store):
    submit(store, golf("frame", 7.0), golf("left_handed", True), golf("stature", 1.83))
    submit(store, *(golf_click(name, [*place, 2]) for name, place in JOINTS.items()))


def test_clicks_are_in_the_file_that_the_fit_reads(open_store, bare):
    store = open_store()
    click_all(store)
    submit(store, golf_click("left_knee", [67, 45, 1], was=[66, 45, 2]))
    clicks = read_some_clicks(bare / "golf_clicks.json")
    wanted = GolfClicks(7, (128, 64), {**JOINTS, "left_knee": (67, 45)}, ("left_knee",), True, 1.83)
    assert clicks == wanted
    assert open_store().state.cells == store.state.cells
    store = open_store()
    store.undo("u")
    assert read_some_clicks(bare / "golf_clicks.json").joints == JOINTS


def test_clicks_of_a_file_come_in_and_nothing_of_it_is_lost(open_store, bare):
    file = bare / "golf_clicks.json"
    write_clicks(file, GolfClicks(3, (128, 64), JOINTS, focal=150.0, principal=(64.0, 30.0)))
    by_hand = file.read_text().replace("{\n", '{ "by": "hand",\n', 1)
    file.write_text(by_hand)
    store = open_store()
    assert store.state.cells["golf", "frame"] == 3
    assert file.read_text() == by_hand
    submit(store, golf("stature", 1.7))
    assert (bare / "golf_clicks.old-1.json").read_text() == by_hand
    told = read_some_clicks(file)
    assert (told.focal, told.principal, told.stature) == (150.0, (64.0, 30.0), 1.7)
    write_clicks(file, GolfClicks(4, (128, 64), JOINTS))
    store.refresh()
    assert store.state.cells["golf", "frame"] == 4
    store.undo("u")
    assert read_some_clicks(file) == told


def test_joints_club_and_key_postures_are_marks_of_the_fit(open_store, bare):
    store = open_store()
    submit(store, mark(9, "left_wrist", [40.5, 20, 2]), mark(9, "neck", [0, 0, 0]))
    submit(store, shaft(9, [40, 21, 70, 5]), key_posture("top", 9), key_posture("hit", 14))
    submit(store, shaft(3, [1, 2, 3, 4]))
    assert json.loads((bare / "golf_marks.json").read_text()) == {
        "keyrecon_golf_marks": 1,
        "size": [128, 64],
        "keys": {"top": 9, "hit": 14},
        "frames": [
            {"frame": 3, "joints": {}, "shaft": [[1, 2], [3, 4]]},
            {"frame": 9, "joints": {"left_wrist": [40.5, 20]}, "shaft": [[40, 21], [70, 5]]},
        ],
    }
    assert open_store().state.cells == store.state.cells


def test_marks_that_another_program_writes_come_in(open_store, bare):
    store, file = open_store(), bare / "golf_marks.json"
    submit(store, mark(9, "left_wrist", [40.5, 20, 1]), mark(9, "neck", [0, 0, 0]))
    content = json.loads(file.read_text())
    content["keys"]["top"] = 8.5
    content["frames"].append({"frame": 11, "joints": {"neck": [5, 6]}, "shaft": [[1, 2], [3, 4]]})
    file.write_text(json.dumps(content))
    store.refresh()
    assert store.state.cells == {
        ("mark", 9, "left_wrist"): [40.5, 20, 1],
        ("mark", 9, "neck"): [0, 0, 0],
        ("mark", 11, "neck"): [5, 6, 2],
        ("shaft", 11): [1, 2, 3, 4],
        ("key", "top"): 8.5,
    }
    assert '"neck"' in (bare / "annotations.json").read_text()
    file.write_text("{}")
    with pytest.raises(NotSaved, match="cannot be read"):
        store.refresh()
    assert len(store.state.cells) == 5


def test_a_key_posture_between_two_frames_is_moved_cleared_and_put_back(open_store, bare):
    file = bare / "golf_marks.json"
    file.write_text('{"keyrecon_golf_marks": 1, "size": [128, 64], "keys": {"top": 8.5}}')
    store = open_store()
    for was, to in ((8.5, 9), (9, 8.5), (8.5, None)):
        assert submit(store, key_posture("top", to, was=was))[0]["ok"]
        assert json.loads(file.read_text())["keys"] == ({"top": to} if to else {})
    assert submit(store, key_posture("top", -0.5))[0]["status"] == 400


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (golf_click("nose", [3, 3, 2]), "no joint 'nose'"),
        (golf_click("root", [300, 3, 2]), "too far off the picture"),
        (shaft(100, [1, 2, 3, 4]), "Frame 100 is outside"),
        (shaft(3, [1, 2, 3, 400]), "too far off the picture"),
        (key_posture("top", 100), "Frame 100 is outside"),
        (golf("frame", 100), "Frame 100 is outside"),
        (golf("stature", -1), "height in metres cannot be -1"),
        (golf("left_handed", 1.5), "true or false"),
    ],
)
def test_what_cannot_be_is_refused(open_store, bare, wrong, message):
    answer = submit(open_store(), wrong)[0]
    assert answer["status"] == 400
    assert message in answer["error"]
    assert not (bare / "golf_clicks.json").exists()
    assert not (bare / "golf_marks.json").exists()


def test_a_project_of_another_kind_gets_no_golf_files(open_store, bare):
    (bare / "project.toml").write_text('[video]\npath = "v.mp4"\nfingerprint = "x"\n')
    submit(open_store(), mark(9, "neck", [4, 5, 2]))
    assert not (bare / "golf_marks.json").exists()


def test_a_project_that_becomes_a_swing_while_it_is_open_gets_its_files(open_store, bare):
    (bare / "project.toml").write_text('[video]\npath = "v.mp4"\nfingerprint = "x"\n')
    store = open_store()
    submit(store, mark(9, "neck", [4, 5, 2]))
    Workspace(bare).become_golf()
    click_all(store)
    submit(store, shaft(9, [40, 21, 70, 5]))
    assert read_some_clicks(bare / "golf_clicks.json").joints == JOINTS
    marks = json.loads((bare / "golf_marks.json").read_text())
    shown = {"frame": 9, "joints": {"neck": [4, 5]}, "shaft": [[40, 21], [70, 5]]}
    assert marks["frames"] == [shown]
    assert open_store().state.cells == store.state.cells


def test_a_project_file_that_somebody_is_changing_holds_up_no_edit(open_store, bare):
    store, file = open_store(), bare / "project.toml"
    text = file.read_text()
    file.write_text(text[:-5])
    assert submit(store, mark(9, "neck", [4, 5, 2]))[0]["ok"]
    file.write_text(text)
    assert open_store().state.cells == {("mark", 9, "neck"): [4, 5, 2]}


def test_clicks_that_a_fit_brings_into_an_open_project_come_in(open_store, bare):
    (bare / "project.toml").write_text('[video]\npath = "v.mp4"\nfingerprint = "x"\n')
    store = open_store()
    write_clicks(bare / "golf_clicks.json", GolfClicks(3, (128, 64), JOINTS))
    submit(store, golf("frame", 5, was=3))
    assert read_some_clicks(bare / "golf_clicks.json") == GolfClicks(5, (128, 64), JOINTS)


def test_a_whole_address_is_one_edit_that_is_taken_back_as_one(open_store, bare):
    parts = [golf("frame", 7), *(golf_click(n, [*p, 2]) for n, p in JOINTS.items())]
    store = open_store()
    assert submit(store, edit("group", edits=parts))[0]["ok"]
    store.undo("u")
    assert store.state.cells == {}
    with pytest.raises(KeyreconError):
        read_some_clicks(bare / "nothing.json")
