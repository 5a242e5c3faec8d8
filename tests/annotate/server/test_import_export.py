"""Marks from and for other programs, through the page."""

import random

import pytest
from annotator import ask
from annotator_edits import mark, submit


def test_marks_go_out_and_come_back_in_every_format(opened):
    session = opened()
    submit(session.store, mark(3, "neck", [10.25, 20.5, 2]), mark(7, "left_hip", [30, 40, 1]))
    for form in ("coco", "dlc", "cvat"):
        text = ask(session, "GET", f"/api/export/{form}").content.decode()
        answer = ask(session, "POST", "/api/import", {"name": form, "text": text}).json()
        assert (answer["frames"], answer["new"], answer["conflicts"]) == ([3, 7], 0, [])
    assert ask(session, "GET", "/api/export/doc").status == 400


def test_an_absent_joint_goes_out_and_is_neither_new_nor_contradicted_when_it_comes_back(opened):
    session = opened()
    submit(session.store, mark(3, "neck", [10, 20, 0]), mark(3, "head_top", [0, 0, 0]))
    text = ask(session, "GET", "/api/export/coco").content.decode()
    answer = ask(session, "POST", "/api/import", {"name": "a.json", "text": text}).json()
    assert (answer["frames"], answer["new"], answer["conflicts"]) == ([3], 0, [])
    session.store.undo("u")
    answer = ask(session, "POST", "/api/import", {"name": "a.json", "text": text}).json()
    assert (answer["new"], answer["conflicts"]) == (1, [])
    submit(session.store, mark(3, "head_top", [5, 6, 2]))
    answer = ask(session, "POST", "/api/import", {"name": "a.json", "text": text}).json()
    assert [conflict["joint"] for conflict in answer["conflicts"]] == ["head_top"]


def coco_with(session, *edits):
    """The text of a COCO file with these marks alone."""
    before = session.store.state.revision
    submit(session.store, *edits)
    text = ask(session, "GET", "/api/export/coco").content.decode()
    while session.store.state.revision < before + 2 * len(edits):
        session.store.undo(f"undo {session.store.state.revision}")
    return text


@pytest.mark.parametrize("mode", ["keep", "replace"])
def test_conflicts_are_shown_before_anything_changes_and_then_settled_as_told(opened, mode):
    session = opened()
    text = coco_with(session, mark(3, "neck", [50, 20, 2]), mark(4, "neck", [1, 2, 2]))
    submit(session.store, mark(3, "neck", [10, 20, 2]))
    before = session.store.state
    answer = ask(session, "POST", "/api/import", {"name": "a.json", "text": text}).json()
    assert answer["conflicts"] == [
        {"frame": 3, "kind": "mark", "joint": "neck", "old": [10, 20, 2], "new": [50, 20, 2]}
    ]
    assert answer["new"] == 1
    assert session.store.state == before
    question = {"name": "a.json", "text": text, "accept": True, "mode": mode}
    assert ask(session, "POST", "/api/import", question).status == 200
    wanted = [10, 20, 2] if mode == "keep" else [50, 20, 2]
    assert session.store.state.cells["mark", 3, "neck"] == wanted
    assert session.store.state.cells["mark", 4, "neck"] == [1, 2, 2]
    session.store.undo("u")
    assert session.store.state.cells == before.cells


def test_a_file_may_have_a_long_name(opened):
    session = opened()
    submit(session.store, mark(3, "neck", [10.25, 20.5, 2]))
    text = ask(session, "GET", "/api/export/coco").content.decode()
    name = "2026-11-24 second set, serves of the afternoon, seen from the stand, corrected.json"
    answer = ask(session, "POST", "/api/import", {"name": name, "text": text})
    assert answer.status == 200, answer.json()


def test_a_file_of_another_kind_is_refused_under_its_own_name(opened):
    session = opened()
    for text in ("", "hello", "{", '{"images": 3}', "<annotations>", "scorer,a\n", "\u0000"):
        answer = ask(session, "POST", "/api/import", {"name": "../../marks.txt", "text": text})
        assert answer.status == 400
        assert answer.json()["error"].startswith("../../marks.txt ")


SPOILT = (
    "",
    "NaN",
    "1e999",
    "-1",
    "null",
    "[]",
    "{",
    '"',
    "<",
    "é",
    "\u0000",
    "99999999999999999999",
)


def spoil(text, rng):
    """The text cut off, or with a piece replaced."""
    at = rng.randrange(len(text))
    if rng.random() < 0.2:
        return text[:at]
    return text[:at] + rng.choice(SPOILT) + text[at + rng.randrange(12) :]


@pytest.mark.parametrize("form", ["coco", "dlc", "cvat"])
def test_a_spoilt_file_is_read_or_refused_and_changes_nothing(opened, form):
    session, rng = opened(), random.Random(form)
    submit(session.store, mark(3, "neck", [10.25, 20.5, 2]), mark(7, "left_hip", [30, 40, 1]))
    text = ask(session, "GET", f"/api/export/{form}").content.decode()
    before, statuses = session.store.state, set()
    for _ in range(60):
        question = {"name": "a", "text": spoil(text, rng)}
        statuses.add(ask(session, "POST", "/api/import", question).status)
    assert statuses == {200, 400}
    assert session.store.state == before


def test_of_the_files_only_those_that_were_exported_go_out(opened, folder):
    session = opened()
    (folder / "exports").mkdir()
    (folder / "exports" / "p.bvh").write_text("HIERARCHY")
    (folder / "exports" / ".p.trc.1.part").write_text("half")
    assert [file["name"] for file in ask(session, "GET", "/api/exports").json()] == ["p.bvh"]
    sent = ask(session, "GET", "/api/exports/p.bvh")
    assert (sent.status, sent.headers["content-length"]) == (200, "9")
    for name in ("..%2Fproject.toml", ".p.trc.1.part", "q.bvh", "%2e%2e"):
        assert ask(session, "GET", f"/api/exports/{name}").status in (400, 404)
    assert ask(session, "GET", "/api/report").status == 400
