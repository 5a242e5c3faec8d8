"""Records on disk: one npz file each, arrays beside a JSON description, no pickle.

A record (a frozen dataclass of this package) is taken apart into arrays and a tree that says
where they belong. Tuples of records of one kind (one per frame) are stored end to end with their
lengths, so that a long video costs a handful of arrays, not thousands.

What hours of video give is larger than memory may be: such tuples are written part by part, and
large files are not read but mapped, so that the system fetches what is used and lets go of the
rest. Arrays begin at places in the file that suit their numbers.
"""

import json
import zipfile
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from keyrecon.io.durable import make_folder, replacing
from keyrecon.reading import map_arrays, read_arrays, reading

Tree = dict[str, Any]
Arrays = dict[str, list[np.ndarray]]
"""Parts of each array that is stored, which lie end to end."""
MAPPED_BYTES = 1 << 18
"""Files from this size on are mapped: the edges of a shot of one second are. Of a match of hours no
single shot is large, all of them are."""
ALIGNMENT = 64
"""Bytes: where arrays begin in a file."""
HEADER_BYTES = 10
"""Before the text that describes an array: a magic word, a version and the length of the text."""


def save_record(path: Path, value: object) -> None:
    """Write a record, tuple, number, text, path or None; it appears whole or not at all."""
    arrays: Arrays = {}
    tree = _take_apart(value, arrays)
    text = np.frombuffer(json.dumps(tree).encode(), dtype=np.uint8)
    make_folder(path.parent)
    with replacing(path, durably=False) as file, zipfile.ZipFile(file, "w") as archive:
        for name, parts in {"tree": [text], **arrays}.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as stream:
                stream.write(_header(parts, file.tell()))
                for part in parts:
                    stream.write(part.tobytes())


def _header(parts: Sequence[np.ndarray], at: int) -> bytes:
    """What NumPy's format says of arrays end to end, at a place in a file."""
    shape = (sum(len(part) for part in parts), *parts[0].shape[1:]) if parts[0].ndim else ()
    described = {"descr": parts[0].dtype.str, "fortran_order": False, "shape": shape}
    text = repr(described).encode("latin1")
    room = -(at + HEADER_BYTES + len(text) + 1) % ALIGNMENT
    text += b" " * room + b"\n"
    return np.lib.format.magic(1, 0) + len(text).to_bytes(2, "little") + text


def is_mapped(path: Path) -> bool:
    """Whether a stored result is so large that `load_record` leaves it on the disk."""
    return path.stat().st_size >= MAPPED_BYTES


def load_record(path: Path) -> Any:
    """Read what `save_record` wrote; raises KeyreconError for a file of another kind.

    Arrays of a large file cannot be written to.
    """
    with reading(path, "a stored result", "delete it and run again"):
        stored = map_arrays(path) if is_mapped(path) else read_arrays(path)
        return _put_together(json.loads(stored["tree"].tobytes()), stored)


def _take_apart(value: object, arrays: Arrays) -> Tree:
    if isinstance(value, np.ndarray):
        return {"array": _store([value], arrays)}
    if is_dataclass(value):
        parts = {f.name: _take_apart(getattr(value, f.name), arrays) for f in fields(value)}
        return {"record": _name_type(value), "fields": parts}
    if isinstance(value, tuple):
        if _is_ragged(value):
            return _take_apart_ragged(value, arrays)
        return {"tuple": [_take_apart(part, arrays) for part in value]}
    if isinstance(value, Path):
        return {"path": str(value)}
    return {"value": value.item() if isinstance(value, np.generic) else value}


def _is_ragged(parts: tuple) -> bool:
    """Whether `parts` are records of one kind that hold nothing but arrays alike."""
    if len(parts) < 2 or not is_dataclass(parts[0]):
        return False
    names = [f.name for f in fields(parts[0])]
    first = [getattr(parts[0], name) for name in names]
    return all(isinstance(a, np.ndarray) and a.ndim > 0 for a in first) and all(
        type(part) is type(parts[0])
        and all(
            getattr(part, name).shape[1:] == a.shape[1:] and getattr(part, name).dtype == a.dtype
            for name, a in zip(names, first, strict=True)
        )
        for part in parts
    )


def _take_apart_ragged(parts: tuple, arrays: Arrays) -> Tree:
    stored = {}
    for field in fields(parts[0]):
        columns = [getattr(part, field.name) for part in parts]
        stored[field.name] = {
            "data": _store(columns, arrays),
            "lengths": _store([np.array([len(c) for c in columns])], arrays),
        }
    return {"ragged": _name_type(parts[0]), "count": len(parts), "fields": stored}


def _store(parts: list[np.ndarray], arrays: Arrays) -> str:
    name = f"a{len(arrays)}"
    arrays[name] = parts
    return name


def _put_together(tree: Tree, stored: Any) -> Any:
    if "array" in tree:
        return stored[tree["array"]]
    if "tuple" in tree:
        return tuple(_put_together(part, stored) for part in tree["tuple"])
    if "record" in tree:
        parts = {name: _put_together(part, stored) for name, part in tree["fields"].items()}
        return _record_type(tree["record"])(**parts)
    if "ragged" in tree:
        columns = {
            name: np.split(stored[part["data"]], np.cumsum(stored[part["lengths"]])[:-1])
            for name, part in tree["fields"].items()
        }
        kind = _record_type(tree["ragged"])
        return tuple(
            kind(**{name: column[i] for name, column in columns.items()})
            for i in range(tree["count"])
        )
    return Path(tree["path"]) if "path" in tree else tree["value"]


def _name_type(value: object) -> str:
    return f"{type(value).__module__}:{type(value).__name__}"


def _record_type(name: str) -> type:
    """The record of that name; nothing but the package's own records is ever called."""
    module, _, kind = name.partition(":")
    if module.split(".")[0] != "keyrecon":
        raise ValueError(f"unknown record '{name}'")
    record_type = vars(import_module(module)).get(kind)
    if not (isinstance(record_type, type) and is_dataclass(record_type)):
        raise ValueError(f"unknown record '{name}'")
    return record_type
