"""What the page asks the server, and what the server answers."""

import asyncio
import json
import socket
import threading
from dataclasses import replace
from functools import partial

import numpy as np
from annotator import CREDENTIALS, HEADERS, ask, call, run_apart
from annotator_edits import edit, mark, submit
from small_motion import make_motion

from keyrecon.annotate.assist.answers import project_motion_digest
from keyrecon.annotate.assistant import Assistant
from keyrecon.annotate.server.address import listen, make_credentials
from keyrecon.annotate.server.descriptions import marking_order
from keyrecon.annotate.server.events import Events
from keyrecon.annotate.server.routes import make_app
from keyrecon.annotate.server.session import ProjectWatch, describe_files
from keyrecon.annotate.store.cells import by_frame
from keyrecon.app.annotator import PageServer
from keyrecon.body import LSP14
from keyrecon.io.formats.keyframes import keyframes_to_json
from keyrecon.io.formats.motion_file import write_motion
from keyrecon.io.provenance import RunNotes, marks_digest, motion_digest, note_run
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options
from keyrecon.records import HalfKeyframes, Keyframes
from keyrecon.world.records import GroundMarks


def write_keyframes(folder, upper, lower, n_frames=50):
    def half(frames):
        frames = np.array(frames)
        nearest = frames[np.abs(np.arange(n_frames)[:, None] - frames).argmin(axis=1)]
        zero, all_ = np.zeros(n_frames), np.ones(n_frames, dtype=bool)
        return HalfKeyframes(frames, nearest, all_, 1.0, 0.1, zero, len(frames))

    chosen = Keyframes(half(upper), half(lower), 10, 0.95)
    (folder / "keyframes.json").write_text(keyframes_to_json(chosen))


def test_the_project_is_described_to_the_page(opened, folder):
    write_keyframes(folder, [10, 30], [30, 40])
    session = opened()
    submit(
        session.store, edit("own", frame=20, to="upper"), edit("lock", frame=30, was=False, to=True)
    )
    answer = ask(session, "GET", "/api/project").json()
    assert (answer["n_frames"], answer["width"], answer["height"]) == (50, 128, 64)
    assert answer["usual_budget"] == 0.06
    assert answer["limbs"][0].keys() == {"name", "parent", "child", "half"}
    rows = {row["frame"]: row for row in answer["keyframes"]}
    assert [(f, row["half"], row["own"], row["locked"]) for f, row in rows.items()] == [
        (10, "upper", False, False),
        (20, "upper", True, False),
        (30, "both", False, True),
        (40, "lower", False, False),
    ]
    assert rows[10]["stands_for"] == 21  # frames 0 to 20 are nearest to it


def test_the_marking_order_goes_from_the_head_along_the_limbs():
    names = [LSP14.names[joint] for joint in marking_order(LSP14)]
    assert sorted(names) == sorted(LSP14.names)
    assert names[:5] == ["head_top", "neck", "right_shoulder", "right_elbow", "right_wrist"]
    assert names[-3:] == ["left_hip", "left_knee", "left_ankle"]


def test_edits_and_undo_through_the_page(opened):
    session = opened()
    answer = ask(session, "POST", "/api/edits", {"edits": [mark(3, "neck", [10, 20, 2])]}).json()
    assert answer["results"][0]["ok"]
    assert ask(session, "GET", "/api/state").json()["marks"] == {"3": {"neck": [10, 20, 2]}}
    undone = ask(session, "POST", "/api/undo", {"id": "u"}).json()
    assert undone["changes"] == [
        {"kind": "mark", "frame": 3, "joint": "neck", "from": [10, 20, 2], "to": None}
    ]
    assert ask(session, "POST", "/api/undo", {"id": "u2"}).json()["edit"] is None


def test_what_is_not_saved_is_answered_so_and_accepted_when_it_is_sent_again(opened, folder):
    session = opened()
    submit(session.store, mark(3, "neck", [10, 20, 2]))
    (folder / "annotations.json").write_text("half a fi")
    late = {"edits": [mark(4, "neck", [10, 20, 2])]}
    answer = ask(session, "POST", "/api/edits", late)
    assert answer.status == 507
    assert "cannot be read" in answer.json()["error"]
    (folder / "annotations.json").unlink()
    assert ask(session, "POST", "/api/edits", late).json()["results"][0]["ok"]
    assert len(session.store.state.cells) == 2


def test_without_an_assistant_its_questions_have_empty_answers(opened):
    session = opened()
    assert ask(session, "GET", "/api/suggestion/3").json() == {}
    assert ask(session, "GET", "/api/checks").json() is None
    assert ask(session, "GET", "/api/next_frames").json() == []
    assert ask(session, "POST", "/api/picks/preview", {"frames": [1]}).json() == {}
    assert ask(session, "GET", "/api/backprojection/3").status == 204


def test_the_assistant_hears_what_is_marked_and_taken(opened, folder):
    write_keyframes(folder, [10], [10])
    heard = {}

    def checks(annotations):
        heard["marks"], heard["absent"] = annotations.frames.tolist(), annotations.absent
        return [{"frame": 3, "suspicion": float("nan")}]

    def suggest(annotations, taken):
        heard["taken"] = taken
        return []

    session = opened(Assistant(checks=checks, next_frames=suggest))
    submit(session.store, mark(3, "neck", [1, 2, 2]), mark(3, "left_hip", [0, 0, 0]))
    submit(session.store, edit("own", frame=20, to="both"))
    assert ask(session, "GET", "/api/checks").json() == [{"frame": 3, "suspicion": None}]
    ask(session, "GET", "/api/next_frames")
    assert heard == {"marks": [3], "absent": ((3, "left_hip"),), "taken": {10, 20}}


def test_an_assistant_that_takes_long_keeps_no_edit_waiting(opened):
    held, asked = threading.Event(), []

    def checks(annotations):
        asked.append(1)
        assert held.wait(20)
        return []

    session = opened(Assistant(checks=checks))
    app = make_app(session, CREDENTIALS)

    async def many():
        questions = [
            asyncio.create_task(call(app, "GET", "/api/checks", HEADERS)) for _ in range(60)
        ]
        body = json.dumps({"edits": [mark(3, "neck", [10, 20, 2])]}).encode()
        saved = await call(app, "POST", "/api/edits", HEADERS, body)
        waiting = len(asked)
        held.set()
        await asyncio.gather(*questions)
        return saved, waiting

    saved, waiting = run_apart(many())
    assert saved.json()["results"][0]["ok"]
    assert waiting <= 1
    assert len(asked) == 60


def test_a_new_choice_of_keyframes_drops_none_that_was_worked_on_or_locked(opened, folder):
    write_keyframes(folder, [5, 10, 30], [30, 40])
    session = opened()
    submit(session.store, mark(10, "neck", [10, 20, 2]))
    submit(session.store, edit("lock", frame=40, was=False, to=True))
    submit(session.store, mark(30, "left_hip", [10, 20, 2]))
    write_keyframes(folder, [12, 30], [31])
    rows = {row["frame"]: row for row in ask(session, "GET", "/api/project").json()["keyframes"]}
    assert rows.keys() == {10, 12, 30, 31, 40}
    assert (rows[10]["half"], rows[10]["own"]) == ("upper", True)
    assert (rows[30]["half"], rows[30]["own"]) == ("both", True)  # now asked for the upper body
    assert (rows[40]["half"], rows[40]["locked"]) == ("lower", True)
    kept = {"10": "upper", "30": "both", "40": "lower"}
    assert by_frame(opened().store.state.cells, "own") == kept


def test_a_frame_that_bears_marks_is_listed_even_if_nobody_asked_for_it(opened, folder):
    write_keyframes(folder, [10], [10])
    session = opened()
    submit(session.store, mark(20, "neck", [10, 20, 2]), mark(20, "left_hip", [10, 20, 2]))
    rows = {row["frame"]: row for row in ask(session, "GET", "/api/project").json()["keyframes"]}
    assert (rows[20]["half"], rows[20]["own"], rows[20]["stands_for"]) == ("both", False, 0)


def test_the_motion_is_read_in_stretches_once_it_is_made(opened, folder):
    session, motion = opened(), make_motion(frames=50)
    assert ask(session, "GET", "/api/motion?from=0&to=5").json() == {}
    write_motion(folder / "motion.npz", motion)
    answer = ask(session, "GET", "/api/motion?from=45&to=60").json()
    assert (answer["from"], answer["to"], len(answer["points3d"])) == (45, 50, 5)
    assert np.abs(np.array(answer["points2d"]) - motion.points2d[45:]).max() <= 0.05
    assert ask(session, "GET", "/api/motion?from=x").status == 400
    assert answer["cuts"] == []


def test_the_page_is_told_where_the_motion_goes_on_in_another_shot(opened, folder):
    session = opened()
    write_motion(folder / "motion.npz", replace(make_motion(frames=50), cuts=np.array([20])))
    assert ask(session, "GET", "/api/motion?from=30&to=40").json()["cuts"] == [20]


def test_a_motion_is_out_of_date_when_what_it_was_made_from_has_changed(opened, folder):
    workspace = Workspace(folder)
    session = opened(Assistant(motion_digest=partial(project_motion_digest, folder)))
    (folder / "cache").mkdir(exist_ok=True)

    def is_current():
        return ask(session, "GET", "/api/run").json()["is_current"]

    for digest in (motion_digest(workspace, Options(), Options()), marks_digest(workspace)):
        note_run(workspace, RunNotes(digest, ()))  # of this version, and of former ones
        assert is_current()
    note_run(workspace, RunNotes(motion_digest(workspace, Options(), Options()), ()))
    with (folder / "project.toml").open("a") as file:
        file.write('[options]\nshots.skip = "2"\n')
    assert not is_current()
    with (folder / "project.toml").open("a") as file:
        file.write("shots.skpi = 3\n")
    assert not is_current()


def test_a_motion_is_out_of_date_when_more_is_known_of_the_lens(opened, folder):
    """A run takes the angle that was told for the ground: it moves joints by centimetres."""
    workspace, video = Workspace(folder), Workspace(folder).video()
    session = opened(Assistant(motion_digest=partial(project_motion_digest, folder)))
    (folder / "cache").mkdir(exist_ok=True)

    def is_current():
        return ask(session, "GET", "/api/run").json()["is_current"]

    note_run(workspace, RunNotes(project_motion_digest(folder, video), ()))
    assert is_current()
    workspace.change_ground_marks(GroundMarks(field_of_view=62.0), GroundMarks())
    assert not is_current()
    note_run(workspace, RunNotes(project_motion_digest(folder, video), ()))
    assert is_current()


def test_every_open_page_hears_the_news():
    async def listen():
        events = Events()
        pages = [events.stream(lambda: {"revision": 0}) for _ in range(2)]
        first = [await anext(page) for page in pages]
        threading.Thread(target=events.publish, args=({"revision": 1},)).start()
        later = [await anext(page) for page in pages]
        events.close()
        rest = [[text async for text in page] for page in pages]
        return first, later, rest

    first, later, rest = run_apart(listen())
    assert first == ['data: {"revision": 0}\n\n'] * 2
    assert later == ['data: {"revision": 1}\n\n'] * 2
    assert rest == [[], []]


def test_what_stands_in_the_way_is_reported_once_and_when_it_is_gone(opened, folder, monkeypatch):
    session = opened()
    submit(session.store, mark(3, "neck", [10, 20, 2]))
    heard = []
    monkeypatch.setattr(Events, "publish", lambda self, news: heard.append(news))
    watch = ProjectWatch(session)
    watch.close()
    (folder / "annotations.json").write_text("half a fi")
    for _ in range(3):
        watch.check()
    (folder / "annotations.json").unlink()
    watch.check()
    assert [bool(news["trouble"]) for news in heard] == [True, False]


def test_a_page_opens_before_the_stored_results_are_read_and_hears_of_them(opened, folder):
    write_keyframes(folder, [10, 30], [30, 40])
    when_read = []
    assistant = Assistant(
        ready=lambda _, then: bool(when_read or when_read.append(then)),
        keyframes=lambda _: {"frames": {10: {"why": "Unlike the others."}}, "boxes": [None] * 50},
    )
    session = opened(assistant)
    early = ask(session, "GET", "/api/project").json()
    assert [row["frame"] for row in early["keyframes"]] == [10, 30, 40]
    assert (early["boxes"], early["has"]["loaded"]) == (None, False)
    news = []
    session.events.publish = news.append
    when_read[0]()
    assert news == [{"project": True}]
    late = ask(session, "GET", "/api/project").json()
    assert late["keyframes"][0]["why"] == "Unlike the others."
    assert late["has"]["loaded"]


def test_whatever_another_program_makes_of_the_project_is_news(opened, folder):
    session = opened()
    watch = ProjectWatch(session)
    watch.close()
    heard = []
    session.events.publish = heard.append
    (folder / "cache").mkdir(exist_ok=True)
    (folder / "exports").mkdir()
    written = ("motion.npz", "report.html", "cache/run.json", "exports/p.bvh")
    for name in ("exports", *written):
        if name != "exports":
            (folder / name).write_text("written")
        watch.check()
        assert heard.pop() == {"project": True}, name
        watch.check()
        assert heard == []


def test_a_project_tells_of_which_files_it_was_read(opened, folder):
    session = opened()
    read = ask(session, "GET", "/api/project").json()["files"]
    assert read == describe_files(session.workspace)
    (folder / "motion.npz").write_text("written")
    assert read != describe_files(session.workspace)


def test_a_frame_beyond_the_last_one_and_a_joint_that_nobody_has_are_refused(opened):
    session = opened(Assistant(suggestion=lambda *_: {}, pose=lambda *_: {}))
    place = {"frame": 50, "marks": {}, "nearer": {}}
    assert ask(session, "POST", "/api/pose", place).status == 400
    assert ask(session, "POST", "/api/pose", {**place, "frame": 49}).status == 200
    odd = {"frame": 3, "marks": {"toe": [1, 2, 2]}, "nearer": {}}
    assert ask(session, "POST", "/api/pose", odd).status == 400
    for route in ("suggestion", "backprojection"):
        assert ask(session, "GET", f"/api/{route}/50").status == 400


def test_the_watching_thread_outlives_bad_bytes(opened, folder):
    session = opened()
    published = []
    session.events.publish = published.append
    watch = ProjectWatch(session)
    try:
        for name in ("keyframes.json", "annotations.json"):
            (folder / name).write_bytes(b"\xff\xfe{")
            watch.check()
            assert name in [news["trouble"] for news in published if "trouble" in news][-1]
            (folder / name).unlink()
            watch.check()
        assert watch._thread.is_alive()
    finally:
        watch.close()


def test_a_connection_that_is_accepted_while_the_server_stops_is_closed(opened):
    session = opened()

    async def stop_while_one_comes():
        with listen("127.0.0.1", 0) as listener, socket.socket() as browser:
            server = PageServer(session, make_credentials(listener, "127.0.0.1"), grace=0)
            server.config.load()
            server.lifespan = server.config.lifespan_class(server.config)
            await server.startup([listener])
            browser.connect(listener.getsockname())
            for _ in range(2):  # the listener is read; what was accepted has no protocol yet
                await asyncio.sleep(0)
            assert not server.server_state.connections
            await server.shutdown([listener])
            return len(server.server_state.connections), browser.recv(1)

    assert run_apart(stop_while_one_comes()) == (0, b"")
