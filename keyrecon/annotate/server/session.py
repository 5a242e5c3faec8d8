"""All that the server works with for one project, and what its state looks like to the page."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from keyrecon.annotate.server.descriptions import (
    describe_keyframes,
    describe_skeleton,
    describe_video,
    halves_by_frame,
)
from keyrecon.annotate.server.events import Events
from keyrecon.annotate.server.frame_cache import FrameCache
from keyrecon.annotate.server.jobs import Command, Job, Jobs
from keyrecon.annotate.store.assistant import Assistant
from keyrecon.annotate.store.cells import Change, by_frame, picks_of
from keyrecon.annotate.store.edits import Limits
from keyrecon.annotate.store.journal import Entry, JournalState
from keyrecon.annotate.store.kept_keyframes import KeptKeyframes
from keyrecon.annotate.store.store import Store
from keyrecon.io.workspace import Workspace

Json = dict[str, Any]


@dataclass(frozen=True)
class Session:
    """One project, open for annotation."""

    workspace: Workspace
    limits: Limits
    store: Store
    stills: FrameCache
    jobs: Jobs
    events: Events
    keyframes: KeptKeyframes
    assistant: Assistant

    def close(self) -> None:
        """Put everything away."""
        self.jobs.close()
        self.stills.close()
        self.store.close()


def open_session(
    workspace: Workspace, assistant: Assistant, commands: Mapping[str, Command]
) -> Session:
    """Open a project; KeyreconError when its files cannot be read or it is open elsewhere."""
    video = workspace.video()
    limits = Limits(workspace.skeleton, len(video), (video.width, video.height))
    store, events = Store(workspace, limits), Events()
    store.listen(lambda entries: events.tell(describe_entries(entries, store.state)))
    return Session(
        workspace=workspace,
        limits=limits,
        store=store,
        stills=FrameCache(video, workspace.folder / "cache" / "stills"),
        jobs=Jobs(commands, lambda job: events.tell({"job": describe_job(job)})),
        events=events,
        keyframes=KeptKeyframes(workspace, store),
        assistant=assistant,
    )


def describe_project(desk: Session) -> Json:
    """What does not change from one edit to the next."""
    keyframes, cells = desk.keyframes.current(), desk.store.state.cells
    own = {int(frame): half for frame, half in by_frame(cells, "own").items()}
    known = desk.assistant.keyframes(own) if desk.assistant.keyframes and keyframes else {}
    skeleton = desk.limits.skeleton
    return {
        **describe_video(desk.stills.video, desk.workspace.folder.resolve().name),
        **describe_skeleton(skeleton),
        "id": f"{desk.workspace.folder.resolve().name}-{desk.stills.identity}",
        "version": desk.stills.identity,
        "keyframes": describe_keyframes(keyframes, cells, skeleton, known.get("frames", {})),
        "height_px": known.get("height_px"),
        "settings": describe_settings(Workspace(desk.workspace.folder)),
        "has": {
            "picks": bool(picks_of(cells)),
            "keyframes": bool(halves_by_frame(keyframes)),
            "motion": desk.workspace.motion_file.is_file(),
            "assistant": bool(known),
        },
    }


def describe_settings(workspace: Workspace) -> Json:
    """Options of earlier runs that the page asks for; None where none was set."""
    options = workspace.project.get("options", {})
    return {
        "budget": options.get("keyframes", {}).get("budget"),
        "height": options.get("lift", {}).get("height"),
    }


def describe_state(state: JournalState) -> Json:
    """Everything that edits change."""
    cells = state.cells
    return {
        "revision": state.revision,
        "marks": by_frame(cells, "mark"),
        "nearer": by_frame(cells, "nearer"),
        "picks": picks_of(cells),
        "own": by_frame(cells, "own"),
        "locked": by_frame(cells, "lock"),
        **describe_stacks(state),
    }


def describe_stacks(state: JournalState) -> Json:
    """How much can be taken back and done again."""
    return {"undo": len(state.undoable), "redo": len(state.redoable)}


def describe_entries(entries: Iterable[Entry], state: JournalState) -> Json:
    """Accepted edits, and what can be undone after them, as news."""
    told = [
        {
            "revision": entry.revision,
            "id": entry.id,
            "role": entry.role,
            "kind": entry.label,
            "changes": describe_changes(entry.changes),
        }
        for entry in entries
    ]
    return {"revision": state.revision, "edits": told, **describe_stacks(state)}


def describe_changes(changes: Iterable[Change]) -> list[Json]:
    """Cells as the page names them."""
    where: dict[str, Callable[[Any], Json]] = {
        "mark": lambda key: {"frame": key[1], "joint": key[2]},
        "nearer": lambda key: {"frame": key[1], "limb": key[2]},
        "pick": lambda key: {"id": key[1]},
        "own": lambda key: {"frame": key[1]},
        "lock": lambda key: {"frame": key[1]},
    }
    return [
        {"kind": key[0], **where[str(key[0])](key), "from": before, "to": after}
        for key, before, after in changes
    ]


def describe_job(job: Job) -> Json:
    """How far a job is."""
    return asdict(job)
