"""The annotator's server: the route table, and what turns a request into an answer.

Routes lead to plain functions (handlers.py), which run in worker threads; bodies are parsed
against a declared type before. Everything goes through the security middleware first.
"""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
from anyio import CapacityLimiter
from anyio.to_thread import run_sync
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp

from keyrecon.annotate.server import handlers, world_handlers
from keyrecon.annotate.server.page_words import in_page_words
from keyrecon.annotate.server.security import Credentials, SecurityMiddleware
from keyrecon.annotate.server.session import Session, describe_files
from keyrecon.annotate.store.edits import EditList
from keyrecon.annotate.store.journal import NotSaved
from keyrecon.errors import KeyreconError

PACKAGE = Path(__file__).parents[2]
PAGE = PACKAGE / "annotate" / "page"
SHARED = tuple(
    PACKAGE / "report" / name for name in ("colors.js", "figure3d.js", "ground_level.js")
)
"""Scripts that the page shares with the report."""
TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}


@dataclass(frozen=True)
class ApiRoute:
    """One line of the route table."""

    method: str
    path: str
    handler: Callable[..., Any]
    body: type | None = None
    alone: bool = False
    """Whether one request at a time is answered. The others wait outside the worker threads, so
    that a slow answer never keeps an edit waiting."""


ROUTES = (
    ApiRoute("GET", "/api/project", handlers.project, alone=True),
    ApiRoute("GET", "/api/state", handlers.state),
    ApiRoute("POST", "/api/edits", handlers.edits, EditList),
    ApiRoute("POST", "/api/undo", handlers.undo, handlers.HistoryRequest),
    ApiRoute("POST", "/api/redo", handlers.redo, handlers.HistoryRequest),
    ApiRoute("GET", "/api/suggestion/{frame:int}", handlers.pose_suggestion, alone=True),
    ApiRoute("POST", "/api/pose", handlers.pose, handlers.PoseRequest, alone=True),
    ApiRoute("GET", "/api/checks", handlers.checks, alone=True),
    ApiRoute("GET", "/api/next_frames", handlers.next_frames, alone=True),
    ApiRoute("GET", "/api/stretches", handlers.stretches, alone=True),
    ApiRoute("GET", "/api/run", handlers.run),
    ApiRoute("GET", "/api/swing", handlers.swing, alone=True),
    ApiRoute("POST", "/api/picks/preview", handlers.preview, handlers.PreviewRequest, alone=True),
    ApiRoute("GET", "/api/backprojection/{frame:int}", handlers.backprojection, alone=True),
    ApiRoute("GET", "/api/jobs", handlers.jobs),
    ApiRoute("POST", "/api/jobs", handlers.begin_job, handlers.JobRequest),
    ApiRoute("DELETE", "/api/jobs/{job:int}", handlers.cancel_job),
    ApiRoute("POST", "/api/shots", handlers.shot, handlers.ShotRequest, alone=True),
    ApiRoute("GET", "/api/court", world_handlers.court),
    ApiRoute("GET", "/api/court/{frame:int}", world_handlers.court_view, alone=True),
    ApiRoute("POST", "/api/court", world_handlers.court_point, world_handlers.CourtPointRequest),
    ApiRoute("GET", "/api/ground", world_handlers.ground),
    ApiRoute("GET", "/api/ground/{frame:int}", world_handlers.ground_view, alone=True),
    ApiRoute("POST", "/api/ground", world_handlers.change_ground, world_handlers.GroundRequest),
    ApiRoute("GET", "/api/motion", handlers.motion),
    ApiRoute("GET", "/api/report", handlers.report),
    ApiRoute("GET", "/api/exports", handlers.exports),
    ApiRoute("GET", "/api/exports/{name}", handlers.exported_file),
    ApiRoute("GET", "/api/fitted/{name}", handlers.fitted_file),
    ApiRoute("POST", "/api/import", handlers.import_file, handlers.ImportRequest),
    ApiRoute("GET", "/api/export/{format}", handlers.export_file),
)


def make_app(session: Session, credentials: Credentials) -> ASGIApp:
    """The application behind its security middleware."""
    app = Starlette(
        routes=make_routes(session, read_page()),
        exception_handlers={
            NotSaved: lambda _, fault: _error(507, str(fault)),
            KeyreconError: lambda _, fault: _error(400, str(fault)),
            HTTPException: lambda _, fault: _error(fault.status_code, fault.detail),
            Exception: lambda *_: _error(500, "A fault of keyrecon; the terminal tells more."),
        },
    )
    app.router.redirect_slashes = False
    return SecurityMiddleware(app, credentials)


def make_routes(session: Session, files: dict[str, Response]) -> list[Route]:
    """All routes there are."""

    async def events(request: Request) -> Response:
        def first() -> dict[str, Any]:
            files = describe_files(session.workspace)
            return {"revision": session.store.state.revision, "files": files}

        return StreamingResponse(session.events.stream(first), media_type="text/event-stream")

    async def frame(request: Request) -> Response:
        return await _frame(session, request)

    return [
        *(Route(path, _static(answer), methods=["GET"]) for path, answer in files.items()),
        Route("/api/events", events, methods=["GET"]),
        Route("/api/frame/{frame:int}", frame, methods=["GET"]),
        *(Route(one.path, _endpoint(session, one), methods=[one.method]) for one in ROUTES),
    ]


def read_page() -> dict[str, Response]:
    """The page's files by the path of their address, which is that in the package.

    Each has a route of its own, and there is no other way to a file.
    """
    page = [path for path in sorted(PAGE.rglob("*")) if path.suffix in TYPES]
    files = {
        f"/{path.relative_to(PACKAGE).as_posix()}": Response(
            path.read_bytes(), media_type=TYPES[path.suffix]
        )
        for path in (*page, *SHARED)
    }
    return {"/": files.pop("/annotate/page/index.html"), **files}


def _static(answer: Response) -> Callable[[Request], Any]:
    async def endpoint(request: Request) -> Response:
        return answer

    return endpoint


def _endpoint(session: Session, route: ApiRoute) -> Callable[[Request], Any]:
    """An endpoint that parses the body, answers in a worker thread, and writes JSON."""
    limiter = CapacityLimiter(1) if route.alone else None

    async def endpoint(request: Request) -> Response:
        body = _parsed(await request.body(), route.body) if route.body else None
        parsed = handlers.ApiRequest(request.path_params, dict(request.query_params), body)
        answer = await run_sync(route.handler, session, parsed, limiter=limiter)
        return answer if isinstance(answer, Response) else _json(answer)

    return endpoint


def _parsed(body: bytes, kind: type) -> Any:
    try:
        return msgspec.json.decode(body, type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as fault:
        raise KeyreconError(f"The request is not what this route takes: {fault}") from fault


def _json(answer: Any, status: int = 200) -> Response:
    """An answer as JSON; numbers that are none become null."""
    return Response(msgspec.json.encode(answer), status, media_type="application/json")


def _error(status: int, text: str) -> Response:
    return _json({"error": in_page_words(text)}, status)


async def _frame(session: Session, request: Request) -> Response:
    """A frame as JPEG. With the right ?v= the browser may keep it for good: another project may
    have the same port later, and then `v` differs."""
    width, frames = request.query_params.get("width", ""), session.frames
    if width and not (width.isascii() and width.isdecimal() and len(width) < 6):
        raise KeyreconError("'width' is a number of pixels.")
    picture = frames.jpeg(request.path_params["frame"], int(width or 0) or None)
    lasting = request.query_params.get("v") == frames.identity
    control = "private, max-age=31536000, immutable" if lasting else "no-store"
    data = await asyncio.wrap_future(picture)
    return Response(data, media_type="image/jpeg", headers={"Cache-Control": control})
