"""Jobs as they are done in a process of their own, which imports this and little else."""

import os
import time
from pathlib import Path

from keyrecon.errors import KeyreconError
from keyrecon.io.stages import StageStore
from keyrecon.io.workers import open_workers


def counting(options, progress):
    """A job that counts, and waits a while where it is asked to."""
    for n in progress(range(options.get("steps", 3)), "Counting"):
        time.sleep(options.get("seconds", 0))
        if n == options.get("fail_at"):
            raise KeyreconError("That was too far.")
    return "Counted."


def tell_and_wait(number, folder):
    """Tell the process and wait."""
    (Path(folder) / str(number)).write_text(str(os.getpid()))
    time.sleep(60)


def working_side_by_side(options, progress):
    """A job whose work two other processes do; all three tell who they are."""
    folder = Path(options["folder"])
    (folder / "job").write_text(str(os.getpid()))
    with open_workers("2") as workers:
        store = StageStore(folder / "cache", workers=workers)

        def wait(number):
            return store.keep(f"w@{number}", tell_and_wait, number, str(folder))

        return str([*store.each(wait, range(2))])


def crashing(options, progress):
    os._exit(3)
