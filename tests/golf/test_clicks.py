import json

import pytest

from keyrecon.errors import KeyreconError
from keyrecon.golf.clicks import (
    ADDRESS_HEIGHT,
    NEAREST_CAMERA,
    GolfClicks,
    check_clicks,
    clicked_pose,
)
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
        ({"joints": {**JOINTS, "root": (float("nan"), 160)}}, "NaN is not a number"),
        ({"joints": {**JOINTS, "left_ankle": (199, 298)}}, "left_knee and left_ankle are 0."),
        ({"joints": {**JOINTS, "right_knee": (0, 240)}}, "root and right_knee are 0."),
        ({"joints": {k: (30 + y / 2, 60 + x / 2) for k, (x, y) in JOINTS.items()}}, "on the side"),
        ({"joints": {k: (x, 299 - y) for k, (x, y) in JOINTS.items()}}, "from top to bottom"),
        ({"hidden": ["left_wrist"]}, "'left_wrist' is hidden but was not clicked"),
        ({"stature": -1}, "the stature is -1, but it is the player's height in metres"),
        ({"stature": 0}, "the stature is 0"),
        ({"stature": 180}, "the stature is 180"),
        ({"stature": float("nan")}, "NaN is not a number"),
        ({"stature": "tall"}, "not a file of golf clicks"),
        ({"focal": 0}, "the focal length is 0 px, .* lenses have 40 to 12000"),
        ({"focal": float("nan")}, "NaN is not a number"),
        ({"focal": -900}, "the focal length is -900"),
        ({"principal": [5000, 100]}, "principal point .5000, 100. is far outside"),
        ({"principal": [float("nan"), 100]}, "NaN is not a number"),
        ({"size": [0, 300]}, "pictures of 0 x 300 px do not exist"),
        ({"frame": 0.5}, "0.5 is not a whole number"),
        ({"frame": float("inf")}, "not a file of golf clicks"),
        ({"left_handed": "false"}, "'left_handed' is 'false'; it must be true or false"),
    ],
)
def test_a_file_that_cannot_start_a_fit_says_why(tmp_path, changes, message):
    with pytest.raises(KeyreconError, match=message):
        read_clicks(file_of(tmp_path, **changes))


def test_what_nobody_knows_may_be_left_out(tmp_path):
    size = [1280, 720]
    clicks = read_clicks(file_of(tmp_path, size=size, stature=None, focal=None, principal=None))
    assert clicks.stature == 1.75
    assert clicked_pose(clicks).camera.focal == 1.2 * 1280


def test_a_clip_cropped_to_the_player_was_not_filmed_from_beside_him():
    """His depth hardly changes his size, however narrow the picture is that was left of it."""
    pose = clicked_pose(GolfClicks(0, (200, 300), JOINTS))
    metres = pose.camera.focal * ADDRESS_HEIGHT * pose.stature / pose.height
    assert metres == pytest.approx(NEAREST_CAMERA)
    told = clicked_pose(GolfClicks(0, (200, 300), JOINTS, focal=250.0))
    assert told.camera.focal == 250


def test_the_same_clip_twice_as_large_was_filmed_from_as_far():
    larger = {name: (2 * x, 2 * y) for name, (x, y) in JOINTS.items()}
    one, two = (clicked_pose(GolfClicks(0, s, j)) for s, j in
                (((200, 300), JOINTS), ((400, 600), larger)))  # fmt: skip
    assert two.camera.focal == pytest.approx(2 * one.camera.focal)


def test_clicks_of_another_video_are_noticed():
    clicks = GolfClicks(30, (200, 300), JOINTS)
    with pytest.raises(KeyreconError, match="200 x 300 px, but this video has 100 x 150"):
        check_clicks(clicks, 100, (100, 150))
    with pytest.raises(KeyreconError, match=r"300 x 200 \(on its side\)"):
        check_clicks(clicks, 100, (300, 200))
    with pytest.raises(KeyreconError, match="frame 30, but the video has frames 0 to 19"):
        check_clicks(clicks, 20, (200, 300))
