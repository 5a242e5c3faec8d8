"""Writing what a person made: a file appears whole and survives a loss of power, or not at all.

The bytes go to a file of a name of its own in the same folder, which reaches the disk (fsync)
before it takes the place of the old one; then the folder itself is synchronised, because a
rename without that is atomic but not durable. What can be made again needs no such wait for the
disk: it too appears whole to whoever reads it, but a loss of power may tear it.
"""

import hashlib
import os
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import IO

from filelock import FileLock, Timeout

from keyrecon.errors import KeyreconError

STALE_SECONDS = 3600.0
"""Half-written files older than this were left by a process that was killed."""
_MACHINE = hashlib.sha256(platform.node().encode()).hexdigest()[:8]
"""Tells this computer from others that may write to the same drive."""


def write_durably(path: Path, content: bytes | str) -> None:
    """Replace `path` by `content`; text is written as UTF-8.

    On any failure the old file stays as it was and nothing is left beside it. Raises
    KeyreconError where the folder does not take the file (missing, full, read-only).
    """
    with replacing(path) as file:
        file.write(content.encode() if isinstance(content, str) else content)


def write_quickly(path: Path, content: bytes) -> None:
    """Replace `path` by what can be made again; its reader must be able to tell a torn file.

    Raises KeyreconError where the folder does not take the file.
    """
    with replacing(path, durably=False) as file:
        file.write(content)


def put_aside(path: Path) -> Path:
    """Keep a copy of a file that a person made, before it changes: annotations.old-3.json.

    Copies are numbered on from the latest one that is there; none is ever replaced. Returns the
    copy's path.
    """
    numbers = (f.stem.rpartition(".old-")[2] for f in path.parent.glob(f"{path.stem}.old-*"))
    latest = max((int(number) for number in numbers if number.isdecimal()), default=0)
    copy = path.with_name(f"{path.stem}.old-{latest + 1}{path.suffix}")
    write_durably(copy, path.read_bytes())
    return copy


@contextmanager
def replacing(path: Path, durably: bool = True) -> Iterator[IO[bytes]]:
    """A file to be written, which takes the place of `path` when the block ends well.

    On any failure the old file stays as it was and nothing is left beside it; what the system
    refuses becomes a KeyreconError.
    """
    try:
        with _beside(path) as file:
            yield file
            file.flush()
            if durably:
                os.fsync(file.fileno())
            os.replace(file.name, path)
        if durably:
            _synchronise_folder(path.parent)
    except OSError as fault:
        raise KeyreconError(
            f"{path} could not be written ({fault.strerror or fault}); the former content is "
            "unchanged. Free some space or choose another folder."
        ) from fault


@contextmanager
def _beside(path: Path) -> Iterator[IO[bytes]]:
    """A file in the same folder and with the same permissions, gone if the block fails."""
    mode = path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_umask()
    writer = f"{_MACHINE}-{os.getpid()}"
    with NamedTemporaryFile(
        dir=path.parent, prefix=f".{path.name}.{writer}.", suffix=".part", delete=False
    ) as file:
        try:
            if hasattr(os, "fchmod"):  # not on Windows before Python 3.13
                os.fchmod(file.fileno(), mode)
            yield file
        except BaseException:
            Path(file.name).unlink(missing_ok=True)
            raise


def clear_leftovers(folder: Path) -> None:
    """Delete what a process left half-written: one of this machine that is gone, or long ago."""
    for file in folder.glob(".*.part"):
        writer = file.name.split(".")[-3]
        with suppress(OSError):
            if _is_gone(writer) or file.stat().st_mtime < time.time() - STALE_SECONDS:
                file.unlink()


def _is_gone(writer: str) -> bool:
    """Whether a process of this machine wrote a file and has ended since."""
    machine, _, process = writer.rpartition("-")
    if os.name != "posix" or machine != _MACHINE or not process.isdecimal():
        return False
    try:
        os.kill(int(process), 0)  # signal 0 only asks (elsewhere it would be sent)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        return False
    return False


def make_folder(path: Path) -> None:
    """Make a folder and those above it; KeyreconError where the system refuses."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise KeyreconError(
            f"The folder {path} cannot be made ({fault.strerror}); choose another place."
        ) from fault


def hold_lock(path: Path, seconds: float = -1.0) -> FileLock:
    """A lock that one process at a time has; to be released, and gone when the process ends.

    Waits as long as it takes, or some seconds; then raises filelock's Timeout. Raises
    KeyreconError where no file can be written.
    """
    lock = FileLock(path, thread_local=False)
    try:
        lock.acquire(timeout=seconds)
    except Timeout:
        raise
    except OSError as fault:
        raise KeyreconError(
            f"{path.parent} cannot be written ({fault.strerror or fault}); make it writable, or "
            "copy the project to a folder that is."
        ) from fault
    return lock


def _umask() -> int:
    """The mask for new files; it can only be read by setting it."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


def _synchronise_folder(folder: Path) -> None:
    """Bring the folder's entry to the disk, where folders can be opened (not on Windows)."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
