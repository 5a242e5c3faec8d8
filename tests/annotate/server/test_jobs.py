"""Long work for the page: reported, cancelled, begun again."""

import time

import pytest
from annotator_jobs import counting, crashing

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


def test_a_job_that_fails_or_breaks_off_says_so(jobs):
    jobs, _ = jobs
    jobs.start("count", {"fail_at": 1})
    until(lambda: jobs.listed()[0].state == "failed")
    assert jobs.listed()[0].text == "That was too far."
    jobs.start("crash", {})
    until(lambda: jobs.listed()[0].state == "failed")
    assert "broke off" in jobs.listed()[0].text
