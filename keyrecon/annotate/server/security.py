"""Who may talk to the server: only the page that `keyrecon annotate` opened.

Any web site that a person visits can send requests to this machine, so it is not enough to
listen on 127.0.0.1. Every request must carry a Host from a fixed list (against DNS rebinding),
an Origin from a fixed list if it has one, and always if it may change something (against other
sites' requests), and a cookie that only the address printed at the start gives. Bodies are JSON
below a size limit. Answers forbid everything but the page's own scripts and styles.
"""

import secrets
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware.body_limit import RequestBodyLimitMiddleware
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

MAX_BODY_BYTES = 16 << 20
"""Largest body: an imported file of some ten thousand frames, bytes."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
ANSWER_HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}
SAFE_METHODS = ("GET", "HEAD")


@dataclass(frozen=True)
class Credentials:
    """The address of one server and the secrets that give access to it."""

    hosts: tuple[str, ...]
    """host:port as a browser writes them."""
    port: int
    token: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    """Part of the address that is printed."""
    cookie_secret: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    """What the cookie holds."""

    @property
    def origins(self) -> tuple[str, ...]:
        """Origins of the page itself."""
        return tuple(f"http://{host}" for host in self.hosts)

    @property
    def cookie(self) -> str:
        """Name of the cookie: cookies do not tell ports apart, and two projects may be open."""
        return f"keyrecon-{self.port}"

    @property
    def address(self) -> str:
        """What the browser opens."""
        return f"http://{self.hosts[0]}/?token={self.token}"


class SecurityMiddleware:
    """Lets only good requests through to the application, and marks every answer."""

    def __init__(
        self, app: ASGIApp, credentials: Credentials, max_bytes: int = MAX_BODY_BYTES
    ) -> None:
        """Stand before `app`."""
        self._app = RequestBodyLimitMiddleware(app, max_bytes)
        self._credentials = credentials

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request or pass it on."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
        elif scope["type"] == "http":
            answer = self._refusal_or_welcome(scope)
            await (answer or self._app)(scope, receive, _with_headers(send))
        else:
            await send({"type": "websocket.close", "code": 1008})

    def _refusal_or_welcome(self, scope: Scope) -> Response | None:
        """A refusal, or the cookie for the right token; None lets the request through."""
        headers, credentials = Headers(scope=scope), self._credentials
        if headers.getlist("host") not in [[host] for host in credentials.hosts]:
            return _refuse(421, "This is not the address of this server.")
        if refusal := self._refuse_foreign(scope["method"], headers):
            return refusal
        token = parse_qs(scope["query_string"].decode("latin-1")).get("token")
        if scope["path"] == "/" and scope["method"] == "GET" and token:
            return self._welcome(token[0])
        if not self._has_cookie(headers):
            return _refuse(403, "Open the address that keyrecon annotate printed.")
        if scope["method"] == "POST" and headers.get("content-type") != "application/json":
            return _refuse(415, "Only JSON is taken (Content-Type: application/json).")
        return None

    def _refuse_foreign(self, method: str, headers: Headers) -> Response | None:
        origins, safe = headers.getlist("origin"), method in SAFE_METHODS
        allowed = [[origin] for origin in self._credentials.origins]
        if origins not in ([*allowed, []] if safe else allowed):
            return _refuse(403, "Requests of other sites are not answered.")
        if headers.get("sec-fetch-site", "none") not in ("same-origin", "none"):
            return _refuse(403, "Requests of other sites are not answered.")
        return None

    def _welcome(self, token: str) -> Response:
        if not secrets.compare_digest(token.encode(), self._credentials.token.encode()):
            return _refuse(403, "This address is out of date; open the one printed last.")
        answer = RedirectResponse("/", status_code=303)
        answer.set_cookie(
            self._credentials.cookie,
            self._credentials.cookie_secret,
            httponly=True,
            samesite="strict",
            path="/",
        )
        return answer

    def _has_cookie(self, headers: Headers) -> bool:
        try:
            cookies = SimpleCookie("; ".join(headers.getlist("cookie")))
        except CookieError:
            return False
        cookie = cookies.get(self._credentials.cookie)
        return cookie is not None and secrets.compare_digest(
            cookie.value.encode(), self._credentials.cookie_secret.encode()
        )


def _refuse(status: int, text: str) -> JSONResponse:
    return JSONResponse({"error": text}, status)


def _with_headers(send: Send) -> Any:
    async def send_marked(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in ANSWER_HEADERS.items():
                headers.setdefault(name, value)
            headers.setdefault("Cache-Control", "no-store")
        await send(message)

    return send_marked
