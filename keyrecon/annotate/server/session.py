"""All that the server works with for one project, and what watches the project's files."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Thread
from typing import Any

from keyrecon.annotate.assistant import Assistant
from keyrecon.annotate.server.descriptions import (
    describe_entries,
    describe_job,
    describe_keyframes,
    describe_run,
    describe_settings,
    describe_skeleton,
    describe_video,
)
from keyrecon.annotate.server.events import Events
from keyrecon.annotate.server.frame_cache import FrameCache
from keyrecon.annotate.server.jobs import Command, Jobs
from keyrecon.annotate.server.page_words import in_page_words
from keyrecon.annotate.store.cells import by_frame, picks_of
from keyrecon.annotate.store.edits import Limits
from keyrecon.annotate.store.kept_keyframes import KeptKeyframes, halves_by_frame
from keyrecon.annotate.store.store import Store
from keyrecon.errors import KeyreconError
from keyrecon.io.provenance import note_files
from keyrecon.io.workspace import Workspace

logger = logging.getLogger(__name__)
Json = dict[str, Any]
PATIENCE_SECONDS = 0.5
"""That a page waits for what the stored results tell; later that comes as news."""
WATCH_SECONDS = 1.0
"""How often the files are checked: the times of a few files, which costs nothing."""


@dataclass(frozen=True)
class Session:
    """One project, open for annotation."""

    workspace: Workspace
    limits: Limits
    store: Store
    frames: FrameCache
    jobs: Jobs
    events: Events
    keyframes: KeptKeyframes
    assistant: Assistant

    def motion_digest(self) -> str | None:
        """A digest of what a motion would be made from now; None where nothing can tell it."""
        find = self.assistant.motion_digest
        return None if find is None else find(self.frames.video)

    def await_results(self) -> bool:
        """Whether the stored results are loaded; where that takes longer than a page may wait, what
        they tell of the project is news when they are."""
        ready = self.assistant.ready
        return not ready or ready(PATIENCE_SECONDS, lambda: self.events.publish({"project": True}))

    def close(self) -> None:
        """End its threads and let go of its files."""
        self.jobs.close()
        self.frames.close()
        self.store.close()


def open_session(
    workspace: Workspace, assistant: Assistant, commands: Mapping[str, Command]
) -> Session:
    """Open a project; KeyreconError when its files cannot be read or it is open elsewhere."""
    video = workspace.video()
    limits = Limits(workspace.skeleton, len(video), (video.width, video.height))
    store, events = Store(workspace, limits), Events()
    store.listen(lambda entries: events.publish(describe_entries(entries, store.state)))
    return Session(
        workspace=workspace,
        limits=limits,
        store=store,
        frames=FrameCache(video, workspace.folder / "cache" / "stills"),
        jobs=Jobs(commands, lambda job: events.publish({"job": describe_job(job)})),
        events=events,
        keyframes=KeptKeyframes(workspace, store),
        assistant=assistant,
    )


def describe_project(session: Session) -> Json:
    """What does not change from one edit to the next."""
    files = describe_files(
        session.workspace
    )  # before they are read: newer ones are not vouched for
    revision = session.store.state.revision
    keyframes, cells = session.keyframes.current(), session.store.state.cells
    added = {int(frame): half for frame, half in by_frame(cells, "own").items()}
    assistant, skeleton = session.assistant, session.limits.skeleton
    loaded = bool(keyframes) and session.await_results()
    explained = assistant.keyframes(added) if assistant.keyframes and loaded else {}
    bodies = assistant.bodies() if assistant.bodies and not keyframes else None
    shots = assistant.shots() if assistant.shots and loaded else []
    name = session.workspace.folder.resolve().name
    return {
        **describe_video(session.frames.video, name),
        **describe_skeleton(skeleton),
        "id": f"{name}-{session.frames.identity}",
        "version": session.frames.identity,
        "files": files,
        "keyframes": describe_keyframes(
            keyframes, cells, skeleton, explained.get("frames", {}), bodies or ()
        ),
        "bodies": None if bodies is None else [body["frame"] for body in bodies],
        "height_px": explained.get("height_px"),
        "boxes": explained.get("boxes"),
        "shots": shots,
        "golf": session.workspace.is_golf,
        "settings": describe_settings(Workspace(session.workspace.folder), session.frames.video),
        "run": describe_run(session.workspace, revision, session.motion_digest),
        "has": {
            "picks": bool(picks_of(cells)),
            "keyframes": bool(halves_by_frame(keyframes)),
            "motion": session.workspace.motion_file.is_file(),
            "report": session.workspace.report_file.is_file(),
            "assistant": bool(explained),
            "loaded": loaded,
        },
    }


def describe_files(workspace: Workspace) -> str:
    """When the project's kind was told, and when each thing that is described was made: other text
    where any of it changed."""
    files = (
        workspace.project_file,
        workspace.keyframes_file,
        workspace.motion_file,
        workspace.camera_file,
        workspace.report_file,
        *note_files(workspace),
        *workspace.golf_results(),
        workspace.exports,
    )
    return " ".join(str(_stamp(file)) for file in files)


class ProjectWatch:
    """Checks an open project's files, and publishes what other programs changed."""

    def __init__(self, session: Session) -> None:
        """Begin to watch."""
        self._session, self._ended = session, Event()
        self._files = describe_files(session.workspace)
        self._trouble: str | None = None
        self._thread = Thread(target=self._run, name="watch", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop watching."""
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ended.wait(WATCH_SECONDS):
            try:
                self.check()
            except Exception:  # the thread outlives whatever befalls the files
                logger.exception("The files of the project could not be looked at.")

    def check(self) -> None:
        """Take in what changed. What stands in the way is published once, and when it is gone."""
        trouble = None
        try:
            self._session.store.refresh()
            self._session.keyframes.current()
        except KeyreconError as fault:
            trouble = in_page_words(str(fault))
        if trouble != self._trouble:
            self._trouble = trouble
            self._session.events.publish({"trouble": trouble})
        if (files := describe_files(self._session.workspace)) != self._files:
            self._files = files
            self._session.events.publish({"project": True})


def _stamp(file: Path) -> int:
    try:
        return file.stat().st_mtime_ns
    except OSError:
        return 0
