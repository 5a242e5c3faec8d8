"""A project open for annotation, and requests as a page sends them."""

import asyncio
import json
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from urllib.parse import unquote

from keyrecon.annotate.assistant import Assistant
from keyrecon.annotate.server.routes import make_app
from keyrecon.annotate.server.security import Credentials
from keyrecon.annotate.server.session import open_session
from keyrecon.app import project
from keyrecon.io.workspace import Workspace

CREDENTIALS = Credentials(("127.0.0.1:8000", "localhost:8000"), 8000)
HEADERS = {
    "host": "127.0.0.1:8000",
    "origin": "http://127.0.0.1:8000",
    "cookie": f"{CREDENTIALS.cookie}={CREDENTIALS.cookie_secret}",
    "content-type": "application/json",
}
"""What a browser sends for the page."""


def new_project(folder, video_file):
    """The folder of a project without picks or keyframes."""
    project.start(video_file, folder)
    return folder


def open_project(folder, assistant=Assistant(), commands=None):
    return open_session(Workspace(folder), assistant, commands or {})


@dataclass(frozen=True)
class Answer:
    """What an application answered."""

    status: int
    headers: dict[str, str]
    content: bytes

    def json(self):
        return json.loads(self.content)


def run_apart(work):
    """Do asynchronous work in a thread: a driven browser has a loop of its own in this one."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(asyncio.run, work).result()


async def call(app, method, address, headers, body=b""):
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
        await app(scope, receive, send)
    answer = {name.decode(): value.decode() for name, value in sent[0]["headers"]}
    content = b"".join(message.get("body", b"") for message in sent[1:])
    return Answer(sent[0]["status"], answer, content)


def request(*question):
    """The answer to one question."""
    return run_apart(call(*question))


def ask(session, method, path, body=None):
    """Ask as the page does."""
    data = b"" if body is None else json.dumps(body).encode()
    return request(make_app(session, CREDENTIALS), method, path, HEADERS, data)
