"""The command: its address, who can reach it, and a server that is killed."""

import json
import os
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
from annotator_edits import mark

from keyrecon import KeyreconError
from keyrecon.annotate.server import address
from keyrecon.app import annotator
from keyrecon.app.annotator import announce, job_commands
from keyrecon.io import workers as io_workers
from keyrecon.io.provenance import current_exports
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options, with_field_of_view, with_height
from keyrecon.progress import silent


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


def test_an_address_that_others_can_reach_is_warned_of():
    address = "http://127.0.0.1:1/?token=x"
    assert announce(Path("p"), address, "127.0.0.1").endswith(address)
    assert "reached from other machines" in announce(Path("p"), address, "0.0.0.0")


def test_an_address_answers_only_under_the_names_it_is_reached_by(monkeypatch):
    """A browser sends them in small letters."""
    monkeypatch.setattr(address.socket, "gethostname", lambda: "Annas-PC.local")
    monkeypatch.setattr(address, "_addresses", lambda _: ())
    for host, first in (("127.0.0.1", "127.0.0.1"), ("0.0.0.0", "annas-pc.local")):
        with address.listen(host, 0) as listener:
            port = listener.getsockname()[1]
            credentials = address.make_credentials(listener, host)
            assert credentials.hosts[0] == f"{first}:{port}"
            assert f"localhost:{port}" in credentials.hosts
            with pytest.raises(KeyreconError, match="choose another --port"):
                address.listen(host, port)


@pytest.mark.parametrize("port", [-1, 65_536, 99_999])
def test_a_port_that_there_is_not_is_told_with_those_there_are(port):
    with pytest.raises(KeyreconError, match=f"--port cannot be {port}; .* from 1 to 65535, or non"):
        address.listen("127.0.0.1", port)


@pytest.mark.parametrize(
    ("host", "ours"),
    [("127.0.0.1", True), ("localhost", True), ("::1", True), ("0.0.0.0", False), ("evil", False)],
)
def test_only_this_machine_reaches_a_loopback_address(host, ours):
    assert address.is_loopback(host) == ours


def test_a_height_that_was_cleared_is_none_and_one_that_is_not_told_stays(bare, monkeypatch):
    heights = []
    run = job_commands(bare)["run"]

    def note_height(workspace, options, progress, partial):
        heights.append(options.lift.height)
        return ""

    monkeypatch.setattr(annotator.running, "run", note_height)
    Workspace(bare).remember(with_height(Options(), 1.8), Options())
    for told in ({}, {"height": 1.7}, {"height": None}):
        run(told, silent)
    assert heights == [1.8, 1.7, None]


def test_a_field_of_view_is_told_cleared_and_kept_as_a_height_is(bare, monkeypatch):
    told_to_run = []
    run = job_commands(bare)["run"]

    def note_lift(workspace, options, progress, partial):
        told_to_run.append((options.lift.field_of_view, options.lift.height))
        return ""

    monkeypatch.setattr(annotator.running, "run", note_lift)
    remembered = with_field_of_view(with_height(Options(), 1.8), 62.0)
    Workspace(bare).remember(remembered, Options())
    for told in ({}, {"field_of_view": 40.0}, {"field_of_view": None}, {"height": None}):
        run(told, silent)
    assert told_to_run == [(62, 1.8), (40, 1.8), (None, 1.8), (62, None)]
    with pytest.raises(KeyreconError, match="200 cannot be"):
        run({"field_of_view": 200.0}, silent)


def test_an_export_of_a_motion_that_a_run_replaces_meanwhile_is_not_of_the_new_one(
    bare, monkeypatch
):
    workspace = Workspace(bare)
    workspace.motion_file.write_text("old")
    os.utime(workspace.motion_file, (10, 10))

    def export_beside_a_run(_workspace, files, *_):
        workspace.motion_file.write_text("new")
        files[0].write_text("of the old one")
        return []

    monkeypatch.setattr(annotator, "export", export_beside_a_run)
    job_commands(bare)["export"]({"formats": (".mp4",)}, silent)
    assert len(workspace.exported_files()) == 1
    assert current_exports(workspace) == []


@pytest.mark.parametrize(
    ("job", "module", "name", "side_by_side"),
    [
        ("run", "running", "run", True),
        ("keyframes", "keyframing", "find_keyframes", True),
        ("golf", "golf", "fit_project", False),
    ],
)
def test_the_page_has_shots_worked_on_side_by_side_where_the_command_line_does(
    bare, monkeypatch, job, module, name, side_by_side
):
    monkeypatch.setattr(io_workers, "core_count", lambda: 2)
    seen = []

    def look(workspace, *_, **named):
        seen.append(workspace.stages.has_workers)
        return ""

    monkeypatch.setattr(getattr(annotator, module), name, look)
    monkeypatch.setattr(annotator, "_prepare_with_bodies", lambda *_: None)
    monkeypatch.setattr(Workspace, "video", lambda _: None)
    job_commands(bare)[job]({}, silent)
    assert seen == [side_by_side]


@pytest.mark.parametrize("text", ["", "{", "[" * 9999, '{"port": 80, "session": "guess"}', "null"])
def test_a_damaged_memory_of_the_address_is_no_memory(tmp_path, text):
    (tmp_path / "annotator.json").write_text(text)
    assert address.recall(tmp_path / "annotator.json") == address.LastAddress()


def test_the_last_address_is_kept_for_oneself_and_used_again_if_free(tmp_path):
    file = tmp_path / "cache" / "annotator.json"
    with address.listen("127.0.0.1", 0) as first:
        credentials = address.make_credentials(first, "127.0.0.1")
        address.remember(file, credentials)
        memory = address.recall(file)
        with address.listen("127.0.0.1", 0, memory) as second:
            assert second.getsockname()[1] != credentials.port
    with address.listen("127.0.0.1", 0, memory) as third:
        again = address.make_credentials(third, "127.0.0.1", memory)
    assert (again.port, again.cookie_secret) == (credentials.port, credentials.cookie_secret)
    assert again.token != credentials.token
    assert file.stat().st_mode & 0o077 == 0
