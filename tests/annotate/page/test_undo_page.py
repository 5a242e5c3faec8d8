"""Undo on every page: what is taken back is seen, or told, and nothing goes behind one's back."""

import pytest
from page_driver import BROWSER, SCREEN, Person, serving
from page_project import make_golf_project, make_project, truth, write_numbered_video

from keyrecon.annotate.assist.answers import make_assistant
from keyrecon.body import LSP14
from keyrecon.io.workspace import Workspace

pytestmark = pytest.mark.skipif(
    not BROWSER.exists(), reason=f"THE PAGE IS NOT TESTED: there is no browser at {BROWSER}"
)
POINTS2D = truth()[1]


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    return write_numbered_video(tmp_path_factory.mktemp("undo") / "numbered.mp4")


@pytest.fixture
def person(chromium, tmp_path, video):
    """Somebody who marked one joint, the neck of frame 10."""
    with serving(make_project(tmp_path / "rally", video)) as server:
        context = chromium.new_context(viewport=SCREEN)
        person = Person(context, server.credentials.address)
        person.server = server
        person.open(10)
        person.click(POINTS2D[10, LSP14.index(person.asked())])
        person.await_saved()
        yield person
        context.close()
        assert person.complaints == []


def marked(person):
    return list(person.server.ask("state")["marks"].get("10", {}))


def test_what_undo_takes_back_out_of_sight_is_told_and_shown_at_will(person):
    person.press("Alt+3")
    person.page.wait_for_selector("#motion:not([hidden])")
    person.press("Control+z")
    person.await_text("#notice-text", r"Taken back: \w[\w ]+, frame 10\. Redo brings it back")
    assert marked(person) == []
    person.press("Control+y")
    person.await_text("#notice-text", r"Done again: \w[\w ]+, frame 10\.")
    assert len(marked(person)) == 1
    person.page.click("#notice-offer")
    person.page.wait_for_selector("#keyframes:not([hidden])")
    assert person.frame() == 10


@pytest.mark.parametrize(("key", "page"), [("Alt+5", "court"), ("Alt+6", "ground")])
def test_undo_leaves_the_joints_alone_where_points_of_the_world_are_marked(person, key, page):
    person.press(key)
    person.page.wait_for_selector(f"#{page}:not([hidden])")
    person.press("Control+z")
    person.await_text("#notice-text", "not undone here")
    person.await_saved()
    assert len(marked(person)) == 1


def test_undo_of_a_joint_stays_in_the_swing_and_goes_to_its_frame(chromium, tmp_path, video):
    folder = make_golf_project(tmp_path / "swing", video)
    with serving(folder, make_assistant(Workspace(folder))) as server:
        context = chromium.new_context(viewport={"width": 1440, "height": 900})
        person = Person(context, server.credentials.address)
        person.page.wait_for_selector("#swing-picture[data-frame='0']")
        edit = {"id": "a", "kind": "mark", "frame": 40, "joint": "neck"}
        person.page.evaluate(
            "edits => fetch('/api/edits', {method: 'POST', body: JSON.stringify({edits}),"
            " headers: {'Content-Type': 'application/json'}})",
            [edit | {"to": [100, 100, 2], "from": None}],
        )
        person.page.wait_for_selector("#undo:enabled")
        person.press("Control+z")
        person.page.wait_for_selector("#swing-picture[data-frame='40']")
        assert person.page.get_attribute("body", "data-view") == "swing"
        context.close()
        assert person.complaints == []
