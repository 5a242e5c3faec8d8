"""What results were made from: by what the files say, and whatever state they are in."""

import json
import os

import pytest

from keyrecon.io.provenance import (
    RunNotes,
    current_exports,
    is_fitted,
    marks_digest,
    motion_digest,
    motion_stamp,
    note_exports,
    note_fitted,
    note_run,
    read_run,
)
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options


@pytest.fixture
def workspace(bare):
    (bare / "cache").mkdir()
    return Workspace(bare)


def write_marks(workspace, rows, **layout):
    workspace.annotations_file.write_text(json.dumps({"annotations": rows}, **layout))


def test_marks_written_anew_in_other_bytes_are_the_same_evidence(workspace):
    rows = [{"id": 1, "keypoints": [1, 2, 2]}]
    write_marks(workspace, rows)
    before = marks_digest(workspace)
    write_marks(workspace, rows, indent=3)
    assert marks_digest(workspace) == before
    write_marks(workspace, [{"id": 1, "keypoints": [1, 3, 2]}])
    assert marks_digest(workspace) != before


PROJECT = """[video]
path = "v.mp4"
fingerprint = "x"

[options]
lift.height = 2
"""
FILES = {
    "project.toml": PROJECT,
    "keyframes.json": '{"upper": [3], "lower": [3, 9], "nearest": {}}',
    "picks.json": '{"picks": [{"frame": 0, "part": "head"}, {"frame": 3, "part": "foot"}]}',
}


def evidence(folder, name="project.toml", text=PROJECT):
    """What a run of a project is made from, with one of its files written so."""
    for file in FILES:
        (folder / file).write_text(text if file == name else FILES[file])
    workspace = Workspace(folder)
    return motion_digest(workspace, workspace.options(Options(), Options()), Options())


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("keyframes.json", '"upper": [3]', '"upper": [4]'),
        ("keyframes.json", '"lower": [3, 9]', '"lower": [9]'),
        ("picks.json", '"frame": 3', '"frame": 4'),
        ("project.toml", "[options]", '[[added]]\npath = "w.mp4"\nfingerprint = "y"\n[options]'),
        ("project.toml", "\n\n", "\nend = 20\n\n"),
        ("project.toml", "height = 2", "height = 1.9"),
        ("project.toml", "[options]", '[options]\nshots.skip = "2"'),
    ],
)
def test_whatever_a_motion_is_made_of_is_its_evidence(bare, name, old, new):
    assert evidence(bare, name, FILES[name].replace(old, new)) != evidence(bare)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("keyframes.json", '"nearest": {}', '"T": 10'),
        (
            "picks.json",
            FILES["picks.json"],
            json.dumps(
                {
                    "picks": [
                        {"frame": 3, "part": "foot"},
                        {"frame": 0, "part": "head"},
                    ]
                }
            ),
        ),
        ("project.toml", "v.mp4", "elsewhere/v.mp4"),
        ("project.toml", "height = 2", "height = 2.0\ngolf.candidates = 2"),
    ],
)
def test_what_changes_no_motion_is_no_evidence(bare, name, old, new):
    assert evidence(bare, name, FILES[name].replace(old, new)) == evidence(bare)


@pytest.mark.parametrize("content", [b"", b"\xff\xfe", b"[" * 100_000, b"1e999", b"{"])
def test_damaged_marks_are_left_to_their_reader(workspace, content):
    """Who reads the file says in one line what is wrong with it."""
    without = marks_digest(workspace)
    workspace.annotations_file.write_bytes(content)
    assert marks_digest(workspace) == without


@pytest.mark.parametrize("content", [b"", b"[" * 100_000, b'{"evidence": 1}', b"\xff", b"[]", b"1"])
def test_torn_notes_are_none(workspace, content):
    noted = RunNotes("marks", ("a doubt",), ("what helps",), "camera")
    note_run(workspace, noted)
    assert read_run(workspace) == noted
    (workspace.folder / "cache" / "run.json").write_bytes(content)
    assert read_run(workspace) is None


def test_a_torn_note_of_a_fit_calls_for_another(workspace):
    note_fitted(workspace, "all")
    (workspace.folder / "cache" / "golf_fitted").write_bytes(b"\xff\xfe")
    assert not is_fitted(workspace)


def write(file, seconds):
    """A file of a time today."""
    seconds += 1_700_000_000
    file.parent.mkdir(exist_ok=True)
    file.write_text("x")
    os.utime(file, (seconds, seconds))
    return file


def test_an_export_shows_the_motion_that_there_was_when_it_was_begun(workspace):
    write(workspace.motion_file, 10)
    began = motion_stamp(workspace)
    write(workspace.motion_file, 20)  # a run ends while the export is written
    late, unknown, old = (write(workspace.exports / f"{n}.bvh", n) for n in (30, 31, 9))
    note_exports(workspace, [late], began)
    assert current_exports(workspace) == [unknown]
    note_exports(workspace, [late, old], motion_stamp(workspace))
    assert {*current_exports(workspace)} == {late, unknown, old}
    write(old, 8)  # whatever was noted is of another file
    assert old not in current_exports(workspace)
    (workspace.folder / "cache" / "exports.json").write_bytes(b"[")
    assert {*current_exports(workspace)} == {late, unknown}


def test_what_a_fit_wrote_is_of_an_earlier_motion_after_a_run(workspace):
    workspace.golf_clicks_file.write_text("{}")
    table = write(workspace.folder / "golf.csv", 9)
    write(workspace.motion_file, 10)
    assert current_exports(workspace) == [table]  # of a fit by a former version
    note_exports(workspace, [table], motion_stamp(workspace))
    assert current_exports(workspace) == [table]
    write(workspace.motion_file, 20)
    assert current_exports(workspace) == []
    (workspace.folder / "cache" / "exports.json").unlink()
    note_run(workspace, RunNotes("", ()))
    assert current_exports(workspace) == []
