"""What a person decided: kept, undone, shared between pages and programs, never lost."""


import pytest
from annotator import mark, submit

from keyrecon.annotate.edits import Limits
from keyrecon.annotate.store import Store
from keyrecon.body import LSP14
from keyrecon.formats.coco import read_coco
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


def on_file(folder):
    marks = read_coco(folder / "annotations.json", LSP14, 100, (128, 64))
    return {
        (int(frame), LSP14.names[j]): marks.joints[k, j].tolist()
        for k, frame in enumerate(marks.frames)
        for j in range(14)
        if marks.joints[k, j, 0] == marks.joints[k, j, 0]
    }


def test_an_edit_is_in_the_state_the_file_and_the_next_start(opened, folder):
    assert submit(opened(), mark(3, "neck", [10, 20.25, 2]))[0]["ok"]
    assert on_file(folder) == {(3, "neck"): [10, 20.25]}
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
    assert on_file(folder) == {(3, "neck"): [11, 20]}
    assert opened().redo("r3") is None
