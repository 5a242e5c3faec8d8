"""What the annotator keeps of a project, asked for by several threads at once."""

import time
from concurrent.futures import ThreadPoolExecutor, wait
from threading import Barrier, Event
from types import SimpleNamespace

import numpy as np
import pytest

from keyrecon.annotate.assist import project_cache
from keyrecon.annotate.assist.body_estimate import BodyEstimate
from keyrecon.annotate.assist.neighbours import Neighbours
from keyrecon.annotate.assist.pose_suggestion import PoseSuggestion
from keyrecon.annotate.assist.preview import Strip
from keyrecon.annotate.assist.project_cache import ProjectCache
from keyrecon.body import LSP14
from keyrecon.io.workspace import Workspace
from keyrecon.records import Annotations, CameraPath, Colors, Pick, Preparation

MARKS = Annotations(
    LSP14, np.array([4]), np.full((1, 14, 2), 20.0), np.ones((1, 14), bool), np.zeros((1, 13), int)
)

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


def test_nothing_that_followed_from_a_preparation_outlives_it(cache, monkeypatch):
    """The track, the shots and the sizes that it was made with may all be others."""
    one, other = object.__new__(Preparation), object.__new__(Preparation)
    known = dict.fromkeys(("video", "shots", "track"), SimpleNamespace(fps=50.0, height=None))
    known["edges"] = {9: SimpleNamespace(points=[(5.0, 6.0)])}
    for preparation in (one, other):
        vars(preparation).update(known)
    of = {
        made: {kind: object.__new__(kind) for kind in (Neighbours, PoseSuggestion, BodyEstimate)}
        for made in (one, other)
    }
    preparations = {of[made][PoseSuggestion]: made for made in of}
    source = SimpleNamespace(frames=MARKS.frames, joints=MARKS.joints)
    for name, said in (
        ("find_neighbours", lambda made, marks: (of[made][Neighbours],)),
        ("choose_sources", lambda *_: source),
        ("nearest_marks", lambda *_: source),
        ("suggest_joints", lambda made, *_: of[made][PoseSuggestion]),
        ("surer_by_flow", lambda suggested, *_: suggested),
        ("estimate_body", lambda marks, known, *_: of[preparations[known[9]]][BodyEstimate]),
    ):
        monkeypatch.setattr(project_cache, name, said)
    for made in (one, other, one):
        monkeypatch.setattr(cache, "preparation", lambda made=made: made)
        assert cache.neighbours(MARKS) == (of[made][Neighbours],)
        assert cache.any_suggestion(MARKS, 9) is of[made][PoseSuggestion]
        assert cache.suggestion(MARKS, 9) is of[made][PoseSuggestion]
        assert cache.body(MARKS) is of[made][BodyEstimate]


def test_where_nobody_was_found_nothing_is_suggested(monkeypatch, cache):
    preparation = object.__new__(Preparation)
    edges = {9: SimpleNamespace(points=[])}
    vars(preparation).update(edges=edges, video=None, shots=None, track=None)
    monkeypatch.setattr(project_cache, "choose_sources", lambda *_: MARKS)
    monkeypatch.setattr(cache, "preparation", lambda: preparation)
    assert cache.suggestion(MARKS, 9) is None


def test_whoever_does_not_wait_for_the_stored_results_is_told_when_they_are_read(
    cache, monkeypatch
):
    may_end, told = Event(), Event()
    monkeypatch.setattr(cache, "preparation", may_end.wait)
    assert not cache.is_ready(0.01, told.set)
    assert not told.is_set()
    may_end.set()
    assert told.wait(60)
    assert cache.is_ready(60.0, lambda: pytest.fail("told though it was waited for"))
