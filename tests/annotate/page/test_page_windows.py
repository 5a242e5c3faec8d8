"""The annotator's page in windows of every size: nothing lies over anything or out of reach."""

import pytest
from overlaps import OVERLAPS, PARTS
from page_driver import BROWSER, Person, serving
from page_project import make_project, truth, write_numbered_video, write_true_motion

from keyrecon.body import LSP14
from keyrecon.io.provenance import RunNotes, note_run
from keyrecon.io.workspace import Workspace

pytestmark = pytest.mark.skipif(
    not BROWSER.exists(), reason=f"THE PAGE IS NOT TESTED: there is no browser at {BROWSER}"
)
WINDOWS = (
    (1920, 1080), (1366, 768), (1100, 500), (1024, 768), (911, 512), (768, 1024), (600, 900),
    (390, 800),
)  # fmt: skip

STEP_HEIGHTS = (
    "[...document.querySelectorAll('header nav button')].map((button) => button.offsetHeight)"
)


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    folder = tmp_path_factory.mktemp("windows")
    video = write_numbered_video(folder / "numbered.mp4")
    with serving(make_project(folder / "rally", video)) as served:
        yield served


@pytest.mark.parametrize("size", WINDOWS, ids=lambda size: "x".join(map(str, size)))
def test_no_part_of_a_page_lies_over_another_or_out_of_reach(chromium, server, size):
    context = chromium.new_context(viewport={"width": size[0], "height": size[1]})
    person = Person(context, server.credentials.address)
    found = {}
    for key, page in (
        ("Alt+1", "bodies"),
        (None, "pick"),
        ("Alt+2", "keyframes"),
        ("Alt+3", "motion"),
        ("Alt+4", "files"),
    ):
        if key is None:
            person.page.click("#bodies-colours")
        else:
            person.press(key)
        person.page.wait_for_selector(f"#{page}:not([hidden])")
        person.await_drawn()
        heights = person.page.evaluate(STEP_HEIGHTS)
        assert max(heights) <= 46, page  # no name of a step takes two lines
        found[page] = person.page.evaluate(OVERLAPS, PARTS)
        wide = person.page.evaluate("document.documentElement.scrollWidth")
        assert wide <= size[0], page
    context.close()
    assert found == {"bodies": [], "pick": [], "keyframes": [], "motion": [], "files": []}


NEWS = "The light changes in frames 3 to 9: what the player wears is hard to tell there. " * 6


@pytest.mark.parametrize("size", [(1366, 768), (1024, 700), (600, 900)])
@pytest.mark.parametrize("text", ["Taken back: neck, frame 10.", NEWS], ids=["short", "long"])
def test_a_notice_lies_over_no_control(chromium, server, size, text):
    context = chromium.new_context(viewport={"width": size[0], "height": size[1]})
    person = Person(context, server.credentials.address)
    for key, page in (("Alt+1", "bodies"), ("Alt+2", "keyframes"), ("Alt+3", "motion"),
                      ("Alt+4", "files"), ("Alt+5", "court"), ("Alt+6", "ground")):  # fmt: skip
        person.press(key)
        person.page.wait_for_selector(f"#{page}:not([hidden])")
        server.session.events.publish({"trouble": text})
        person.page.wait_for_selector("#notice:not([hidden])")
        person.await_drawn()
        notice = person.page.locator("#notice").bounding_box()
        assert notice["width"] > 200
        assert person.page.evaluate(COVERED) == [], page
        person.page.click("#notice-close")
        person.page.wait_for_selector("#notice", state="hidden")
    context.close()
    assert person.complaints == []


COVERED = """
() => {
  const notice = document.querySelector("#notice").getBoundingClientRect();
  const apart = (box) => box.right <= notice.left || notice.right <= box.left
    || box.bottom <= notice.top || notice.bottom <= box.top;
  return [...document.querySelectorAll("header button, main :is(button, a, input, select)")]
    .filter((part) => part.checkVisibility() && !part.closest("#notice"))
    .filter((part) => !apart(part.getBoundingClientRect()))
    .map((part) => part.id || part.innerText);
}
"""
"""Controls that a notice lies over."""


@pytest.mark.parametrize("width", [1920, 1366, 1100])
def test_what_is_said_of_a_motion_is_not_cut_off(chromium, tmp_path, server, width):
    folder = make_project(tmp_path / "rally", server.folder.parent / "numbered.mp4")
    write_true_motion(folder)
    (folder / "cache").mkdir(exist_ok=True)
    note_run(Workspace(folder), RunNotes("of other marks", ()))
    with serving(folder) as served:
        context = chromium.new_context(viewport={"width": width, "height": 768})
        person = Person(context, served.credentials.address)
        person.have_marked(40, lambda joint: truth()[1][40, LSP14.index(joint)])
        person.await_saved()
        person.press("Alt+3")
        person.await_text("#motion-text", "Not yet in the motion")
        person.await_drawn()
        prompt = person.page.locator("#motion .prompt")
        room, text = prompt.evaluate("e => [e.clientHeight, e.scrollHeight]")
        context.close()
    assert text <= room
