"""Where stages are run when not here: processes of this machine, or machines of a Dask cluster.

Both are executors as `concurrent.futures` has them. Dask gives a task whose worker was lost to
another one; of processes of this machine none is expected to be lost, and the command ends.
"""

import logging
import multiprocessing
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from keyrecon.errors import KeyreconError, explain
from keyrecon.io.stage_tasks import StageTask, carry_out

Item = TypeVar("Item")
Result = TypeVar("Result")

CONNECT_SECONDS = 10.0
"""Until a scheduler must answer, and until it must have a worker."""
IN_QUEUE = 2
"""Shots per worker that are worked on: one runs while the next one is got ready."""
MOST_AT_ONCE = 400
"""Shots that are worked on, each by a thread that waits."""


@dataclass(frozen=True, eq=False)
class Workers:
    """Those who carry out tasks."""

    executor: Executor
    count: int
    """As many as there were at the beginning."""
    where: str
    """In messages."""

    @property
    def at_once(self) -> int:
        """Shots that are worked on at a time."""
        return min(MOST_AT_ONCE, IN_QUEUE * self.count)

    def carry_out(self, task: StageTask) -> float:
        """What the function of that name gives, done elsewhere; waits for it.

        Raises KeyreconError as that does, and where the workers are gone.
        """
        with self._naming_loss():
            return self.executor.submit(carry_out, task).result()

    def each(self, work: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """`work`, which calls stages, done for every item side by side; results in order."""
        pool = ThreadPoolExecutor(self.at_once)
        pending: deque[Future[Result]] = deque()
        try:
            for item in items:
                pending.append(pool.submit(work, item))
                if len(pending) > self.at_once:
                    yield pending.popleft().result()
            while pending:
                yield pending.popleft().result()
        finally:  # who waits for a stage is woken when the workers are let go
            pool.shutdown(wait=False, cancel_futures=True)

    @contextmanager
    def _naming_loss(self) -> Iterator[None]:
        try:
            yield
        except (BrokenExecutor, CancelledError) as fault:
            raise self._lost("no longer there") from fault
        except Exception as fault:
            if type(fault).__name__ == "KilledWorker":
                raise self._lost(
                    "lost again and again with the same stage, maybe for want of memory"
                ) from fault
            raise

    def _lost(self, how: str) -> KeyreconError:
        return KeyreconError(
            f"The workers of {self.where} are {how}; finished stages are kept, the same command "
            "goes on from there."
        )


@contextmanager
def open_workers(where: str | None) -> Iterator[Workers | None]:
    """The workers at the address of a Dask scheduler, or so many processes; None for nothing said.

    Raises KeyreconError where there are none.
    """
    if where is None:
        yield None
    elif where.isdecimal():
        with _processes(int(where)) as workers:
            yield workers
    else:
        with _cluster(where) as workers:
            yield workers


@contextmanager
def _processes(count: int) -> Iterator[Workers]:
    if count == 0:
        raise KeyreconError("--workers is a number of processes from 1 on, or an address.")
    others = multiprocessing.active_children()
    pool = ProcessPoolExecutor(count, multiprocessing.get_context("spawn"))
    try:
        yield Workers(pool, count, "this machine")
    finally:
        for process in multiprocessing.active_children():
            if process not in others:
                process.terminate()  # what it does nobody waits for any more
        pool.shutdown(cancel_futures=True)


@contextmanager
def _cluster(address: str) -> Iterator[Workers]:
    try:
        import dask
        from distributed import Client
    except ImportError as fault:
        raise KeyreconError(
            "--workers with an address needs Dask: pip install 'keyrecon[cluster]'."
        ) from fault
    if ":" not in address.split("//")[-1]:
        raise KeyreconError(
            f"--workers {address} has no port; give the address that `dask scheduler` prints, such "
            "as tcp://head:8786."
        )
    for name in logging.root.manager.loggerDict:
        if name.startswith("distributed"):  # what matters is told in one line
            logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError) as fault:
        raise KeyreconError(
            f"No Dask scheduler answers at {address} ({explain(fault)}); start one with "
            "`dask scheduler` and give the address that it prints."
        ) from fault
    try:
        yield Workers(client.get_executor(), _count_workers(client, address), address)
    finally:
        with dask.config.set({"distributed.comm.retry.count": 0}):
            client.close()


def _count_workers(client: Any, address: str) -> int:
    """Workers of a scheduler, waiting for the first one."""
    try:
        client.wait_for_workers(1, timeout=CONNECT_SECONDS)
    except TimeoutError as fault:
        raise KeyreconError(
            f"The scheduler at {address} has no workers; start some with: "
            f"dask worker {address} --nthreads 1"
        ) from fault
    return len(client.ncores())
