"""The step of the page where the ground is found where there is no court."""

import numpy as np
import pytest
from ground_walker import HORIZON, SIZE, posts, seen, standing
from page_driver import BROWSER, Person, serving

from keyrecon.annotate.assist.answers import make_assistant
from keyrecon.app.annotator import job_commands
from keyrecon.app.project import start
from keyrecon.io.formats.motion_file import write_motion
from keyrecon.io.video_writer import write_video
from keyrecon.io.workspace import Workspace
from keyrecon.world.records import GroundMarks

pytestmark = pytest.mark.skipif(
    not BROWSER.exists(), reason=f"THE PAGE IS NOT TESTED: there is no browser at {BROWSER}"
)


@pytest.fixture
def folder(tmp_path):
    points = standing(steps=2)
    picture = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    picture[::40, ::40] = 200
    write_video(tmp_path / "v.mp4", [picture] * len(points), 50.0)
    start(tmp_path / "v.mp4", tmp_path / "p")
    write_motion(tmp_path / "p" / "motion.npz", seen(points))
    return tmp_path / "p"


def click_on(person, place):
    scale, x, y = map(float, person.page.get_attribute("#ground-picture", "data-view").split())
    box = person.page.locator("#ground-picture").bounding_box()
    person.page.mouse.click(box["x"] + scale * place[0] + x, box["y"] + scale * place[1] + y)


def test_upright_things_are_marked_and_squares_lie_on_the_ground(folder, chromium):
    with serving(
        folder, make_assistant(Workspace(folder)), commands=job_commands(folder)
    ) as server:
        context = chromium.new_context(viewport={"width": 1440, "height": 900})
        person = Person(context, server.credentials.address)
        person.press("Alt+6")
        person.await_text("#ground-text", "Click one end of something upright")
        person.page.wait_for_selector("#ground-picture[data-frame='0']")
        for number, post in enumerate(posts(), start=1):
            click_on(person, post.start)
            person.await_text("#ground-text", "Click its other end")
            click_on(person, post.end)
            person.await_text("#ground-marks", f"vertical-{number}")
        person.page.click("#ground-kinds [data-kind=length]")
        click_on(person, posts()[0].start)
        person.await_text("#notice-text", "Type the length in metres first")
        person.page.click("#ground-kinds [data-kind=horizon]")
        click_on(person, HORIZON.start)
        click_on(person, HORIZON.end)
        person.await_text("#ground-marks", "horizon-1")
        person.page.click("#ground-fov")
        for key in ("6", "1", "Backspace", "0", ".", "4", "Enter"):
            person.press(key)
        person.await_text("#ground-text", "Do the squares lie flat")
        person.await_text("#ground-more", "The camera is 2.")
        context.close()
        assert person.complaints == []
        told = Workspace(folder).ground_marks()
        assert told.field_of_view == 60.4
        assert [mark.kind for mark in told.marks] == ["vertical", "vertical", "horizon"]
        for mark, post in zip(told.marks, posts(), strict=False):
            assert np.abs(np.subtract(mark.start, post.start)).max() < 2.5


def test_a_length_that_is_none_is_told_from_one_that_is_missing(folder, chromium):
    with serving(folder, make_assistant(Workspace(folder))) as server:
        context = chromium.new_context(viewport={"width": 1440, "height": 900})
        person = Person(context, server.credentials.address)
        person.press("Alt+6")
        person.page.wait_for_selector("#ground-picture[data-frame='0']")
        for kind in ("length", "vertical"):
            person.page.click(f"#ground-kinds [data-kind={kind}]")
            person.page.fill("#ground-metres", "-3")
            click_on(person, posts()[0].start)
            person.await_text("#notice-text", "A length is a number of metres above 0")
            person.page.click("#notice-close")
            person.page.wait_for_selector("#notice", state="hidden")
        context.close()
        assert person.complaints == []


INK = """
() => {
  const canvas = document.querySelectorAll("#ground-picture canvas")[1];
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  return data.some((value) => value > 0);
}
"""
"""Whether anything is drawn over the picture."""


def test_marks_stay_on_the_picture_they_were_made_on_until_another_is_here(folder, chromium):
    Workspace(folder).change_ground_marks(GroundMarks((posts()[0],)))
    with serving(folder, make_assistant(Workspace(folder))) as server:
        context = chromium.new_context(viewport={"width": 1440, "height": 900})
        person = Person(context, server.credentials.address)
        held = []
        context.route("**/api/frame/1?*", lambda route: held.append(route))
        person.press("Alt+6")
        person.page.wait_for_selector("#ground-picture[data-frame='0']")
        person.await_text("#ground-marks", "frame 0")
        assert person.page.evaluate(INK)
        person.press("e")
        person.page.wait_for_selector("#ground-picture.late")
        person.await_drawn()
        assert person.page.evaluate(INK)
        for route in held:
            route.continue_()
        person.page.wait_for_selector("#ground-picture[data-frame='1']")
        person.await_drawn()
        assert not person.page.evaluate(INK)
        context.close()


def test_two_clicks_on_a_removal_take_one_mark_away(folder, chromium):
    marks = (*posts(), HORIZON)
    Workspace(folder).change_ground_marks(GroundMarks(marks))
    with serving(folder, make_assistant(Workspace(folder))) as server:
        context = chromium.new_context(viewport={"width": 1440, "height": 900})
        person = Person(context, server.credentials.address)
        person.press("Alt+6")
        person.page.dblclick("[aria-label='Remove vertical-1']", delay=60)
        person.page.wait_for_selector("[aria-label='Remove vertical-2']", state="detached")
        person.page.wait_for_timeout(300)
        context.close()
        assert person.complaints == []
        assert Workspace(folder).ground_marks().marks == marks[1:]
