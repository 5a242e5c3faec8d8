"""Clicks are looked at as they are made: what is missing, and what cannot be."""

from page_project import write_numbered_video

from keyrecon.app.pick_checks import implausible_picks, missing_parts
from keyrecon.app.project import add_picks, start
from keyrecon.io.workspace import Workspace
from keyrecon.records import Pick


def body(frame, head=(320, 100), feet=((300, 300), (340, 300))):
    points = [("head", head), *(("foot", foot) for foot in feet)]
    return [Pick(frame, part, float(x), float(y)) for part, (x, y) in points]


def test_what_is_missing_is_said_at_once_and_not_when_the_work_begins(tmp_path):
    start(write_numbered_video(tmp_path / "v.mp4"), tmp_path / "p")
    project = Workspace(tmp_path / "p")
    told = add_picks(project, [Pick(3, "head", 320.0, 100.0)])
    assert "Still missing: both feet" in told
    assert "--region shirt:X,Y" in told
    assert "Next:" not in told
    told = add_picks(project, [*body(5)[1:], Pick(3, "shirt", 320.0, 180.0)])
    assert told.endswith(f"Next: keyrecon keyframes {tmp_path / 'p'}")


def test_one_foot_asks_for_the_other():
    assert missing_parts(body(0)[:2]) == [
        "the other foot (--foot X,Y)",
        "a point on clothes or skin (--region shirt:X,Y)",
    ]


def test_a_head_far_from_where_the_feet_say_it_is_is_named_with_its_frame():
    right = [*body(0), *body(40), *body(80)]
    assert implausible_picks(right) == []
    assert implausible_picks([*right, *body(60, head=(320, 330))]) == [
        "Frame 60: the head was clicked lower than the feet; look there."
    ]
    (line,) = implausible_picks([*right, *body(60, head=(320, 270))])
    assert "Frame 60: head and feet were clicked 30 px apart" in line


def test_a_crouch_is_no_mistake():
    assert implausible_picks([*body(0), *body(40, head=(330, 195))]) == []
