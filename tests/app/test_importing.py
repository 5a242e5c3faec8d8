"""Marks of a file in a golf project: what a fit then holds."""

import numpy as np
import pytest

from keyrecon.app.golf import kept_marks
from keyrecon.app.project import import_annotations, load_annotations, start
from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.records import SwingMarks
from keyrecon.io.formats.coco import write_coco
from keyrecon.io.formats.golf_marks import write_golf_marks
from keyrecon.io.formats.keyframes import keyframes_to_json
from keyrecon.io.video_writer import write_video
from keyrecon.io.workspace import Workspace
from keyrecon.records import Annotations, HalfKeyframes, Keyframes

SIZE = 128, 96
WRIST, HIP = LSP14.index("left_wrist"), LSP14.index("left_hip")


def joints_at(**places):
    joints = np.full((1, len(LSP14.names), 2), np.nan)
    for name, place in places.items():
        joints[0, LSP14.index(name)] = place
    return joints


@pytest.fixture
def workspace(tmp_path):
    """A swing with a wrist, a club and the top marked, and another wrist and a hip in a file."""
    write_video(tmp_path / "v.mp4", [np.zeros((96, 128, 3), np.uint8)] * 12, 25.0)
    start(tmp_path / "v.mp4", tmp_path / "p", golf=True)
    marks = SwingMarks(
        np.array([5]), joints_at(left_wrist=(60, 40)), np.full((1, 2, 2), 30.0),
        np.array([np.nan, 5.5, np.nan, np.nan]),
    )  # fmt: skip
    write_golf_marks(tmp_path / "p" / "golf_marks.json", marks, SIZE)
    joints, bones = joints_at(left_wrist=(70, 50), left_hip=(64, 60)), len(LSP14.bones)
    seen, nearer = np.isfinite(joints[..., 0]), np.zeros((1, bones), np.int64)
    file = Annotations(LSP14, np.array([5]), joints, seen, nearer)
    write_coco(tmp_path / "marks.json", file, SIZE)
    return Workspace(tmp_path / "p")


def test_a_mark_that_a_file_replaces_is_the_one_that_a_fit_holds(workspace):
    file = workspace.folder.parent / "marks.json"
    with pytest.raises(KeyreconError, match=r"1 mark differs .*frame 5 left_wrist"):
        import_annotations(workspace, file, replacing=False)
    import_annotations(workspace, file, replacing=True)
    held = kept_marks(workspace, workspace.video())
    assert held.joints[0, WRIST].tolist() == [70, 50]
    assert held.joints[0, HIP].tolist() == [64, 60]
    assert np.isfinite(held.shafts).all() and held.keys[1] == 5.5
    there = load_annotations(workspace, workspace.video())
    assert there.joints[0, WRIST].tolist() == [70, 50]
    assert "[60" in (workspace.folder / "golf_marks.old-1.json").read_text()


def chosen_keyframes(frames):
    """The file of keyframes of twelve frames, whole bodies."""
    half = HalfKeyframes(
        np.array(frames), np.full(12, frames[0]), np.ones(12, bool), 1.0, 0.1, np.zeros(12), 1
    )
    return keyframes_to_json(Keyframes(half, half, 2, 0.95))


NEXT = {
    "keyframes": (False, []),
    "run": (False, [5]),
    "golf fit": (True, []),
}


@pytest.mark.parametrize("step", NEXT)
def test_what_comes_after_an_import_is_what_the_project_can_do(tmp_path, step):
    text, workspace = import_body(tmp_path, *NEXT[step])
    assert text.endswith(f"\nNext: keyrecon {step} {workspace.folder}")


def test_an_import_that_leaves_keyframes_unmarked_names_them(tmp_path):
    text, workspace = import_body(tmp_path, False, [5, 8])
    assert "1 of 2 keyframes is not marked yet: frame 8 (upper body, lower body).\n" in text
    assert text.endswith(f"keyrecon run {workspace.folder} --partial")


def test_frames_that_were_taken_from_names_of_pictures_are_told(tmp_path):
    text, _ = import_body(tmp_path, False, [5], names="shot_{}.png")
    assert "1 frame was taken from the pictures' names: 5 (shot_5.png).\n" in text
    assert "Warning" not in text
    text, _ = import_body(tmp_path / "x", False, [5])
    assert "names" not in text


def test_marks_on_frames_that_nobody_asked_for_are_warned_of(tmp_path):
    text, _ = import_body(tmp_path, False, [8], names="shot_{}.png")
    assert "\nWarning: 1 of 1 marked frame is no keyframe that was asked for: 5; if" in text
    assert "Warning" not in import_body(tmp_path / "x", False, [])[0]


def test_a_file_without_marks_is_refused_and_changes_nothing(workspace):
    file = workspace.folder.parent / "none.json"
    nobody = Annotations(
        LSP14, np.zeros(0, int), np.zeros((0, 14, 2)), np.zeros((0, 14), bool),
        np.zeros((0, 13), int),
    )  # fmt: skip
    write_coco(file, nobody, SIZE)
    with pytest.raises(KeyreconError, match=r"none\.json holds no marks; nothing was changed"):
        import_annotations(workspace, file, replacing=True)
    assert not workspace.annotations_file.exists()


def import_body(folder, golf, chosen, names=None):
    """Import a whole body on frame 5 into a project in which keyframes are `chosen`.

    With `names` the file tells frames by names of pictures alone.
    """
    folder.mkdir(exist_ok=True)
    write_video(folder / "v.mp4", [np.zeros((96, 128, 3), np.uint8)] * 12, 25.0)
    start(folder / "v.mp4", folder / "p", golf=golf)
    joints, nearer = np.full((1, len(LSP14.names), 2), 40.0), np.zeros((1, len(LSP14.bones)), int)
    joints += np.arange(len(LSP14.names))[None, :, None]
    body = Annotations(LSP14, np.array([5]), joints, np.isfinite(joints[..., 0]), nearer)
    write_coco(folder / "marks.json", body, SIZE)
    if names:
        text = (folder / "marks.json").read_text()
        text = text.replace("frame_000005.png", names.format(5)).replace(', "frame": 5', "")
        (folder / "marks.json").write_text(text)
    workspace = Workspace(folder / "p")
    if chosen:
        workspace.keyframes_file.write_text(chosen_keyframes(chosen))
    return import_annotations(workspace, folder / "marks.json", replacing=False), workspace
