"""A person at the annotator's page: a real browser, a real server, and a count of what is done."""

import asyncio
import json
import math
import os
import re
import time
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from urllib.request import Request, urlopen

from keyrecon.annotate.assistant import Assistant
from keyrecon.annotate.server.session import open_session
from keyrecon.app.annotator import PageServer, listen, make_credentials
from keyrecon.body import LSP14
from keyrecon.io.workspace import Workspace

BROWSER = Path(os.environ.get("KEYRECON_BROWSER", "/usr/bin/chromium"))
"""The program that shows the page; one with `firefox` in its name is driven as Firefox is."""
SCREEN = {"width": 1366, "height": 768}
SELECTED = "document.querySelector('.joint.selected')?.dataset.joint"
OPEN_JOINTS = (
    "[...document.querySelectorAll('.joint[data-joint]:not([hidden]):not(.marked)')]"
    ".map((row) => row.dataset.joint)"
)
SOON = 60_000
"""How long the page may take for anything, ms."""


class Serving:
    """The server of one project in a thread; may be stopped and started again at its address."""

    def __init__(self, folder, assistant=Assistant(), commands=None):
        self.folder, self.assistant, self.commands = folder, assistant, commands or {}
        self.credentials = None
        self.start()

    def start(self):
        listener = listen("127.0.0.1", self.credentials.port if self.credentials else 0)
        self.credentials = self.credentials or make_credentials(listener, "127.0.0.1")
        self.session = open_session(Workspace(self.folder), self.assistant, self.commands)
        self._server = PageServer(self.session, self.credentials, grace=0)
        self._thread = Thread(target=asyncio.run, args=(self._server.serve(sockets=[listener]),))
        self._thread.start()

    def stop(self):
        self._server.should_exit = True
        self._thread.join()
        self.session.close()

    def ask(self, path):
        """An answer of the server, as the page would get it."""
        cookie = f"{self.credentials.cookie}={self.credentials.cookie_secret}"
        request = Request(f"{self.credentials.origins[0]}/api/{path}", headers={"Cookie": cookie})
        with urlopen(request) as answer:
            return json.load(answer)


@contextmanager
def serving(folder, assistant=Assistant(), commands=None):
    server = Serving(folder, assistant, commands)
    try:
        yield server
    finally:
        server.stop()


@contextmanager
def browser():
    """A browser of the system; nothing is downloaded."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        if "firefox" in BROWSER.name:
            opened = play.firefox.launch(executable_path=str(BROWSER), channel="moz-firefox")
        else:
            opened = play.chromium.launch(executable_path=str(BROWSER), args=["--no-sandbox"])
        yield opened
        opened.close()


class Person:
    """Somebody at the page, who counts clicks, drags and keys and notes every complaint."""

    def __init__(self, context, address):
        self.page = context.new_page()
        self.page.set_default_timeout(SOON)
        self.clicks = self.drags = self.keys = 0
        self.complaints = []
        self.page.on("pageerror", lambda fault: self.complaints.append(str(fault)))
        self.page.on("console", self._hear)
        self.page.on("response", self._remember)
        self.page.goto(address)
        self.page.wait_for_selector("#saving[data-status]", state="attached")

    def _hear(self, message):
        if message.type == "error" and not message.text.startswith("Failed to load resource"):
            self.complaints.append(message.text)

    @property
    def actions(self):
        return self.clicks + self.drags + self.keys

    def on_screen(self, place):
        """Where a point of the picture is in the window."""
        scale, x, y = map(float, self.page.get_attribute("#picture", "data-view").split())
        box = self.page.locator("#picture").bounding_box()
        return box["x"] + scale * place[0] + x, box["y"] + scale * place[1] + y

    def click(self, place):
        self.page.mouse.click(*self.on_screen(place))
        self.clicks += 1

    def point_at(self, place):
        self.page.mouse.move(*self.on_screen(place))

    def drag(self, start, end):
        self.point_at(start)
        self.page.mouse.down()
        x, y = self.on_screen(end)
        self.page.mouse.move(x + 6, y + 6)
        self.page.mouse.move(x, y)
        self.page.mouse.up()
        self.drags += 1

    def press(self, key):
        self.page.keyboard.press(key)
        self.keys += 1

    def text(self, selector):
        return self.page.inner_text(selector)

    def frame(self):
        """The keyframe that is open."""
        found = re.search(r"frame (\d+) of", self.text("#position"))
        return int(found[1])

    def asked(self):
        """The joint that is asked for, if any."""
        return self.page.evaluate(f"{SELECTED} ?? null")

    def await_text(self, selector, pattern):
        self.page.wait_for_function(
            "([s, p]) => new RegExp(p).test(document.querySelector(s).innerText)",
            arg=[selector, pattern],
        )

    def await_fact(self, holds):
        """Until something holds that the server does by and by."""
        ends = time.monotonic() + SOON / 1000
        while not holds():
            assert time.monotonic() < ends
            self.page.wait_for_timeout(50)

    def await_drawn(self):
        """Until what was done shows: two animation frames."""
        self.page.evaluate(
            "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
        )

    def await_saved(self):
        self.await_drawn()
        self.page.wait_for_selector("#saving[data-status=saved]")

    def open(self, frame):
        """Go to a keyframe as by its row in the list."""
        self.page.evaluate("frame => { location.hash = `frame=${frame}`; }", frame)
        self.await_text("#position", rf"frame {frame} of")
        self.page.wait_for_selector(f"#picture[data-frame='{frame}']")

    def pose(self):
        """The server's last answer about the pose."""
        self.await_drawn()
        self.page.wait_for_selector("#pose-canvas[aria-busy=false]")
        return self._pose.json()

    def _remember(self, response):
        if response.url.endswith("/api/pose"):
            self._pose = response

    def mark_joints(self, place_of):
        """Click every joint that is asked for where `place_of(joint)` says."""
        self.page.wait_for_selector(f"#picture[data-frame='{self.frame()}']")
        while self.asked():
            self.mark_one(place_of)

    def mark_one(self, place_of):
        """Click the joint that is asked for."""
        joint = self.asked()
        self.click(place_of(joint))
        self.page.wait_for_function(f"joint => {SELECTED} !== joint", arg=joint)

    def have_marked(self, frame, place_of):
        """Open a keyframe with every joint of it marked at one go, without a click."""
        self.open(frame)
        names = self.page.evaluate(OPEN_JOINTS)
        places = {name: [float(x) for x in place_of(name)] for name in names}
        edits = [
            {"id": f"given-{frame}-{name}", "kind": "mark", "frame": frame, "joint": name}
            | {"to": [*at, 2], "from": None}
            for name, at in places.items()
        ]
        self._send(edits)
        self.page.wait_for_function(f"() => {OPEN_JOINTS}.length === 0")

    def give_depths(self, signs, place_of):
        """Take the best of the poses offered and turn the limbs that are wrong in it.

        To point at a limb is no action: the key that turns it is.
        """
        offered = [pose["nearer"] for pose in self.pose().get("alternatives", [])[:3]]
        wrong = [[limb for limb in signs if signs[limb] != nearer.get(limb)] for nearer in offered]
        if not offered:
            return
        best = min(range(len(wrong)), key=lambda n: len(wrong[n]))
        self.press(str(best + 1))
        for limb in wrong[best]:
            self.point_at(clearest_place(limb, place_of))
            self.await_drawn()
            self.press("f")

    def suggestion(self, frame):
        """What is suggested for the open joints of a keyframe, once the page shows it."""
        answer = self.page.evaluate(f"fetch('/api/suggestion/{frame}').then((a) => a.json())")
        open_joints = self.page.evaluate(OPEN_JOINTS)
        offered = {name: at for name, at in answer.get("joints", {}).items() if name in open_joints}
        if offered:
            self.await_text("#prompt-text", "suggestion|Which ends|done")
        return offered

    def take_suggestion(self):
        """Accept what is suggested, and wait for what is asked next."""
        self.press("Enter")
        self.await_text("#prompt-text", "Which ends|done|Click")

    def add_keyframes(self, frames):
        """Give the project keyframes of one's own, without the page's help."""
        edits = [
            {"id": f"own-{n}", "kind": "own", "frame": n, "to": "both", "from": None}
            for n in frames
        ]
        self._send(edits)
        self.await_text("#done-count", "of")

    def _send(self, edits):
        self.page.evaluate(
            "edits => fetch('/api/edits', {method: 'POST', body: JSON.stringify({edits}),"
            " headers: {'Content-Type': 'application/json'}})",
            edits,
        )

    def durations(self, name):
        """How long what the page measures under a name took each time, ms."""
        return self.page.evaluate(
            "name => performance.getEntriesByName(name).map((entry) => entry.duration)", name
        )

    def scroll_times(self, selector):
        """Time from picture to picture while a list is scrolled from end to end, ms."""
        return self.page.evaluate(
            """async (selector) => {
              const list = document.querySelector(selector), times = [];
              const picture = () => new Promise(requestAnimationFrame);
              let last = await picture();
              for (let n = 0; n <= 100; n++) {
                list.scrollTop = (n / 100) * list.scrollHeight;
                const now = await picture();
                times.push(now - last);
                last = now;
              }
              return times;
            }""",
            selector,
        )

    def call(self, module, expression):
        """What an expression on a module of the page gives; the module is called `m`."""
        address = f"/annotate/page/{module}.js"
        return self.page.evaluate(f"import('{address}').then((m) => ({expression}))")


class Held:
    """Requests that wait until they are let go, the oldest first."""

    def __init__(self, person, pattern, method="GET"):
        self.person, self.routes, self.method, self.ended = person, [], method, False
        person.page.route(pattern, self._take)

    def _take(self, route):
        if route.request.method == self.method and not self.ended:
            self.routes.append(route)
        else:
            route.continue_()

    def wait_for(self, count):
        """Until so many have come."""
        self.person.await_fact(lambda: len(self.routes) >= count)

    def let_go(self):
        """Let one go, when it has come."""
        self.wait_for(1)
        self.routes.pop(0).continue_()

    def end(self):
        """Let all go that have come, and hold none that comes later."""
        self.ended = True
        while self.routes:
            self.let_go()


def clearest_place(limb, place_of):
    """Where along a limb a person points, so that no joint of another limb is meant."""
    parent = LSP14.names[LSP14.parents[LSP14.index(limb)]]
    others = [place_of(name) for name in LSP14.names if name not in (limb, parent)]
    others = [place for place in others if math.isfinite(place[0])]
    start, end = place_of(parent), place_of(limb)
    places = [start + share * (end - start) for share in (0.5, 0.4, 0.6, 0.3, 0.7)]
    return max(places, key=lambda place: min((far(place, other) for other in others), default=0))


def far(one, other):
    return math.dist(one[:2], other[:2])
