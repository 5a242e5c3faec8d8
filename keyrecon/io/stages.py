"""Keep-or-make of stage results.

A result is stored under a name that is a hash of everything that made it: the stage's code, its
options and its inputs. The same inputs and options find it again; anything else makes it anew.
Results of earlier stages count by their own hashes, so that nothing large is hashed twice.
"""

import hashlib
import inspect
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path, PosixPath
from typing import Any, ParamSpec, TypeVar

import numpy as np

from keyrecon.errors import KeyreconError
from keyrecon.io.storage import is_mapped, load_record, save_record
from keyrecon.io.video import Video
from keyrecon.numerics.threads import one_order_of_sums

PACKAGE = Path(__file__).parent.parent
SHARED_CODE = (
    "body.py",
    "records.py",
    "timeline.py",
    "io/frame_reader.py",
    "io/video.py",
    "numerics/*.py",
    "paper/*.py",
    "segmentation/*.py",
)
"""Modules whose change makes the results of every stage anew."""
KEPT_RESULTS = 3
"""Results kept of each stage, so that options can be tried out and taken back."""
PLAIN_TYPES = (bool, int, float, complex, str, bytes, type(None), Path, PosixPath)
"""Values whose text tells all of them; anything else would collide or never be found again."""


Inputs = ParamSpec("Inputs")
Result = TypeVar("Result")


class StageStore:
    """Stage results in a folder that is safe to delete."""

    def __init__(self, folder: Path, force: bool = False) -> None:
        """Use `folder`; `force` makes every stage again."""
        self.folder = folder
        self.force = force
        self.seconds: dict[str, float] = {}
        """How long each stage took that was run, seconds."""
        self._keys: dict[int, tuple[object, str]] = {}

    def keep(
        self,
        name: str,
        stage: Callable[Inputs, Result],
        /,
        *inputs: Inputs.args,
        **named: Inputs.kwargs,
    ) -> Result:
        """The result of a stage: stored if the same inputs and options made it, else made."""
        key, path = self._place(name, stage, inputs, named)
        result = _NOTHING if self.force else _stored(path)
        if result is _NOTHING:
            started = time.perf_counter()
            with one_order_of_sums():
                result = stage(*inputs, **named)
            stage_of_shot = name.partition("@")
            before = self.seconds.get(stage_of_shot[0], 0.0) if stage_of_shot[1] else 0.0
            self.seconds[stage_of_shot[0]] = before + time.perf_counter() - started
            save_record(path, result)
            self._forget(name, path)
            result = _left_on_disk(path, result)
        self._keys[id(result)] = (result, key)
        return result

    def recall(
        self,
        name: str,
        stage: Callable[Inputs, Result],
        /,
        *inputs: Inputs.args,
        **named: Inputs.kwargs,
    ) -> Result:
        """The stored result of a stage, as `keep` would find it; KeyreconError if there is none."""
        key, path = self._place(name, stage, inputs, named)
        if (result := _stored(path)) is _NOTHING:
            raise KeyreconError(f"The result of '{name}' is not in {self.folder}; make it again.")
        self._keys[id(result)] = (result, key)
        return result

    def _place(
        self,
        name: str,
        stage: Callable[..., object],
        inputs: tuple[object, ...],
        named: Mapping[str, object],
    ) -> tuple[str, Path]:
        """What tells this result from others, and its file. How progress is shown changes none."""
        arguments = tuple(item for item in sorted(named.items()) if item[0] != "progress")
        key = self._key((_code_of(stage), name, arguments, *inputs))
        return key, self.folder / f"{name}-{key}.npz"

    def _forget(self, name: str, made: Path) -> None:
        """Drop all but the latest few results of a stage; another process may do the same."""
        results: list[tuple[float, Path]] = []
        for path in self.folder.glob(f"{name}-*.npz"):
            with suppress(FileNotFoundError):
                results.append((path.stat().st_mtime, path))
        for _, old in sorted(results)[:-KEPT_RESULTS]:
            if old != made:
                with suppress(PermissionError):  # Windows keeps what is mapped
                    old.unlink(missing_ok=True)

    def _key(self, value: object) -> str:
        digest = hashlib.sha256()
        self._digest(value, digest)
        return digest.hexdigest()[:16]

    def _digest(self, value: object, digest: "hashlib._Hash") -> None:
        """Feed a value's content; a result that `keep` made counts by its own key."""
        known = self._keys.get(id(value))
        if known is not None:
            digest.update(known[1].encode())
        elif isinstance(value, Video):
            digest.update(value.fingerprint.encode() + value.stamps.tobytes())
            digest.update(value.time.tobytes() + bytes((value.turns, value.mirrored)))
        elif isinstance(value, np.ndarray):
            digest.update(f"{value.dtype}{value.shape}".encode() + value.tobytes())
        elif is_dataclass(value):
            digest.update(type(value).__name__.encode())
            for field in fields(value):
                digest.update(field.name.encode())
                self._digest(getattr(value, field.name), digest)
        elif isinstance(value, tuple):
            digest.update(f"tuple{len(value)}".encode())
            for part in value:
                self._digest(part, digest)
        elif isinstance(value, Enum) or type(value) in PLAIN_TYPES:
            digest.update(repr(value).encode())
        else:
            raise TypeError(f"a stage was given a {type(value).__name__}, which has no digest")


_NOTHING: Any = object()
"""In place of a result; None can be one."""


def _stored(path: Path) -> Any:
    """What is stored there; nothing where no file is, or what a loss of power left of one."""
    try:
        return load_record(path) if path.is_file() else _NOTHING
    except KeyreconError:
        return _NOTHING


def _left_on_disk(path: Path, result: Any) -> Any:
    """The same result without the memory that it took, where it is large."""
    with suppress(FileNotFoundError, KeyreconError):  # other processes may have dropped it again
        if is_mapped(path):
            return load_record(path)
    return result


def _code_of(stage: Callable[..., Any]) -> str:
    """Hash of the stage's folder and of what all stages share: new code makes new results."""
    stage_code = Path(inspect.getfile(stage)).parent.rglob("*.py")
    shared = (file for pattern in SHARED_CODE for file in PACKAGE.glob(pattern))
    sources = sorted({*stage_code, *shared})
    return hashlib.sha256(b"".join(file.read_bytes() for file in sources)).hexdigest()
