"""The page of a fitted swing: what is doubtful is told, and everything can be put right."""

import json

import pytest
from golfer import Golfer
from overlaps import OVERLAPS, PARTS
from page_driver import BROWSER, Held, serving
from page_project import CLUB, FRAMES, make_golf_project, truth, write_numbered_video

from keyrecon.annotate.assist.answers import make_assistant
from keyrecon.body import LSP14
from keyrecon.io.workspace import Workspace

pytestmark = pytest.mark.skipif(
    not BROWSER.exists(), reason=f"THE PAGE IS NOT TESTED: there is no browser at {BROWSER}"
)
DOUBTS = ("the downswing takes 0.62 s (frame 40)", "both hands lie off the player (frame 47)")
WRIST = LSP14.index("left_wrist")


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    return write_numbered_video(tmp_path_factory.mktemp("swing") / "numbered.mp4")


@pytest.fixture
def visit(tmp_path, video, chromium):
    """Opens the page of a swing with these doubts."""
    opened = []

    def go(doubts=(), size=(1440, 900), first=0):
        folder = make_golf_project(tmp_path / "swing", video, doubts, first)
        server = serving(folder, make_assistant(Workspace(folder)))
        context = chromium.new_context(viewport={"width": size[0], "height": size[1]})
        serves = server.__enter__()
        person = Golfer(context, serves.credentials.address)
        person.server = serves
        opened.append((server, context, person))
        person.page.wait_for_selector("#swing-picture[data-frame='0']")
        return person, folder

    yield go
    for server, context, person in opened:
        context.close()
        server.__exit__(None, None, None)
        assert person.complaints == []


def marks(folder):
    return json.loads((folder / "golf_marks.json").read_text())


def test_a_doubtful_fit_says_so_everywhere_and_leads_to_the_frames(visit):
    person, _ = visit(DOUBTS)
    person.await_text("#swing-text", "doubtful: do not use its numbers")
    person.await_text("#swing-more", "The downswing takes 0.62 s; both hands")
    person.await_text("#swing-state", "doubtful")
    person.press("Enter")
    person.await_frame("swing", 40)
    person.press("Enter")
    person.await_frame("swing", 47)
    person.page.click("#doubts >> text=0.62")
    person.await_frame("swing", 40)
    person.press("Alt+3")
    person.await_text("#report-text", "doubtful: do not use its numbers")


def test_no_golfer_stands_in_frames_to_which_nothing_was_fitted(visit):
    person, folder = visit(first=8)
    person.press("1")
    person.await_frame("swing", 10)
    person.page.wait_for_selector("#swing-empty", state="hidden")
    for _ in range(5):
        person.press("q")
    person.await_frame("swing", 5)
    person.await_text("#swing-empty", "Nothing is fitted to this frame")
    wrist, aside = truth()[1][5, WRIST], truth()[1][5, WRIST] + (12, 8)
    person.drag(wrist, aside)  # moves the picture, since there is no joint to drag
    person.drag(CLUB[1], CLUB[1] + (9, -6))
    person.await_drawn()
    person.await_text("#swing-text", "The swing is found")
    assert not (folder / "golf_marks.json").exists() or not marks(folder)["frames"]


def test_a_swing_that_is_on_its_way_says_so(visit):
    person, _ = visit()
    held = Held(person, "**/api/motion?*")
    person.page.reload()
    person.await_text("#swing-empty", "on its way")
    held.end()
    person.page.wait_for_selector("#swing-empty", state="hidden")


def test_the_report_of_the_first_fit_can_be_opened_at_once(visit):
    person, folder = visit()
    report = (folder / "report.html").rename(folder / "kept.html")
    person.page.reload()
    person.page.wait_for_selector("#swing-picture[data-frame='0']")
    person.page.wait_for_selector("#swing-report", state="hidden")
    report.rename(folder / "report.html")
    person.server.session.events.publish({"project": True})
    person.page.wait_for_selector("#swing-report")


def test_joint_club_and_key_postures_are_put_right_and_taken_back(visit):
    person, folder = visit()
    person.await_text("#swing-text", "The swing is found")
    person.press("2")
    person.await_frame("swing", 40)
    person.page.wait_for_selector("#swing-empty", state="hidden")  # there is a body to drag
    wrist, aside = truth()[1][40, WRIST], truth()[1][40, WRIST] + (12, 8)
    person.drag(wrist, aside)
    person.await_text("#swing-marks", "Frame 40: left wrist")
    higher = CLUB[1] + (9, -6)
    person.drag(CLUB[1], higher)
    person.press("e")
    person.press("t")
    person.await_text("#swing-strip", r"top\s*41")
    person.await_saved()
    found = marks(folder)
    assert found["keys"] == {"top": 41}
    (row,) = found["frames"]
    assert row["frame"] == 40
    assert row["joints"]["left_wrist"] == pytest.approx(aside, abs=1)
    assert row["shaft"][0] == pytest.approx(CLUB[0], abs=0.1)
    assert row["shaft"][1] == pytest.approx(higher, abs=1)
    person.await_text("#swing-text", "does not know all your marks")
    for _ in range(3):
        person.press("Control+z")
        person.await_drawn()
    person.await_saved()
    person.await_text("#swing-text", "The swing is found")
    assert (marks(folder)["keys"], marks(folder)["frames"]) == ({}, [])


def test_a_club_is_two_clicks_and_marks_are_taken_away_frame_by_frame(visit):
    person, folder = visit()
    person.press("3")
    person.await_frame("swing", 48)
    person.press("c")
    person.await_text("#swing-text", "Click the club between the hands")
    person.click((200, 300))
    person.await_text("#swing-text", "Click the club's head")
    person.click((250, 340))
    person.press("h")
    person.await_text("#swing-marks", "Frame 48: club, hit")
    person.await_saved()
    hands, head = marks(folder)["frames"][0]["shaft"]
    assert [*hands, *head] == pytest.approx([200, 300, 250, 340], abs=1)
    person.page.click("#swing-marks >> text=✕")
    person.page.wait_for_selector("#swing-marked", state="hidden")
    person.press("c")
    person.press("Escape")
    person.await_text("#swing-text", "does not know all|The swing is found")
    person.await_saved()
    assert marks(folder)["frames"] == []


def test_a_whole_body_marked_in_a_swing_is_evidence_too(visit):
    person, folder = visit()
    person.press("2")
    person.await_frame("swing", 40)
    person.press("k")
    person.await_text("#prompt-text", "Click the head top")
    person.mark_joints(lambda joint: truth()[1][40, LSP14.index(joint)])
    person.await_saved()
    assert len(marks(folder)["frames"][0]["joints"]) == 14
    person.press("Alt+2")
    person.await_text("#swing-marks", "Frame 40: ")


def test_no_key_of_a_swing_fails(visit):
    person, _ = visit()
    pages = person.call("views/keyboard", "m.KEYS")
    for number, page in ((1, "address"), (2, "swing"), (3, "files")):
        person.press(f"Alt+{number}")
        for keys, _, action in pages[page]:
            if action not in ("primary", "add"):
                person.press(keys[-1].replace(" ", "Space"))
    person.press("?")
    assert "this frame is the start" in person.text("#keys-panel")


@pytest.mark.parametrize("size", [(1440, 900), (1920, 1080), (1024, 700)], ids=str)
def test_no_part_of_a_swings_pages_lies_over_another(visit, size):
    person, _ = visit(DOUBTS, size)
    for key, page in (("Alt+1", "address"), ("Alt+2", "swing"), ("Alt+3", "files")):
        person.press(key)
        person.page.wait_for_selector(f"#{page}:not([hidden])")
        person.await_drawn()
        assert person.page.evaluate(OVERLAPS, PARTS) == [], page
        assert person.page.evaluate("document.documentElement.scrollWidth") <= size[0]


def test_frames_of_the_swing_are_played_to_the_end(visit):
    person, _ = visit()
    person.page.fill("#swing-frame", str(FRAMES - 5))
    person.press(" ")
    person.await_text("#swing-where", f"frame {FRAMES - 1} of")


def test_no_swing_is_fitted_with_a_height_that_cannot_be(visit):
    person, _ = visit()
    person.press("2")
    person.await_frame("swing", 40)
    for key in ("e", "t"):  # the fit does not know that the top is here
        person.press(key)
    person.await_text("#swing-text", "does not know all your marks")
    for typed in ("abc", "18", "2,0x"):
        person.press("Alt+1")
        person.page.fill("#stature", typed)
        person.page.press("#stature", "Enter")
        person.page.click("#address-list")  # the field is left
        person.await_text("#address-more", "height .* cannot be")
        assert person.page.is_disabled("#address-primary")
        assert person.page.input_value("#stature") == typed
        person.press("Alt+2")
        person.await_text("#swing-more", "height .* cannot be")
        assert person.page.is_disabled("#swing-primary")
        person.press("r")
        person.press("Enter")
        person.await_drawn()
        assert person.server.ask("jobs") == []
    person.press("Alt+1")
    person.page.fill("#stature", "180")
    person.page.press("#stature", "Enter")
    person.page.wait_for_selector("#address-primary:enabled")
