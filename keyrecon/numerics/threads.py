"""Linear algebra on one thread, so that sums are formed in one order on any machine.

Libraries of linear algebra split products among the cores there are, and a sum in another order has
other last bits; fits that go on from them end up elsewhere. Work is spread over cores by frames and
blocks instead (`io.frame_reader`, `TemplateFits.in_blocks`). The command line does all its work so;
in other programs every stage does.
"""

import os
from dataclasses import dataclass

from threadpoolctl import threadpool_limits


def one_order_of_sums() -> threadpool_limits:
    """A context in which linear algebra runs on one thread."""
    return threadpool_limits(limits=1, user_api="blas")


@dataclass
class _Sharing:
    """How many processes that work side by side this one is of."""

    processes: int = 1


_SHARING = _Sharing()


def core_count() -> int:
    """Cores that this process has to itself; results do not depend on it."""
    return max(1, (os.cpu_count() or 1) // _SHARING.processes)


def share_cores(processes: int) -> None:
    """Leave the others of so many processes their cores."""
    import cv2  # which most commands do without

    _SHARING.processes = processes
    cv2.setNumThreads(core_count())
