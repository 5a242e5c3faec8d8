"""A project open for annotation, and requests as a page sends them."""

import asyncio
import json
from contextlib import suppress
from dataclasses import dataclass
from urllib.parse import unquote

from keyrecon import project
from keyrecon.annotate.assistant import Assistant
from keyrecon.annotate.desk import open_desk
from keyrecon.workspace import Workspace


def new_project(folder, video_file):
    """A project without picks or keyframes."""
    project.start(video_file, folder)
    return Workspace(folder)


def open_project(folder, assistant=Assistant(), commands=None):
    return open_desk(Workspace(folder), assistant, commands or {})


@dataclass(frozen=True)
class Answer:
    """What an application answered."""

    status: int
    headers: dict[str, str]
    content: bytes

    def json(self):
        return json.loads(self.content)


def request(app, method, address, headers, body=b""):
    """Ask an ASGI application, with exactly these headers: a list of pairs, or a dict."""
    path, _, query = address.partition("?")
    pairs = headers.items() if isinstance(headers, dict) else headers
    scope = {
        "type": "http",
        "http_version": "1.1",
        "method": method,
        "scheme": "http",
        "path": unquote(path),
        "raw_path": path.encode(),
        "query_string": query.encode(),
        "root_path": "",
        "headers": [(name.encode(), value.encode()) for name, value in pairs],
    }
    sent = []
    coming = [{"type": "http.request", "body": body, "more_body": False}]

    async def receive():
        return coming.pop() if coming else {"type": "http.disconnect"}

    async def send(message):
        sent.append(message)

    with suppress(Exception):  # the server logs it; what counts is what was answered
        asyncio.run(app(scope, receive, send))
    told = {name.decode(): value.decode() for name, value in sent[0]["headers"]}
    content = b"".join(message.get("body", b"") for message in sent[1:])
    return Answer(sent[0]["status"], told, content)
