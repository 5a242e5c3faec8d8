"""Exporting from a project: everything is looked at before anything is written."""

import shutil

import av
import pytest
from small_motion import make_motion

from keyrecon.app.exporting import export
from keyrecon.app.project import start
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.motion_file import write_motion
from keyrecon.io.workspace import Workspace
from keyrecon.progress import silent


@pytest.fixture
def project(tmp_path, write_numbered):
    video = tmp_path / "rally.mp4"
    shutil.copy(write_numbered("v.mp4", list(range(0, 240, 12))), video)
    start(video, tmp_path / "p")
    write_motion(tmp_path / "p" / "motion.npz", make_motion(20))
    (tmp_path / "p" / "annotations.json").write_text("what a person marked")
    (tmp_path / "p" / "annotations.old-1.json").write_text("marked before")
    return Workspace(tmp_path / "p")


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def assert_refused(project, *names, match):
    folder = project.folder.parent
    before = contents(folder)
    with pytest.raises(KeyreconError, match=match):
        export(project, [folder / name for name in names], silent)
    assert contents(folder) == before


@pytest.mark.parametrize(
    "name",
    [
        "p/annotations.json",
        "p/annotations.old-1.json",
        "p/../p/motion.npz",
        "rally.mp4",
    ],
)
def test_nothing_that_the_project_needs_is_written_over(project, name):
    assert_refused(project, name, match="belongs to the project and would be lost")


def test_a_link_to_the_video_is_the_video(project):
    (project.folder / "overlay.mp4").symlink_to(project.folder.parent / "rally.mp4")
    assert_refused(project, "p/overlay.mp4", match="belongs to the project")


def test_one_name_that_cannot_be_keeps_all_from_being_written(project):
    assert_refused(project, "a.bvh", "b.xyz", match=r"no export to '.xyz'; use .*\.mp4")
    assert_refused(project, "a.bvh", "nowhere/b.trc", match="There is no folder .*nowhere")
    assert_refused(project, match="No file was named")


def test_suffixes_may_be_written_in_capitals(project):
    folder = project.folder.parent
    told = export(project, [folder / "A.BVH", folder / "OVERLAY.MP4", folder / "a.json"], silent)
    assert [line.split("/")[-1] for line in told] == ["A.BVH.", "OVERLAY.MP4.", "a.json."]
    with av.open(str(folder / "OVERLAY.MP4")) as container:
        assert sum(1 for _ in container.decode(video=0)) == 20


def test_an_overlay_that_breaks_off_leaves_the_one_there_was(project):
    folder = project.folder.parent
    (folder / "overlay.mp4").write_bytes(b"the last one")

    def impatient(items, *_):
        yield from (item for n, item in enumerate(items) if n < 5 or stop())

    def stop():
        raise KeyboardInterrupt

    before = contents(folder)
    with pytest.raises(KeyboardInterrupt):
        export(project, [folder / "overlay.mp4"], impatient)
    assert contents(folder) == before
