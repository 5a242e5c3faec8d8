"""Results of a clip's stages as it is, and which of them a variant has to make anew.

A result is stored under a hash of what went into its stage, code left out. A variant takes a stored
result where its inputs are the same and the stage uses nothing that was changed. Once every stage
that uses it has given the same bits as before, all that follows is the same: the run ends.
"""

import json
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import ParamSpec, TypeVar

import numpy as np

from keyrecon.io.stage_tasks import PACKAGE
from keyrecon.io.stages import StageStore
from keyrecon.io.storage import load_record, save_record
from keyrecon.records import Annotations

Inputs = ParamSpec("Inputs")
Result = TypeVar("Result")
WITHOUT_SIGNS = ("flow", "propagate")
"""Stages of the marks that use no depth signs: once for marks with signs and without."""


class Unchanged(Exception):
    """Nothing that a variant changed changes a bit."""


class Finished(Exception):
    """The last stage that was asked for is done."""

    def __init__(self, result: object) -> None:
        """Carries the stage's result."""
        super().__init__()
        self.result = result


class VariantStore(StageStore):
    """Keeps the stages of a clip as it is, or runs a variant of it."""

    def __init__(self, folder: Path, changed: frozenset[str] | None) -> None:
        """`changed`: stages that use what is changed, '' between them; None runs and keeps all."""
        super().__init__(folder)
        self.changed = changed
        self.last = ""
        """The stage after which to stop."""
        self._index = folder / "index.json"
        known = {} if changed is None else json.loads(self._index.read_text())
        self._known: dict[str, list[str]] = known
        """Stage and digest of every result as it was, by the key of its inputs."""
        self._left = {key for key, (name, _) in known.items() if stage_of(name) in (changed or ())}
        self._differs = "" in (changed or ())
        self._made: dict[str, object] = {}
        self.held: frozenset[str] = frozenset()
        """Stages that a variant takes as they were, whatever goes into them."""
        self._stage = ""
        self._codes: set[tuple[str, object]] = set()

    def keep(
        self,
        name: str,
        stage: Callable[Inputs, Result],
        /,
        *inputs: Inputs.args,
        **named: Inputs.kwargs,
    ) -> Result:
        """The stage's result: stored, made before in this run, or made now."""
        bare = inputs  # and no options: a number in them is a change like any other
        if stage_of(name) in WITHOUT_SIGNS:
            bare = tuple(without_signs(i) if isinstance(i, Annotations) else i for i in inputs)
        key = self._key((name, *bare))
        if key not in self._made:
            self._made[key] = self._find(name, key, lambda: stage(*inputs, **named))
        if name == self.last:
            raise Finished(self._made[key])
        return self._made[key]

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Notes what the functions mention that are called; of a variant, nothing."""
        if self.changed is not None:
            yield
            return
        threading.setprofile(self._watch)
        sys.setprofile(self._watch)
        try:
            yield
        finally:
            sys.setprofile(None)
            threading.setprofile(None)
        self.folder.mkdir(parents=True, exist_ok=True)
        self._index.write_text(json.dumps(self._known))

    def called(self) -> dict[str, dict[str, list[str]]]:
        """Names that the called functions of the package mention, by stage and module."""
        names: dict[str, dict[str, set[str]]] = {}
        for stage, code in self._codes:
            file = Path(code.co_filename)
            if code.co_name != "<module>" and file.is_relative_to(PACKAGE):
                modules = names.setdefault(stage, {})
                modules.setdefault(str(file.relative_to(PACKAGE)), set()).update(code.co_names)
        return {
            stage: {module: sorted(found) for module, found in modules.items()}
            for stage, modules in names.items()
        }

    def _find(self, name: str, key: str, run: Callable[[], Result]) -> Result:
        if name in self.held and self.changed is not None:
            key = next(known for known, (stage, _) in self._known.items() if stage == name)
        path = self.folder / f"{name}-{key}.npz"
        if key in self._known and stage_of(name) not in (self.changed or ()):
            result = load_record(path)
            self._note_kept(result, self._known[key][1], path)
            return result
        result = self._run(stage_of(name), run)
        digest = self._key(result)
        self._note_kept(result, digest, path)
        if self.changed is None:
            save_record(path, result)
            self._known[key] = [name, digest]
        else:
            self._compare(key, digest)
        return result

    def _compare(self, key: str, digest: str) -> None:
        """Ends the run when all stages that the change reaches have given what they gave before."""
        self._left.discard(key)
        self._differs |= self._known.get(key, ["", ""])[1] != digest
        if not self._left and not self._differs:
            raise Unchanged

    def _run(self, name: str, run: Callable[[], Result]) -> Result:
        self._stage, started = name, time.process_time()
        result = run()
        self.seconds[name] = self.seconds.get(name, 0.0) + time.process_time() - started
        self._stage = ""
        return result

    def _watch(self, frame: object, event: str, _: object) -> None:
        if event == "call":
            self._codes.add((self._stage, frame.f_code))


def stage_of(name: str) -> str:
    """The stage that is kept under a name: of one shot, what stands before the shot."""
    return name.partition("@")[0]


def without_signs(marks: Annotations) -> Annotations:
    """The marks as somebody gave them who told no depth signs."""
    return replace(marks, nearer=np.zeros_like(marks.nearer))
