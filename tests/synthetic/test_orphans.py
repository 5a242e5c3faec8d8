"""Processes that draw end with the one that began them."""

import signal
import subprocess
import sys
import time
from pathlib import Path

from processes import is_running, needs_proc


def children(pid):
    """Processes that a process has begun and that still run."""
    listed = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(child) for child in listed]


@needs_proc
def test_nobody_goes_on_drawing_for_a_command_that_was_killed(tmp_path):
    command = [sys.executable, "-m", "keyrecon", "synth", "--out", str(tmp_path / "made")]
    with subprocess.Popen(
        [*command, "--workers", "2"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    ) as synth:
        end = time.monotonic() + 60
        while len(drawing := children(synth.pid)) < 3:  # one keeps count of shared resources
            assert synth.poll() is None
            assert time.monotonic() < end
            time.sleep(0.1)
        time.sleep(1.0)
        synth.send_signal(signal.SIGKILL)
    end = time.monotonic() + 20
    while any(is_running(child) for child in drawing):
        assert time.monotonic() < end
        time.sleep(0.1)
