"""annotations.json and picks.json show the state, and what other programs change comes in."""

import json
from dataclasses import replace
from threading import Thread

import pytest
from annotator_edits import edit, mark, submit
from annotator_files import LIMITS, NECK, add_mark, on_file, one_mark, read_marks

from keyrecon.annotate.store import file_sync as files
from keyrecon.annotate.store.journal import NotSaved
from keyrecon.annotate.store.store import Store
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.coco import coco_lines, coco_text, write_coco
from keyrecon.io.formats.picks import read_picks
from keyrecon.io.workspace import Workspace
from keyrecon.records import Pick


def test_marks_that_another_program_adds_come_in_and_ours_stay(open_store, bare):
    store = open_store()
    submit(store, mark(3, "neck", [10, 20, 2]))
    add_mark(bare, 5, "head_top", 30, 40)
    submit(store, mark(4, "neck", [11, 21, 2]))
    wanted = {
        NECK: [10, 20, 2],
        ("mark", 4, "neck"): [11, 21, 2],
        ("mark", 5, "head_top"): [30, 40, 2],
    }
    assert store.state.cells == wanted == on_file(bare)


def test_an_edit_puts_the_lines_of_its_own_frame_together_and_no_others(
    open_store, bare, monkeypatch
):
    store, written = open_store(), []
    submit(store, *(mark(frame, "neck", [frame, 20, 2]) for frame in range(50)))

    def spied(marks, size):
        written.extend(marks.frames.tolist())
        return coco_lines(marks, size)

    monkeypatch.setattr(files, "coco_lines", spied)
    submit(store, mark(7, "neck", [9, 9, 1], was=[7, 20, 2]))
    submit(store, mark(8, "neck", None, was=[8, 20, 2]))
    store.undo("u")
    assert written == [7, 8]
    text = (bare / "annotations.json").read_text()
    assert text == coco_text(store.annotations(), (128, 64))


def test_marks_added_while_nobody_served_come_in_at_the_next_start(open_store, bare):
    submit(open_store(), mark(3, "neck", [10, 20, 2]), mark(6, "neck", [1, 2, 0]))
    add_mark(bare, 5, "head_top", 30, 40)
    assert open_store().state.cells == {
        NECK: [10, 20, 2],
        ("mark", 6, "neck"): [1, 2, 0],
        ("mark", 5, "head_top"): [30, 40, 2],
    }


def test_joints_said_to_be_absent_travel_with_the_file(open_store, bare, tmp_path):
    submit(open_store(), mark(3, "neck", [10, 20, 2]), mark(6, "neck", [1, 2, 0]))
    there = tmp_path / "there"
    there.mkdir()
    for name in ("project.toml", "annotations.json"):
        (there / name).write_bytes((bare / name).read_bytes())
    travelled = Store(Workspace(there), LIMITS)
    assert travelled.state.cells == {NECK: [10, 20, 2], ("mark", 6, "neck"): [0, 0, 0]}
    travelled.close()


def test_a_program_that_knows_no_absent_joints_takes_none_away(open_store, bare):
    submit(open_store(), mark(3, "neck", [10, 20, 2]), mark(6, "neck", [1, 2, 0]))
    file = bare / "annotations.json"
    write_coco(file, replace(read_marks(bare), absent=()), (128, 64))
    assert open_store().state.cells == {NECK: [10, 20, 2], ("mark", 6, "neck"): [1, 2, 0]}
    assert read_marks(bare).absent == ((6, "neck"),)
    add_mark(bare, 6, "neck", 30, 40)
    assert open_store().state.cells == {NECK: [10, 20, 2], ("mark", 6, "neck"): [30, 40, 2]}
    assert read_marks(bare).absent == ()


def test_what_another_program_did_can_be_undone(open_store, bare):
    store = open_store()
    submit(store, mark(3, "neck", [10, 20, 2]))
    add_mark(bare, 3, "neck", 60, 20)
    store.refresh()
    assert store.state.cells == {NECK: [60, 20, 2]}
    store.undo("u")
    assert store.state.cells == {NECK: [10, 20, 2]} == on_file(bare)


def test_an_edit_between_another_programs_reading_and_writing_waits(open_store, bare):
    store = open_store()
    submit(store, mark(3, "neck", [10, 20, 2]))
    done = []
    with Workspace(bare).exclusive():
        late = Thread(target=lambda: done.append(submit(store, mark(4, "neck", [11, 21, 2]))))
        late.start()
        add_mark(bare, 5, "head_top", 30, 40)
        assert not done
    late.join()
    assert len(store.state.cells) == 3
    assert store.state.cells == on_file(bare)


def test_the_first_start_takes_what_is_there_and_keeps_a_copy(open_store, bare):
    write_coco(bare / "annotations.json", *one_mark())
    text = (bare / "annotations.json").read_text()
    text = text.replace('"info"', '"from": "elsewhere", "info"')
    (bare / "annotations.json").write_text(text)
    store = open_store()
    assert store.state.cells == {NECK: [10, 20, 2]}
    assert store.undo("u") is None
    assert (bare / "annotations.old-1.json").read_text() == text


def test_opening_a_project_changes_none_of_its_files(open_store, bare):
    write_coco(bare / "annotations.json", *one_mark())
    rows = [
        {"frame": 7, "part": "shirt", "x": 5, "y": 6},
        {"frame": 2, "part": "head", "x": 1, "y": 2},
    ]
    (bare / "picks.json").write_text(json.dumps({"picks": rows}))
    before = {path: path.read_bytes() for path in bare.glob("*.json")}
    for _ in range(2):
        assert len(open_store().state.cells) == 3
        assert {path: path.read_bytes() for path in bare.glob("*.json")} == before
    open_store().undo("nothing")
    submit(open_store(), mark(4, "neck", [11, 21, 2]))
    assert (bare / "picks.json").read_bytes() == before[bare / "picks.json"]
    assert len(on_file(bare)) == 2


def test_a_file_of_our_own_needs_no_copy(open_store, bare):
    write_coco(bare / "annotations.json", *one_mark())
    assert open_store().state.cells == {NECK: [10, 20, 2]}
    assert not {*bare.glob("*.old-*")}


@pytest.mark.parametrize("text", ["", "{", '{"images": []}', "no json at all"])
def test_a_file_that_does_not_parse_never_becomes_an_empty_project(open_store, bare, text):
    submit(open_store(), mark(3, "neck", [10, 20, 2]))
    (bare / "annotations.json").write_text(text)
    with pytest.raises(KeyreconError, match=r"annotations\.json cannot be read .* move it away"):
        open_store()
    assert (bare / "annotations.json").read_text() == text
    (bare / "annotations.json").unlink()
    assert open_store().state.cells == {NECK: [10, 20, 2]} == on_file(bare)


def test_a_new_project_does_not_begin_over_a_file_that_does_not_parse(open_store, bare):
    (bare / "annotations.json").write_text("{")
    with pytest.raises(KeyreconError, match="move it away to begin without it"):
        open_store()
    assert (bare / "annotations.json").read_text() == "{"


def test_a_file_that_stops_parsing_meanwhile_is_not_written_over(open_store, bare):
    store = open_store()
    submit(store, mark(3, "neck", [10, 20, 2]))
    (bare / "annotations.json").write_text("half a fi")
    late = mark(4, "neck", [11, 21, 2])
    for _ in range(2):
        with pytest.raises(NotSaved, match="move it away"):
            submit(store, late)
    assert (bare / "annotations.json").read_text() == "half a fi"
    (bare / "annotations.json").unlink()
    assert submit(store, late)[0]["ok"]
    assert len(on_file(bare)) == 2


def test_a_kill_between_journal_and_file_is_made_good_at_the_next_start(open_store, bare):
    store = open_store()
    submit(store, mark(3, "neck", [10, 20, 2]))
    before = (bare / "annotations.json").read_bytes()
    submit(store, mark(4, "neck", [11, 21, 2]))
    store.close()
    (bare / "annotations.json").write_bytes(before)
    assert len(open_store().state.cells) == 2
    assert len(on_file(bare)) == 2


def test_a_kill_between_journal_and_file_then_an_import_loses_neither(open_store, bare):
    store = open_store()
    submit(store, mark(3, "neck", [10, 20, 2]))
    before = (bare / "annotations.json").read_bytes()
    submit(store, mark(4, "neck", [11, 21, 2]))
    store.close()
    (bare / "annotations.json").write_bytes(before)
    add_mark(bare, 5, "head_top", 30, 40)
    assert {key[1] for key in open_store().state.cells} == {3, 4, 5}


def test_the_newest_picks_of_page_and_command_line_are_together(open_store, bare):
    store = open_store()
    place = {"id": "p1", "frame": 2, "part": " Head ", "x": 10, "y": 20}
    submit(store, edit("pick", to=place))
    Workspace(bare).add_picks([Pick(4, "foot", 5.0, 6.0)])
    store.refresh()
    assert read_picks(bare / "picks.json") == (
        Pick(2, "head", 10.0, 20.0),
        Pick(4, "foot", 5.0, 6.0),
    )
    gone = {**place, "part": "head"}
    submit(store, edit("pick", was=gone, to=None))
    assert read_picks(bare / "picks.json") == (Pick(4, "foot", 5.0, 6.0),)
