"""Long work for the page: reported, cancelled, begun again."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from annotator_jobs import counting, crashing, working_side_by_side
from processes import is_running, needs_proc

from keyrecon import KeyreconError
from keyrecon.annotate.server.jobs import Jobs


def until(fact, seconds=20.0):
    """Wait for something that another thread or process does."""
    end = time.monotonic() + seconds
    while not fact():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.fixture
def jobs():
    heard = []
    commands = {"count": counting, "crash": crashing, "work": working_side_by_side}
    jobs = Jobs(commands, heard.append)
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
    with pytest.raises(KeyreconError, match="at work already"):
        jobs.start("count", {})
    until(lambda: heard)
    assert jobs.cancel(first.id).state == "cancelled"
    second = jobs.start("count", {"steps": 2})
    until(lambda: jobs.listed()[0].state == "done")
    assert [(job.id, job.state) for job in jobs.listed()] == [
        (second.id, "done"),
        (first.id, "cancelled"),
    ]


def test_what_is_heard_last_of_a_job_is_its_end():
    heard, slow = [], threading.Event()

    def publish(job):
        if job.state == "running":
            slow.set()
            time.sleep(0.5)
        heard.append(job.state)

    jobs = Jobs({"count": counting}, publish)
    job = jobs.start("count", {"steps": 1000, "seconds": 0.1})
    assert slow.wait(20)
    jobs.cancel(job.id)
    until(lambda: {"running", "cancelled"} <= {*heard})
    jobs.close()
    assert heard.index("cancelled") > heard.index("running")


SERVER = """
import sys
import time
from annotator_jobs import working_side_by_side
from keyrecon.annotate.server.jobs import Jobs
if __name__ == "__main__":
    Jobs({"work": working_side_by_side}, print).start("work", {"folder": sys.argv[1]})
    time.sleep(60)
"""


def told_processes(folder):
    """A job and the two processes that work for it, once they have told who they are."""
    files = [folder / name for name in ("job", "0", "1")]
    until(lambda: all(file.is_file() and file.read_text() for file in files), 40)
    return [int(file.read_text()) for file in files]


@needs_proc
def test_a_job_that_is_cancelled_takes_those_that_work_for_it_along(jobs, tmp_path):
    jobs, _ = jobs
    job = jobs.start("work", {"folder": str(tmp_path)})
    processes = told_processes(tmp_path)
    jobs.cancel(job.id)
    until(lambda: not any(map(is_running, processes)))


@needs_proc
def test_nothing_works_on_when_the_server_is_killed(tmp_path):
    script = tmp_path / "server.py"
    script.write_text(SERVER)
    paths = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen([sys.executable, script, tmp_path], env=paths) as server:
        processes = told_processes(tmp_path)
        server.send_signal(signal.SIGKILL)
    until(lambda: not any(map(is_running, processes)))


def test_a_job_that_fails_or_breaks_off_says_so(jobs):
    jobs, _ = jobs
    jobs.start("count", {"fail_at": 1})
    until(lambda: jobs.listed()[0].state == "failed")
    assert jobs.listed()[0].text == "That was too far."
    jobs.start("crash", {})
    until(lambda: jobs.listed()[0].state == "failed")
    assert "broke off" in jobs.listed()[0].text
