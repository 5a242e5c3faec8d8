"""A journal that a disk damaged is told of; it never opens with other marks than were made."""

import random
import sqlite3

import pytest
from annotator_edits import edit, mark, submit
from annotator_files import NECK, on_file

from keyrecon.annotate.store.journal import NotSaved
from keyrecon.errors import KeyreconError


def filled(open_store, bare):
    """A journal with some edits, folded into one file."""
    store = open_store()
    for frame in range(30):
        submit(store, mark(frame, "neck", [10 + frame, 20.25, 2]))
        submit(store, edit("lock", frame=frame, was=False, to=True))
    cells = dict(store.state.cells)
    store.close()
    return cells, (bare / "annotate.sqlite").read_bytes()


def reopened(open_store):
    """The cells that the journal opens with, or what is said of it."""
    try:
        return dict(open_store().state.cells)
    except KeyreconError as fault:
        said = str(fault)
        assert "annotate.sqlite" in said and "\n" not in said
        return said


@pytest.fixture
def again(open_store):
    """Open the store where a former attempt may have failed."""

    def attempt():
        return reopened(open_store)

    return attempt


def test_bytes_that_a_disk_flipped_are_noticed(open_store, bare, again):
    cells, data = filled(open_store, bare)
    marks, rng, told = on_file(bare), random.Random(0), 0
    for _ in range(60):
        damaged = bytearray(data)
        for _ in range(rng.choice((1, 1, 20))):
            damaged[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        (bare / "annotate.sqlite").write_bytes(damaged)
        found = again()
        told += isinstance(found, str)
        assert isinstance(found, str) or found == cells
        assert on_file(bare) == marks
    assert told > 20


@pytest.mark.parametrize("keep", [0.3, 0.7, 0.99])
def test_a_journal_that_was_cut_off_is_told(open_store, bare, again, keep):
    _, data = filled(open_store, bare)
    (bare / "annotate.sqlite").write_bytes(data[: round(keep * len(data))])
    said = again()
    assert "move annotate.sqlite* away" in said
    assert len(on_file(bare)) == 30


def test_without_the_damaged_journal_the_marks_are_those_of_the_file(open_store, bare, again):
    _, data = filled(open_store, bare)
    (bare / "annotate.sqlite").write_bytes(data[:5000])
    again()
    (bare / "annotate.sqlite").unlink()
    assert {key for key in again() if key[0] == "mark"} == on_file(bare).keys()


def change(bare, statement):
    with sqlite3.connect(bare / "annotate.sqlite") as base:
        base.execute(statement)
    base.close()


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE entries SET changes = replace(changes, '20.25', '99.25') WHERE revision = 3",
        "UPDATE entries SET role = 'nothing' WHERE revision = 3",
        "DELETE FROM entries WHERE revision = 60",
        "DELETE FROM entries WHERE revision = 3",
        "UPDATE notes SET value = '[[[' WHERE name = 'digest'",
        "UPDATE notes SET value = '7' WHERE name = 'annotations.json'",
    ],
)
def test_rows_that_were_changed_behind_its_back_are_told(open_store, bare, again, statement):
    filled(open_store, bare)
    change(bare, statement)
    assert isinstance(again(), str)


def test_edits_that_an_older_keyrecon_added_count(open_store, bare, again):
    cells, _ = filled(open_store, bare)
    changes = '[[["mark", 50, "neck"], null, [1.5, 2.5, 2]]]'
    change(
        bare,
        "INSERT INTO entries (revision, id, role, of, label, changes) VALUES "
        f"(61, 'late', 'edit', NULL, 'mark', '{changes}')",
    )
    assert again() == cells | {("mark", 50, "neck"): [1.5, 2.5, 2]}


@pytest.mark.parametrize("damage", [b"\xff\xfe", b"[" * 10**5, b'{"images": 1e999}'])
def test_a_file_of_marks_that_cannot_be_read_refuses_edits_and_they_are_kept(
    open_store, bare, damage
):
    store = open_store()
    submit(store, mark(3, "neck", [10, 20, 2]))
    (bare / "annotations.json").write_bytes(damage)
    with pytest.raises(NotSaved, match=r"annotations\.json"):
        submit(store, mark(4, "neck", [10, 20, 2]))
    (bare / "annotations.json").unlink()
    assert submit(store, mark(4, "neck", [10, 20, 2]))[0]["ok"]
    assert {NECK, ("mark", 4, "neck")} == on_file(bare).keys()


def test_a_click_needs_the_name_of_a_part(open_store):
    store = open_store()
    place = {"id": "a", "frame": 0, "part": "   ", "x": 5.0, "y": 5.0}
    assert submit(store, edit("pick", to=place, was=None))[0]["status"] == 400
