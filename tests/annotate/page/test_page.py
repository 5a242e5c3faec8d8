"""The annotator's page in a real browser: what a person does there is what stands in the files."""

from functools import partial

import numpy as np
import pytest
from page_driver import BROWSER, SCREEN, Held, Person, far, serving
from page_project import (
    FPS,
    FRAMES,
    PIXELS,
    STATURE,
    block,
    count_slowly,
    follow_at_once,
    make_project,
    read_number,
    true_signs,
    truth,
    write_numbered_video,
    write_true_motion,
)

from keyrecon.annotate.assist.answers import describe_pose
from keyrecon.annotate.assist.body_estimate import estimate_body
from keyrecon.annotate.assist.project_cache import ProjectCache
from keyrecon.annotate.assistant import Assistant
from keyrecon.app.project import start
from keyrecon.body import LSP14
from keyrecon.io.formats.coco import read_coco

pytestmark = pytest.mark.skipif(
    not BROWSER.exists(), reason=f"THE PAGE IS NOT TESTED: there is no browser at {BROWSER}"
)
POINTS3D, POINTS2D = truth()


@pytest.fixture(scope="session")
def video_file(tmp_path_factory):
    return write_numbered_video(tmp_path_factory.mktemp("page") / "numbered.mp4")


@pytest.fixture
def folder(tmp_path, video_file):
    return make_project(tmp_path / "rally", video_file)


@pytest.fixture
def context(chromium):
    opened = chromium.new_context(viewport=SCREEN)
    yield opened
    opened.close()


@pytest.fixture
def person(context, folder):
    """Somebody at the page of a new project, whom nothing may have disturbed."""
    with serving(folder) as server:
        person = Person(context, server.credentials.address)
        person.server = server
        yield person
        context.close()
    assert person.complaints == []


def place_of(frame, joint):
    return POINTS2D[frame, LSP14.names.index(joint)]


def marks_on_file(folder):
    return read_coco(folder / "annotations.json", LSP14, 100, (640, 360))


def test_a_keyframe_without_help_is_fourteen_clicks(person, folder):
    person.open(10)
    person.mark_joints(partial(place_of, 10))
    person.await_saved()
    marks = marks_on_file(folder)
    assert (person.clicks, person.keys) == (14, 0)
    assert marks.frames.tolist() == [10]
    assert np.abs(marks.joints[0] - POINTS2D[10]).max() < 1.0
    assert marks.visible.all()


def test_the_picture_is_that_of_the_keyframe(person):
    for frame in (10, 40, 55, 70):
        person.open(frame)
        blocks = person.page.evaluate(
            """places => {
              const [picture] = document.querySelectorAll("#picture canvas");
              const ratio = devicePixelRatio, pen = picture.getContext("2d");
              return places.map(([x, y]) => pen.getImageData(x * ratio, y * ratio, 1, 1).data[0]);
            }""",
            [corner_of(person, block(bit)) for bit in range(8)],
        )
        assert read_number(blocks) == frame


def corner_of(person, place):
    box = person.page.locator("#picture").bounding_box()
    x, y = person.on_screen(place)
    return [x - box["x"], y - box["y"]]


def test_upper_body_keyframes_ask_for_no_legs(person):
    person.open(40)
    joints = person.page.locator(".joint:not([hidden]) .name").all_inner_texts()
    assert len(joints) == 8
    assert not {"left hip", "right knee", "left ankle"} & set(joints)


def test_work_goes_on_when_the_server_is_gone(person, folder):
    person.open(10)
    person.click(place_of(10, person.asked()))
    person.await_saved()
    person.server.stop()
    first = person.asked()
    person.click(place_of(10, first))
    person.await_text("#saving", "Not saved: 1")
    second = person.asked()
    person.click(place_of(10, second))
    person.await_text("#saving", "Not saved: 2")
    person.server.start()
    person.await_saved()
    marks = marks_on_file(folder)
    for joint in (first, second):
        assert far(marks.joints[0, LSP14.index(joint)], place_of(10, joint)) < 1.0


def test_edits_kept_in_the_browser_outlive_the_page(person, folder, context):
    person.open(10)
    person.server.stop()
    joint = person.asked()
    person.click(place_of(10, joint))
    person.await_text("#saving", "Not saved: 1")
    person.page.close()
    person.server.start()
    again = Person(context, person.server.credentials.address)
    again.await_saved()
    again.await_text("#joints", "visible")
    assert np.isfinite(marks_on_file(folder).joints[0, LSP14.index(joint)]).all()


def test_two_pages_see_each_other_and_overwrite_nothing(person, context, folder):
    other = Person(context, person.server.credentials.address)
    for one in (person, other):
        one.open(10)
    person.click(place_of(10, "head_top"))
    other.await_text(".joint[data-joint=head_top] .visibility", "visible")
    before = marks_on_file(folder).joints[0, LSP14.index("head_top")]
    context.route("**/api/events", lambda route: route.abort())
    other.page.reload()
    other.open(10)
    person.drag(before, before + 20)
    person.await_saved()
    other.drag(before, before - 20)
    other.await_text("#notice", "Another page changed the same place")
    kept = marks_on_file(folder).joints[0, LSP14.index("head_top")]
    assert far(kept, before + 20) < 1.5
    other.page.click("#notice-offer")
    other.await_saved()
    taken = marks_on_file(folder).joints[0, LSP14.index("head_top")]
    assert far(taken, before - 20) < 1.5
    other.complaints.clear()


def test_undo_takes_the_last_edit_back_after_a_reload(person, folder):
    person.open(10)
    person.click(place_of(10, "head_top"))
    person.click(place_of(10, "neck"))
    person.await_saved()
    person.page.reload()
    person.open(10)
    person.press("Control+z")
    person.await_text(".joint[data-joint=neck] .visibility", "^$")
    marks = marks_on_file(folder).joints[0]
    assert np.isnan(marks[LSP14.index("neck")]).all()
    assert np.isfinite(marks[LSP14.index("head_top")]).all()
    person.press("Control+y")
    person.await_text(".joint[data-joint=neck] .visibility", "visible")


def place_by_keys(person, folder, *keys):
    """The joint asked for in frame 10, placed by keys and chosen again, and its place."""
    person.open(10)
    joint = person.asked()
    for key in (*keys, "Space"):
        person.press(key)
    person.await_saved()
    start = marks_on_file(folder).joints[0, LSP14.index(joint)]
    person.press("w")
    return joint, start


def await_hidden(person, folder, joint):
    """What is on the file once a joint is hidden: its place."""
    person.await_text(f".joint[data-joint={joint}] .visibility", "hidden")
    person.await_saved()
    marks = marks_on_file(folder)
    assert not marks.visible[0, LSP14.index(joint)]
    return marks.joints[0, LSP14.index(joint)]


def test_a_key_that_is_held_goes_on_where_it_moves_and_does_the_rest_once(person, folder):
    joint, start = place_by_keys(person, folder, "ArrowLeft")
    for key in ("ArrowRight", "v"):
        for _ in range(3):
            person.page.keyboard.down(key)
        person.page.keyboard.up(key)
    moved = await_hidden(person, folder, joint)
    assert moved == pytest.approx([start[0] + 3, start[1]], abs=0.11)


def test_the_keyboard_alone_places_moves_and_hides_a_joint(person, folder):
    joint, start = place_by_keys(person, folder, "Shift+ArrowUp", "ArrowLeft")
    for _ in range(3):
        person.press("ArrowRight")
    person.press("v")
    moved = await_hidden(person, folder, joint)
    assert moved == pytest.approx([start[0] + 3, start[1]], abs=0.11)


def test_one_key_swaps_left_and_right_of_the_arms(person, folder):
    person.open(40)
    person.mark_joints(partial(place_of, 40))
    person.press("c")
    person.await_saved()
    joints = marks_on_file(folder).joints[0]
    for part in ("wrist", "elbow", "shoulder"):
        left = joints[LSP14.index(f"left_{part}")]
        assert far(left, place_of(40, f"right_{part}")) < 1.0


def test_a_picture_zoomed_at_the_pointer_is_still_marked_right(person, folder):
    person.open(10)
    person.point_at(place_of(10, "head_top"))
    person.page.mouse.wheel(0, -600)
    person.click(place_of(10, "head_top"))
    person.await_saved()
    marks = marks_on_file(folder).joints[0]
    assert far(marks[LSP14.index("head_top")], place_of(10, "head_top")) < 0.3


def suggesting_assistant(errors):
    """A suggestion from the truth, off by `errors` (px) where they are given."""

    def suggestion(annotations, frame):
        joints = {
            name: [*(place_of(frame, name) + errors.get(name, 0.0)).tolist(), 0.8]
            for name in LSP14.names
        }
        return {"joints": joints, "from": [3], "nearer": {}}

    return Assistant(suggestion=suggestion)


def test_a_suggestion_costs_one_action_and_one_more_per_joint_that_is_off(context, folder):
    wrong = {"left_wrist": 25.0, "right_knee": -18.0}
    with serving(folder, suggesting_assistant(wrong)) as server:
        person = Person(context, server.credentials.address)
        person.open(10)
        person.await_text("#prompt-text", "suggestion for 14 joints")
        for joint, error in wrong.items():
            person.drag(place_of(10, joint) + error, place_of(10, joint))
        person.press("Enter")
        person.await_text("#done-count", "1 of")
        person.await_saved()
        context.close()
    assert person.actions == 3
    assert np.abs(marks_on_file(folder).joints[0] - POINTS2D[10]).max() < 1.5
    assert person.complaints == []


def test_a_list_of_five_hundred_keyframes_makes_few_rows(person):
    rows = person.call(
        "views/lists",
        """(() => {
          const root = document.querySelector("#frame-list").cloneNode();
          document.querySelector("#frame-list").replaceWith(root);
          const list = m.createVirtualList(root, {
            height: 44, fill: (row, item) => { row.textContent = item; }, choose() {},
          });
          list.show(Array.from({ length: 500 }, (_, n) => `row ${n}`), 499);
          return [...root.querySelectorAll(".row")].map((row) => row.textContent);
        })()""",
    )
    assert len(rows) < 30
    assert "row 499" in rows


def test_no_key_of_any_page_fails(person):
    pages = person.call("views/keyboard", "m.KEYS")
    for number, page in ((1, "bodies"), (1, "pick"), (2, "keyframes"), (3, "motion"), (4, "files")):
        person.press(f"Alt+{number}")
        if page == "pick":
            person.page.click("#bodies-colours")
        for keys, _, action in pages[page]:
            if action not in ("primary", "add"):
                person.press(keys[-1].replace(" ", "Space"))
    person.press("?")
    assert "swap left and right" in person.text("#keys-panel")


def asking_assistant(folder, frame):
    """Asks for one more body once the player was followed."""

    def bodies():
        box = [*POINTS2D[frame].min(axis=0).tolist(), *POINTS2D[frame].max(axis=0).tolist()]
        return [{"frame": frame, "box": box}] if (folder / "followed").exists() else None

    return Assistant(bodies=bodies)


def test_a_new_project_begins_with_whole_bodies_and_no_colour(context, tmp_path, video_file):
    folder = tmp_path / "new"
    start(video_file, folder)
    commands = {"follow": partial(follow_at_once, folder)}
    with serving(folder, asking_assistant(folder, 55), commands) as server:
        person = Person(context, server.credentials.address)
        person.await_text("#bodies-text", "shows the player clearly")
        person.page.wait_for_selector("#bodies-picture[data-frame]")
        person.press("Enter")
        person.await_text("#position", r"frame \d+ of")
        first = person.frame()
        assert "top of the skull" in person.text("#prompt-more").lower()
        person.mark_joints(partial(place_of, first))
        person.await_text("#prompt-text", "The body is marked")  # seen from the side: no question
        person.press("Enter")
        person.await_text("#bodies-text", "The body is marked")
        person.press("Enter")
        person.await_text("#bodies-text", "One body is to be marked")
        person.press("Enter")
        person.page.wait_for_selector("#picture[data-frame='55']")
        assert "least sure" in person.text("#explanation")
        person.mark_joints(partial(place_of, 55))
        person.press("Enter")
        person.await_text("#bodies-primary", "Choose the keyframes")
        person.await_saved()
        context.close()
    assert marks_on_file(folder).frames.tolist() == [first, 55]
    assert (person.clicks, person.keys) == (28, 5)
    assert person.complaints == []


def test_the_guide_shows_the_joint_that_is_asked_for(person):
    person.open(10)
    assert "stored results are missing" in person.text("#pose-empty")
    person.press("Alt+1")
    person.page.wait_for_selector("#bodies:not([hidden])")
    person.page.hover("#guide [data-joint=left_hip]")
    assert "left hip: the centre of the joint" in person.text("#guide-words")


def test_colours_are_picked_by_clicks_and_removed_by_clicks(person, folder):
    person.press("Alt+1")
    person.page.click("#bodies-colours")
    person.page.wait_for_selector("#pick-picture[data-frame]")
    box = person.page.locator("#pick-picture").bounding_box()
    for dx in (0, 20, 40, 60):
        person.page.mouse.click(box["x"] + 300 + dx, box["y"] + 200)
    person.await_text("#pick-text", "Click the shorts.*or go on")
    assert "last click was taken for the shirt" in person.text("#pick-more")
    person.await_saved()
    picks = person.server.ask("state")["picks"]
    assert [pick["part"] for pick in sorted(picks, key=lambda pick: pick["x"])] == [
        "head",
        "foot",
        "foot",
        "shirt",
    ]
    person.page.mouse.click(box["x"] + 300, box["y"] + 200)
    person.await_text("#pick-text", "Click the middle of the head")


def test_what_a_click_is_taken_for_is_asked_part_by_part_and_then_chosen(person):
    person.press("Alt+1")
    person.page.click("#bodies-colours")
    person.page.wait_for_selector("#pick-picture[data-frame]")
    box = person.page.locator("#pick-picture").bounding_box()
    for n in range(8):
        person.page.mouse.click(box["x"] + 200 + 25 * n, box["y"] + 200)
    person.await_text("#pick-text", "The colours are known")
    person.await_text("#notice-text", "Choose on the right what the click is to show")
    person.await_saved()
    picks = person.server.ask("state")["picks"]
    parts = [pick["part"] for pick in sorted(picks, key=lambda pick: pick["x"])]
    assert parts == ["head", "foot", "foot", "shirt", "shorts", "skin", "hair"]
    assert person.text("#pick-count") == "7 clicks"
    cut = "[...document.querySelectorAll('.parts kbd')].filter((key) =>"
    cut += " key.getBoundingClientRect().right > key.parentElement.getBoundingClientRect().right)"
    assert person.page.evaluate(f"{cut}.length") == 0


def test_left_and_right_exchanged_on_the_first_body_are_put_right_by_one_answer(person, folder):
    mirror = dict([*LSP14.mirrored, *(pair[::-1] for pair in LSP14.mirrored)])

    def exchanged(joint):
        index = LSP14.index(joint)
        return POINTS2D[10, mirror.get(index, index)]

    person.open(10)
    person.mark_joints(exchanged)
    person.await_text("#prompt-text", "Does the player face you here")
    person.press("o" if "As it is marked, yes" in person.text("#prompt-more") else "Enter")
    person.await_text("#notice-text", "Left and right of the body were exchanged")
    person.await_saved()
    assert np.abs(marks_on_file(folder).joints[0] - POINTS2D[10]).max() < 1.0
    person.open(70)
    person.mark_joints(partial(place_of, 70))
    person.await_text("#prompt-text", "done")


def turned_readings(annotations, frame, marks, nearer):
    """Two readings of a chest, turned to the left and to the right, nearly as likely."""
    trunk = {"right_shoulder": 1, "right_hip": 1, "left_shoulder": -1, "left_hip": -1}
    flat = {"right_shoulder": (-0.1, 0.0), "left_shoulder": (0.1, 0.0)}
    flat |= {"right_hip": (-0.07, 0.5), "left_hip": (0.07, 0.5)}

    def reading(sign, cost):
        points = {name: [x, y, -sign * trunk[name] * 0.1] for name, (x, y) in flat.items()}
        return {
            "nearer": {n: sign * s for n, s in trunk.items()},
            "points3d": points,
            "cost": cost,
        }

    likely = reading(1, 0.0)
    limbs = {n: {"sign": s, "certainty": 0.1, "given": False} for n, s in trunk.items()}
    return likely | {"limbs": limbs, "alternatives": [likely, reading(-1, 0.2)], "stretched": {}}


def test_to_which_side_the_chest_is_turned_is_asked_once_where_it_is_undecided(context, folder):
    with serving(folder, Assistant(pose=turned_readings)) as server:
        person = Person(context, server.credentials.address)
        person.open(70)
        person.mark_joints(partial(place_of, 70))
        person.await_text("#prompt-text", "To which side of the picture is the chest turned")
        person.press("o")
        person.await_saved()
        person.await_text("#prompt-text", "done|Next|All keyframes")
        given = server.ask("state")["nearer"]["70"]
        assert given["right_shoulder"] == given["right_hip"] == -given["left_hip"]
        (right,) = [
            pose["nearer"]
            for pose in turned_readings(None, 70, {}, {})["alternatives"]
            if pose["points3d"]["left_shoulder"][2] > 0  # the left shoulder is behind
        ]
        assert given == right
        context.close()
    assert person.complaints == []


class MarksOnly(ProjectCache):
    """Knows the player's height, and nothing else before it is marked."""

    def __init__(self):
        """Nothing is prepared."""

    def body(self, annotations, wait=False):
        return estimate_body(annotations, {}, np.full(FRAMES, 0.9 * STATURE * PIXELS), FPS)

    def any_suggestion(self, annotations, frame):
        return None


def test_a_keyframe_with_its_depths_is_fourteen_clicks_and_six_keys(context, folder):
    """Pointing at a limb costs nothing: what is turned is turned by a key."""
    truth = true_signs(POINTS3D[70])
    with serving(folder, Assistant(pose=partial(describe_pose, MarksOnly()))) as server:
        person = Person(context, server.credentials.address)
        person.open(70)
        person.mark_joints(partial(place_of, 70))
        person.await_text("#prompt-text", "Which ends are nearer")
        person.give_depths(truth, partial(place_of, 70))
        person.await_text("#prompt-text", "done|Next|All keyframes")
        person.await_saved()
        context.close()
    marks = marks_on_file(folder)
    found = {LSP14.names[c]: s for (_, c), s in zip(LSP14.bones, marks.nearer[0], strict=True)}
    assert {name: found[name] for name in truth} == truth
    assert (person.clicks, person.drags) == (14, 0)
    assert person.keys <= 6
    assert person.complaints == []


def start_counting(context, server):
    """Somebody who has marked a frame and has the motion made, which takes its time."""
    person = Person(context, server.credentials.address)
    person.have_marked(40, partial(place_of, 40))
    person.press("Alt+3")
    person.await_text("#motion-text", "Make the motion")
    person.press("Enter")
    person.await_text("#job-text", "Counting")
    return person


def test_long_work_shows_how_far_it_is_and_can_be_cancelled(context, folder):
    with serving(folder, commands={"run": count_slowly}) as server:
        person = start_counting(context, server)
        job = person.page.locator("#job").bounding_box()
        assert job["y"] + job["height"] <= person.page.locator("header").bounding_box()["height"]
        person.page.click("#job-cancel")
        person.await_text("#notice-text", "Cancelled")
        person.await_text("#motion-text", "Make the motion")
        context.close()
    assert person.complaints == []


def test_long_work_that_ended_with_its_server_is_told_and_can_be_started_again(context, folder):
    with serving(folder, commands={"run": count_slowly}) as server:
        person = start_counting(context, server)
        server.stop()
        person.await_text("#saving", "Not connected")
        server.start()
        person.await_text("#notice-text", "starting again goes on from there")
        person.await_text("#motion-text", "Make the motion")
        person.press("Enter")
        person.await_text("#job-text", "Counting")
        person.page.wait_for_selector("#notice", state="hidden")
        person.page.wait_for_selector("#job:not([hidden])")
        context.close()
    assert person.complaints == []


STRETCH = {
    "first": 20,
    "last": 31,
    "text": "Frames 20-31: arms uncertain; marking frame 26 would help most.",
    "frame": 26,
    "half": "upper",
}


def test_what_is_uncertain_is_told_and_one_click_goes_to_mark_it(context, folder):
    with serving(folder, Assistant(stretches=lambda annotations: [STRETCH])) as server:
        person = Person(context, server.credentials.address)
        person.page.click("[data-tab=next]")
        person.await_text("#next-list", "Frames 20-31")
        person.page.click("#next-list .row")
        person.await_text("#position", "frame 26 of")
        assert len(person.page.locator(".joint:not([hidden]) .name").all()) == 8
        context.close()
    assert person.complaints == []


def test_what_is_uncertain_is_asked_for_anew_when_a_run_has_ended(context, folder):
    told = []
    assistant = Assistant(stretches=lambda annotations: [STRETCH] * len(told))
    with serving(folder, assistant, {"run": partial(follow_at_once, folder)}) as server:
        person = Person(context, server.credentials.address)
        person.page.click("[data-tab=next]")
        person.await_text("#explanation", "stored results are missing")
        assert person.text("#next-list") == ""
        person.have_marked(40, partial(place_of, 40))
        person.await_saved()
        person.page.wait_for_timeout(1500)  # what edits set off has come to rest
        told.append(True)
        person.press("Alt+3")
        person.press("Enter")
        person.page.wait_for_function(
            "() => document.querySelector('#stretches').textContent.includes('frame 26')"
        )
        context.close()
    assert person.complaints == []


def test_the_end_of_work_that_was_never_seen_to_run_is_news(context, folder):
    with serving(folder, Assistant(), {"run": partial(follow_at_once, folder)}) as server:
        person = Person(context, server.credentials.address)
        person.have_marked(40, partial(place_of, 40))
        person.await_saved()
        person.press("Alt+3")
        person.page.evaluate("() => { requestAnimationFrame = (draw) => setTimeout(draw, 3000); }")
        person.press("Enter")
        person.await_text("#notice", "Followed")
        context.close()
    assert person.complaints == []


def test_a_page_that_can_tell_nothing_of_the_body_says_why(person):
    person.await_text("#pose-empty", "stored results are missing.* Make the motion")


def test_edits_made_without_the_server_can_be_taken_back(person, folder):
    person.open(10)
    person.server.stop()
    for _ in range(3):
        person.mark_one(partial(place_of, 10))
    person.await_text("#saving", "Not saved")
    person.press("Control+z")
    person.press("Control+z")
    person.server.start()
    person.await_saved()
    assert np.isfinite(marks_on_file(folder).joints[0, :, 0]).sum() == 1


def player_known():
    """Where the player is in every frame, as the track knows it."""
    boxes = np.hstack([POINTS2D.min(axis=1), POINTS2D.max(axis=1)]).tolist()
    return Assistant(keyframes=lambda added: {"frames": {}, "height_px": 240.0, "boxes": boxes})


def view_of(person):
    return [*map(float, person.page.get_attribute("#picture", "data-view").split())]


def test_a_frame_that_a_person_adds_opens_at_the_player_and_z_shows_the_whole(context, folder):
    write_true_motion(folder)
    with serving(folder, player_known()) as server:
        person = Person(context, server.credentials.address)
        person.press("Alt+3")
        person.await_text("#motion-text", "The motion is made")
        for _ in range(26):
            person.press("e")
        person.press("k")
        person.await_text("#position", "frame 26 of")
        person.page.wait_for_selector("#picture[data-frame='26']")
        near = view_of(person)
        person.press("z")
        person.await_drawn()
        assert view_of(person)[0] < 0.8 * near[0]
        person.press("z")
        person.await_drawn()
        assert view_of(person) == near
        context.close()
    assert person.complaints == []


INK = """
() => {
  const canvas = document.querySelectorAll("#picture canvas")[1], pen = canvas.getContext("2d");
  return pen.getImageData(0, 0, canvas.width, canvas.height).data.some((value) => value > 0);
}
"""
"""Whether anything is drawn over the picture."""


def test_before_the_project_is_read_there_is_nothing_to_press(person):
    held = Held(person, "**/api/state")
    person.page.reload()
    held.wait_for(1)
    person.press("Alt+3")
    assert person.page.evaluate("() => document.body.inert")
    held.let_go()
    person.page.unroute("**/api/state")
    person.page.wait_for_selector("body[data-view=keyframes]")
    person.press("Alt+3")
    person.page.wait_for_selector("body[data-view=motion]")


def test_a_picture_that_did_not_come_is_asked_for_again(person, context):
    person.open(10)
    context.route("**/api/frame/*", lambda route: route.abort())
    person.page.evaluate("location.hash = 'frame=70'")
    person.await_text("#position", "frame 70 of")
    person.page.wait_for_timeout(3000)
    context.unroute("**/api/frame/*")
    person.page.wait_for_selector("#picture[data-frame='70']")


def test_marks_wait_for_the_picture_they_belong_to(person, context):
    person.open(10)
    person.click(place_of(10, "head_top"))
    person.click(place_of(10, "neck"))
    person.await_drawn()
    assert person.page.evaluate(INK)
    context.route("**/api/frame/*", lambda route: route.abort())
    person.press("e")
    person.await_text("#position", "frame 11 of")
    person.await_drawn()
    assert not person.page.evaluate(INK)
    person.press("q")
    person.page.evaluate("location.hash = 'frame=70'")
    person.await_text("#position", "frame 70 of")
    person.await_drawn()
    person.page.mouse.click(*[value / 2 for value in SCREEN.values()])
    assert not person.page.evaluate(INK)
    context.unroute("**/api/frame/*")
    person.point_at(place_of(70, "neck"))
    person.page.wait_for_selector("#picture[data-frame='70']")
    assert {*person.server.ask("state")["marks"]} == {"10"}
