"""What a person decided: kept, undone, shared between pages and programs, never lost."""

import json
import random
from threading import Thread

import numpy as np
import pytest
from annotator_edits import edit, mark, submit

from keyrecon.annotate.edits import Limits, parse_edits
from keyrecon.annotate.journal import NotSaved
from keyrecon.annotate.marks import cells_from_annotations, written_cells
from keyrecon.annotate.store import Store
from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.formats.coco import read_coco, write_coco
from keyrecon.formats.picks import read_picks
from keyrecon.merging import merge_annotations
from keyrecon.records import Annotations, Pick
from keyrecon.workspace import Workspace

LIMITS = Limits(LSP14, 100, (128, 64))
NECK = ("mark", 3, "neck")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "project.toml").write_text('[video]\npath = "v.mp4"\nfingerprint = "x"\n')
    return tmp_path


@pytest.fixture
def opened(folder):
    """Open the project's store; those opened before are closed."""
    stores = []

    def again():
        for store in stores:
            store.close()
        stores[:] = [Store(Workspace(folder), LIMITS)]
        return stores[0]

    yield again
    for store in stores:
        store.close()


def read_marks(folder):
    return read_coco(folder / "annotations.json", LSP14, 100, (128, 64))


def in_thread(work):
    thread = Thread(target=work)
    thread.start()
    return thread


def one_mark():
    """A neck at (10, 20) on frame 3, and the size of its picture."""
    joints = np.full((1, 14, 2), np.nan)
    joints[0, LSP14.index("neck")] = 10, 20
    seen = np.isfinite(joints).all(axis=2)
    return Annotations(LSP14, np.array([3]), joints, seen, np.zeros((1, 13), int)), (128, 64)


def on_file(folder):
    """The cells that annotations.json holds."""
    if not (folder / "annotations.json").exists():
        return {}
    return cells_from_annotations(read_marks(folder))


def add_mark(folder, frame, joint, x, y):
    """What `keyrecon import` does: read, add, write."""
    joints = np.full((1, 14, 2), np.nan)
    joints[0, LSP14.index(joint)] = x, y
    old = read_marks(folder)
    new = type(old)(
        skeleton=LSP14,
        frames=np.array([frame]),
        joints=joints,
        visible=np.isfinite(joints).all(axis=2),
        nearer=np.zeros((1, 13), dtype=np.int64),
    )
    write_coco(folder / "annotations.json", merge_annotations(old, new), (128, 64))


def test_an_edit_is_in_the_state_the_file_and_the_next_start(opened, folder):
    assert submit(opened(), mark(3, "neck", [10, 20.25, 2]))[0]["ok"]
    assert on_file(folder) == {NECK: [10, 20.25, 2]}
    assert opened().state.cells == {NECK: [10, 20.25, 2]}


def test_what_another_page_changed_meanwhile_is_not_overwritten(opened):
    store = opened()
    submit(store, mark(3, "neck", [10, 20, 2]))
    answer = submit(store, mark(3, "neck", [50, 20, 2]))[0]
    assert not answer["ok"]
    assert answer["current"] == {"neck": [10, 20, 2]}
    assert store.state.cells[NECK] == [10, 20, 2]
    assert submit(store, mark(3, "neck", [50, 20, 2], was=[10, 20, 2]))[0]["ok"]


def test_an_edit_sent_twice_counts_once(opened):
    store = opened()
    first = mark(3, "neck", [10, 20, 2])
    submit(store, first)
    store.undo("u")
    assert submit(opened(), first)[0]["ok"]
    assert opened().state.cells == {}


def test_undo_and_redo_survive_a_restart(opened, folder):
    store = opened()
    submit(store, mark(3, "neck", [10, 20, 2]))
    submit(store, mark(3, "neck", [11, 20, 2], was=[10, 20, 2]))
    opened().undo("u1")
    assert opened().state.cells == {NECK: [10, 20, 2]}
    opened().undo("u2")
    assert opened().state.cells == {}
    assert on_file(folder) == {}
    opened().redo("r1")
    opened().redo("r2")
    assert on_file(folder) == {NECK: [11, 20, 2]}
    assert opened().redo("r3") is None


def test_a_new_edit_ends_what_could_be_redone(opened):
    store = opened()
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


def test_undoing_everything_leads_back_through_every_state_and_redoing_forward(opened, folder):
    store, rng = opened(), random.Random(5)
    states = [store.state.cells]
    while len(states) < 40:
        assert submit(store, random_edit(store, rng))[0]["ok"]
        if store.state.cells != states[-1]:
            states.append(store.state.cells)
        assert on_file(folder) == written_cells(store.state.cells)
    store = opened()
    for n, before in enumerate(reversed(states[:-1])):
        store.undo(f"undo {n}")
        assert store.state.cells == before
    for n, after in enumerate(states[1:]):
        store.redo(f"redo {n}")
        assert store.state.cells == after
    assert opened().state.cells == states[-1]


def test_marks_that_another_program_adds_come_in_and_ours_stay(opened, folder):
    store = opened()
    submit(store, mark(3, "neck", [10, 20, 2]))
    add_mark(folder, 5, "head_top", 30, 40)
    submit(store, mark(4, "neck", [11, 21, 2]))
    wanted = {
        NECK: [10, 20, 2],
        ("mark", 4, "neck"): [11, 21, 2],
        ("mark", 5, "head_top"): [30, 40, 2],
    }
    assert store.state.cells == wanted == on_file(folder)


def test_marks_added_while_nobody_served_come_in_at_the_next_start(opened, folder):
    submit(opened(), mark(3, "neck", [10, 20, 2]), mark(6, "neck", [1, 2, 0]))
    add_mark(folder, 5, "head_top", 30, 40)
    assert opened().state.cells == {
        NECK: [10, 20, 2],
        ("mark", 6, "neck"): [1, 2, 0],
        ("mark", 5, "head_top"): [30, 40, 2],
    }


def test_what_another_program_did_can_be_undone(opened, folder):
    store = opened()
    submit(store, mark(3, "neck", [10, 20, 2]))
    add_mark(folder, 3, "neck", 60, 20)
    store.refresh()
    assert store.state.cells == {NECK: [60, 20, 2]}
    store.undo("u")
    assert store.state.cells == {NECK: [10, 20, 2]} == on_file(folder)


def test_an_edit_between_another_programs_reading_and_writing_waits(opened, folder):
    store = opened()
    submit(store, mark(3, "neck", [10, 20, 2]))
    done = []
    with Workspace(folder).exclusive():
        late = in_thread(lambda: done.append(submit(store, mark(4, "neck", [11, 21, 2]))))
        add_mark(folder, 5, "head_top", 30, 40)
        assert not done
    late.join()
    assert len(store.state.cells) == 3
    assert store.state.cells == on_file(folder)


def test_the_first_start_takes_what_is_there_and_keeps_a_copy(opened, folder):
    write_coco(folder / "annotations.json", *one_mark())
    text = (folder / "annotations.json").read_text()
    store = opened()
    assert store.state.cells == {NECK: [10, 20, 2]}
    assert store.undo("u") is None
    assert (folder / "annotations.old-1.json").read_text() == text


@pytest.mark.parametrize("text", ["", "{", '{"images": []}', "no json at all"])
def test_a_file_that_does_not_parse_never_becomes_an_empty_project(opened, folder, text):
    submit(opened(), mark(3, "neck", [10, 20, 2]))
    (folder / "annotations.json").write_text(text)
    with pytest.raises(KeyreconError, match=r"annotations\.json was changed .* move it away"):
        opened()
    assert (folder / "annotations.json").read_text() == text
    (folder / "annotations.json").unlink()
    assert opened().state.cells == {NECK: [10, 20, 2]} == on_file(folder)


def test_a_file_that_stops_parsing_meanwhile_is_not_written_over(opened, folder):
    store = opened()
    submit(store, mark(3, "neck", [10, 20, 2]))
    (folder / "annotations.json").write_text("half a fi")
    late = mark(4, "neck", [11, 21, 2])
    for _ in range(2):
        with pytest.raises(NotSaved, match="move it away"):
            submit(store, late)
    assert (folder / "annotations.json").read_text() == "half a fi"
    (folder / "annotations.json").unlink()
    assert submit(store, late)[0]["ok"]
    assert len(on_file(folder)) == 2


def test_a_journal_that_is_none_is_not_replaced(opened, folder):
    (folder / "annotate.sqlite").write_bytes(b"something else" * 1000)
    with pytest.raises(KeyreconError, match="cannot be used as a journal"):
        opened()
    assert (folder / "annotate.sqlite").read_bytes().startswith(b"something else")


def test_a_project_is_annotated_by_one_server_at_a_time(opened, folder):
    opened()
    with pytest.raises(KeyreconError, match="being annotated already"):
        Store(Workspace(folder), LIMITS)


def test_a_kill_between_journal_and_file_is_made_good_at_the_next_start(opened, folder):
    store = opened()
    submit(store, mark(3, "neck", [10, 20, 2]))
    before = (folder / "annotations.json").read_bytes()
    submit(store, mark(4, "neck", [11, 21, 2]))
    store.close()
    (folder / "annotations.json").write_bytes(before)
    assert len(opened().state.cells) == 2
    assert len(on_file(folder)) == 2


def test_a_kill_between_journal_and_file_then_an_import_loses_neither(opened, folder):
    store = opened()
    submit(store, mark(3, "neck", [10, 20, 2]))
    before = (folder / "annotations.json").read_bytes()
    submit(store, mark(4, "neck", [11, 21, 2]))
    store.close()
    (folder / "annotations.json").write_bytes(before)
    add_mark(folder, 5, "head_top", 30, 40)
    assert {key[1] for key in opened().state.cells} == {3, 4, 5}


def test_the_newest_picks_of_page_and_command_line_are_together(opened, folder):
    store = opened()
    place = {"id": "p1", "frame": 2, "part": " Head ", "x": 10, "y": 20}
    submit(store, edit("pick", to=place))
    Workspace(folder).add_picks([Pick(4, "foot", 5.0, 6.0)])
    store.refresh()
    assert read_picks(folder / "picks.json") == (
        Pick(2, "head", 10.0, 20.0),
        Pick(4, "foot", 5.0, 6.0),
    )
    gone = {**place, "part": "head"}
    submit(store, edit("pick", was=gone, to=None))
    assert read_picks(folder / "picks.json") == (Pick(4, "foot", 5.0, 6.0),)


def test_a_change_of_several_cells_stands_whole_or_not_at_all(opened):
    store = opened()
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


def test_a_group_is_carried_out_in_order_and_undone_at_once(opened):
    store = opened()
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


def test_a_group_of_which_one_part_conflicts_changes_nothing(opened):
    store = opened()
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
def test_what_cannot_be_is_refused_and_the_rest_of_a_batch_accepted(opened, message):
    store = opened()
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
    with pytest.raises(KeyreconError, match="no edits"):
        parse_edits(json.dumps({"edits": [{**mark(3, "neck", [1, 1, 2]), **change}]}).encode())


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e999"])
def test_a_place_that_is_no_number_is_refused(number):
    text = json.dumps({"edits": [mark(3, "neck", [7.5, 1, 2])]}).replace("7.5", number)
    with pytest.raises(KeyreconError, match="no edits"):
        parse_edits(text.encode())


def test_what_was_accepted_is_told_to_every_listener(opened):
    store, told = opened(), []
    store.listen(told.extend)
    submit(store, mark(3, "neck", [10, 20, 2]), mark(3, "neck", [99, 20, 2]))
    store.undo("u")
    assert [(entry.role, entry.changes[0].after) for entry in told] == [
        ("edit", [10, 20, 2]),
        ("undo", None),
    ]
