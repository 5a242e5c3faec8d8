"""A stage's call as a task that another process or machine can carry out.

What is sent is names alone: the stage's function and files in the folder of stage results, which
whoever carries it out must see under the same path, as it must the video. Inputs that are results
of earlier stages are read from where these were stored; all others are stored for the task first.
The result is stored where the one who asks looks for it. So a task that is lost with its worker
is done again by another, and nobody holds in memory what waits.
"""

import hashlib
import inspect
import platform
import re
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any

from keyrecon.errors import KeyreconError
from keyrecon.io.held_video import HeldVideo, share_decoded, shows_same
from keyrecon.io.storage import load_record, save_record
from keyrecon.numerics.threads import one_order_of_sums

PACKAGE = Path(__file__).parent.parent
IMPORT = re.compile(rf"^\s*from ({PACKAGE.name}[.\w]*) import (\([^)]*\)|.*)$", re.MULTILINE)
"""What a module of the package takes from another one."""
VIDEOS = "io/*video.py"
"""Modules of what a stage is given as its video, whichever of them it names."""
PATIENCE = 60.0
"""Seconds until a file that another machine has written must be seen: network drives may go on
telling for so long that there is none (the attribute cache of NFS: acdirmax)."""
_ONE_AT_A_TIME = Lock()
"""Of the stages in a process: the number of threads of linear algebra is the whole process's."""
_AT_HAND: list[HeldVideo] = []
"""The shot that this process had to do with last, with the frames that it has decoded of it."""


@dataclass(frozen=True)
class StoredResult:
    """In the place of an input: the result of an earlier stage."""

    path: str


@dataclass(frozen=True)
class StageTask:
    """A call that can be sent."""

    stage: Callable[..., Any]
    inputs: Path
    """Where `store_inputs` has put them."""
    result: Path
    """Where the result is to be stored."""
    code: str
    """Of the stage, as `hash_code` has it here."""


def store_inputs(path: Path, inputs: tuple[object, ...], named: dict[str, object]) -> None:
    """Put the inputs of a task where whoever carries it out finds them."""
    save_record(path, (inputs, tuple(named.items())))


def carry_out(task: StageTask) -> float:
    """Do what a task says; how many seconds it took.

    Raises KeyreconError where folder or program are not those of the one who asks.
    """
    here = platform.node()
    if hash_code(task.stage) != task.code:
        raise KeyreconError(
            f"The worker on {here} has another version of keyrecon; install the same everywhere."
        )
    if not task.inputs.parent.is_dir():
        raise KeyreconError(
            f"The worker on {here} does not see {task.inputs.parent}; workers need the project's "
            "folder and its video under the same paths."
        )
    inputs, named = read_when_there(task.inputs)
    inputs = [
        read_when_there(Path(value.path)) if isinstance(value, StoredResult) else value
        for value in inputs
    ]
    with _ONE_AT_A_TIME, one_order_of_sums():
        began = time.perf_counter()
        inputs = _with_frames_at_hand(inputs)
        result = task.stage(*inputs, **dict(named))
        seconds = time.perf_counter() - began
    save_record(task.result, result)
    return seconds


def _with_frames_at_hand(inputs: list[Any]) -> list[Any]:
    """Inputs whose video need not be decoded again if the last task's was the same."""
    known = [*_AT_HAND]
    _AT_HAND.clear()  # one shot at a time is held
    for number, value in enumerate(inputs):
        if isinstance(value, HeldVideo):
            same = (other for other in known if shows_same(value, other))
            inputs[number] = next((share_decoded(value, other) for other in same), value)
            _AT_HAND.append(inputs[number])
    return inputs


def read_when_there(path: Path) -> Any:
    """A stored record that another machine may just have written."""
    end = time.monotonic() + PATIENCE
    while not path.is_file():
        if time.monotonic() > end:
            raise KeyreconError(
                f"{platform.node()} does not see {path}, which another machine has written; "
                "workers need the project's folder, on a drive that they share."
            )
        time.sleep(0.1)
    return load_record(path)


def hash_code(stage: Callable[..., Any]) -> str:
    """Hash of the stage's module, all that it imports, and videos: new code makes new results."""
    return _hash_sources(Path(inspect.getfile(sys.modules[stage.__module__])))


@cache
def _hash_sources(module: Path) -> str:
    """Of a module of stages, with what it imports, as this process has read it."""
    files = set[Path]().union(*map(imported_files, (module, *PACKAGE.glob(VIDEOS))))
    return hashlib.sha256(b"".join(map(_source, sorted(files)))).hexdigest()


def imported_files(module: Path) -> set[Path]:
    """A module's file and those of all modules of the package that it imports, and they import."""
    found, open_ones = {module}, [module]
    while open_ones:
        new = _imports(open_ones.pop()) - found
        found |= new
        open_ones += new
    return found


@cache
def _source(file: Path) -> bytes:
    return file.read_bytes()


@cache
def _imports(file: Path) -> frozenset[Path]:
    """Files of the package that a file names."""
    named: set[Path] = set()
    for package, names in IMPORT.findall(_source(file).decode()):
        place = PACKAGE.parent.joinpath(*package.split("."))
        inside = (place / name for name in re.findall(r"\w+", names))
        named |= {place.with_suffix(".py"), *(path.with_suffix(".py") for path in inside)}
    return frozenset(path for path in named if path.is_file())
