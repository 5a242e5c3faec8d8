"""Where stages are run when not here: processes of this machine, or machines of a Dask cluster.

A task whose worker was lost is given to another one by Dask; a process of this machine is begun
again. Where nobody says otherwise, as many processes as there are cores work on shots side by side,
and all else is done here.
"""

import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Future, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from typing import Any, TypeVar

from keyrecon.errors import KeyreconError, explain
from keyrecon.io.local_workers import local_processes
from keyrecon.io.stage_tasks import StageTask, carry_out
from keyrecon.numerics.threads import core_count

Item = TypeVar("Item")
Result = TypeVar("Result")

CONNECT_SECONDS = 10.0
"""Until a scheduler must answer, and until it must have a worker."""
IN_QUEUE = 2
"""Shots per worker of a cluster that are worked on: one runs while the next one is got ready."""
MOST_AT_ONCE = 400
"""Shots that are worked on, each by a thread that waits."""
IN_ORDER = 8
"""Shots begun or done for each that is worked on, until the first of them is done: a short one does
not wait for a long one before it."""
MOST_PROCESSES = 8
"""That are begun where nobody says how many: each may hold a shot of 1 GB."""
MOST_GROUPS = 2
"""Groups of shots that they work on at a time, each of 1.3 GB where shots seldom have half."""


@dataclass(frozen=True, eq=False)
class Workers:
    """Those who carry out tasks."""

    do: Callable[[StageTask], float]
    """Has a task done and waits for it."""
    at_once: int
    """Shots that are worked on at a time."""
    where: str
    """In messages."""
    turn: Callable[[], AbstractContextManager[None]] = nullcontext
    """Within it a thread works on one shot."""
    takes_stage: Callable[[], bool] = lambda: True
    """Whether a stage that this thread calls is for them."""
    large_at_once: int | None = None
    """Groups of shots that are worked on at a time; as many as shots where nothing is said."""
    far: bool = False
    """Whether they are other machines, which had better read a video themselves than be sent it."""

    def carry_out(self, task: StageTask) -> float:
        """What the function of that name gives, done elsewhere; waits for it.

        Raises KeyreconError as that does, and where the workers are gone.
        """
        with self._naming_loss():
            return self.do(task)

    def each(
        self, work: Callable[[Item], Result], items: Iterable[Item], large: bool = False
    ) -> Iterator[Result]:
        """`work`, which calls stages, done for every item side by side; results in order."""
        at_once = self.large_at_once if large and self.large_at_once else self.at_once

        def work_in_turn(item: Item) -> Result:
            with self.turn():
                return work(item)

        pool = ThreadPoolExecutor(at_once)
        pending: deque[Future[Result]] = deque()
        try:
            for item in items:
                pending.append(pool.submit(work_in_turn, item))
                if len(pending) > IN_ORDER * at_once:
                    yield pending.popleft().result()
            while pending:
                yield pending.popleft().result()
        finally:  # who waits for a stage is woken when the workers are let go
            pool.shutdown(wait=False, cancel_futures=True)

    @contextmanager
    def _naming_loss(self) -> Iterator[None]:
        try:
            yield
        except CancelledError as fault:
            raise self._lost("no longer there") from fault
        except Exception as fault:
            if isinstance(fault, BrokenExecutor) or type(fault).__name__ == "KilledWorker":
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
    """The workers at the address of a Dask scheduler, or so many processes.

    Where nothing is said they are as many as there are cores, and work on nothing but shots and
    groups of shots; on one core there are none. Raises KeyreconError where there are none at the
    address.
    """
    if where is None:
        count = min(MOST_PROCESSES, core_count())
        if count == 1:
            yield None
            return
        with local_processes(count) as processes:
            yield Workers(
                processes.carry_out,
                count,
                "this machine",
                processes.turn,
                lambda: processes.in_turn,
                min(MOST_GROUPS, count),
            )
    elif where.isdecimal():
        if (count := int(where)) == 0:
            raise KeyreconError("--workers is a number of processes from 1 on, or an address.")
        with local_processes(count) as processes:
            yield Workers(processes.carry_out, count, "this machine", processes.turn)
    else:
        with _cluster(where) as workers:
            yield workers


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
        executor, count = client.get_executor(), _count_workers(client, address)
        yield Workers(
            lambda task: executor.submit(carry_out, task).result(),
            min(MOST_AT_ONCE, IN_QUEUE * count),
            address,
            far=True,
        )
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
