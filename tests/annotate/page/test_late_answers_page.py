"""The page while answers are late: no press is lost, counted for another thing, or does harm."""

from functools import partial

import numpy as np
import pytest
from page_driver import BROWSER, Held, serving
from page_project import (
    SIZE,
    follow_at_once,
    make_project,
    truth,
    write_numbered_video,
    write_true_motion,
)

from keyrecon.annotate.assist.answers import make_assistant
from keyrecon.annotate.assistant import Assistant
from keyrecon.body import LSP14
from keyrecon.io.workspace import Workspace
from keyrecon.world.records import GroundMark, GroundMarks

pytestmark = pytest.mark.skipif(
    not BROWSER.exists(), reason=f"THE PAGE IS NOT TESTED: there is no browser at {BROWSER}"
)
POINTS2D = truth()[1]
NECK = LSP14.index("neck")


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    return write_numbered_video(tmp_path_factory.mktemp("late") / "numbered.mp4")


@pytest.fixture
def folder(tmp_path, video):
    return make_project(tmp_path / "rally", video)


def aim(person, picture, share=(0.5, 0.5)):
    """A place of a picture in the window, by its share of breadth and height."""
    box = person.page.locator(f"{picture} canvas").last.bounding_box()
    return box["x"] + share[0] * box["width"], box["y"] + share[1] * box["height"]


def test_a_joint_that_is_held_while_another_frame_opens_is_not_dragged_there(folder, visit):
    with serving(folder) as server:
        person = visit(server)
        for frame in (10, 40):
            person.have_marked(frame, lambda joint, t=frame: POINTS2D[t, LSP14.index(joint)])
        person.open(10)
        person.await_text("[data-joint=neck] .visibility", "visible")
        person.point_at(POINTS2D[10, NECK])
        person.page.mouse.down()
        person.point_at(POINTS2D[10, NECK] + 20)
        person.press("d")
        person.page.wait_for_selector("#picture[data-frame='40']")
        person.point_at(POINTS2D[40, NECK] + 50)
        person.page.mouse.up()
        person.await_saved()
        marks = server.ask("state")["marks"]
        assert marks["40"]["neck"][:2] == pytest.approx(POINTS2D[40, NECK], abs=1)
        assert marks["10"]["neck"][:2] == pytest.approx(POINTS2D[10, NECK] + 20, abs=1)


@pytest.mark.parametrize(("key", "name"), [("Alt+5", "court"), ("Alt+6", "ground")])
def test_what_is_done_before_the_world_is_there_does_no_harm(folder, visit, key, name):
    with serving(folder, make_assistant(Workspace(folder))) as server:
        person = visit(server)
        held = Held(person, f"**/api/{name}")
        person.press(key)
        person.page.wait_for_selector(f"#{name}:not([hidden])")
        held.wait_for(1)
        x, y = aim(person, f"#{name}-picture")
        person.page.mouse.move(x, y)
        person.page.mouse.down()
        person.page.mouse.move(x + 40, y + 30, steps=3)
        person.page.mouse.up()
        person.page.mouse.wheel(0, -200)
        for pressed in ("Backspace", "Escape", "e", "z"):
            person.press(pressed)
        held.let_go()
        person.page.wait_for_selector(f"#{name}-picture[data-frame]")
        assert not person.page.is_visible("#notice")


def test_points_of_a_court_are_clicked_faster_than_they_are_kept(folder, visit):
    with serving(folder, make_assistant(Workspace(folder))) as server:
        person = visit(server)
        person.press("Alt+5")
        person.page.wait_for_selector("#court-picture[data-frame]")
        held = Held(person, "**/api/court", "POST")
        for share in ((0.3, 0.6), (0.7, 0.6), (0.5, 0.4)):
            person.page.mouse.click(*aim(person, "#court-picture", share))
        person.await_text("#court-points", "the middle of the net")
        for _ in range(3):
            held.let_go()
        person.await_fact(lambda: len(Workspace(folder).court_clicks()) == 3)
        places = {click.name: click.x for click in Workspace(folder).court_clicks()}
        assert places["near-left"] < places["net-middle"] < places["near-right"]
        person.await_text("#court-chosen", "near end of the centre line")


def test_a_point_of_the_court_that_is_not_kept_is_not_shown(folder, visit):
    with serving(folder, make_assistant(Workspace(folder))) as server:
        person = visit(server)
        person.press("Alt+5")
        person.page.wait_for_selector("#court-picture[data-frame]")
        refusal = {"status": 400, "json": {"error": "The disk is full."}}
        person.page.route(
            "**/api/court",
            lambda route: (
                route.fulfill(**refusal) if route.request.method == "POST" else route.continue_()
            ),
        )
        person.page.mouse.click(*aim(person, "#court-picture"))
        person.await_text("#notice-text", "The disk is full")
        person.page.wait_for_selector("#court-points > div", state="detached")
        assert Workspace(folder).court_clicks() == ()


def test_the_last_point_of_a_court_is_kept_before_it_is_looked_for(folder, visit):
    commands = {"court": partial(follow_at_once, folder)}
    with serving(folder, make_assistant(Workspace(folder)), commands) as server:
        person = visit(server)
        person.press("Alt+5")
        person.page.wait_for_selector("#court-picture[data-frame]")
        held = Held(person, "**/api/court", "POST")
        person.page.mouse.click(*aim(person, "#court-picture"))
        held.wait_for(1)
        person.press("Enter")
        person.await_drawn()
        assert server.ask("jobs") == []
        held.let_go()
        person.await_text("#notice-text", "Followed")


def test_marks_of_the_ground_are_taken_away_faster_than_that_is_kept(folder, visit):
    posts = [GroundMark("vertical", 0, (50.0 * n, 50.0), (50.0 * n, 150.0)) for n in (1, 2, 3)]
    Workspace(folder).change_ground_marks(GroundMarks(tuple(posts)))
    with serving(folder, make_assistant(Workspace(folder))) as server:
        person = visit(server)
        person.press("Alt+6")
        person.await_text("#ground-marks", "vertical-3")
        held = Held(person, "**/api/ground", "POST")
        person.press("Backspace")
        person.press("Backspace")
        for _ in range(2):
            held.let_go()
        person.await_fact(lambda: Workspace(folder).ground_marks().marks == (posts[0],))
        person.await_text("#ground-marks", "^vertical-1, frame 0\\s*✕$")


INK = """
() => {
  const canvas = document.querySelectorAll("#pick-picture canvas")[1];
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  return data.some((value) => value > 0);
}
"""
"""Whether anything is drawn over the picture."""


def tint(picks, frame, part):
    return np.full((SIZE[1], SIZE[0], 4), 200, np.uint8)


def test_a_map_that_is_not_wanted_any_more_is_not_laid_over_the_picture(folder, visit):
    with serving(folder, Assistant(backprojection=tint)) as server:
        person = visit(server)
        person.press("Alt+1")
        person.page.click("#bodies-colours")
        person.page.wait_for_selector("#pick-picture[data-frame]")
        held = Held(person, "**/api/backprojection/*")
        person.press("m")
        held.wait_for(1)
        person.press("m")
        with person.page.expect_response("**/api/backprojection/*") as answer:
            held.let_go()
        answer.value.finished()
        person.await_drawn()
        assert not person.page.evaluate(INK)
        person.press("m")
        held.let_go()
        person.page.wait_for_function(INK)


def test_a_page_that_opens_while_work_ends_has_what_it_made(folder, visit):
    with serving(folder) as server:
        person = visit(server)
        person.have_marked(40, lambda joint: POINTS2D[40, LSP14.index(joint)])
        person.await_saved()
        held = Held(person, "**/api/events")
        person.page.reload()
        person.page.wait_for_selector("body[data-view]:not([inert])")
        person.press("Alt+3")
        person.await_text("#motion-text", "Make the motion")
        write_true_motion(folder)
        held.let_go()
        person.await_text("#motion-text", "The motion is made")
