"""What the page is told of a golf swing, and what it has done."""

import numpy as np
import pytest
from annotator import ask, open_project
from annotator_edits import golf, golf_click, key_posture, shaft

from keyrecon.annotate.assist.answers import make_assistant
from keyrecon.app.annotator import job_commands
from keyrecon.app.project import start
from keyrecon.io.provenance import golf_digest, is_fitted, note_fitted
from keyrecon.io.video_writer import write_video
from keyrecon.io.workspace import Workspace

SIZE = (320, 270)
JOINTS = {
    "head_top": (160, 40), "root": (160, 142), "right_knee": (142, 192), "left_knee": (178, 192),
    "right_ankle": (138, 240), "left_ankle": (182, 240),
}  # fmt: skip


@pytest.fixture
def session(tmp_path, write_pictures):
    folder = tmp_path / "swing"
    start(write_pictures(SIZE, 30), folder, golf=True)
    opened = open_project(folder, make_assistant(Workspace(folder)), job_commands(folder))
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def write_pictures(tmp_path_factory):
    def write(size, count):
        path = tmp_path_factory.mktemp("v") / "grey.mp4"
        picture = np.full((size[1], size[0], 3), 90, np.uint8)
        write_video(path, (picture for _ in range(count)), 30.0)
        return path

    return write


def edit(session, *edits):
    answer = ask(session, "POST", "/api/edits", {"edits": edits}).json()
    assert all(result["ok"] for result in answer["results"])


def click(session, **changes):
    places = {**JOINTS, **changes}
    edit(session, golf("frame", 2), *(golf_click(n, [*p, 2]) for n, p in places.items()))


def swing(session):
    return ask(session, "GET", "/api/swing").json()


def test_the_page_knows_a_golf_project_and_what_was_told_of_it(session):
    assert ask(session, "GET", "/api/project").json()["golf"]
    edit(session, golf("frame", 2), golf("stature", 1.8), golf("left_handed", True))
    edit(session, golf_click("root", [160, 142, 2]), shaft(4, [1, 2, 3, 4]), key_posture("top", 9))
    state = ask(session, "GET", "/api/state").json()
    assert state["golf"] == {"frame": 2, "stature": 1.8, "left_handed": True}
    assert state["clicks"] == {"root": [160, 142, 2]}
    assert state["shafts"] == {"4": [1, 2, 3, 4]}
    assert state["keys"] == {"top": 9}
    undone = ask(session, "POST", "/api/undo", {"id": "u"}).json()["changes"]
    assert undone == [{"kind": "key", "name": "top", "from": 9, "to": None}]


def test_clicks_of_a_golfer_are_right(session):
    assert swing(session)["wrong"] is None
    click(session)
    assert swing(session)["wrong"] is None
    assert "keys" not in swing(session)


def test_knees_exchanged_are_told_at_once(session):
    click(session, left_knee=JOINTS["right_knee"], right_knee=JOINTS["left_knee"])
    assert "left and right of the knees seem to be exchanged" in swing(session)["wrong"]


def test_a_height_that_nobody_has_is_told(session):
    click(session)
    edit(session, golf("stature", 0.3))
    assert "the stature is 0.3" in swing(session)["wrong"]


def test_key_postures_out_of_order_are_told(session):
    edit(session, key_posture("top", 9), key_posture("hit", 4))
    assert swing(session)["wrong"].startswith("The hit is marked in frame 4, and the top")


def test_a_fit_is_fresh_until_something_else_is_told(session):
    click(session)
    folder = session.workspace
    assert not is_fitted(folder)
    note_fitted(folder, golf_digest(folder))
    assert is_fitted(folder)
    edit(session, shaft(4, [1, 2, 3, 4]))
    assert not is_fitted(folder)
    ask(session, "POST", "/api/undo", {"id": "u"})
    assert is_fitted(folder)


def test_what_a_fit_wrote_can_be_taken_along(session):
    (session.workspace.folder / "golf.csv").write_text("name,value\n")
    rows = ask(session, "GET", "/api/exports").json()
    assert [(row["name"], row["current"]) for row in rows] == [("golf.csv", True)]
    assert ask(session, "GET", "/api/fitted/golf.csv").status == 200
    for kind in ("fitted", "exports"):
        assert ask(session, "GET", f"/api/{kind}/project.toml").status == 400


def test_an_export_named_as_what_the_fit_wrote_can_be_taken_along_too(session):
    exports = session.workspace.exports
    exports.mkdir()
    for folder, text in ((exports.parent, "of the fit"), (exports, "exported")):
        (folder / "golf.csv").write_text(text)
    rows = ask(session, "GET", "/api/exports").json()
    assert [(row["name"], row["fitted"]) for row in rows] == [
        ("golf.csv", True),
        ("golf.csv", False),
    ]
    for row, kind in zip(rows, ("fitted", "exports"), strict=True):
        sent = ask(session, "GET", f"/api/{kind}/golf.csv")
        assert int(sent.headers["content-length"]) == row["bytes"]
