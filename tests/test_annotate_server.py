"""What the page asks the server, and what the server answers."""

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request

import cv2
import numpy as np
import pytest
from annotator import new_project, open_project, request
from annotator_edits import edit, mark, submit
from annotator_jobs import counting, crashing
from conftest import read_number

from keyrecon import KeyreconError
from keyrecon.annotate import address
from keyrecon.annotate.assistant import Assistant
from keyrecon.annotate.cells import by_frame
from keyrecon.annotate.describe import guided_order
from keyrecon.annotate.events import Events
from keyrecon.annotate.guard import Door
from keyrecon.annotate.jobs import Jobs
from keyrecon.annotate.server import make_app
from keyrecon.annotate.watch import Watch
from keyrecon.body import LSP14
from keyrecon.formats.keyframes import keyframes_to_json
from keyrecon.records import HalfKeyframes, Keyframes

DOOR = Door(("127.0.0.1:8000",), 8000)
HEADERS = {
    "host": "127.0.0.1:8000",
    "origin": "http://127.0.0.1:8000",
    "cookie": f"{DOOR.cookie}={DOOR.session}",
    "content-type": "application/json",
}
KINDS = {
    "constant rate": {},
    "B-frames": {"bf": "3", "g": "30"},
    "open GOP": {"x264-params": "open-gop=1:bframes=3:keyint=15:min-keyint=15"},
}


@pytest.fixture
def folder(tmp_path, write_numbered):
    new_project(tmp_path / "p", write_numbered("v.mp4", list(range(0, 600, 12))))
    return tmp_path / "p"


@pytest.fixture
def opened(folder):
    desks = []

    def again(assistant=Assistant(), commands=None):
        for desk in desks:
            desk.close()
        desks[:] = [open_project(folder, assistant, commands)]
        return desks[0]

    yield again
    for desk in desks:
        desk.close()


def ask(desk, method, path, body=None):
    data = b"" if body is None else json.dumps(body).encode()
    return request(make_app(desk, DOOR), method, path, HEADERS, data)


def write_keyframes(folder, upper, lower, n_frames=50):
    def half(frames):
        frames = np.array(frames)
        nearest = frames[np.abs(np.arange(n_frames)[:, None] - frames).argmin(axis=1)]
        zero, all_ = np.zeros(n_frames), np.ones(n_frames, dtype=bool)
        return HalfKeyframes(frames, nearest, all_, 1.0, 0.1, zero, len(frames))

    chosen = Keyframes(half(upper), half(lower), 10, 0.95)
    (folder / "keyframes.json").write_text(keyframes_to_json(chosen))


def until(fact, seconds=20.0):
    """Wait for something that another thread or process does."""
    end = time.monotonic() + seconds
    while not fact():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_the_project_tells_the_page_all_it_must_know(opened, folder):
    write_keyframes(folder, [10, 30], [30, 40])
    desk = opened()
    submit(
        desk.store, edit("own", frame=20, to="upper"), edit("lock", frame=30, was=False, to=True)
    )
    told = ask(desk, "GET", "/api/project").json()
    assert (told["n_frames"], told["width"], told["height"]) == (50, 128, 64)
    assert told["limbs"][0].keys() == {"name", "parent", "child", "half"}
    rows = {row["frame"]: row for row in told["keyframes"]}
    assert [(f, row["half"], row["own"], row["locked"]) for f, row in rows.items()] == [
        (10, "upper", False, False),
        (20, "upper", True, False),
        (30, "both", False, True),
        (40, "lower", False, False),
    ]
    assert rows[10]["stands_for"] == 21  # frames 0 to 20 are nearest to it


def test_the_guided_order_goes_from_the_head_along_the_limbs():
    names = [LSP14.names[joint] for joint in guided_order(LSP14)]
    assert sorted(names) == sorted(LSP14.names)
    assert names[:5] == ["head_top", "neck", "right_shoulder", "right_elbow", "right_wrist"]
    assert names[-3:] == ["left_hip", "left_knee", "left_ankle"]


def test_edits_and_undo_through_the_page(opened):
    desk = opened()
    answer = ask(desk, "POST", "/api/edits", {"edits": [mark(3, "neck", [10, 20, 2])]}).json()
    assert answer["results"][0]["ok"]
    assert ask(desk, "GET", "/api/state").json()["marks"] == {"3": {"neck": [10, 20, 2]}}
    undone = ask(desk, "POST", "/api/undo", {"id": "u"}).json()
    assert undone["changes"] == [
        {"kind": "mark", "frame": 3, "joint": "neck", "from": [10, 20, 2], "to": None}
    ]
    assert ask(desk, "POST", "/api/undo", {"id": "u2"}).json()["edit"] is None


@pytest.mark.parametrize("kind", KINDS)
def test_the_still_of_frame_n_shows_frame_n(tmp_path, write_numbered, kind):
    video = write_numbered("v.mp4", list(range(0, 720, 12)), KINDS[kind])
    new_project(tmp_path / "p", video)
    desk = open_project(tmp_path / "p")
    try:
        for frame in np.random.default_rng(2).permutation(60).tolist():
            answer = ask(desk, "GET", f"/api/still/{frame}")
            picture = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_COLOR)
            assert read_number(picture) == frame
    finally:
        desk.close()


def test_stills_asked_for_all_at_once_are_all_answered(opened):
    stills = opened().stills
    stills.prepare(range(50))
    waiting = [stills.still(frame) for frame in [*range(50), *range(49, -1, -1)]]
    for frame, picture in zip([*range(50), *range(49, -1, -1)], waiting, strict=True):
        data = np.frombuffer(picture.result(timeout=20), np.uint8)
        assert read_number(cv2.imdecode(data, cv2.IMREAD_COLOR)) == frame


def test_stills_may_be_kept_by_the_browser_only_under_the_name_of_this_video(opened):
    desk = opened()
    name = ask(desk, "GET", "/api/project").json()["version"]
    for query, kept in (("", False), ("?v=other", False), (f"?v={name}", True)):
        control = ask(desk, "GET", f"/api/still/3{query}").headers["cache-control"]
        assert ("immutable" in control) == kept
        assert ("no-store" in control) != kept


def test_a_still_that_cannot_be_made_says_why(opened, monkeypatch):
    desk = opened()

    def broken(*_):
        raise KeyreconError("frame 7 cannot be decoded")

    monkeypatch.setattr(type(desk.stills.video), "frames", broken)
    answer = ask(desk, "GET", "/api/still/7")
    assert (answer.status, answer.json()) == (400, {"error": "frame 7 cannot be decoded"})


def test_without_an_assistant_its_questions_have_empty_answers(opened):
    desk = opened()
    assert ask(desk, "GET", "/api/ghost/3").json() == {}
    assert ask(desk, "GET", "/api/checks").json() == []
    assert ask(desk, "GET", "/api/next").json() == []
    assert ask(desk, "POST", "/api/picks/preview", {"frames": [1]}).json() == {}
    assert ask(desk, "GET", "/api/backprojection/3").status == 204


def test_the_assistant_hears_what_is_marked_and_taken(opened, folder):
    write_keyframes(folder, [10], [10])
    heard = {}

    def checks(annotations, absent):
        heard["marks"], heard["absent"] = annotations.frames.tolist(), absent
        return [{"frame": 3, "suspicion": float("nan")}]

    def suggest(annotations, taken):
        heard["taken"] = taken
        return []

    desk = opened(Assistant(checks=checks, suggest=suggest))
    submit(desk.store, mark(3, "neck", [1, 2, 2]), mark(3, "left_hip", [0, 0, 0]))
    submit(desk.store, edit("own", frame=20, to="both"))
    assert ask(desk, "GET", "/api/checks").json() == [{"frame": 3, "suspicion": None}]
    ask(desk, "GET", "/api/next")
    assert heard == {"marks": [3], "absent": {(3, "left_hip")}, "taken": {10, 20}}


def test_a_new_choice_of_keyframes_drops_none_that_was_worked_on_or_locked(opened, folder):
    write_keyframes(folder, [5, 10, 30], [30, 40])
    desk = opened()
    submit(desk.store, mark(10, "neck", [10, 20, 2]))
    submit(desk.store, edit("lock", frame=40, was=False, to=True))
    write_keyframes(folder, [12, 31], [31])
    rows = {row["frame"]: row for row in ask(desk, "GET", "/api/project").json()["keyframes"]}
    assert rows.keys() == {10, 12, 31, 40}
    assert (rows[10]["half"], rows[10]["own"]) == ("upper", True)
    assert (rows[40]["half"], rows[40]["locked"]) == ("lower", True)
    assert by_frame(opened().store.state.cells, "own") == {"10": "upper", "40": "lower"}


@pytest.fixture
def jobs():
    heard = []
    jobs = Jobs({"count": counting, "crash": crashing}, heard.append)
    yield jobs, heard
    jobs.close()


def test_a_job_tells_how_far_it_is_and_what_came_of_it(jobs):
    jobs, heard = jobs
    jobs.start("count", {"steps": 4, "seconds": 0.15})
    until(lambda: heard and heard[-1].state == "done")
    assert heard[-1].text == "Counted."
    assert {(job.text, job.total) for job in heard[:-1]} == {("Counting", 4)}


def test_a_job_can_be_cancelled_and_begun_again(jobs):
    jobs, heard = jobs
    first = jobs.start("count", {"steps": 1000, "seconds": 0.1})
    with pytest.raises(KeyreconError, match="Another job is running"):
        jobs.start("count", {})
    until(lambda: heard)
    assert jobs.cancel(first.id).state == "cancelled"
    second = jobs.start("count", {"steps": 2})
    until(lambda: jobs.listed()[0].state == "done")
    assert [(job.id, job.state) for job in jobs.listed()] == [
        (second.id, "done"),
        (first.id, "cancelled"),
    ]


def test_a_job_that_fails_or_breaks_off_says_so(jobs):
    jobs, _ = jobs
    jobs.start("count", {"fail_at": 1})
    until(lambda: jobs.listed()[0].state == "failed")
    assert jobs.listed()[0].text == "That was too far."
    jobs.start("crash", {})
    until(lambda: jobs.listed()[0].state == "failed")
    assert "broke off" in jobs.listed()[0].text


def test_every_open_page_hears_the_news():
    async def listen():
        events = Events()
        pages = [events.stream({"revision": 0}) for _ in range(2)]
        first = [await anext(page) for page in pages]
        threading.Thread(target=events.tell, args=({"revision": 1},)).start()
        later = [await anext(page) for page in pages]
        events.close()
        rest = [[text async for text in page] for page in pages]
        return first, later, rest

    first, later, rest = asyncio.run(listen())
    assert first == ['data: {"revision": 0}\n\n'] * 2
    assert later == ['data: {"revision": 1}\n\n'] * 2
    assert rest == [[], []]


def test_what_stands_in_the_way_is_told_once_and_when_it_is_gone(opened, folder, monkeypatch):
    desk = opened()
    submit(desk.store, mark(3, "neck", [10, 20, 2]))
    heard = []
    monkeypatch.setattr(Events, "tell", lambda self, news: heard.append(news))
    watch = Watch(desk)
    watch.close()
    (folder / "annotations.json").write_text("half a fi")
    for _ in range(3):
        watch.look()
    (folder / "annotations.json").unlink()
    watch.look()
    assert [bool(news["trouble"]) for news in heard] == [True, False]


def test_marks_go_out_and_come_back_in_every_format(opened):
    desk = opened()
    submit(desk.store, mark(3, "neck", [10.25, 20.5, 2]), mark(7, "left_hip", [30, 40, 1]))
    for form in ("coco", "dlc", "cvat"):
        text = ask(desk, "GET", f"/api/export/{form}").content.decode()
        told = ask(desk, "POST", "/api/import", {"name": form, "text": text}).json()
        assert (told["frames"], told["new"], told["conflicts"]) == ([3, 7], 0, [])
    assert ask(desk, "GET", "/api/export/doc").status == 400


def coco_with(desk, *edits):
    """The text of a COCO file with these marks alone."""
    before = desk.store.state.revision
    submit(desk.store, *edits)
    text = ask(desk, "GET", "/api/export/coco").content.decode()
    while desk.store.state.revision < before + 2 * len(edits):
        desk.store.undo(f"undo {desk.store.state.revision}")
    return text


@pytest.mark.parametrize("mode", ["keep", "replace"])
def test_conflicts_are_shown_before_anything_changes_and_then_settled_as_told(opened, mode):
    desk = opened()
    text = coco_with(desk, mark(3, "neck", [50, 20, 2]), mark(4, "neck", [1, 2, 2]))
    submit(desk.store, mark(3, "neck", [10, 20, 2]))
    before = desk.store.state
    told = ask(desk, "POST", "/api/import", {"name": "a.json", "text": text}).json()
    assert told["conflicts"] == [
        {"frame": 3, "kind": "mark", "joint": "neck", "old": [10, 20, 2], "new": [50, 20, 2]}
    ]
    assert told["new"] == 1
    assert desk.store.state == before
    question = {"name": "a.json", "text": text, "accept": True, "mode": mode}
    assert ask(desk, "POST", "/api/import", question).status == 200
    wanted = [10, 20, 2] if mode == "keep" else [50, 20, 2]
    assert desk.store.state.cells["mark", 3, "neck"] == wanted
    assert desk.store.state.cells["mark", 4, "neck"] == [1, 2, 2]
    desk.store.undo("u")
    assert desk.store.state.cells == before.cells


def test_a_file_of_another_kind_is_refused_under_its_own_name(opened):
    desk = opened()
    for text in ("", "hello", "{", '{"images": 3}', "<annotations>", "scorer,a\n", "\u0000"):
        answer = ask(desk, "POST", "/api/import", {"name": "../../marks.txt", "text": text})
        assert answer.status == 400
        assert answer.json()["error"].startswith("../../marks.txt ")


@pytest.fixture
def serve(folder):
    """Start the command; returns the process and a way to ask it as the page does."""
    running = []

    def start(*words):
        command = [sys.executable, "-m", "keyrecon.cli", "annotate", str(folder), "--no-browser"]
        paths = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        program = subprocess.Popen([*command, *words], stdout=subprocess.PIPE, env=paths, text=True)
        running.append(program)
        program.stdout.readline()
        printed = program.stdout.readline().strip()
        base = printed.partition("/?")[0]
        opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
        json_headers = {"Origin": base, "Content-Type": "application/json"}
        opener.open(printed)

        def ask(path, body=None):
            data = None if body is None else json.dumps(body).encode()
            question = urllib.request.Request(base + path, data, json_headers)
            with opener.open(question, timeout=20) as answer:
                return json.load(answer)

        return program, ask

    yield start
    for program in running:
        program.kill()
        program.communicate()


def test_a_killed_server_starts_again_with_all_it_acknowledged(serve, folder):
    program, ask = serve()
    for frame in range(10):
        answer = ask("/api/edits", {"edits": [mark(frame, "neck", [10, 20, 2])]})
        assert answer["results"][0]["ok"]
    program.kill()
    program.wait()
    program, _ = serve()
    # the page that was open goes on: same port, same cookie
    assert ask("/api/state")["marks"].keys() == {str(frame) for frame in range(10)}
    assert ask("/api/state")["undo"] == 10
    program.send_signal(signal.SIGINT)
    rest = program.communicate(timeout=20)[0]
    assert "Everything that was marked is kept" in rest
    assert program.returncode == 0
    assert not {*folder.glob("annotate.sqlite-*")}  # the log is folded into the database
    program, _ = serve("--host", "0.0.0.0")
    assert "can be reached from other machines" in program.stdout.readline()


def test_an_address_answers_only_under_the_names_it_is_reached_by():
    for host, first in (("127.0.0.1", "127.0.0.1"), ("0.0.0.0", socket.gethostname())):
        with address.listen(host, 0) as listener:
            port = listener.getsockname()[1]
            door = address.make_door(listener, host)
            assert door.hosts[0] == f"{first}:{port}"
            assert f"localhost:{port}" in door.hosts
            with pytest.raises(KeyreconError, match="choose another --port"):
                address.listen(host, port)


@pytest.mark.parametrize(
    ("host", "ours"),
    [("127.0.0.1", True), ("localhost", True), ("::1", True), ("0.0.0.0", False), ("evil", False)],
)
def test_only_this_machine_reaches_a_loopback_address(host, ours):
    assert address.is_loopback(host) == ours


@pytest.mark.parametrize("text", ["", "{", "[]", '{"port": 80, "session": "guess"}', "null"])
def test_a_damaged_memory_of_the_address_is_no_memory(tmp_path, text):
    (tmp_path / "annotator.json").write_text(text)
    assert address.recall(tmp_path / "annotator.json") == address.Memory()


def test_the_last_address_is_kept_for_oneself_and_used_again_if_free(tmp_path):
    file = tmp_path / "cache" / "annotator.json"
    with address.listen("127.0.0.1", 0) as first:
        door = address.make_door(first, "127.0.0.1")
        address.remember(file, door)
        memory = address.recall(file)
        with address.listen("127.0.0.1", 0, memory) as second:
            assert second.getsockname()[1] != door.port
    with address.listen("127.0.0.1", 0, memory) as third:
        again = address.make_door(third, "127.0.0.1", memory)
    assert (again.port, again.session) == (door.port, door.session)
    assert again.token != door.token
    assert file.stat().st_mode & 0o077 == 0
