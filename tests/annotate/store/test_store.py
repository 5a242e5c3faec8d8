"""What a person decided: kept, undone, shared between pages and programs, never lost."""

import json
import random
from dataclasses import replace

import msgspec
import pytest
from annotator_edits import edit, mark, read_edits, submit
from annotator_files import LIMITS, NECK, on_file

from keyrecon.annotate.store.cells import written_cells
from keyrecon.annotate.store.edits import Limits
from keyrecon.annotate.store.journal import NotSaved
from keyrecon.annotate.store.store import Store
from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.io.workspace import Workspace


def test_an_edit_is_in_the_state_the_file_and_the_next_start(open_store, bare):
    assert submit(open_store(), mark(3, "neck", [10, 20.25, 2]))[0]["ok"]
    assert on_file(bare) == {NECK: [10, 20.25, 2]}
    assert open_store().state.cells == {NECK: [10, 20.25, 2]}


def test_what_another_page_changed_meanwhile_is_not_overwritten(open_store):
    store = open_store()
    submit(store, mark(3, "neck", [10, 20, 2]))
    answer = submit(store, mark(3, "neck", [50, 20, 2]))[0]
    assert not answer["ok"]
    assert answer["current"] == {"neck": [10, 20, 2]}
    assert store.state.cells[NECK] == [10, 20, 2]
    assert submit(store, mark(3, "neck", [50, 20, 2], was=[10, 20, 2]))[0]["ok"]


def test_an_edit_sent_twice_counts_once(open_store):
    store = open_store()
    first = mark(3, "neck", [10, 20, 2])
    assert "known" not in submit(store, first)[0]
    store.undo("u")
    again = submit(open_store(), first)[0]
    assert (again["ok"], again["known"]) == (True, True)
    assert open_store().state.cells == {}


def test_undo_and_redo_survive_a_restart(open_store, bare):
    store = open_store()
    submit(store, mark(3, "neck", [10, 20, 2]))
    submit(store, mark(3, "neck", [11, 20, 2], was=[10, 20, 2]))
    open_store().undo("u1")
    assert open_store().state.cells == {NECK: [10, 20, 2]}
    open_store().undo("u2")
    assert open_store().state.cells == {}
    assert on_file(bare) == {}
    open_store().redo("r1")
    open_store().redo("r2")
    assert on_file(bare) == {NECK: [11, 20, 2]}
    assert open_store().redo("r3") is None


def test_a_new_edit_ends_what_could_be_redone(open_store):
    store = open_store()
    submit(store, mark(3, "neck", [10, 20, 2]))
    store.undo("u")
    submit(store, mark(4, "neck", [10, 20, 2]))
    assert store.redo("r") is None


def random_edit(store, rng):
    """Some edit of any kind that fits what is there."""
    frame, joint = rng.randrange(3), rng.choice(LSP14.names[:4])
    cells, place = store.state.cells, [rng.randrange(128), rng.randrange(64), rng.randrange(3)]
    signs = {joint: rng.choice([1, -1, None])}
    halves = [None, "upper", "lower", "both"]
    pick = cells.get(("pick", joint))
    return rng.choice(
        [
            mark(frame, joint, rng.choice([None, place]), was=cells.get(("mark", frame, joint))),
            edit("nearer", frame=frame, to=signs, was={joint: cells.get(("nearer", frame, joint))}),
            edit("own", frame=frame, to=rng.choice(halves), was=cells.get(("own", frame))),
            edit("lock", frame=frame, to=rng.random() < 0.5, was=("lock", frame) in cells),
            edit(
                "pick",
                was=pick and {"id": joint, **pick},
                to={"id": joint, "frame": frame, "part": "shirt", "x": place[0], "y": place[1]},
            ),
        ]
    )


def test_undoing_everything_leads_back_through_every_state_and_redoing_forward(open_store, bare):
    store, rng = open_store(), random.Random(5)
    states = [store.state.cells]
    while len(states) < 25:
        assert submit(store, random_edit(store, rng))[0]["ok"]
        if store.state.cells != states[-1]:
            states.append(store.state.cells)
        assert on_file(bare) == written_cells(store.state.cells)
    store = open_store()
    for n, before in enumerate(reversed(states[:-1])):
        store.undo(f"undo {n}")
        assert store.state.cells == before
    for n, after in enumerate(states[1:]):
        store.redo(f"redo {n}")
        assert store.state.cells == after
    assert open_store().state.cells == states[-1]


def test_marks_that_no_longer_fit_the_project_stop_the_start(open_store, bare):
    submit(open_store(), mark(99, "neck", [10, 20, 2]))
    for limits, message in (
        (Limits(LSP14, 50, (128, 64)), "Frame 99 was marked"),
        (Limits(replace(LSP14, names=("tail",) * 14), 100, (128, 64)), "Marks of neck"),
    ):
        open_store().close()
        with pytest.raises(KeyreconError, match=message):
            Store(Workspace(bare), limits)


def test_a_journal_that_is_none_is_not_replaced(open_store, bare):
    (bare / "annotate.sqlite").write_bytes(b"something else" * 1000)
    with pytest.raises(KeyreconError, match="is not a whole journal"):
        open_store()
    assert (bare / "annotate.sqlite").read_bytes().startswith(b"something else")


def test_a_project_is_annotated_by_one_server_at_a_time(open_store, bare):
    open_store()
    with pytest.raises(KeyreconError, match="being annotated already"):
        Store(Workspace(bare), LIMITS)


def test_an_edit_is_not_saved_where_the_projects_lock_cannot_be_taken(open_store, bare):
    store = open_store()
    lock = bare / ".change.lock"
    lock.unlink(missing_ok=True)
    lock.mkdir()  # as on a disk that takes no files
    late = mark(3, "neck", [10, 20, 2])
    with pytest.raises(NotSaved, match="cannot be written"):
        submit(store, late)
    lock.rmdir()
    assert submit(store, late)[0]["ok"]


def test_a_change_of_several_cells_stands_whole_or_not_at_all(open_store):
    store = open_store()
    submit(store, mark(3, "neck", [10, 20, 2]))
    swap = edit(
        "marks",
        frame=3,
        was={"neck": None, "head_top": None},
        to={"neck": [1, 1, 2], "head_top": [2, 2, 2]},
    )
    answer = submit(store, swap)[0]
    assert answer["current"] == {"neck": [10, 20, 2], "head_top": None}
    assert store.state.cells == {NECK: [10, 20, 2]}


def test_a_group_is_carried_out_in_order_and_undone_at_once(open_store):
    store = open_store()
    submit(store, mark(3, "neck", [10, 20, 2]))
    parts = [
        mark(3, "neck", None, was=[10, 20, 2]),
        mark(3, "neck", [1, 1, 1]),
        edit("nearer", frame=3, was={}, to={"left_hip": 1}),
    ]
    assert submit(store, edit("group", edits=parts))[0]["ok"]
    assert store.state.cells == {NECK: [1, 1, 1], ("nearer", 3, "left_hip"): 1}
    store.undo("u")
    assert store.state.cells == {NECK: [10, 20, 2]}


def test_a_group_of_which_one_part_conflicts_changes_nothing(open_store):
    store = open_store()
    submit(store, mark(3, "neck", [10, 20, 2]))
    parts = [mark(3, "head_top", [5, 5, 2]), mark(3, "neck", [1, 1, 1])]
    answer = submit(store, edit("group", edits=parts))[0]
    assert answer["current"] == {"head_top": None, "neck": [10, 20, 2]}
    assert store.state.cells == {NECK: [10, 20, 2]}


IMPOSSIBLE = {
    "Frame 100 is outside": mark(100, "neck", [1, 1, 2]),
    "no joint 'tail'": mark(3, "tail", [1, 1, 2]),
    "too far off": mark(3, "neck", [10_000, 1, 2]),
    "ends no limb": edit("nearer", frame=3, was={}, to={"neck": 1}),
    "picture of 128x64": edit("pick", to={"id": "a", "frame": 1, "part": "head", "x": -1, "y": 1}),
}


@pytest.mark.parametrize("message", IMPOSSIBLE)
def test_what_cannot_be_is_refused_and_the_rest_of_a_batch_accepted(open_store, message):
    store = open_store()
    bad, good = submit(store, IMPOSSIBLE[message], mark(3, "head_top", [1, 1, 1]))
    assert (bad["status"], good["ok"]) == (400, True)
    assert message in bad["error"]
    assert len(store.state.cells) == 1


@pytest.mark.parametrize(
    "change",
    [
        {"kind": "unknown"},
        {"frame": -1},
        {"frame": "3"},
        {"frame": 3.5},
        {"joint": ""},
        {"joint": "x" * 100},
        {"to": [1, 2]},
        {"to": [1, 2, 3]},
        {"to": ["1", "2", 2]},
        {"to": {"x": 1}},
        {"id": None},
        {"more": 1},
    ],
)
def test_an_edit_of_another_form_is_refused(change):
    with pytest.raises(msgspec.DecodeError):
        read_edits(json.dumps({"edits": [{**mark(3, "neck", [1, 1, 2]), **change}]}))


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e999"])
def test_a_place_that_is_no_number_is_refused(number):
    text = json.dumps({"edits": [mark(3, "neck", [7.5, 1, 2])]}).replace("7.5", number)
    with pytest.raises(msgspec.DecodeError):
        read_edits(text)


def test_what_was_accepted_is_told_to_every_listener(open_store):
    store, answer = open_store(), []
    store.listen(answer.extend)
    submit(store, mark(3, "neck", [10, 20, 2]), mark(3, "neck", [99, 20, 2]))
    store.undo("u")
    assert [(entry.role, entry.changes[0].after) for entry in answer] == [
        ("edit", [10, 20, 2]),
        ("undo", None),
    ]
