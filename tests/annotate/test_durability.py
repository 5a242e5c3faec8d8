"""Kills at any moment and full disks: what was acknowledged is there, the project opens."""

import os
import random
import resource
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest
from annotator_edits import mark, submit

from keyrecon.annotate.store.cells import cells_from_annotations, written_cells
from keyrecon.annotate.store.edits import Limits
from keyrecon.annotate.store.journal import NotSaved
from keyrecon.annotate.store.store import Store
from keyrecon.body import LSP14
from keyrecon.io.formats.coco import read_coco
from keyrecon.io.workspace import Workspace

LIMITS = Limits(LSP14, 100, (128, 64))
KILLS = int(os.environ.get("KEYRECON_KILLS", "25"))
"""How often the editing program is killed."""
EDITING = """
import itertools, os, sys
from pathlib import Path
from annotator_edits import mark, submit
from keyrecon.annotate.store.edits import Limits
from keyrecon.annotate.store.store import Store
from keyrecon.body import LSP14
from keyrecon.io.workspace import Workspace

def say(word):  # in one piece: whoever is killed has said a word or has not
    os.write(1, f"{word}\\n".encode())

def edit_forever(folder, first):
    say(os.getpid())
    store = Store(Workspace(folder), Limits(LSP14, 100, (128, 64)))
    for number in itertools.count(first):
        if number % 7 == 5:
            store.undo(f"edit {number}")
        elif number % 7 == 6:
            store.redo(f"edit {number}")
        else:
            before = store.state.cells.get(("mark", number % 100, "neck"))
            late = mark(number % 100, "neck", [number % 120, 7.5, 2], was=before)
            assert submit(store, {**late, "id": f"edit {number}"})[0]["ok"]
        say(number)

for first in sys.stdin:
    child = os.fork()
    if not child:
        edit_forever(Path(sys.argv[1]), int(first))
    os.waitpid(child, 0)
    say("dead")
"""
"""Begins to edit at the number it is given, in a process that can be killed, again and again."""


@pytest.fixture
def editing(bare):
    """The editing program, and pipes to and from it."""
    paths = os.pathsep.join([*sys.path])
    with subprocess.Popen(
        [sys.executable, "-c", EDITING, str(bare)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": paths},
    ) as program:
        yield program
        program.kill()


def cells_now(bare):
    """What is there when the project is opened; the file must say the same."""
    store = Store(Workspace(bare), LIMITS)
    cells = store.state.cells
    store.close()
    if cells:
        marks = read_coco(bare / "annotations.json", LSP14, 100, (128, 64))
        assert cells_from_annotations(marks) == written_cells(cells)
    return cells


def edit_and_be_killed(editing, first, least, seconds):
    """Numbers of the edits that were acknowledged before the kill, `least` and some seconds on."""
    print(first, file=editing.stdin, flush=True)
    process = int(editing.stdout.readline())
    heard = [editing.stdout.readline() for _ in range(least)]
    time.sleep(seconds)
    os.kill(process, signal.SIGKILL)
    heard += iter(editing.stdout.readline, "dead\n")
    return [int(line) for line in heard]


def cells_after(count):
    """What must be there after so many steps of EDITING: five edits, an undo and a redo."""
    edits = [n for n in range(count) if n % 7 < 5]
    if count % 7 == 6:
        edits.pop()
    return {("mark", n % 100, "neck"): [n % 120, 7.5, 2] for n in edits}


def test_no_kill_loses_an_acknowledged_edit(bare, editing):
    rng, done = random.Random(KILLS), 0
    for _ in range(KILLS):
        heard = edit_and_be_killed(editing, done, rng.randrange(10), rng.uniform(0.0, 0.02))
        done = heard[-1] + 1 if heard else done
        assert heard == [*range(done - len(heard), done)]
        one_ahead = cells_after(done + 1)  # accepted, and killed before it was acknowledged
        assert cells_now(bare) in (cells_after(done), one_ahead)
    assert done > 3 * KILLS


@contextmanager
def files_of_at_most(size):
    """As if the disk were full: no file of this process can grow beyond `size`."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def fill(store):
    """Edit until an edit is not saved; returns the accepted ones and the one that was not."""
    accepted = {}
    for number in range(10_000):
        late = mark(number % 100, LSP14.names[number // 100], [number % 120, 7.5, 2])
        try:
            assert submit(store, late)[0]["ok"]
        except NotSaved as fault:
            return accepted, late, str(fault)
        accepted["mark", late["frame"], late["joint"]] = late["to"]
    raise AssertionError("The disk never was full.")


@pytest.mark.parametrize("size", [1_000, 9_000, 30_000, 64_000])
def test_a_full_disk_is_told_and_damages_nothing(bare, size):
    store = Store(Workspace(bare), LIMITS)
    with files_of_at_most(size):
        accepted, late, message = fill(store)
    assert "could not be written" in message
    assert "ree some space" in message
    store.close()
    assert accepted.items() <= cells_now(bare).items()
    store = Store(Workspace(bare), LIMITS)
    assert submit(store, late)[0]["ok"]
    store.close()
    accepted["mark", late["frame"], late["joint"]] = late["to"]
    assert cells_now(bare) == accepted


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs to mount a disk")
def test_a_tiny_disk_that_fills_up_is_told_and_damages_nothing(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=300k", "tmpfs", str(disk)]
    if subprocess.run(mount, check=False, capture_output=True).returncode:
        pytest.skip("this machine lets nobody mount a disk")
    try:
        (disk / "project.toml").write_text('[video]\npath = "v.mp4"\nfingerprint = "x"\n')
        store = Store(Workspace(disk), LIMITS)
        (disk / "ballast").write_bytes(bytes(60_000))
        accepted, late, message = fill(store)
        assert "could not be written" in message
        (disk / "ballast").unlink()
        assert submit(store, late)[0]["ok"]
        store.close()
        accepted["mark", late["frame"], late["joint"]] = late["to"]
        assert cells_now(disk) == accepted
    finally:
        subprocess.run(["umount", str(disk)], check=True)
