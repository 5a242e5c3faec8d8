"""`keyrecon annotate`: the page's server put together with what it calls, and its address."""

import asyncio
import re
import socket
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, get_args

import numpy as np
import uvicorn

from keyrecon.annotate.assist.answers import make_assistant
from keyrecon.annotate.server.address import (
    LastAddress,
    is_loopback,
    listen,
    make_credentials,
    recall,
    remember,
)
from keyrecon.annotate.server.routes import make_app
from keyrecon.annotate.server.security import Credentials
from keyrecon.annotate.server.session import ProjectWatch, Session, open_session
from keyrecon.app import golf, keyframing, project, running
from keyrecon.app.court import calibrate
from keyrecon.app.exporting import export
from keyrecon.app.ground import find_ground
from keyrecon.app.preparing import describe_shots, prepare_project
from keyrecon.errors import KeyreconError
from keyrecon.io.durable import make_folder
from keyrecon.io.formats.coco import write_coco
from keyrecon.io.provenance import motion_stamp, note_exports
from keyrecon.io.video import Video
from keyrecon.io.work_lock import lock_project
from keyrecon.io.workers import open_workers
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options, marked_frames, with_field_of_view, with_height
from keyrecon.progress import Progress
from keyrecon.report.overlay import Limbs, OverlayOptions, View
from keyrecon.world.calibration import CalibrationOptions
from keyrecon.world.court_finding import ASK
from keyrecon.world.records import GroundMarks

OPEN_GROUND = ("The focal length cannot", "Mark two", "Tell the camera's", "No way on")
"""How lines begin that say what is open, and what would tell it."""
OF_MOTION = ("On the ", "For a report with ")
"""How lines begin that say what a new camera has made of the motion."""
GRACE_SECONDS = 2
"""How long open connections may take to end when the server is stopped."""
SETTLING_SECONDS = 0.05
"""How long a connection that was just accepted may take to get its protocol."""
IDLE_SECONDS = 75
"""How long a connection may rest: a person looks at a picture longer than a program would."""


def serve_annotator(
    workspace: Workspace,
    host: str,
    port: int,
    open_browser: bool,
    say: Callable[[str], None],
) -> None:
    """Serve the page of a project until interrupted; without a port at any that is free."""
    file, private = workspace.folder / "cache" / "annotator.json", is_loopback(host)
    memory = recall(file) if private else LastAddress()
    with listen(host, port, memory) as listener:
        session = open_session(workspace, make_assistant(workspace), job_commands(workspace.folder))
        watch = ProjectWatch(session)
        try:
            credentials = make_credentials(listener, host, memory)
            say(announce(workspace.folder, credentials.address, host))
            if private:
                remember(file, credentials)
            if open_browser:
                webbrowser.open(credentials.address)
            with suppress(KeyboardInterrupt):
                asyncio.run(PageServer(session, credentials).serve(sockets=[listener]))
            say("Stopped. Everything that was marked is kept.")
        finally:
            watch.close()
            session.close()


def announce(folder: Path, address: str, host: str) -> str:
    """What to open, and a warning where others can reach it too."""
    text = f"Annotating {folder}. Open in a browser:\n  {address}"
    if is_loopback(host):
        return text
    return (
        f"{text}\nWarning: {host} can be reached from other machines, without encryption; whoever "
        "has the address can change this project. Safer: leave --host out and use ssh -L."
    )


class PageServer(uvicorn.Server):
    """Leaves no connection open when it is stopped. Streams of news would keep it waiting; and a
    connection just accepted has no protocol yet: asyncio would lose it if it closed the server."""

    def __init__(
        self, session: Session, credentials: Credentials, grace: int = GRACE_SECONDS
    ) -> None:
        """Serve a project; the address with its token appears in no log. Open connections may take
        `grace` seconds to end."""
        config = uvicorn.Config(
            make_app(session, credentials),
            log_level="warning",
            access_log=False,
            server_header=False,
            timeout_keep_alive=IDLE_SECONDS,
            timeout_graceful_shutdown=grace,
        )
        super().__init__(config)
        self._events = session.events

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop; called in the server's own loop."""
        self._events.close()
        for listener in sockets or ():
            asyncio.get_running_loop().remove_reader(listener)
        await asyncio.sleep(SETTLING_SECONDS)
        await super().shutdown(sockets)


def job_commands(folder: Path) -> dict[str, Callable[[dict[str, Any], Progress], str]]:
    """What the page can have done, by name."""
    side_by_side = {"follow": _follow_player, "keyframes": _find_keyframes, "run": _run}
    jobs = {"golf": _fit_swing, "court": _find_court, "ground": _find_ground}
    return {
        **{name: partial(_work_side_by_side, job, folder) for name, job in side_by_side.items()},
        **{name: partial(_work_alone, job, folder) for name, job in jobs.items()},
        "export": partial(_export, folder),
    }


_Job = Callable[[Workspace, dict[str, Any], Progress], str]


def _work_alone(job: _Job, folder: Path, options: dict[str, Any], progress: Progress) -> str:
    """A job during which no command works on the project."""
    with lock_project(folder, "The page of keyrecon annotate"):
        return job(Workspace(folder), options, progress)


def _work_side_by_side(job: _Job, folder: Path, options: dict[str, Any], progress: Progress) -> str:
    """The same with shots worked on side by side, as the command line does."""
    with lock_project(folder, "The page of keyrecon annotate"), open_workers(None) as made_by:
        return job(Workspace(folder, workers=made_by), options, progress)


def _follow_player(workspace: Workspace, _: dict[str, Any], progress: Progress) -> str:
    """The automatic part with the bodies marked so far, before keyframes are chosen."""
    video = workspace.video()
    _prepare_with_bodies(workspace, video)
    marks = project.load_annotations(workspace, video)
    options = workspace.options(Options(), Options())
    prepared = prepare_project(workspace, video, marks, options, progress)
    shots = prepared.preparation.shots
    seen = float((prepared.preparation.track.confidence[shots.usable_frames] > 0).mean())
    share = f"Player found in {seen:.1%} of {len(shots.usable_frames)} frames."
    return "\n".join([share, *describe_shots(shots), *prepared.warnings()])


def _prepare_with_bodies(workspace: Workspace, video: Video) -> None:
    """Before there are keyframes, every mark there is teaches the automatic part."""
    if workspace.keyframes_file.exists() or not workspace.annotations_file.exists():
        return
    marks = project.load_annotations(workspace, video)
    if len(np.intersect1d(*marked_frames(marks))):
        write_coco(workspace.prepared_marks_file, marks, (video.width, video.height))


def _find_keyframes(workspace: Workspace, options: dict[str, Any], progress: Progress) -> str:
    reach = options.get("reach")
    chosen = keyframing.KeyframeSettings(
        options.get("budget"), options.get("coverage"), None if reach is None else round(reach)
    )
    _prepare_with_bodies(workspace, workspace.video())
    return _warnings(keyframing.find_keyframes(workspace, Options(), chosen, progress))


def _run(workspace: Workspace, options: dict[str, Any], progress: Progress) -> str:
    height, fov = options.get("height"), options.get("field_of_view")
    settings = running.run_options(workspace, Options(), height, fov=fov)
    if options.get("height", settings.lift.height) is None:  # its field was cleared
        settings = with_height(settings, None)
    if options.get("field_of_view", settings.lift.field_of_view) is None:
        settings = with_field_of_view(settings, None)
    return _warnings(running.run(workspace, settings, progress, partial=True))


def _find_court(workspace: Workspace, _: dict[str, Any], progress: Progress) -> str:
    """The court from its lines and the points clicked so far; what became of the motion, or why it
    tells no way, is returned."""
    try:
        text = calibrate(workspace, (), CalibrationOptions(), progress)
    except KeyreconError as fault:
        said = str(fault).replace(ASK, "click four of its points in the picture.")
        raise KeyreconError(
            said.split(" Clicked so far")[0].split(" Clicks of former")[0]
        ) from fault
    return "\n".join(part for part in (*_motion_notes(text), _warnings(text)) if part)


def _motion_notes(output: str) -> list[str]:
    """What a new camera has made of the motion that there is; the page has no file of the way."""
    lines = [line for line in output.splitlines() if line.startswith(OF_MOTION)]
    return [re.sub(r"; \S.* shows the way\.", ".", line) for line in lines]


def _find_ground(workspace: Workspace, _: dict[str, Any], progress: Progress) -> str:
    """The camera from all that was marked; what is still open is returned, and what became of the
    motion."""
    text = find_ground(workspace, GroundMarks(), progress)
    open_lines = [line for line in text.splitlines() if line.startswith(OPEN_GROUND)]
    return "\n".join([*_motion_notes(text), *open_lines])


def _fit_swing(workspace: Workspace, _: dict[str, Any], progress: Progress) -> str:
    """A golf fit; what the page shows in no other place is returned."""
    summary = golf.fit_project(workspace, progress=progress)
    return "\n".join(line for line in summary.splitlines() if line.startswith("Note: "))


def _warnings(output: str) -> str:
    """Of what a command tells, the cuts, clicks and marks that do not fit the rest, and what speaks
    against the track or the camera: the page shows everything else in places of its own."""
    named = re.compile(
        r"\d+ shots, |The [\w ]+ (clicked|marked) in frame \d+|The lower edge of the picture|"
        r"Something laid over|Another figure|The player found jumps|The light changes|"
        r"The video is dark|No way on the"
    )
    return "\n".join(line for line in output.splitlines() if named.match(line))


def _export(folder: Path, options: dict[str, Any], progress: Progress) -> str:
    """Files for other programs into the folder `exports`, named after the project; what they hold
    is returned."""
    workspace = Workspace(folder)
    make_folder(workspace.exports)
    first, last = options.get("first"), options.get("last")
    frames = None if None in (first, last) else f"{first}-{last}"
    chosen: dict[str, Any] = {
        name: options[name] for name in ("skeleton", "slowmo", "size") if name in options
    }
    if "view" in options:
        chosen["view"] = tuple(options["view"])
    for name, kind in (("view", View), ("skeleton", Limbs)):
        if not {*np.atleast_1d(chosen.get(name, ()))} <= {*get_args(kind)}:
            raise KeyreconError(f"There is no {name} '{chosen[name]}'.")
    overlay = OverlayOptions(**chosen)
    name = folder.resolve().name + "".join(f"_{part}" for part in _name_parts(frames, overlay))
    files = [workspace.exports / f"{name}{suffix}" for suffix in options.get("formats", ())]
    motion = motion_stamp(workspace)
    lines = export(workspace, files, progress, frames, overlay)
    note_exports(workspace, files, motion)
    return "\n".join(line.replace(f"{workspace.exports}/", "") for line in lines)


def _name_parts(frames: str | None, overlay: OverlayOptions) -> list[str]:
    """What tells files of one motion apart."""
    plain = OverlayOptions()
    parts = [frames] if frames else []
    parts += [*overlay.view] if overlay.view != plain.view else []
    parts += [overlay.skeleton] if overlay.skeleton != plain.skeleton else []
    parts += [f"slow{overlay.slowmo:g}"] if overlay.slowmo != plain.slowmo else []
    return parts + ([f"{overlay.size}p"] if overlay.size else [])
