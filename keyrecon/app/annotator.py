"""`keyrecon annotate`: the page's server put together with what it calls, and its address."""

import asyncio
import socket
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

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
from keyrecon.annotate.server.session import Session, open_session
from keyrecon.annotate.store.watch import Watch
from keyrecon.app import project
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options
from keyrecon.progress import Progress

GRACE_SECONDS = 2
"""How long open connections may take to end when the server is stopped."""
IDLE_SECONDS = 75
"""How long a connection may rest: a person looks at a picture longer than a program would."""


def serve_annotator(
    workspace: Workspace, place: tuple[str, int], open_browser: bool, say: Callable[[str], None]
) -> None:
    """Serve the page of a project at (host, port) until interrupted."""
    file, private = workspace.folder / "cache" / "annotator.json", is_loopback(place[0])
    memory = recall(file) if private else LastAddress()
    with listen(*place, memory) as listener:
        desk = open_session(workspace, make_assistant(workspace), job_commands(workspace.folder))
        watch = Watch(desk)
        try:
            door = make_credentials(listener, place[0], memory)
            say(announce(workspace.folder, door.address, place[0]))
            if private:
                remember(file, door)
            if open_browser:
                webbrowser.open(door.address)
            with suppress(KeyboardInterrupt):
                asyncio.run(_Server(desk, door).serve(sockets=[listener]))
            say("Stopped. Everything that was marked is kept.")
        finally:
            watch.close()
            desk.close()


def announce(folder: Path, address: str, host: str) -> str:
    """What to open, and a warning where others can reach it too."""
    text = f"Annotating {folder}. Open in a browser:\n  {address}"
    if is_loopback(host):
        return text
    return (
        f"{text}\nWarning: {host} can be reached from other machines, without encryption; whoever "
        "has the address can change this project. Safer: leave --host out and use ssh -L."
    )


class _Server(uvicorn.Server):
    """Ends the streams of news when it is stopped; they would keep it waiting."""

    def __init__(self, desk: Session, door: Credentials) -> None:
        """Serve a project; the address with its token appears in no log."""
        config = uvicorn.Config(
            make_app(desk, door),
            log_level="warning",
            access_log=False,
            server_header=False,
            timeout_keep_alive=IDLE_SECONDS,
            timeout_graceful_shutdown=GRACE_SECONDS,
        )
        super().__init__(config)
        self._events = desk.events

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop; called in the server's own loop."""
        self._events.close()
        await super().shutdown(sockets)


def job_commands(folder: Path) -> dict[str, Callable[[dict[str, Any], Progress], str]]:
    """What the page can have done, by name."""
    return {"keyframes": partial(_find_keyframes, folder), "run": partial(_run, folder)}


def _find_keyframes(folder: Path, told: dict[str, Any], progress: Progress) -> str:
    reach = told.get("reach")
    chosen = {
        "budget": told.get("budget"),
        "coverage": told.get("coverage"),
        "reach": None if reach is None else round(reach),
    }
    return project.find_keyframes(Workspace(folder), Options(), chosen, progress)


def _run(folder: Path, told: dict[str, Any], progress: Progress) -> str:
    workspace = Workspace(folder)
    options = project.settings(workspace, Options(), told.get("height"))
    return project.run(workspace, options, progress, partial=True)
