"""Jobs as they are done in a process of their own, which imports this and little else."""

import os
import time

from keyrecon.errors import KeyreconError


def counting(options, progress):
    """A job that counts, and waits a while where it is asked to."""
    for n in progress(range(options.get("steps", 3)), "Counting"):
        time.sleep(options.get("seconds", 0))
        if n == options.get("fail_at"):
            raise KeyreconError("That was too far.")
    return "Counted."


def crashing(options, progress):
    os._exit(3)
