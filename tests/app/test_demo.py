"""The demo is made again in a folder in which a person may have marked something."""

from types import SimpleNamespace

import numpy as np

from keyrecon.app import demo
from keyrecon.body import LSP14
from keyrecon.io.formats.coco import write_coco
from keyrecon.io.workspace import Workspace
from keyrecon.progress import silent
from keyrecon.records import Annotations

SIZE = (128, 64)


class _Pictures:
    width, height = SIZE

    def __len__(self):
        return 2000


def marks(*frames):
    k = len(frames)
    joints = np.full((k, 14, 2), 20.0) + np.arange(14)[None, :, None]
    seen, signs = np.ones((k, 14), bool), np.zeros((k, 13), np.int64)
    return Annotations(LSP14, np.array(frames), joints, seen, signs)


def test_marks_of_a_person_stay_beside_those_of_the_demo(bare, monkeypatch):
    half = SimpleNamespace(frames=np.array([3]))
    keyframes = SimpleNamespace(upper=half, lower=half, frames=half.frames)
    made = SimpleNamespace(video=_Pictures(), keyframes=keyframes)
    monkeypatch.setattr(demo, "prepared", lambda *_: made)
    monkeypatch.setattr(demo, "mark_from_truth", lambda *_: marks(3))
    workspace = Workspace(bare)
    truth = dict.fromkeys(("points2d", "points3d", "visible"), np.zeros(1))

    def make():
        return demo._mark(workspace, truth, bare / "none.json", silent)

    assert "kept" not in make() and "kept" not in make()
    assert not [*bare.glob("*.old-*")]
    write_coco(workspace.annotations_file, marks(3, 777), SIZE)
    told = workspace.annotations_file.read_bytes()
    assert "annotations.old-1.json" in make()
    assert (bare / "annotations.old-1.json").read_bytes() == told
