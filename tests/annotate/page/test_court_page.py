"""The step of the page where the court is found, looked at and mended."""

import numpy as np
import pytest
from page_driver import BROWSER, Person, serving
from painted_court import camera_at, paint

from keyrecon.annotate.assist.answers import make_assistant
from keyrecon.app.annotator import job_commands
from keyrecon.app.project import start
from keyrecon.io.video_writer import write_video
from keyrecon.io.workspace import Workspace
from keyrecon.world.court import POINTS

pytestmark = pytest.mark.skipif(
    not BROWSER.exists(), reason=f"THE PAGE IS NOT TESTED: there is no browser at {BROWSER}"
)
CAMERA = camera_at((0.4, -32, 9), (0, -2, 0), 1.5)


ASIDE = np.array([9.0, 0.0])


def place_of(name):
    return CAMERA.project(np.array([POINTS[name]]))[0]


@pytest.fixture
def folder(tmp_path):
    pictures = [np.repeat(paint(CAMERA, seed=t)[..., None], 3, axis=2) for t in range(4)]
    write_video(tmp_path / "v.mp4", pictures, 25.0)
    start(tmp_path / "v.mp4", tmp_path / "p")
    return tmp_path / "p"


def on_screen(person, place):
    scale, x, y = map(float, person.page.get_attribute("#court-picture", "data-view").split())
    box = person.page.locator("#court-picture").bounding_box()
    return box["x"] + scale * place[0] + x, box["y"] + scale * place[1] + y


def test_a_court_is_found_looked_at_and_mended_by_dragging(folder, chromium):
    with serving(
        folder, make_assistant(Workspace(folder)), commands=job_commands(folder)
    ) as server:
        context = chromium.new_context(viewport={"width": 1440, "height": 900})
        person = Person(context, server.credentials.address)
        person.press("Alt+5")
        person.await_text("#court-text", "Is this a tennis court?")
        person.page.click("#court-primary")
        person.await_text("#court-text", "Do the pink lines lie on the painted ones?")
        person.await_text("#court-more", "found in 100 %")
        person.page.wait_for_selector("#court-picture[data-lines=camera]")
        assert not person.page.is_visible("#court-primary")
        for name in ("near-left", "near-right", "far-left", "far-right"):
            person.page.mouse.move(*on_screen(person, place_of(name)))
            person.page.mouse.down()
            moved = on_screen(person, place_of(name) + ASIDE)
            person.page.mouse.move(*moved, steps=3)
            person.page.mouse.up()
            person.await_text("#court-points", "the {} {} corner".format(*name.split("-")))
        person.await_text("#court-text", "Do the yellow lines lie on the painted ones?")
        assert person.page.is_visible("#court-primary")
        context.close()
        assert person.complaints == []
        clicks = {click.name: click for click in Workspace(folder).court_clicks()}
        assert set(clicks) == {"near-left", "near-right", "far-left", "far-right"}
        for name, click in clicks.items():
            assert np.abs([click.x, click.y] - (place_of(name) + ASIDE)).max() < 2.5
