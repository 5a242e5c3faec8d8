"""Shots of a video on the page: told by pictures, corrected by a click, known by the next run."""

from functools import partial

import pytest
from page_driver import BROWSER, Held, Person, serving
from page_project import FRAMES, make_project, write_numbered_video

from keyrecon.annotate.assist.shot_strip import list_shots
from keyrecon.annotate.assistant import Assistant
from keyrecon.app.preparing import with_chosen_shots
from keyrecon.io.formats.shot_choices import ShotChoices
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options
from keyrecon.records import PERHAPS, PLAYER, Shots

pytestmark = pytest.mark.skipif(
    not BROWSER.exists(), reason=f"THE PAGE IS NOT TESTED: there is no browser at {BROWSER}"
)
SHOTS = Shots((0, 40, 60), FRAMES, (PLAYER, "somebody else", PLAYER))


def keep(workspace, number, used):
    """As the assistant of a project, whose shots are these."""
    now = SHOTS.usable[number - 1]
    workspace.choose_shot(number, None if now == used else used)
    return list_shots(SHOTS, workspace)


@pytest.fixture
def folder(tmp_path):
    return make_project(tmp_path / "match", write_numbered_video(tmp_path / "numbered.mp4"))


def open_page(chromium, server):
    person = Person(chromium.new_context(), server.credentials.address)
    person.press("Alt+1")
    person.page.wait_for_selector("#shots .shot")
    return person


def words(person):
    return [text.split("\n") for text in person.page.locator("#shots .shot").all_inner_texts()]


def pressed(person):
    shots = person.page.locator("#shots .shot")
    return [shots.nth(n).get_attribute("aria-pressed") for n in range(shots.count())]


def test_a_click_says_which_shots_show_the_player_and_outlives_the_page(chromium, folder):
    workspace = Workspace(folder)
    told = Assistant(
        shots=partial(list_shots, SHOTS, workspace), choose_shot=partial(keep, workspace)
    )
    with serving(folder, told) as server:
        person = open_page(chromium, server)
        assert [row[0] for row in words(person)] == ["1 · 0-39", "2 · 40-59", "3 · 60-99"]
        assert [row[-1] for row in words(person)] == ["used", "somebody else", "used"]
        assert pressed(person) == ["true", "false", "true"]
        loaded = "[...document.querySelectorAll('.shot img')].every((one) => one.naturalWidth > 0)"
        person.await_fact(lambda: person.page.evaluate(loaded))
        person.page.click("#shots .shot:nth-child(2)")
        person.page.wait_for_selector(".shot:nth-child(2)[aria-pressed=true]")
        person.page.click("#shots .shot:nth-child(3)")
        person.page.wait_for_selector(".shot:nth-child(3)[aria-pressed=false]")
        assert words(person)[1][-1] == "to be used"
        assert "again" in person.page.inner_text("#shots-note")
        person.await_saved()
        person.page.reload()
        person.page.wait_for_selector("#saving[data-status]", state="attached")
        person.press("Alt+1")
        person.page.wait_for_selector(".shot:nth-child(2)[aria-pressed=true]")
        assert pressed(person) == ["true", "true", "false"]
        person.page.click("#shots .shot:nth-child(3)")
        person.page.wait_for_selector(".shot:nth-child(3)[aria-pressed=true]")
        person.await_saved()
    assert Workspace(folder).shot_choices() == ShotChoices(use=(2,))


def test_a_second_click_takes_the_first_back_though_that_is_not_kept_yet(chromium, folder):
    workspace = Workspace(folder)
    told = Assistant(
        shots=partial(list_shots, SHOTS, workspace), choose_shot=partial(keep, workspace)
    )
    with serving(folder, told) as server:
        person = open_page(chromium, server)
        held = Held(person, "**/api/shots", "POST")
        for shot, times in ((2, 2), (3, 1)):
            for _ in range(times):
                before = pressed(person)[shot - 1]
                person.page.click(f"#shots .shot:nth-child({shot})")
                person.page.wait_for_selector(
                    f".shot:nth-child({shot}):not([aria-pressed={before}])"
                )
        for _ in range(3):
            held.let_go()
        person.await_saved()
        assert pressed(person) == ["true", "false", "false"]
    assert Workspace(folder).shot_choices() == ShotChoices(skip=(3,))


def test_the_strip_asks_of_a_shot_whether_it_is_the_player_until_a_click_tells(chromium, folder):
    workspace = Workspace(folder)
    shots = Shots((0, 40, 60), FRAMES, (PLAYER, PERHAPS, "somebody else"))

    def say(number, used):
        workspace.choose_shot(number, used)
        return list_shots(shots, workspace)

    with serving(
        folder, Assistant(shots=partial(list_shots, shots, workspace), choose_shot=say)
    ) as server:
        person = open_page(chromium, server)
        assert [row[-1] for row in words(person)] == ["used", PERHAPS, "somebody else"]
        person.await_text("#shots-note", "Is this the player\\? Click it if so: shot 2")
        assert person.page.locator(".shot.unsure").count() == 1
        person.page.click(".shot.unsure")
        person.await_text("#shots-note", "Choose the keyframes again")
        person.await_saved()
    assert workspace.shot_choices() == ShotChoices(use=(2,))


def test_a_video_of_one_shot_has_no_strip(chromium, folder):
    with serving(folder) as server:
        person = Person(chromium.new_context(), server.credentials.address)
        person.press("Alt+1")
        person.page.wait_for_selector("#bodies:not([hidden])")
        assert not person.page.is_visible("#shots-row")


def test_what_was_clicked_stands_over_what_was_set_before():
    options = with_chosen_shots(Options(), ShotChoices(use=(3, 12), skip=(2,)))
    assert (options.shots.use, options.shots.skip) == ("3,12", "2")
    again = with_chosen_shots(options, ShotChoices(use=(2,), skip=(3,)))
    assert (again.shots.use, again.shots.skip) == ("2,12", "3")
    assert with_chosen_shots(again, ShotChoices()) is again
