"""report.html in windows of several widths."""

from dataclasses import replace

import numpy as np
import pytest
from page_driver import BROWSER
from report_material import make_material, on_court, on_ground, write_report

pytestmark = pytest.mark.skipif(
    not BROWSER.exists(), reason=f"THE REPORT IS NOT OPENED: there is no browser at {BROWSER}"
)
MIDDLE_OF_MAP = """
() => {
  const { frame: [left, near, right, far] } = JSON.parse(
    document.getElementById("motion-data").textContent,
  ).court;
  const canvas = document.getElementById("court-map"), sharp = canvas.width / canvas.clientWidth;
  const scale = Math.min(
    (canvas.clientWidth - 100) / (right - left), (canvas.clientHeight - 16) / (far - near),
  );
  const [x, y] = [8 + (0 - left) * scale, 8 + (far + 14) * scale];
  const area = [sharp * x - 3, sharp * y - 3, 6, 6].map(Math.round);
  return [...canvas.getContext("2d").getImageData(...area).data];
}
"""
"""Pixels of the map about the place 14 m from the net and in the middle of its width."""
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


LEGENDS_OVER_TITLES = """
[...document.querySelectorAll(".chart")].flatMap((chart) => {
  const boxes = (what) =>
    [...chart.querySelectorAll(what)].map((one) => one.getBoundingClientRect());
  const legends = boxes(".legend"), titles = boxes(".annotation-text");
  return legends.flatMap((one) => titles.filter((other) =>
    one.left < other.right && other.left < one.right
    && one.top < other.bottom && other.top < one.bottom).map(() => chart.dataset.chart));
})
"""


def test_on_a_phone_no_legend_lies_on_a_title_and_key_instants_can_be_seen(chromium, report):
    page = chromium.new_page(viewport={"width": 390, "height": 844})
    page.goto(report.as_uri())
    page.wait_for_selector("[data-chart=sources] .main-svg")
    over = page.evaluate(LEGENDS_OVER_TITLES)
    page.evaluate("document.querySelector('.strip').classList.add('four')")
    widths = page.evaluate(
        "[...document.querySelectorAll('.four .still')].map((still) => still.clientWidth)"
    )
    page.close()
    assert over == []
    assert min(widths) > 120


def test_the_player_is_looked_at_from_all_around_the_court(chromium, report):
    page = chromium.new_page(viewport={"width": 1366, "height": 900})
    faults = []
    page.on("pageerror", lambda fault: faults.append(str(fault)))
    page.goto(report.as_uri())
    page.wait_for_selector(".js-plotly-plot .main-svg")
    figure = "document.getElementById('figure-canvas').toDataURL()"
    assert not page.is_visible("#show-truth")  # which is not drawn there
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
    assert page.is_visible("#show-truth")
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


READ_MATRIX = """
(place) => {
  const figure = document.querySelector(".matrix");
  const box = figure.querySelector("canvas:last-of-type");
  const { left, top, width, height } = box.getBoundingClientRect();
  box.dispatchEvent(new PointerEvent("pointermove", {
    clientX: left + (place[0] + 0.5) * width / 40, clientY: top + (place[1] + 0.5) * height / 40,
  }));
  return figure.querySelector("output").textContent;
}
"""


def test_a_frame_without_the_player_is_said_to_be_compared_with_none(chromium, tmp_path):
    material = make_material(tmp_path)
    distance = material.keyframes.upper.distance.copy()
    distance[25:30] = np.inf
    upper = replace(material.keyframes.upper, distance=distance)
    told = replace(material, keyframes=replace(material.keyframes, upper=upper))
    write_report(tmp_path / "report.html", told)
    page = chromium.new_page(viewport={"width": 1366, "height": 900})
    page.goto((tmp_path / "report.html").as_uri())
    page.wait_for_selector(".matrix canvas")
    said = [page.evaluate(READ_MATRIX, place) for place in ([27, 24], [24, 24])]
    page.close()
    assert said[0] == "frames 24 and 27: not compared"
    assert said[1].endswith("player heights, alike")


def jumping(material, cuts):
    """The walk on the court, which goes on 4 m further to the right from frame 20 on."""
    world, camera = on_court(material).court
    root = world.root.copy()
    root[:, 0] = np.where(np.arange(len(root)) < 20, -2.0, 2.0)
    moved = replace(world, root=root)
    return replace(material, court=(moved, camera), motion=replace(material.motion, cuts=cuts))


def test_no_curve_of_a_joint_leads_from_one_shot_to_the_next(chromium, tmp_path):
    write_report(tmp_path / "report.html", jumping(make_material(tmp_path), np.array([20])))
    page = chromium.new_page(viewport={"width": 1366, "height": 900})
    page.goto((tmp_path / "report.html").as_uri())
    page.wait_for_selector("[data-chart=joint] .main-svg")
    joint = "document.querySelector('[data-chart=joint]').data[1]"
    x, y = (page.evaluate(f"Array.from({joint}.{axis}, (n) => n)") for axis in "xy")
    page.close()
    assert len(x) == 41
    assert [at for at, value in zip(x, y, strict=True) if not np.isfinite(value or np.nan)] == [
        19.5
    ]


def test_no_way_leads_from_one_shot_to_the_next(chromium, tmp_path):
    material = make_material(tmp_path)
    seen = {}
    for name, cuts in (("one", None), ("two", np.array([20]))):
        write_report(tmp_path / f"{name}.html", jumping(material, cuts))
        page = chromium.new_page(viewport={"width": 1366, "height": 900})
        page.goto((tmp_path / f"{name}.html").as_uri())
        page.wait_for_selector(".js-plotly-plot .main-svg")
        page.locator("#court-map").scroll_into_view_if_needed()
        page.wait_for_timeout(100)
        seen[name] = np.array(page.evaluate(MIDDLE_OF_MAP)).reshape(-1, 4)
        page.close()
    assert np.ptp(seen["two"], axis=0).max() == 0  # the surroundings alone
    assert (seen["one"] != seen["two"]).any()
