"""What all readers of files share: a damaged file gives one line, and no endless work.

Files come from other programs, from disks and networks that tear them, and from people who edit
them. What a decoder raises over a damaged one is not in its documentation (mutated files brought up
sixteen kinds of exception, `zlib.error` and `NotImplementedError` among them), so `reading` turns
all of them into one line that names the file; the fault itself stays its cause.
"""

import json
import math
import mmap
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np

from keyrecon.errors import KeyreconError, explain

MAX_DIGITS = 18
"""Of a whole number in JSON: more do not fit into 64 bits."""
MAX_ARRAY_BYTES = 1 << 31
"""Arrays of one file may take so much where they are compressed: those of a motion of two hours
take 0.4 GB. Uncompressed ones are as large as their file."""
CHUNK_BYTES = 1 << 20
"""Read at a time where nothing is kept."""
MAPPED_SHARE = 0.75
"""Of the files that a process may have open (each mapped one counts): others need some too."""
KINDS = "biufUS"
"""Of NumPy's types: truth values, numbers and texts."""


@contextmanager
def reading(path: Path, what: str, remedy: str) -> Iterator[None]:
    """Turn whatever is raised over a file's content into "PATH is not WHAT (why); REMEDY."."""
    try:
        if path.exists() and not path.is_file():  # a pipe would keep its reader waiting
            raise ValueError("a folder" if path.is_dir() else "no file but a pipe or device")
        with np.errstate(all="ignore"):  # numbers out of hand are named, not warned of
            yield
    except KeyreconError:
        raise
    except Exception as fault:
        raise KeyreconError(f"{path} is not {what} ({explain(fault)}); {remedy}.") from fault


def read_text(path: Path) -> str:
    """A file's text, UTF-8 with or without a mark at its beginning."""
    return path.read_text(encoding="utf-8-sig")


def parse_json(text: str) -> Any:
    """What JSON says; ValueError for what is none, and for what nothing here can hold."""
    try:
        return json.loads(
            text, parse_constant=_refuse_word, parse_float=_finite, parse_int=_whole_number
        )
    except RecursionError as fault:
        raise ValueError("lists within lists without end") from fault


def _refuse_word(word: str) -> float:
    raise ValueError(f"{word} is not a number")


def _finite(word: str) -> float:
    number = float(word)
    if not math.isfinite(number):
        raise ValueError(f"{word[:MAX_DIGITS]} is too large for a number")
    return number


def _whole_number(word: str) -> int:
    if len(word.lstrip("-")) > MAX_DIGITS:
        raise ValueError(f"a number of {len(word)} digits is too large")
    return int(word)


def whole(value: object) -> int:
    """A JSON number that is whole; ValueError for any other value, which `int` would round."""
    if isinstance(value, bool) or not isinstance(value, int | float) or value != int(value):
        raise ValueError(f"{value!r} is not a whole number")
    return int(value)


def real(value: object) -> float:
    """A JSON number; ValueError for any other value."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{value!r} is not a number")
    return float(value)


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """All arrays of an npz file; ValueError and others for a file that is damaged or no npz.

    A header is held against the bytes that are there before anything is made of its size.
    """
    with path.open("rb") as file, zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        most = max(MAX_ARRAY_BYTES, path.stat().st_size)
        if sum(member.file_size for member in members) > most:
            raise ValueError("its arrays are larger than any that were written here")
        return {
            member.filename.removesuffix(".npy"): _read_array(archive, member) for member in members
        }


def map_arrays(path: Path) -> dict[str, np.ndarray]:
    """The same of a file that `keyrecon.io.storage` wrote, left on the disk until they are used.

    They take address space, no memory that the system could not take back, and cannot be written
    to. All bytes are held against the file's checksums first. Where too many files are open, they
    are read.
    """
    with path.open("rb") as file, zipfile.ZipFile(file) as archive:
        if file.fileno() >= MAPPED_SHARE * open_files_allowed():  # the lowest that is free
            return read_arrays(path)
        whole_file = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        return {
            member.filename.removesuffix(".npy"): _map_array(archive, member, whole_file)
            for member in archive.infolist()
        }


def open_files_allowed() -> int | float:
    """How many files this process may have open, as many as the system lets it."""
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return math.inf
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and soft < hard:
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
        return hard
    return math.inf if soft == resource.RLIM_INFINITY else soft


def _map_array(
    archive: zipfile.ZipFile, member: zipfile.ZipInfo, whole_file: mmap.mmap
) -> np.ndarray:
    with archive.open(member) as stream:
        shape, fortran, dtype = _read_header(member, stream)
        header = stream.tell()
        while stream.read(CHUNK_BYTES):
            pass  # the checksum is held against what was read at the end
    names = whole_file[member.header_offset + 26 : member.header_offset + 30]
    lengths = int.from_bytes(names[:2], "little") + int.from_bytes(names[2:], "little")
    start = member.header_offset + 30 + lengths + header
    if member.compress_type != zipfile.ZIP_STORED or fortran or start % dtype.alignment:
        return _read_array(archive, member)
    count = math.prod(shape)
    return np.frombuffer(whole_file, dtype, count, start if count else 0).reshape(shape)


def _read_array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> np.ndarray:
    with archive.open(member) as stream:
        _read_header(member, stream)
        stream.seek(0)
        return np.lib.format.read_array(stream, allow_pickle=False)


def _read_header(
    member: zipfile.ZipInfo, stream: zipfile.ZipExtFile | IO[bytes] | IO[bytes]
) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, order and type of an array; ValueError where they do not fit its bytes."""
    version = np.lib.format.read_magic(stream)
    read_header = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }[version]
    shape, fortran, dtype = read_header(stream)
    if dtype.kind not in KINDS or dtype.hasobject:
        raise ValueError(f"{member.filename} holds neither numbers nor texts")
    if math.prod(shape) * dtype.itemsize != member.file_size - stream.tell():
        raise ValueError(f"{member.filename} is not as long as it says")
    return shape, fortran, dtype


def check_numbers(name: str, values: np.ndarray, gaps: bool = False) -> np.ndarray:
    """The values; ValueError where they are not numbers, or not finite unless `gaps` may be."""
    if values.dtype.kind not in "biuf":
        raise ValueError(f"{name} holds no numbers")
    known = ~np.isnan(values) if gaps else np.True_
    if not np.isfinite(np.where(known, values, 0)).all():
        raise ValueError(f"{name} has values that are no numbers")
    return values
