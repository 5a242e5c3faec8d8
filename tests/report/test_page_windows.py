"""report.html in windows of several widths."""

import pytest
from page_driver import BROWSER
from report_material import make_material, on_court, on_ground

from keyrecon.report.page import write_report

pytestmark = pytest.mark.skipif(
    not BROWSER.exists(), reason=f"THE REPORT IS NOT OPENED: there is no browser at {BROWSER}"
)
TOPS = """
[...document.querySelectorAll(".still")].map((still) => [
  Math.round(still.getBoundingClientRect().top),
  Math.round(still.firstElementChild.getBoundingClientRect().top),
])
"""
"""Where each card of the pictures begins, and where its picture does."""


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    write_report(folder / "report.html", on_court(make_material(folder)))
    return folder / "report.html"


@pytest.mark.parametrize("width", [1366, 800, 390])
def test_a_report_fits_its_window_and_its_pictures_stand_in_rows(chromium, report, width):
    page = chromium.new_page(viewport={"width": width, "height": 800})
    page.goto(report.as_uri())
    page.wait_for_selector(".js-plotly-plot .main-svg")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.evaluate("document.querySelector('.strip .still').append('lower body as well '.repeat(9))")
    tops = page.evaluate(TOPS)
    page.close()
    assert len(tops) > 20
    assert all(picture - card <= 1 for card, picture in tops)


def test_the_player_is_looked_at_from_all_around_the_court(chromium, report):
    page = chromium.new_page(viewport={"width": 1366, "height": 900})
    faults = []
    page.on("pageerror", lambda fault: faults.append(str(fault)))
    page.goto(report.as_uri())
    page.wait_for_selector(".js-plotly-plot .main-svg")
    figure = "document.getElementById('figure-canvas').toDataURL()"
    seen = set()
    for eye in ("camera", "umpire", "above", "opponent"):
        page.click(f"[data-eye={eye}]")
        page.wait_for_timeout(60)
        seen.add(page.evaluate(figure))
    for kind in ("time", "heat", "speed"):
        page.click(f"[data-map={kind}]")
    assert "2.1 m behind the baseline" in page.inner_text("#court-now")
    page.locator("#court-map").scroll_into_view_if_needed()
    box = page.locator("#court-map").bounding_box()
    way = box["x"] + 0.5 * box["width"], box["y"] + box["height"] * 15.1 / 16.6
    page.mouse.click(*way)
    page.uncheck("#on-court")
    page.close()
    assert len(seen) == 4
    assert faults == []


def test_the_way_lies_on_the_ground_where_there_is_no_court(chromium, tmp_path):
    write_report(tmp_path / "report.html", on_ground(make_material(tmp_path)))
    page = chromium.new_page(viewport={"width": 1366, "height": 900})
    faults = []
    page.on("pageerror", lambda fault: faults.append(str(fault)))
    page.goto((tmp_path / "report.html").as_uri())
    page.wait_for_selector(".js-plotly-plot .main-svg")
    for eye in ("camera", "above"):
        page.click(f"[data-eye={eye}]")
    for kind in ("time", "heat", "speed"):
        page.click(f"[data-map={kind}]")
    assert page.inner_text("#court-now").endswith("m/s")
    assert page.locator("[data-eye=umpire]").count() == 0
    page.close()
    assert faults == []
