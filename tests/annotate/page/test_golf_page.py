"""A golf swing on the page alone, from the first click to the exported file."""

import numpy as np
import pytest
from golfer import Golfer
from page_driver import BROWSER, serving
from small_swing import QUICK

from keyrecon.annotate.assist.answers import make_assistant
from keyrecon.app.annotator import job_commands
from keyrecon.app.golf_demo import click_first_frame
from keyrecon.app.project import start
from keyrecon.body import LSP14
from keyrecon.golf.swing_fit import GolfOptions
from keyrecon.io.formats.clicks import read_clicks
from keyrecon.io.formats.swing_file import read_swing
from keyrecon.io.workspace import GOLF, Workspace
from keyrecon.metrics import read_truth

pytestmark = pytest.mark.skipif(
    not BROWSER.exists(), reason=f"THE PAGE IS NOT TESTED: there is no browser at {BROWSER}"
)
ORDER = ("head_top", "root", "right_knee", "left_knee", "right_ankle", "left_ankle")


@pytest.fixture(scope="module")
def film(fitted_swing):
    """A small film of a swing, and its truth."""
    return fitted_swing / "video.mp4", read_truth(fitted_swing / "truth.npz")


@pytest.fixture
def folder(film, tmp_path):
    start(film[0], tmp_path / "swing", golf=True)
    Workspace(tmp_path / "swing").remember(QUICK, GolfOptions(), GOLF)
    return tmp_path / "swing"


@pytest.fixture
def person(folder, chromium):
    assistant, commands = make_assistant(Workspace(folder)), job_commands(folder)
    with serving(folder, assistant, commands) as server:
        context = chromium.new_context(viewport={"width": 1440, "height": 900})
        golfer = Golfer(context, server.credentials.address)
        yield golfer
        context.close()
        assert golfer.complaints == []


def click_address(person, joints):
    person.await_frame("address", 0)
    for name in ORDER:
        person.click(joints[name])
        person.await_drawn()
    person.await_saved()


def await_fit(person):
    person.await_text("#swing-text", "The swing is being fitted")
    person.await_text("#swing-text", "The swing is found|This fit is doubtful")


def test_from_the_first_click_to_the_exported_file(person, folder, film):
    truth = film[1]
    person.await_text("#address-text", "Find the address")
    click_address(person, click_first_frame(truth).joints)
    person.page.type("#stature", "183")
    person.await_text("#stature-said", "taken as 1.83 m")
    person.page.keyboard.press("Tab")
    person.await_text("#address-text", "All six joints are clicked")
    person.await_saved()
    clicks = read_clicks(folder / "golf_clicks.json")
    assert (clicks.frame, clicks.stature) == (0, 1.83)
    person.page.click("#address-primary")
    person.press("Alt+2")
    await_fit(person)
    put_right(person, folder, truth)
    take_files_along(person, folder)


def put_right(person, folder, truth):
    """Say which frame is the top, and where wrist and club are there; the next fit holds it."""
    top, wrist = round(float(truth["keys"][1])), LSP14.index("left_wrist")
    place = truth["points2d"][top, wrist] + [1.0, 0.0]
    person.press("2")
    person.await_text("#swing-where", r"^\S+ [1-9]")  # the address was frame 0
    assert abs(int(person.text("#swing-where").split()[1]) - top) < 8
    person.page.fill("#swing-frame", str(top))
    person.await_frame("swing", top)
    person.press("t")
    person.page.click("#swing-targets >> text=left wrist")
    person.await_text("#swing-text", "Click the left wrist")
    person.click(place)
    person.press("c")
    for end in truth["club2d"][top]:
        person.click(end)
    person.await_saved()
    person.await_text("#swing-marks", f"Frame {top}: left wrist, club, top")
    person.await_text("#swing-text", "does not know all your marks")
    person.press("Enter")
    await_fit(person)
    swing = read_swing(folder / "motion.npz")
    assert np.linalg.norm(swing.motion.points2d[top, wrist] - place) < 5
    assert swing.keys[1] == pytest.approx(top, abs=0.5)


def take_files_along(person, folder):
    person.press("Alt+3")
    person.page.wait_for_selector("#report:not([hidden])")
    person.await_text("#export-list", "golf.csv")
    person.page.check("#formats [value='.csv']")
    person.press("Enter")
    person.await_text("#export-list", "swing.csv")
    with person.page.expect_download() as saved:
        person.page.click("#export-list a >> text=golf.csv")
    assert saved.value.path().read_text().count("\n") > 10
    assert (folder / "exports" / "swing.csv").read_text().count("\n") > 20


def test_sides_that_were_exchanged_are_told_and_undone(person, film):
    """A click is dragged to its place, taken back, and the clicks begun anew elsewhere."""
    joints = click_first_frame(film[1]).joints
    exchanged = {**joints, "left_knee": joints["right_knee"], "right_knee": joints["left_knee"]}
    click_address(person, exchanged)
    person.await_text("#address-text", "Nobody stands as it was clicked")
    person.await_text("#address-more", "left and right of the knees")
    person.press("Control+z")
    person.await_text("#address-text", "Click the player's left ankle")
    person.press("e")
    person.await_text("#address-text", "The clicks are in frame 0")
    person.press("o")
    person.await_text("#address-text", "Find the address")
    person.await_text("#address-where", "frame 1 of")
    person.press("Control+z")
    person.await_text("#address-text", "The clicks are in frame 0")
    person.press("Enter")
    person.await_frame("address", 0)


def test_a_page_that_is_opened_again_has_all_that_was_clicked(person, film):
    click_address(person, click_first_frame(film[1]).joints)
    person.page.check("#left-handed")
    person.await_saved()
    person.page.reload()
    person.await_text("#address-count", "6 of 6")
    assert person.page.is_checked("#left-handed")
    person.press("Alt+2")
    person.await_text("#swing-text", "The swing can be fitted")
