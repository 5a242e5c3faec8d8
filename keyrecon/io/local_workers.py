"""Processes of this machine that carry out stages.

Each is a pool of its own: whoever works on a shot has one of them to himself until the shot is
done, and what that process has decoded of the shot serves all of its stages. One that is lost is
begun again, and does what it was doing once more.
"""

import multiprocessing
import os
import signal
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from queue import LifoQueue
from threading import Lock, Thread, local

from keyrecon.io.stage_tasks import StageTask, carry_out
from keyrecon.numerics.threads import share_cores


class LocalProcesses:
    """Some processes, which begin when they are first needed."""

    def __init__(self, count: int) -> None:
        """So many at most."""
        self._all = [_Process(count) for _ in range(count)]
        self._idle: LifoQueue[_Process] = LifoQueue()  # the last one has its libraries read
        for process in self._all:
            self._idle.put(process)
        self._own = local()

    def close(self) -> None:
        """Begin none any more."""
        for process in self._all:
            process.close()

    def wait(self) -> None:
        """Return when all have ended, and what kept watch over them.

        Python wakes such watches when the program ends, without a look at whether one is just about
        to close what it is woken by: then a traceback would follow what the program said last.
        """
        for process in self._all:
            process.let_go()

    @contextmanager
    def turn(self) -> Iterator[None]:
        """Within it, this thread has a process to itself; waits until one is free."""
        process = self._idle.get()
        self._own.process = process
        try:
            yield
        finally:
            del self._own.process
            self._idle.put(process)

    @property
    def in_turn(self) -> bool:
        """Whether this thread has a process to itself."""
        return hasattr(self._own, "process")

    def carry_out(self, task: StageTask) -> float:
        """Have a task done by the process of this thread, or by any; BrokenExecutor without."""
        if not self.in_turn:
            with self.turn():
                return self.carry_out(task)
        process: _Process = self._own.process
        return process.carry_out(task)


class _Process:
    """One process, or none yet."""

    def __init__(self, count: int) -> None:
        """One of so many."""
        self._count, self._closed = count, False
        self._pool: ProcessPoolExecutor | None = None
        self._changing = Lock()

    def carry_out(self, task: StageTask) -> float:
        """Have a task done, a second time where the process is lost on the way."""
        try:
            return self._submit(task).result()
        except BrokenExecutor:
            self.let_go()
        try:
            return self._submit(task).result()
        except BrokenExecutor:
            self.let_go()
            raise

    def _submit(self, task: StageTask) -> Future[float]:
        with self._changing:
            if self._closed:
                raise BrokenExecutor("closed")
            if self._pool is None:
                self._pool = ProcessPoolExecutor(
                    1, multiprocessing.get_context("spawn"), _begin, (self._count,)
                )
            return self._pool.submit(carry_out, task)

    def close(self) -> None:
        """Begin it no more."""
        with self._changing:
            self._closed = True

    def let_go(self) -> None:
        """Wait until the process, which has been ended, is gone."""
        with self._changing:
            if self._pool is not None:
                self._pool.shutdown()
            self._pool = None


def _begin(count: int) -> None:
    """What each of `count` processes does first."""
    belong_to_parent()
    share_cores(count)


def belong_to_parent() -> None:
    """Let this process end when the one that began it does, and not by a key."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one who asks is told, and ends this one
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def local_processes(count: int) -> Iterator[LocalProcesses]:
    """So many processes, ended with the context whatever they do."""
    others = multiprocessing.active_children()
    processes = LocalProcesses(count)
    try:
        yield processes
    finally:
        processes.close()
        for process in multiprocessing.active_children():
            if process not in others:
                process.terminate()  # what it does nobody waits for any more
        processes.wait()
