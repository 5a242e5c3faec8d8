"""What the annotator keeps of a project, asked for by several threads at once."""

import time
from concurrent.futures import ThreadPoolExecutor, wait
from threading import Barrier

import pytest

from keyrecon.annotate.assist import project_cache
from keyrecon.annotate.assist.preview import Strip
from keyrecon.annotate.assist.project_cache import ProjectCache
from keyrecon.io.workspace import Workspace
from keyrecon.records import CameraPath, Colors, Pick

QUESTIONS = {
    "colors": [(Pick(frame, "head", 1.0, 2.0),) for frame in range(2)],
    "strip": [(frame, frame + 1) for frame in range(2)],
}


@pytest.fixture
def cache(folder, monkeypatch):
    """A cache whose answers are slow to make; `made` lists what they were made for."""
    cache = ProjectCache(Workspace(folder))
    cache.made, cache.answers, cache.seconds = [], {}, 0.0

    def make(kind, question):
        cache.made.append(question)
        time.sleep(cache.seconds)
        return cache.answers.setdefault(question, object.__new__(kind))

    monkeypatch.setattr(project_cache, "learn_colors", lambda video, picks: make(Colors, picks))
    monkeypatch.setattr(project_cache, "cut_strip", lambda video, frames: make(Strip, frames))
    path = object.__new__(CameraPath)
    monkeypatch.setattr(project_cache, "estimate_shot_motion", lambda strip: path)
    return cache


def answer(cache, kind, question):
    """The one object that was made for a question."""
    found = getattr(cache, kind)(question)
    return found[0] if kind == "strip" else found


@pytest.mark.parametrize("kind", QUESTIONS)
def test_two_that_ask_for_the_same_at_once_wait_for_one_answer(cache, kind):
    cache.seconds, together = 0.05, Barrier(2)
    question = QUESTIONS[kind][0]

    def ask(_):
        together.wait()
        return answer(cache, kind, question)

    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(ask, range(2))
    assert first is second
    assert cache.made == [question]


class WatchedPick(Pick):
    """Calls `compared` when it is compared with another one."""

    compared = staticmethod(lambda: None)

    def __eq__(self, other):
        """Equal on the same frame."""
        self.compared()
        return self.frame == other.frame

    __hash__ = Pick.__hash__


def test_nobody_gets_the_colors_that_another_thread_asked_for_meanwhile(cache, monkeypatch):
    """Whoever finds its answer kept must get it, though another is kept a moment later."""
    mine, others = QUESTIONS["colors"]
    kept = cache.colors((WatchedPick(0, "head", 1.0, 2.0),))
    with ThreadPoolExecutor(1) as pool:

        def meanwhile():
            monkeypatch.setattr(WatchedPick, "compared", staticmethod(lambda: None))
            wait([pool.submit(cache.colors, others)], timeout=0.5)

        monkeypatch.setattr(WatchedPick, "compared", staticmethod(meanwhile))
        assert cache.colors(mine) is kept
