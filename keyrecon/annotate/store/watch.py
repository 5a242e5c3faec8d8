"""Looks once a second for what other programs changed in the project, and tells the pages."""

from threading import Event, Thread

from keyrecon.annotate.server.session import Session
from keyrecon.errors import KeyreconError

SECONDS = 1.0
"""How often: three files are asked for their time, which costs nothing."""


class Watch:
    """Watches a project while it is open."""

    def __init__(self, desk: Session) -> None:
        """Begin to watch."""
        self._desk, self._ended = desk, Event()
        self._seen = self._files()
        self._trouble: str | None = None
        self._thread = Thread(target=self._run, name="watch", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop watching."""
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ended.wait(SECONDS):
            self.look()

    def look(self) -> None:
        """Take in what changed; what stands in the way is told once, and when it is gone."""
        trouble = None
        try:
            self._desk.store.refresh()
            self._desk.keyframes.current()
        except KeyreconError as fault:
            trouble = str(fault)
        if trouble != self._trouble:
            self._trouble = trouble
            self._desk.events.tell({"trouble": trouble})
        if (now := self._files()) != self._seen:
            self._seen = now
            self._desk.events.tell({"project": True})

    def _files(self) -> list[int]:
        """When keyframes and motion were made."""
        files = (self._desk.workspace.keyframes_file, self._desk.workspace.motion_file)
        return [file.stat().st_mtime_ns if file.exists() else 0 for file in files]
