import json

import pytest

from keyrecon.errors import KeyreconError
from keyrecon.golf.clicks import GolfClicks, check_clicks, clicked_pose
from keyrecon.io.formats.clicks import read_clicks, write_clicks

JOINTS = {
    "head_top": (100.0, 40.0),
    "root": (90.0, 160.0),
    "right_knee": (80.0, 220.0),
    "left_knee": (110.0, 220.0),
    "right_ankle": (78.0, 280.0),
    "left_ankle": (112.0, 280.0),
}


def file_of(tmp_path, **changes):
    path = tmp_path / "clicks.json"
    content = {"keyrecon_golf_clicks": 1, "frame": 0, "size": [200, 300], "joints": JOINTS}
    path.write_text(json.dumps(content | changes))
    return path


def test_clicks_survive_their_file(tmp_path):
    clicks = GolfClicks(3, (200, 300), JOINTS, ("left_knee",), True, 1.8, 900.0, (100.0, 140.0))
    write_clicks(tmp_path / "c.json", clicks)
    assert read_clicks(tmp_path / "c.json") == clicks


def test_the_root_lies_between_both_hips(tmp_path):
    joints = {name: place for name, place in JOINTS.items() if name != "root"}
    joints |= {"right_hip": (80, 160), "left_hip": (100, 160)}
    clicks = read_clicks(file_of(tmp_path, joints=joints))
    assert clicked_pose(clicks).place("root").tolist() == [90, 160]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"keyrecon_golf_clicks": 2}, "version 2"),
        ({"joints": {**JOINTS, "nose": (90, 40)}}, "'nose', which is no joint"),
        ({"joints": {"head_top": (100, 40)}}, "lacks a click on root and right_knee"),
        ({"joints": {**JOINTS, "root": (250, 160)}}, "root at .* outside the picture"),
        ({"joints": {**JOINTS, "root": (90, 290)}}, "from top to bottom"),
        ({"joints": {k: (90, 100 + y / 20) for k, (_, y) in JOINTS.items()}}, "12 px apart"),
        ({"joints": 7}, "not a file of golf clicks"),
    ],
)
def test_a_file_that_cannot_start_a_fit_says_why(tmp_path, changes, message):
    with pytest.raises(KeyreconError, match=message):
        read_clicks(file_of(tmp_path, **changes))


def test_clicks_of_another_video_are_noticed():
    clicks = GolfClicks(30, (200, 300), JOINTS)
    with pytest.raises(KeyreconError, match="200 x 300 px, but this video has 100 x 150"):
        check_clicks(clicks, 100, (100, 150))
    with pytest.raises(KeyreconError, match="frame 30, but the video has frames 0 to 19"):
        check_clicks(clicks, 20, (200, 300))
