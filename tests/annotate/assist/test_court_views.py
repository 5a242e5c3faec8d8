"""The court over the picture, as the server tells it to the page."""

import numpy as np
from annotator import ask
from court_walker import court_camera
from painted_court import camera_at

from keyrecon.annotate.assist.answers import make_assistant
from keyrecon.io.formats.camera_file import write_camera
from keyrecon.io.workspace import Workspace
from keyrecon.world.court import POINTS

CAMERA = camera_at((0.4, -32, 9), (0, -2, 0), 1.5, (128, 64))
NAMES = ("near-left", "near-right", "far-left", "far-right")


def put(session, name, place, frame=3):
    x, y = (float(value) for value in place)
    return ask(session, "POST", "/api/court", {"name": name, "frame": frame, "place": [x, y]})


def place_of(name):
    return CAMERA.project(np.array([POINTS[name]]))[0]


def test_the_courts_camera_is_shown_over_its_frames(opened, folder):
    session = opened(make_assistant(Workspace(folder)))
    assert ask(session, "GET", "/api/court/3").json()["source"] is None
    write_camera(Workspace(folder).camera_file, court_camera(CAMERA, 50))
    view = ask(session, "GET", "/api/court/3").json()
    assert view["source"] == "camera"
    assert np.abs(view["points"]["net-middle"] - place_of("net-middle")).max() < 0.06
    assert ask(session, "GET", "/api/court").json()["found"] == 1.0


def test_four_clicks_of_a_frame_show_where_they_put_the_court(opened, folder):
    session = opened(make_assistant(Workspace(folder)))
    write_camera(Workspace(folder).camera_file, court_camera(CAMERA, 50))
    aside = np.array([4.0, 0.0])
    for name in NAMES:
        told = put(session, name, place_of(name) + aside).json()
    assert len(told["clicks"]) == 4
    assert told["changed"]
    view = ask(session, "GET", "/api/court/3").json()
    assert view["source"] == "clicks"
    assert np.abs(view["points"]["near-left"] - place_of("near-left") - aside).max() < 1.0
    assert ask(session, "GET", "/api/court/4").json()["source"] == "camera"
    put(session, "far-right", place_of("near-left") + np.array([30, -3]))
    assert "contradict" in ask(session, "GET", "/api/court/3").json()["fault"]


def test_a_camera_of_clicks_that_were_all_taken_away_is_to_be_found_again(opened, folder):
    session = opened(make_assistant(Workspace(folder)))
    assert not put(session, "net-middle", (60, 30)).json()["found"]
    write_camera(Workspace(folder).camera_file, court_camera(CAMERA, 50))
    assert not ask(session, "GET", "/api/court").json()["changed"]
    gone = ask(session, "POST", "/api/court", {"name": "net-middle", "frame": 3}).json()
    assert gone["clicks"] == [] and gone["changed"]
    Workspace(folder).camera_file.unlink()
    assert not ask(session, "GET", "/api/court").json()["changed"]


def test_a_click_is_on_disk_when_it_is_answered_and_can_be_taken_away(opened, folder):
    session = opened(make_assistant(Workspace(folder)))
    put(session, "net-middle", (60, 30))
    assert [click.name for click in Workspace(folder).court_clicks()] == ["net-middle"]
    answer = put(session, "net-midle", (60, 30))
    assert answer.status == 400
    assert "did you mean net-middle" in answer.json()["error"]
    gone = ask(session, "POST", "/api/court", {"name": "net-middle", "frame": 3}).json()
    assert gone["clicks"] == []
    assert Workspace(folder).court_clicks() == ()
