"""One command at a time works on a project.

Commands that write hold a lock from the first file that they read to the last that they write, so
that no result is made of half of one command's files and half of another's. The system lets go of
the lock when the process ends, however it ends. A person's marks need no such lock: they are kept
under `Workspace.exclusive`, while a command works, too.
"""

import json
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from filelock import FileLock, Timeout

from keyrecon.errors import KeyreconError
from keyrecon.io.durable import hold_lock, make_folder, write_quickly
from keyrecon.io.project_file import no_project

WAIT_SECONDS = 1.0
"""How long a command waits for another before it is refused: one that keeps a click is gone by
then, and one that stays has told who it is."""


@contextmanager
def lock_project(folder: Path, command: str) -> Iterator[None]:
    """Have a project to oneself; others are told that this `command` is working on it.

    Raises KeyreconError where another command has it, where there is no project, or where the
    folder takes no files.
    """
    if not (folder / "project.toml").is_file():
        raise no_project(folder)
    with lock_folder(folder, command):
        for file in (folder / "cache").glob("inputs-*.npz"):  # workers that were killed had them
            file.unlink(missing_ok=True)
        yield


@contextmanager
def lock_folder(folder: Path, command: str) -> Iterator[None]:
    """The same for a folder in which a project may only be begun; it is made if need be."""
    make_folder(folder)
    note = folder / ".work.note"
    try:
        lock = hold_lock(folder / ".work.lock", WAIT_SECONDS)
    except Timeout as fault:
        raise KeyreconError(
            f"{_describe_holder(note)} is working on {folder}; wait until it has ended, or stop it "
            "where it was begun."
        ) from fault
    try:
        write_quickly(note, json.dumps(_describe_self(command)).encode())
        yield
    finally:
        note.unlink(missing_ok=True)
        lock.release()


def lock_annotation(folder: Path, remedy: str) -> FileLock:
    """The lock that the one page has that a project can be open on; gone when its server ends.

    Raises KeyreconError, which tells the remedy, where it is taken.
    """
    try:
        return hold_lock(folder / ".annotate.lock", seconds=0.0)
    except Timeout as fault:
        raise KeyreconError(f"{folder} is being annotated already; {remedy}.") from fault


def _describe_self(command: str) -> dict[str, str | int]:
    return {
        "command": command,
        "process": os.getpid(),
        "machine": platform.node(),
        "since": f"{datetime.now().astimezone():%Y-%m-%d %H:%M}",
    }


def _describe_holder(note: Path) -> str:
    """Who has the project, as far as that is known."""
    try:
        holder = json.loads(note.read_bytes())
        here = holder["machine"] == platform.node()
        place = "" if here else f" on {holder['machine']}"
        return f"{holder['command']} (process {holder['process']}{place}, since {holder['since']})"
    except (OSError, ValueError, KeyError, TypeError):  # it is gone, or torn
        return "Another command"
