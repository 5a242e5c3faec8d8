"""The keyframes that were chosen, and what happens when a new choice replaces them.

A person's work must not disappear from the list because the program chose again: a keyframe that is
locked or bears marks, and that the new choice leaves out or asks less of, stays in the list as
one of the person's own.
"""

import json

from keyrecon.annotate.store.cells import Change, by_frame, marked_frames
from keyrecon.annotate.store.store import Store
from keyrecon.io.formats.keyframes import read_keyframes
from keyrecon.io.workspace import Workspace
from keyrecon.records import Keyframes


class KeptKeyframes:
    """keyframes.json as it is now; re-read when it changes."""

    def __init__(self, workspace: Workspace, store: Store) -> None:
        """Begin with what the store remembers of the last choice."""
        self._file, self._store = workspace.keyframes_file, store
        self._read: tuple[tuple[int, int], Keyframes] | None = None
        self.current()

    def current(self) -> Keyframes | None:
        """The choice there is; KeyreconError for a file that cannot be read."""
        if not self._file.is_file():
            return None
        status = self._file.stat()
        signature = (status.st_mtime_ns, status.st_size)
        if self._read is None or self._read[0] != signature:
            keyframes = read_keyframes(self._file)
            self._keep_worked_on(halves_by_frame(keyframes))
            self._read = (signature, keyframes)
        return self._read[1]

    def _keep_worked_on(self, chosen: dict[int, str]) -> None:
        note = self._store.note("keyframes")
        before = {int(frame): half for frame, half in json.loads(note or "{}").items()}
        if before == chosen:
            return
        cells = self._store.state.cells
        worked_on = {*marked_frames(cells), *map(int, by_frame(cells, "lock"))}
        keep = [
            Change(("own", frame), None, half)
            for frame, half in before.items()
            if frame in worked_on and ("own", frame) not in cells
            if join_halves(chosen.get(frame), half) != chosen.get(frame)
        ]
        self._store.apply("keep", keep, role="fixed", notes={"keyframes": json.dumps(chosen)})


def halves_by_frame(keyframes: Keyframes | None) -> dict[int, str]:
    """Which half of the body is to be marked on each keyframe."""
    if keyframes is None:
        return {}
    upper, lower = ({*half.frames.tolist()} for half in (keyframes.upper, keyframes.lower))
    return {
        frame: "both" if frame in upper & lower else "upper" if frame in upper else "lower"
        for frame in sorted(upper | lower)
    }


def join_halves(one: str | None, other: str | None) -> str:
    """What two requests for a frame, not both empty, ask for together."""
    halves = {half for half in (one, other) if half is not None}
    return halves.pop() if len(halves) == 1 else "both"
