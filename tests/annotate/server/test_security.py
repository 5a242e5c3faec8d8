"""Nothing gets in: good and bad Host, Origin, token, method, path and body on every route."""

import itertools
import json

import pytest
from annotator import CREDENTIALS, HEADERS, new_project, open_project, request, run_apart

from keyrecon.annotate.server import routes as server
from keyrecon.annotate.server.security import MAX_BODY_BYTES

METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE")
BAD_HOSTS = (
    *("evil.com", "evil.com:8000", "127.0.0.1", "127.0.0.1:80", "127.0.0.1.evil.com:8000"),
    *("localhost", "LOCALHOST.:8000", "[::1]:8000", "0.0.0.0:8000", "", "127.0.0.1:8000@evil.com"),
)
BAD_ORIGINS = (
    *("http://evil.com", "null", "https://127.0.0.1:8000", "http://127.0.0.1", "http://[::1]:8000"),
    *("http://127.0.0.1:8001", "http://localhost.evil.com:8000", "", "http://127.0.0.1:8000/"),
)
BAD_COOKIES = (
    *(
        "",
        f"{CREDENTIALS.cookie}=",
        f"{CREDENTIALS.cookie}=guess",
        f"{CREDENTIALS.cookie}={CREDENTIALS.token}",
    ),
    *(
        f"other={CREDENTIALS.cookie_secret}",
        f"{CREDENTIALS.cookie}={CREDENTIALS.cookie_secret}x",
        f"{CREDENTIALS.cookie}={CREDENTIALS.cookie_secret[:-1]}",
    ),
)
"""The token of the address gives the cookie and does not take its place."""


@pytest.fixture(scope="module")
def session(tmp_path_factory, write_numbered):
    folder = tmp_path_factory.mktemp("guarded") / "p"
    new_project(folder, write_numbered("v.mp4", list(range(0, 240, 12))))
    session = open_project(folder)
    yield session
    session.close()


@pytest.fixture(scope="module")
def routes(session):
    """(method, address) of every route, from the table itself."""
    filled = {"{frame:int}": "3", "{job:int}": "1", "{format}": "coco", "{name}": "rally.bvh"}
    table = []
    for route in server.make_routes(session, server.read_page()):
        path = route.path
        for gap, value in filled.items():
            path = path.replace(gap, value)
        assert "{" not in path
        table += [(method, path) for method in route.methods if method != "HEAD"]
    assert len(table) > 40
    return table


@pytest.fixture(scope="module")
def ask(session):
    """Ask with exactly these headers; returns the answer."""
    app = server.make_app(session, CREDENTIALS)

    def send(method, path, headers=HEADERS, body=b""):
        return request(app, method, path, headers, body)

    return send


def changed(**headers):
    """Good headers with some changed or left out."""
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    return {n: v for n, v in {**HEADERS, **named}.items() if v is not None}


def test_the_page_itself_gets_in_everywhere(ask, routes):
    for method, path in routes:
        assert ask(method, path).status not in (401, 403, 405, 415, 421), path


def test_no_route_answers_under_another_host(ask, routes):
    for (method, path), host in itertools.product(routes, BAD_HOSTS):
        assert ask(method, path, changed(host=host)).status == 421, (path, host)


def test_no_route_answers_another_origin(ask, routes):
    for (method, path), origin in itertools.product(routes, BAD_ORIGINS):
        assert ask(method, path, changed(origin=origin)).status == 403, (path, origin)


def test_what_changes_something_needs_an_origin(ask, routes):
    for method, path in routes:
        status = ask(method, path, changed(origin=None)).status
        assert (status == 403) == (method != "GET"), path


def test_no_route_answers_without_the_cookie(ask, routes):
    for (method, path), cookie in itertools.product(routes, (*BAD_COOKIES, None)):
        assert ask(method, path, changed(cookie=cookie)).status == 403, (path, cookie)


@pytest.mark.parametrize("site", ["cross-site", "same-site", "anything"])
def test_no_route_answers_what_a_browser_calls_foreign(ask, routes, site):
    for method, path in routes:
        assert ask(method, path, changed(sec_fetch_site=site)).status == 403, path


def test_two_hosts_origins_or_cookies_at_once_are_not_good(ask):
    for name, other in (("host", "evil.com"), ("origin", "http://evil.com")):
        twice = [*HEADERS.items(), (name, other)]
        assert ask("GET", "/api/state", twice).status in (403, 421)


def test_other_methods_are_refused(ask, routes):
    known = {}
    for method, path in routes:
        known.setdefault(path, {"HEAD"}).add(method)
    for path, methods in known.items():
        for method in {*METHODS} - methods - {"GET"}:
            assert ask(method, path).status in (403, 405), (method, path)


@pytest.mark.parametrize(
    "path",
    [
        "/annotate/page/../server/routes.py",
        "/annotate/page/..%2fserver%2froutes.py",
        "/annotate/page/%2e%2e/server/routes.py",
        "/annotate/page/draw/../../server/routes.py",
        "/annotate/page/draw/..%2f..%2fserver%2froutes.py",
        "/annotate/server/routes.py",
        "/annotate/page//etc/passwd",
        "/annotate/page/%2fetc%2fpasswd",
        "/annotate/page/main.js%00.js",
        "/annotate/page/",
        "/annotate/page/draw",
        "/annotate/page/draw/",
        "/report/page.py",
        "/report/cursor.js",
        "/page/main.js",
        "/api/frame/../../project.toml",
        "/api/frame/..%2f..%2fproject.toml",
        "/api/frame/-1",
        "/api/frame/20",
        "/api/frame/99999999999999999999",
        "/api/frame/3?width=-5",
        "/api/frame/3?width=1e9",
        "/api/frame/3?width=%D9%A3",
        "/api/export/..%2fannotations.json",
        "/project.toml",
        "/static/annotations.json",
        "//evil.com",
    ],
)
def test_nothing_but_what_is_listed_is_served(ask, path):
    answer = ask("GET", path)
    assert answer.status in (400, 404)
    assert b"fingerprint" not in answer.content


BODIES = {
    "": 400,
    "{": 400,
    "null": 400,
    "[]": 400,
    "[" * 100_000: 400,
    '{"edits": [' + '{"id":' * 50_000: 400,
    '{"edits": 3}': 400,
    '{"edits": [{"kind": "__class__", "id": "a"}]}': 400,
    '{"id": "' + "x" * 100 + '"}': 400,
    '{"more": 1}': 400,
    '{"frames": [1e99]}': 400,
    '\ufeff{"edits": []}': 400,
    '"' + "x" * (MAX_BODY_BYTES + 1) + '"': 413,
}


def test_no_body_of_another_form_gets_in(ask, routes, session):
    before = session.store.state
    for (method, path), body in itertools.product(routes, BODIES):
        if method == "POST":
            answer = ask(method, path, body=body.encode())
            assert answer.status == BODIES[body], (path, body[:40])
            assert answer.json()["error"]
    assert session.store.state == before


@pytest.mark.parametrize(
    "kind",
    [
        *("text/plain", "application/x-www-form-urlencoded", "multipart/form-data", None),
        "application/json; charset=utf-7",
    ],
)
def test_forms_of_other_sites_are_no_json(ask, routes, kind):
    for method, path in routes:
        if method == "POST":
            assert ask(method, path, changed(content_type=kind), body=b"{}").status == 415


def test_the_token_gives_the_cookie_once_more_for_each_page(ask):
    bare = {"host": HEADERS["host"]}
    for _ in range(2):
        answer = ask("GET", f"/?token={CREDENTIALS.token}", bare)
        assert (answer.status, answer.headers["location"]) == (303, "/")
        cookie = answer.headers["set-cookie"]
        assert "HttpOnly" in cookie
        assert "samesite=strict" in cookie.lower()
        assert CREDENTIALS.token not in cookie
    for token in (
        "",
        "guess",
        CREDENTIALS.cookie_secret,
        CREDENTIALS.token[:-1],
        CREDENTIALS.token + "%C3%A9",
    ):
        assert ask("GET", f"/?token={token}", bare).status == 403
    assert ask("GET", f"/api/state?token={CREDENTIALS.token}", bare).status == 403


def test_every_answer_forbids_what_the_page_does_not_need(ask, routes):
    answers = [ask("GET", "/"), ask("GET", "/nothing"), ask("GET", "/", {"host": "evil.com"})]
    for answer in answers:
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert "frame-ancestors 'none'" in policy
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert "access-control-allow-origin" not in answer.headers


def test_sockets_are_closed_at_once(session):
    sent = []

    async def send(message):
        sent.append(message)

    headers = [(name.encode(), value.encode()) for name, value in HEADERS.items()]
    scope = {"type": "websocket", "path": "/api/events", "headers": headers}
    run_apart(server.make_app(session, CREDENTIALS)(scope, None, send))
    assert sent == [{"type": "websocket.close", "code": 1008}]


def test_an_unforeseen_fault_shows_nothing_of_the_inside(ask, session, monkeypatch):
    monkeypatch.setattr(session.jobs, "listed", lambda: 1 / 0)
    answer = ask("GET", "/api/jobs")
    assert answer.status == 500
    assert b"ZeroDivision" not in answer.content
    assert json.loads(answer.content)["error"]
