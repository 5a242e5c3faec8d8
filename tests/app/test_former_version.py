"""A project made by an earlier version opens, shows its marks, and goes on.

tests/data/project_v1 was left by keyrecon 0.1.0 before its journal's cells, its stages and its
answers were renamed: rendered with `keyrecon synth` (320 x 180, 50 frames), picked, marked from the
truth through the annotator's store with an edit taken back and a joint hidden, a keyframe added and
one locked, and run. Its cache is left out, as it would be after an update.
"""

import shutil
import sqlite3
from pathlib import Path

import numpy as np
import pytest
from annotator import ask, open_project
from annotator_edits import edit, submit

from keyrecon.app import project, running
from keyrecon.io.formats.coco import read_coco
from keyrecon.io.formats.motion_file import read_motion
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options
from keyrecon.progress import silent

FORMER = Path(__file__).parents[1] / "data" / "project_v1"
FRAMES, SIZE, HIDDEN = 50, (320, 180), (13, "right_wrist")


@pytest.fixture
def folder(tmp_path):
    """A copy that may be changed."""
    return Path(shutil.copytree(FORMER, tmp_path / "project"))


@pytest.fixture
def session(folder):
    opened = open_project(folder)
    yield opened
    opened.close()


def test_a_workspace_finds_what_was_picked_chosen_set_and_made(folder):
    workspace = Workspace(folder)
    assert (len(workspace.video()), workspace.video().width) == (FRAMES, SIZE[0])
    assert {pick.part for pick in workspace.picks()} >= {"head", "foot"}
    options = workspace.options(Options(), Options())
    assert (options.keyframes.budget, options.lift.height) == (0.08, 1.78)
    assert len(project.asked_for(workspace, workspace.video()).frames) == 7
    motion = read_motion(workspace.motion_file)
    assert (len(motion.time), motion.units) == (FRAMES, "m")


def test_the_annotator_shows_its_marks_and_changes_no_file(folder):
    before = {path.name: path.read_bytes() for path in folder.glob("*.json")}
    session = open_project(folder)
    state = ask(session, "GET", "/api/state").json()
    described = ask(session, "GET", "/api/project").json()
    stretch = ask(session, "GET", "/api/motion?from=10&to=12").json()
    session.close()
    marks = read_coco(folder / "annotations.json", session.limits.skeleton, FRAMES, SIZE)
    rows = zip(marks.frames.tolist(), marks.joints, strict=True)
    for frame, joints in rows:
        on_page = state["marks"][str(frame)]
        for name, place in zip(marks.skeleton.names, joints, strict=True):
            assert (name in on_page) == np.isfinite(place).all()
            assert name not in on_page or np.allclose(on_page[name][:2], place, atol=0.01)
    assert state["marks"][str(HIDDEN[0])][HIDDEN[1]][2] == 1
    assert sum(map(len, state["nearer"].values())) == np.count_nonzero(marks.nearer)
    rows = {row["frame"]: row for row in described["keyframes"]}
    assert rows[0]["own"] and not rows[12]["own"]
    assert [frame for frame, row in rows.items() if row["locked"]] == [12]
    assert len(stretch["points3d"]) == 2
    assert {path.name: path.read_bytes() for path in folder.glob("*.json")} == before


def test_its_edits_can_be_taken_back_and_done_again(session):
    before = dict(session.store.state.cells)
    hidden = before["mark", *HIDDEN]
    assert ask(session, "POST", "/api/undo", {"id": "back"}).json()["edit"] == "mark"
    visible = session.store.state.cells["mark", *HIDDEN]
    assert (visible[2], hidden[2]) == (2, 1)
    ask(session, "POST", "/api/redo", {"id": "again"})
    assert session.store.state.cells == before
    steps = len(session.store.state.undoable)
    for n in range(steps):
        ask(session, "POST", "/api/undo", {"id": f"back {n}"})
    assert session.store.state.cells.keys() <= {key for key in before if key[0] == "pick"}


def test_edits_that_a_page_of_that_version_kept_are_taken(session):
    kept = [
        edit("own", frame=20, to="both"),
        edit("mark", frame=20, joint="neck", to=[100, 50, 2]),
        edit("pick", to={"id": "a", "frame": 3, "part": "socks", "x": 5, "y": 6}),
    ]
    assert all(result["ok"] for result in submit(session.store, *kept))


def test_it_can_be_run_again(folder):
    workspace = Workspace(folder)
    former = read_motion(workspace.motion_file)
    workspace.motion_file.unlink()
    options = running.run_options(workspace, Options())
    running.run(workspace, options, silent, partial=True)
    motion = read_motion(workspace.motion_file)
    assert motion.points3d.shape == former.points3d.shape
    assert motion.units == former.units
    assert motion.keyframes.tolist() == former.keyframes.tolist()
    marks = project.load_annotations(workspace, workspace.video())
    marked = np.isfinite(marks.joints).all(axis=2)
    kept = motion.points2d_propagated[marks.frames]
    np.testing.assert_allclose(kept[marked], marks.joints[marked])


def test_the_journal_on_the_disk_is_of_the_former_version():
    with sqlite3.connect(f"file:{FORMER / 'annotate.sqlite'}?immutable=1", uri=True) as base:
        kinds = {row[0] for row in base.execute("SELECT label FROM entries")}
    assert {"marks", "nearer", "own", "lock", "mark"} <= kinds
