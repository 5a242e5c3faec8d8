"""Of commands that write into one project, one works at a time; who is killed leaves it free."""

import os
import signal
import subprocess
import sys

import pytest
from command_line import keyrecon
from small_motion import make_motion

from keyrecon import KeyreconError
from keyrecon.annotate.server.page_words import in_page_words
from keyrecon.app.annotator import job_commands
from keyrecon.io import work_lock
from keyrecon.io.durable import hold_lock
from keyrecon.io.formats.motion_file import write_motion
from keyrecon.io.video import open_video
from keyrecon.io.work_lock import lock_project
from keyrecon.io.workspace import Workspace
from keyrecon.progress import silent

HOLD = """
import sys
from pathlib import Path
from keyrecon.io.work_lock import lock_project
with lock_project(Path(sys.argv[1]), "keyrecon run"):
    print("holds", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def project(tmp_path, write_numbered):
    path = tmp_path / "video.mp4"
    path.write_bytes(write_numbered("v.mp4", list(range(0, 240, 12))).read_bytes())
    return Workspace.create(tmp_path / "project", open_video(path), path, {}).folder


@pytest.fixture
def holder(project):
    """Another process that works on the project."""
    paths = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    program = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(project)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=paths,
    )
    assert program.stdout.readline().strip() == b"holds"
    yield program
    program.kill()
    program.communicate()


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr(work_lock, "WAIT_SECONDS", 0.1)


COMMANDS = [
    ("keyframes", "{project}"),
    ("run", "{project}"),
    ("pick", "{project}", "--frame", "0", "--head", "60,20"),
    ("import", "{project}", "{video}"),
    ("court", "{project}"),
    ("ground", "{project}"),
    ("relink", "{project}", "{video}"),
    ("add", "{video}", "--project", "{project}"),
]


@pytest.mark.parametrize("words", COMMANDS, ids=lambda words: words[0])
def test_while_one_command_works_on_a_project_another_that_writes_is_refused(
    project, holder, capsys, words
):
    before = {file.name: file.read_bytes() for file in project.iterdir() if file.is_file()}
    filled = [word.format(project=project, video=project.parent / "video.mp4") for word in words]
    assert keyrecon(*filled) == 1
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert f"keyrecon run (process {holder.pid}, since " in told
    assert f"is working on {project}; wait until it has ended" in told
    assert {f.name: f.read_bytes() for f in project.iterdir() if f.is_file()} == before


def test_what_only_reads_a_project_is_not_refused(project, holder):
    write_motion(project / "motion.npz", make_motion(20))
    assert keyrecon("export", project, project.parent / "m.csv") == 0


def test_a_process_that_is_killed_leaves_the_project_free(project, holder):
    with pytest.raises(KeyreconError, match=f"process {holder.pid}"), lock_project(project, "x"):
        pass
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    with lock_project(project, "x"):
        pass


def test_what_workers_that_were_killed_were_given_is_cleared(project):
    left = project / "cache" / "inputs-track@3-0123.npz"
    left.parent.mkdir()
    left.write_bytes(b"")
    with lock_project(project, "keyrecon run"):
        assert not left.exists()


def test_the_pages_work_is_refused_too_and_what_it_reads_is_not(project, holder):
    jobs = job_commands(project)
    for name in set(jobs) - {"export"}:
        with pytest.raises(KeyreconError, match=f"process {holder.pid}"):
            jobs[name]({}, silent)
    write_motion(project / "motion.npz", make_motion(20))
    assert "csv" in jobs["export"]({"formats": [".csv"]}, silent)


def test_marks_are_taken_while_a_command_works(project, holder):
    with Workspace(project).exclusive():
        pass


def test_who_works_is_not_named_by_who_worked_before(project):
    with lock_project(project, "keyrecon keyframes"):
        pass
    lock = hold_lock(project / ".work.lock")
    with (
        pytest.raises(KeyreconError, match="Another command is working"),
        lock_project(project, "x"),
    ):
        pass
    lock.release()


def test_the_page_says_it_without_a_command(project, holder):
    with pytest.raises(KeyreconError) as told, lock_project(project, "x"):
        pass
    said = in_page_words(str(told.value))
    assert said.startswith(f"A command in a terminal (process {holder.pid}, since ")
    assert said.endswith("wait until it has ended, or stop it where it was begun.")
