"""From the marks to what they are made for, on the page alone: figure, report, video, files."""

import json
import time
from dataclasses import replace
from functools import partial
from typing import get_args

import av
import pytest
from court_walker import court_camera
from page_driver import BROWSER, Held, serving
from page_project import (
    FPS,
    FRAMES,
    SIZE,
    make_project,
    run_at_once,
    truth,
    write_numbered_video,
    write_true_motion,
)
from painted_court import camera_at

from keyrecon.annotate.assist.answers import make_assistant
from keyrecon.annotate.assistant import Assistant
from keyrecon.app.annotator import job_commands
from keyrecon.body import LSP14
from keyrecon.io.formats.camera_file import write_camera
from keyrecon.io.formats.export import SUFFIXES
from keyrecon.io.provenance import (
    RunNotes,
    camera_digest,
    marks_digest,
    note_run,
    read_run,
)
from keyrecon.io.workspace import Workspace
from keyrecon.lens import lens_advice
from keyrecon.pipeline import Options, with_field_of_view, with_height
from keyrecon.propagation.marked_poses import LEAST_MARKED
from keyrecon.report.overlay import Limbs, View

pytestmark = pytest.mark.skipif(
    not BROWSER.exists(), reason=f"THE PAGE IS NOT TESTED: there is no browser at {BROWSER}"
)
SCREENS = ({"width": 1440, "height": 900}, {"width": 1920, "height": 1080})
POINTS2D = truth()[1]
COURT_CAMERA = camera_at((0.4, -32, 9), (0, -2, 0), 1.5, SIZE)
INK = """
(id) => {
  const canvas = document.getElementById(id), pen = canvas.getContext("2d");
  const data = pen.getImageData(0, 0, canvas.width, canvas.height).data;
  let count = 0;
  for (let n = 3; n < data.length; n += 4) count += data[n] > 0;
  return count;
}
"""
"""How many pixels of a canvas are drawn on."""


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    return write_numbered_video(tmp_path_factory.mktemp("results") / "numbered.mp4")


@pytest.fixture
def folder(tmp_path, video):
    return make_project(tmp_path / "rally", video)


def place(joint):
    """Where it is in frame 40."""
    return POINTS2D[40, LSP14.index(joint)]


def mark_and_run(person, height=""):
    person.have_marked(40, place)
    person.await_saved()
    person.press("Alt+3")
    person.await_text("#motion-text", "Make the motion")
    person.page.fill("#height", height)
    person.page.press("#height", "Enter")
    person.await_text("#motion-text", "The motion is made")


def run_and_tell(folder, text, options, progress):
    run_at_once(folder, options, progress)
    workspace = Workspace(folder)
    (folder / "cache").mkdir(exist_ok=True)
    note_run(workspace, RunNotes(marks_digest(workspace), tuple(text.splitlines()[1:])))
    return text


@pytest.mark.parametrize(
    ("more", "stays"),
    [("", False), ("\nThe lower edge of the picture cuts the feet off in frames 3 to 9.", True)],
)
def test_good_news_go_when_they_were_read_and_doubts_stay_until_they_are_closed(
    folder, visit, more, stays
):
    run = partial(run_and_tell, folder, f"Player found in 99 % of 100 frames.{more}")
    with serving(folder, commands={"run": run}) as server:
        person = visit(server)
        person.page.evaluate("() => { window.time = 0; performance.now = () => time; }")
        mark_and_run(person)
        person.await_text("#notice-text", "99 %")
        person.press("Alt+4")
        assert person.page.is_visible("#notice")  # nobody has read it yet
        person.page.evaluate("() => { time = 3100; }")
        person.press("Alt+3")
        person.await_drawn()
        assert person.page.is_visible("#notice") == stays
        if stays:
            person.page.click("#notice-close")
            person.page.wait_for_selector("#notice", state="hidden")
            person.page.reload()
            person.page.wait_for_selector("body[data-view]:not([inert])")
            person.press("Alt+3")
            person.await_text("#motion-doubts", "cuts the feet off in frames 3 to 9")
        else:
            assert not person.page.is_visible("#motion-doubts")


def test_marks_that_came_after_the_motion_are_told_when_the_page_is_opened_again(folder, visit):
    with serving(folder, commands={"run": partial(run_and_tell, folder, "Made.")}) as server:
        person = visit(server)
        mark_and_run(person)
        for changed, text in ((False, "The motion is made"), (True, "Not yet in the motion")):
            if changed:
                person.press("Alt+2")
                person.open(40)
                wrist = POINTS2D[40, LSP14.index("right_wrist")]
                person.drag(wrist, wrist + 6)
                person.await_saved()
                person.press("Alt+3")
                person.await_text("#motion-text", "Not yet in the motion")
            person.page.reload()
            person.page.wait_for_selector("body[data-view]:not([inert])")
            person.press("Alt+3")
            person.await_text("#motion-text", text)


def test_marks_that_are_again_what_the_motion_was_made_from_are_in_it(folder, visit):
    with serving(folder, commands={"run": partial(run_and_tell, folder, "Made.")}) as server:
        person = visit(server)
        mark_and_run(person)
        person.press("Alt+2")
        person.open(40)
        wrist = POINTS2D[40, LSP14.index("right_wrist")]
        person.drag(wrist, wrist + 6)
        person.await_saved()
        person.press("Alt+3")
        person.await_text("#motion-text", "Not yet in the motion")
        person.page.reload()  # even where the page has not seen what it was made from
        person.page.wait_for_selector("body[data-view]:not([inert])")
        person.press("Alt+3")
        person.await_text("#motion-text", "Not yet in the motion")
        person.press("Control+z")
        person.await_text("#motion-text", "The motion is made")
        person.press("Control+y")
        person.await_text("#motion-text", "Not yet in the motion")


def test_what_goes_wrong_on_the_page_itself_is_told_in_one_line_and_costs_no_mark(folder, visit):
    with serving(folder) as server:
        person = visit(server)
        person.open(40)
        person.click(POINTS2D[40, LSP14.index(person.asked())])
        person.await_saved()
        person.page.evaluate("() => { HTMLDialogElement.prototype.showModal = () => ({}).x.y; }")
        person.press("?")
        person.await_text("#notice-text", r"That went wrong on the page \(.*undefined.*\)")
        assert "\n" not in person.text("#notice-text")
        person.click(POINTS2D[40, LSP14.index(person.asked())])
        person.await_saved()
        assert len(server.ask("state")["marks"]["40"]) == 2


def wait_for_ever(options, progress):
    for _ in progress(range(600), "Waiting"):
        time.sleep(0.1)
    return ""


def test_a_run_that_was_cancelled_is_not_taken_for_one_that_knows_the_marks(folder, visit):
    write_true_motion(folder)
    with serving(folder, commands={"run": wait_for_ever}) as server:
        workspace = Workspace(folder)
        (folder / "cache").mkdir(exist_ok=True)
        note_run(workspace, RunNotes("of other marks", ()))
        person = visit(server)
        person.have_marked(40, place)
        person.await_saved()
        person.press("Alt+3")
        person.await_text("#motion-text", "Not yet in the motion")
        person.page.click("#motion-primary")
        person.page.wait_for_selector("#job:not([hidden])")
        person.page.click("#job-cancel")
        person.page.wait_for_selector("#job", state="hidden")
        with person.page.expect_response("**/api/project"):
            server.session.events.publish({"project": True})
        person.await_drawn()
        assert "Not yet in the motion" in person.text("#motion-text")


NEXT = {"frame": 22, "half": "upper", "gain": 1.0, "why": "Least certain."}


def test_after_the_first_run_all_that_it_gave_is_there_without_a_reload(folder, visit):
    def next_frames(annotations, taken):
        return [NEXT] if (folder / "motion.npz").exists() else []

    assistant = Assistant(next_frames=next_frames)
    with serving(folder, assistant, {"run": partial(run_at_once, folder)}) as server:
        person = visit(server)
        mark_and_run(person)
        person.page.wait_for_function(f"() => ({INK})('motion-canvas') > 500")
        assert not person.page.is_visible("#motion-empty")
        person.press("Alt+2")
        person.page.click("[data-tab=next]")
        person.await_text("#next-list", "Frame 22")


@pytest.mark.parametrize(
    ("typed", "said", "metres"),
    [("188", "taken as 1.88 m", 1.88), ("1,75", "metres", 1.75), ("", "body heights", None)],
)
def test_a_height_in_centimetres_is_taken_as_such_and_said_at_once(
    folder, visit, typed, said, metres
):
    with serving(folder, commands={"run": partial(run_at_once, folder)}) as server:
        person = visit(server)
        mark_and_run(person, typed)
        assert said in person.text("#height-said")
        assert json.loads((folder / "told.json").read_text())["height"] == metres


def test_a_height_that_waits_for_the_next_motion_is_kept_and_said_to(folder, visit):
    write_true_motion(folder)
    assistant = make_assistant(Workspace(folder))
    with serving(folder, assistant, {"run": partial(run_and_remember, folder)}) as server:
        person = visit(server)
        person.have_marked(40, place)
        person.press("Alt+3")
        person.page.fill("#height", "183")
        person.await_text("#height-said", "taken as 1.83 m; counts when it is made anew")
        person.page.reload()
        person.page.wait_for_selector("body[data-view]:not([inert])")
        person.press("Alt+3")
        person.await_text("#height-said", "counts when it is made anew")
        assert person.page.input_value("#height") == "183"
        person.press("Alt+6")
        person.page.click("#ground-primary")
        person.await_text("#notice-text", "height that is typed in 3 Motion counts when")
        person.page.click("#notice-offer")
        person.page.click("#motion-primary")
        person.page.wait_for_function(
            "() => !document.querySelector('#height-said').innerText.includes('counts')"
        )
        person.page.wait_for_function("() => !/height/.test(Object.keys(localStorage).join())")


def test_a_press_before_the_ground_is_there_is_not_lost(folder, visit):
    write_true_motion(folder)
    assistant = make_assistant(Workspace(folder))
    with serving(folder, assistant, {"run": partial(run_at_once, folder)}) as server:
        person = visit(server)
        person.have_marked(40, place)
        person.press("Alt+3")
        person.page.fill("#height", "183")
        person.await_text("#height-said", "counts when it is made anew")
        held = Held(person, "**/api/ground")
        person.press("Alt+6")
        person.page.click("#ground-primary")
        held.let_go()
        person.await_text("#notice-text", "height that is typed in 3 Motion counts when")


def run_and_remember(folder, options, progress):
    Workspace(folder).remember(with_height(Options(), options["height"]), Options())
    return run_at_once(folder, options, progress)


def test_a_height_that_cannot_be_is_refused_before_any_work(folder, visit):
    write_true_motion(folder)
    with serving(folder, commands={"run": partial(run_at_once, folder)}) as server:
        person = visit(server)
        person.have_marked(40, place)
        person.press("Alt+3")
        for typed in ("18", "0", "1.8.0", "tall"):
            person.page.fill("#height", typed)
            person.await_text("#height-said", "metres or centimetres")
            assert person.page.is_disabled("#motion-primary")


def begins_work(response):
    return response.url.endswith("/api/jobs") and response.request.method == "POST"


def test_a_field_of_view_is_remembered_told_to_the_run_and_cleared(folder, visit):
    Workspace(folder).remember(with_field_of_view(Options(), 62.5), Options())
    with serving(folder, commands={"run": partial(run_at_once, folder)}) as server:
        person = visit(server)
        person.have_marked(40, place)
        person.press("Alt+3")
        assert person.page.input_value("#fov") == "62.5"
        for typed in ("2", "180", "28 mm"):
            person.page.fill("#fov", typed)
            person.await_text("#fov-said", "degrees across the picture: 62")
            assert person.page.is_disabled("#motion-primary")
        for typed, said, degrees in (("70°", "degrees", 70), ("", "not told", None)):
            person.page.fill("#fov", typed)
            person.await_text("#fov-said", said)
            with person.page.expect_response(begins_work) as answer:
                person.page.press("#fov", "Enter")
            told = answer.value.request.post_data_json["options"]
            assert answer.value.ok and told == {"height": None, "field_of_view": degrees}
            person.await_text("#motion-text", "The motion is made")


def run_of_near_player(folder, options, progress):
    """Asks for the lens unless it was told."""
    text = run_and_tell(folder, "", options, progress)
    if options["field_of_view"] is None:
        workspace = Workspace(folder)
        advice = lens_advice(folder, "The player is 45% of the picture's longer side tall.")
        note_run(workspace, replace(read_run(workspace), advice=(advice,)))
    return text


def test_an_unknown_lens_is_asked_for_beside_the_motion_in_words_of_the_page(folder, visit):
    with serving(folder, commands={"run": partial(run_of_near_player, folder)}) as server:
        person = visit(server)
        mark_and_run(person)
        person.await_text(
            "#motion-advice", "45% .* type it in degrees as field of view, beside the height"
        )
        assert "keyrecon" not in person.text("#motion-advice")
        person.page.fill("#fov", "62")
        person.page.press("#fov", "Enter")
        person.page.wait_for_selector("#motion-advice", state="hidden")


def find_court_after(folder, options, progress):
    write_camera(Workspace(folder).camera_file, court_camera(COURT_CAMERA, FRAMES))
    return "On the court: 9.1 m run.\nFor a report with the court: keyrecon run rally"


def run_before_court(folder, options, progress):
    (folder / "report.html").write_text("<p>A report</p>")
    run_at_once(folder, options, progress)
    workspace = Workspace(folder)
    camera = camera_digest(workspace)
    note_run(workspace, RunNotes(marks_digest(workspace), (), (), camera))
    return ""


def test_after_the_court_the_page_tells_of_the_motion_and_makes_the_report_anew(folder, visit):
    (folder / "cache").mkdir(exist_ok=True)
    jobs = {"run": run_before_court, "court": find_court_after}
    commands = {name: partial(job, folder) for name, job in jobs.items()}
    with serving(folder, make_assistant(Workspace(folder)), commands) as server:
        person = visit(server)
        mark_and_run(person)
        assert person.text("#motion-report") == "Report"
        person.press("Alt+5")
        person.page.click("#court-primary")
        person.await_text("#notice-text", r"9.1 m run.*\n.*make the motion anew \(3 Motion\)")
        person.page.click("#notice-offer")
        person.await_text("#motion-text", "The report does not know the court yet")
        assert person.text("#motion-report") == "Old report"
        person.page.click("#motion-primary")
        person.await_text("#motion-text", "The motion is made")
        assert person.text("#motion-report") == "Report"


def test_a_file_of_marks_that_is_not_taken_in_says_so(folder, visit, tmp_path):
    with serving(folder) as server:
        person = visit(server)
        person.press("Alt+4")
        file = tmp_path / "marks.json"
        file.write_text(json.dumps(server.ask("export/coco")))
        person.page.set_input_files("#import-file", str(file))
        taking = person.page.locator("#marks-files button >> text=Take it")
        taking.wait_for()
        refusal = {"status": 400, "json": {"error": "The disk is full."}}
        person.page.context.route("**/api/import", lambda route: route.fulfill(**refusal))
        taking.click()
        person.await_text("#marks-files", "The disk is full")


def test_the_page_knows_every_format_and_view_and_when_a_keyframe_is_marked(folder, visit):
    with serving(folder) as server:
        person = visit(server)
        for name, known in (("FORMATS", SUFFIXES), ("VIEWS", get_args(View)),
                            ("SKELETONS", get_args(Limbs))):  # fmt: skip
            assert {*person.call("views/exports", f"m.{name}.map(([value]) => value)")} == {*known}
        assert person.call("state/workflow", "m.LEAST_MARKED") == LEAST_MARKED


def test_the_report_opens_sealed_off_from_the_page(folder, visit):
    write_true_motion(folder)
    with serving(folder) as server:
        person = visit(server)
        person.press("Alt+4")
        with person.page.expect_popup() as opened:
            person.page.click("#report")
        opened.value.wait_for_load_state()
        assert opened.value.inner_text("body") == "A report, no cookie for its script"
        opened.value.close()


def test_video_and_files_of_a_part_of_the_clip_without_a_command_line(folder, visit):
    write_true_motion(folder)
    with serving(folder, commands=job_commands(folder)) as server:
        person = visit(server)
        person.press("Alt+3")
        person.page.click("#motion-files")
        person.page.check("#formats [value='.trc']")
        person.press("Enter")
        person.await_text("#export-list", "rally.trc")
        person.page.fill("[aria-label='First frame']", "90")
        person.await_text("#export-range", "0.40 s")
        person.page.check("#overlay-choices [value=above]")
        person.page.select_option("[aria-label=Speed]", "4")
        person.await_text("#overlay-said", "Frames 90 to 99; plays for 1.6 s")
        person.page.click("#export-overlay")
        person.await_text("#export-list", "rally_90-99_camera_above_slow4.mp4")
        with person.page.expect_download() as saved:
            person.page.click("#export-list a >> text=.mp4")
        check_video(saved.value.path())
        person.page.fill("[aria-label='Last frame']", "100")
        person.await_text("#export-range", "two frames from 0 to 99")
        assert person.page.is_disabled("#export-overlay")
    assert (folder / "exports" / "rally.trc").read_text().startswith("PathFileType")


def check_video(path):
    """Ten frames, four times slower than life, two pictures side by side."""
    with av.open(str(path)) as made:
        stream = made.streams.video[0]
        assert stream.frames == 10
        assert float(stream.average_rate) == pytest.approx(FPS / 4, rel=0.01)
        assert stream.width > SIZE[0]


def edges(person, selector):
    box = person.page.locator(selector).bounding_box()
    return box["x"], box["y"], box["x"] + box["width"], box["y"] + box["height"]


@pytest.mark.parametrize(
    ("size", "page", "key", "picture"),
    [
        (SCREENS[0], "keyframes", "Alt+2", "#picture"),
        (SCREENS[1], "motion", "Alt+3", "#motion-picture"),
    ],
)
def test_the_body_in_space_takes_the_whole_stage_and_gives_it_back(
    folder, visit, size, page, key, picture
):
    figure = f"#{page} .figure"
    write_true_motion(folder)
    with serving(folder) as server:
        person = visit(server, size)
        person.press(key)
        person.page.wait_for_selector(f"#{page}:not([hidden])")
        small, stage = edges(person, figure), edges(person, picture)
        person.page.click(f"#{page} [data-stage]")
        large = edges(person, figure)
        assert large == pytest.approx(stage, abs=6)
        aside = edges(person, picture)
        assert aside[0] >= large[2]
        assert aside[3] <= edges(person, f"#{page} .side:last-child > :nth-child(2)")[1] + 60
        person.press("m")
        assert edges(person, figure) == pytest.approx(small, abs=1)
