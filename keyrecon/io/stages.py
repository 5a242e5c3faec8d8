"""Keep-or-make of stage results.

A result is stored under a name that is a hash of everything that made it: the stage's code, its
options and its inputs. The same inputs and options find it again; anything else makes it anew.
Results of earlier stages count by their own hashes, so that nothing large is hashed twice.

Where there are workers, they make what is not stored, and put it where it is looked for here: which
results there are, and what is in them, does not hang on who makes them.
"""

import hashlib
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import cache
from pathlib import Path, PosixPath
from threading import Lock
from typing import Any, ParamSpec, TypeVar
from weakref import ref

import numpy as np

from keyrecon.errors import KeyreconError
from keyrecon.io.stage_tasks import (
    StageTask,
    StoredResult,
    hash_code,
    read_when_there,
    store_inputs,
)
from keyrecon.io.storage import is_mapped, load_record, save_record
from keyrecon.io.video import Video
from keyrecon.io.workers import Workers
from keyrecon.numerics.threads import one_order_of_sums
from keyrecon.parallel_map import one_by_one

KEPT_RESULTS = 3
"""Results kept of each stage, so that options can be tried out and taken back."""
PLAIN_TYPES = (bool, int, float, complex, str, bytes, type(None), Path, PosixPath)
"""Values whose text tells all of them; anything else would collide or never be found again."""


NO_INPUTS = ("progress", "parallel_map")
"""Named arguments that change no result: how progress is shown, and who does the work."""


Inputs = ParamSpec("Inputs")
Result = TypeVar("Result")
Item = TypeVar("Item")


@dataclass(frozen=True, eq=False)
class _Kept:
    """How a result that was stored or found is known."""

    key: str
    path: Path
    alive: object
    """The result itself, or what notes that nobody has it any more."""


class StageStore:
    """Stage results in a folder that is safe to delete."""

    def __init__(self, folder: Path, force: bool = False, workers: Workers | None = None) -> None:
        """Use `folder`; `force` makes every stage again, `workers` make them elsewhere."""
        self.folder = folder
        self.force = force
        self.workers = workers
        self.seconds: dict[str, float] = {}
        """How long each stage took that was run, seconds."""
        self._kept: dict[int, _Kept] = {}
        self._timing = Lock()

    def __call__(
        self,
        name: str,
        stage: Callable[Inputs, Result],
        /,
        *inputs: Inputs.args,
        **named: Inputs.kwargs,
    ) -> Result:
        """The same as `keep`."""
        return self.keep(name, stage, *inputs, **named)

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
            workers = self.workers
            if workers is None or "parallel_map" in named or not workers.takes_stage():
                result = self._make(name, path, stage, inputs, named)
            else:  # one with `parallel_map` hands out its work by itself
                result = self._make_elsewhere(name, path, stage, inputs, named)
            self._forget(name, path)
        self._note_kept(result, key, path)
        return result

    def _make(
        self,
        name: str,
        path: Path,
        stage: Callable[..., Result],
        inputs: tuple[object, ...],
        named: Mapping[str, object],
    ) -> Result:
        """Run a stage here and store its result."""
        started = time.perf_counter()
        with one_order_of_sums():
            result = stage(*inputs, **named)
        self._note(name, time.perf_counter() - started)
        save_record(path, result)
        return _left_on_disk(path, result)

    def _make_elsewhere(
        self,
        name: str,
        path: Path,
        stage: Callable[..., Any],
        inputs: tuple[object, ...],
        named: Mapping[str, Any],
    ) -> Any:
        """Have a stage run by a worker; without its progress."""
        progress = named.get("progress")
        task = self._task(path, stage, inputs, named)
        for _ in progress([name], f"{name}, by a worker", 1) if progress else [name]:
            seconds = self._carry_out(task)
        self._note(name, seconds)
        return read_when_there(path)

    def _task(
        self,
        path: Path,
        stage: Callable[..., Any],
        inputs: tuple[object, ...],
        named: Mapping[str, object],
    ) -> StageTask:
        """A call that workers can carry out, and whose result they store at a path."""
        place = path.with_name(f"inputs-{path.name}")
        store_inputs(place, tuple(self._reference(value) for value in inputs), _inputs_of(named))
        return StageTask(stage, place, path, hash_code(stage))

    def _reference(self, value: object) -> object:
        """A stored result by its file, other values as they are."""
        kept = self._kept.get(id(value))
        return StoredResult(str(kept.path)) if kept and kept.path.is_file() else value

    def _carry_out(self, task: StageTask) -> float:
        assert self.workers is not None
        try:
            return self.workers.carry_out(task)
        finally:
            task.inputs.unlink(missing_ok=True)

    def each(
        self, work: Callable[[Item], Result], items: Iterable[Item], large: bool = False
    ) -> Iterator[Result]:
        """`work`, which calls stages by this store, done for every item, in order.

        With workers several items are worked on at a time, so that all of them have something to
        do; of `large` ones as many as `Workers` allows.
        """
        if self.workers is None:
            return map(work, items)
        return self.workers.each(work, items, large)

    @property
    def has_workers(self) -> bool:
        """Whether anybody makes stages elsewhere."""
        return self.workers is not None

    @property
    def has_far_workers(self) -> bool:
        """Whether other machines do."""
        return self.workers is not None and self.workers.far

    def parallel_map(
        self, work: Callable[..., Result], inputs: Iterable[tuple[Any, ...]]
    ) -> Iterator[Result]:
        """Pieces of a stage's work (`ParallelMap`), done by the workers if there are any."""
        if self.workers is None:
            return one_by_one(work, inputs)

        def elsewhere(arguments: tuple[Any, ...]) -> Result:
            path = self.folder / f"{work.__name__}-{self._key((hash_code(work), arguments))}.npz"
            self._carry_out(self._task(path, work, arguments, {}))
            result: Result = read_when_there(path)
            with suppress(PermissionError):  # Windows keeps what is mapped
                path.unlink(missing_ok=True)
            return result

        return self.workers.each(elsewhere, inputs)

    def _note_kept(self, result: object, key: str, path: Path) -> None:
        """Know a result again as long as somebody has it; those of shots would fill the memory."""
        number = id(result)
        alive: object = result
        with suppress(TypeError):  # of a tuple there are no weak references
            alive = ref(result, lambda _: self._kept.pop(number, None))
        self._kept[number] = _Kept(key, path, alive)

    def _note(self, name: str, seconds: float) -> None:
        """Keep how long a stage took; those of shots add up."""
        stage, of_shot, _ = name.partition("@")
        with self._timing:
            before = self.seconds.get(stage, 0.0) if of_shot else 0.0
            self.seconds[stage] = before + seconds

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
        self._note_kept(result, key, path)
        return result

    def _place(
        self,
        name: str,
        stage: Callable[..., object],
        inputs: tuple[object, ...],
        named: Mapping[str, object],
    ) -> tuple[str, Path]:
        """What tells this result from others, and its file."""
        arguments = tuple(sorted(_inputs_of(named).items()))
        key = self._key((hash_code(stage), name, arguments, *inputs))
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
        known = self._kept.get(id(value))
        if known is not None:
            digest.update(known.key.encode())
        elif isinstance(value, Video):
            digest.update(value.fingerprint.encode() + value.stamps.tobytes())
            digest.update(value.time.tobytes() + bytes((value.turns, value.mirrored)))
            if value.exposure is not None:
                digest.update(value.exposure.tobytes())
        elif isinstance(value, np.ndarray) and not value.dtype.hasobject:
            digest.update(f"{_type_text(value.dtype)}{value.shape}".encode() + value.tobytes())
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
            kind = f"{type(value).__name__}{' of objects' if isinstance(value, np.ndarray) else ''}"
            raise TypeError(f"a stage was given a {kind}, which has no digest")


_NOTHING: Any = object()
"""In place of a result; None can be one."""


@cache
def _type_text(dtype: np.dtype) -> str:
    """NumPy makes it anew every time, which is half of the digest of small arrays."""
    return str(dtype)


def _inputs_of(named: Mapping[str, object]) -> dict[str, object]:
    return {name: value for name, value in named.items() if name not in NO_INPUTS}


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
