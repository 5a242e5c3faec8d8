"""Long work asked for by the page: in a process of its own, with progress, and cancelled at will.

A process of its own leaves the page quick while all cores are busy, and can be ended at any
moment: the results of finished stages are kept in the cache, so the same job goes on from there.
It may have others work for it. All end with it, and it ends with the server.
"""

import itertools
import multiprocessing
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sized
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from threading import Lock, Thread
from typing import Any, TypeVar

from keyrecon.errors import KeyreconError
from keyrecon.io.local_workers import belong_to_parent
from keyrecon.progress import Progress

Item = TypeVar("Item")
Command = Callable[[dict[str, Any], Progress], str]
"""Does the work with the options that the page gave; importable, because it is done elsewhere."""
PROGRESS_SECONDS = 0.1
"""How often progress is reported."""


@dataclass(frozen=True)
class Job:
    """How far a job is."""

    id: int
    kind: str
    state: str = "running"
    """running, done, failed or cancelled"""
    text: str = ""
    """What is being done; at the end what came of it."""
    done: int = 0
    total: int | None = None


class Jobs:
    """The jobs of one project, one at a time."""

    def __init__(self, commands: Mapping[str, Command], publish: Callable[[Job], None]) -> None:
        """Offer `commands` by kind; `publish` is called with every step of a job."""
        self._commands, self._publish = commands, publish
        self._lock = Lock()
        self._jobs: dict[int, Job] = {}
        self._process: Any = None
        self._numbers = itertools.count(time.time_ns() // 1_000_000)

    def listed(self) -> list[Job]:
        """All jobs since the start, the latest first."""
        return [*reversed(self._jobs.values())]

    def start(self, kind: str, options: dict[str, Any]) -> Job:
        """Begin a job; KeyreconError while another one runs."""
        if kind not in self._commands:
            raise KeyreconError(f"There is no job '{kind}'; there are {', '.join(self._commands)}.")
        with self._lock:
            if any(job.state == "running" for job in self._jobs.values()):
                raise KeyreconError(
                    "The program is at work already; wait until it has ended, or cancel it."
                )
            job = Job(next(self._numbers), kind)
            self._jobs[job.id] = job
            ours, theirs = _spawning.Pipe(duplex=False)
            self._process = _spawning.Process(
                target=_work, args=(self._commands[kind], options, theirs)
            )
            self._process.start()
        theirs.close()
        Thread(target=self._receive, args=(job, ours), daemon=True).start()
        return job

    def cancel(self, number: int) -> Job:
        """End a job; KeyreconError if there is none of that number."""
        with self._lock:
            if number not in self._jobs:
                raise KeyreconError(f"There is no job {number}.")
            if self._jobs[number].state == "running":
                self._jobs[number] = replace(self._jobs[number], state="cancelled")
                self._process.terminate()
            job = self._jobs[number]
            self._publish(job)
        return job

    def close(self) -> None:
        """End what is running."""
        for job in self.listed():
            self.cancel(job.id)

    def _receive(self, job: Job, connection: Connection) -> None:
        """Take in what the process reports until it ends."""
        last = job
        with suppress(EOFError):
            while True:
                last = replace(job, **connection.recv())
                self._update(last)
        if last.state == "running":
            text = "The work broke off; the terminal that runs keyrecon annotate says why."
            self._update(replace(last, state="failed", text=text))

    def _update(self, job: Job) -> None:
        with self._lock:
            if self._jobs[job.id].state != "running":
                return
            self._jobs[job.id] = job
            self._publish(job)  # not later: what is published last is the last


_spawning = multiprocessing.get_context("spawn")


def _work(command: Command, options: dict[str, Any], reports: Connection) -> None:
    """What the process does."""
    belong_to_parent()

    def progress(
        items: Iterable[Item], description: str, total: int | None = None
    ) -> Iterator[Item]:
        total = len(items) if total is None and isinstance(items, Sized) else total
        before = 0.0
        for done, item in enumerate(items):
            if time.monotonic() - before > PROGRESS_SECONDS:
                before = time.monotonic()
                reports.send({"text": description, "done": done, "total": total})
            yield item

    with suppress(BrokenPipeError):
        try:
            reports.send({"state": "done", "text": command(options, progress)})
        except KeyreconError as fault:
            reports.send({"state": "failed", "text": str(fault)})
