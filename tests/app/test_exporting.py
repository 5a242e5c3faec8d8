"""Exporting from a project: everything is looked at before anything is written."""

import json
import re
import shutil
import tomllib
from dataclasses import replace

import av
import numpy as np
import pytest
from court_walker import court_camera
from painted_court import camera_at
from small_motion import make_motion

from keyrecon.app import exporting
from keyrecon.app.annotator import job_commands
from keyrecon.app.exporting import export
from keyrecon.app.project import add_video, start
from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.camera_file import write_camera
from keyrecon.io.formats.coco import write_coco
from keyrecon.io.formats.motion_file import read_motion, write_motion
from keyrecon.io.video import open_video
from keyrecon.io.workspace import Workspace
from keyrecon.progress import silent
from keyrecon.records import Annotations
from keyrecon.report.overlay import OverlayOptions
from keyrecon.timeline import cut_motion
from keyrecon.world.placement import given_height
from keyrecon.world.records import GROUND, WorldMotion


@pytest.fixture
def project(tmp_path, write_numbered):
    video = tmp_path / "rally.mp4"
    shutil.copy(write_numbered("v.mp4", list(range(0, 240, 12))), video)
    start(video, tmp_path / "p")
    write_motion(tmp_path / "p" / "motion.npz", make_motion(20))
    (tmp_path / "p" / "annotations.json").write_text("what a person marked")
    (tmp_path / "p" / "annotations.old-1.json").write_text("marked before")
    return Workspace(tmp_path / "p")


def frames_of(path):
    with av.open(str(path)) as container:
        return sum(1 for _ in container.decode(video=0))


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
        "p/skeleton.json",
        "p/keyframes.json",
        "p/picks.JSON",
        "rally.mp4",
    ],
)
def test_nothing_that_the_project_needs_is_written_over(project, name):
    assert_refused(project, name, match="belongs to the project and would be lost")


def test_an_export_in_the_project_takes_the_place_of_the_one_before(project):
    files = [project.folder / name for name in ("coco.json", "rally.csv")]
    export(project, files, silent)
    assert len(export(project, files, silent)) == 2


def test_what_a_golf_fit_has_written_is_its_own(project):
    export(project, [project.folder / "golf.csv"], silent)  # of a project that has no swing
    project.become_golf()
    for name in ("p/golf.csv", "p/overlay.mp4"):
        assert_refused(project, name, match="belongs to the project and would be lost")


def test_a_place_that_the_project_may_come_to_need_is_kept_free(project):
    (project.folder / "annotations.json").unlink()
    assert_refused(project, "p/annotations.json", match="belongs to the project")
    (project.folder.parent / "rally.mp4").unlink()
    assert_refused(project, "rally.mp4", match="belongs to the project")


@pytest.mark.parametrize(
    "name",
    ["annotations.json", "picks.json", "keyframes.JSON", "motion.npz", "camera.npz", "kept.json"],
)
def test_what_another_project_needs_is_not_written_over(project, name):
    other = project.folder.parent / "other"
    other.mkdir()
    (other / "project.toml").write_text("of whatever version")
    (other / "kept.json").write_text("{}")
    assert_refused(project, f"other/{name}", match="belongs to the project in .*other and would be")
    export(project, [other / "rally.json", other / "rally.csv"], silent)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("marks.json", '{"info": {}, "images": [], "annotations": [], "categories": []}'),
        ("notes.json", "what somebody wrote"),
        ("CollectedData.csv", "scorer,me\nbodyparts,head\ncoords,x\n"),
        ("Config.toml", "[project]\n"),
    ],
)
def test_a_file_that_no_export_has_written_is_not_replaced(project, name, text):
    (project.folder.parent / name).write_text(text)
    match = f"{name} is there already and no export has written it; delete it or choose another"
    assert_refused(project, "a.bvh", name, match=match)


def test_a_film_is_told_from_an_overlay_wherever_it_lies(project, write_numbered):
    """It may be the video of another project, whose folder lies elsewhere."""
    folder = project.folder.parent
    shutil.copy(write_numbered("w.mp4", list(range(0, 240, 12))), folder / "second.mp4")
    assert_refused(project, "second.mp4", match="second.mp4 is there already and no export has")
    (folder / "none.mp4").write_text("no video at all")
    assert_refused(project, "none.mp4", match="no export has written it")
    for _ in range(2):
        export(project, [folder / "overlay.mp4"], silent)


def test_an_overlay_of_a_former_version_among_the_exports_is_replaced(project, write_numbered):
    project.exports.mkdir()
    shutil.copy(write_numbered("w.mp4", [5, 9]), project.exports / "p.mp4")
    export(project, [project.exports / "p.mp4"], silent)
    assert frames_of(project.exports / "p.mp4") == 20


def test_a_folder_is_no_file_to_write(project):
    (project.folder / "coco.json").mkdir()
    assert_refused(project, "p/coco.json", match="could not be written")


def test_marks_are_told_from_an_export_and_an_export_is_replaced(project):
    folder = project.folder.parent
    marks = Annotations(
        LSP14, np.array([3]), np.full((1, 14, 2), 9.0), np.ones((1, 14), bool),
        np.zeros((1, 13), np.int64),
    )  # fmt: skip
    write_coco(folder / "marks.json", marks, (128, 64))
    assert_refused(project, "marks.json", match="no export has written it")
    (folder / "empty.json").touch()
    files = [folder / name for name in ("a.json", "a.csv", "empty.json")]
    export(project, files, silent)
    whole = (folder / "a.json").read_bytes()
    export(project, files, silent, "5-11")
    assert len((folder / "a.json").read_bytes()) < len(whole)


def test_a_motion_of_a_video_that_has_grown_is_told_of(project, write_numbered):
    files = [project.folder.parent / "a.csv"]
    assert len(export(project, files, silent)) == 1
    add_video(project, write_numbered("w.mp4", list(range(0, 120, 12))), (0, None))
    told = export(Workspace(project.folder), files, silent)[-1]
    assert told.startswith(
        "The motion is of the first 20 frames, and the video has 30 by now: make"
    )
    project.video().path.unlink()
    assert len(export(Workspace(project.folder), files, silent)) == 1


def test_fbx_is_refused_with_the_way_there(project):
    assert_refused(project, "a.fbx", match=r"write \.glb or \.bvh, open it in Blender .* FBX")


def test_a_range_is_written_with_the_videos_frame_numbers(project):
    folder = project.folder.parent
    names = ("a.csv", "a.npz", "a.json", "a.bvh", "a.trc", "a.mp4")
    export(project, [folder / name for name in names], silent, "5-11")
    rows = [line for line in (folder / "a.csv").read_text().splitlines() if line[0].isdigit()]
    assert [row.split(",")[0] for row in rows] == [str(frame) for frame in range(5, 12)]
    motion = read_motion(folder / "a.npz")
    whole = read_motion(project.motion_file)
    assert np.array_equal(motion.points3d, whole.points3d[5:12])
    assert np.array_equal(motion.time, whole.time[5:12])
    images = json.loads((folder / "a.json").read_text())["images"]
    assert [image["frame"] for image in images] == list(range(5, 12))
    assert "Frames: 7\n" in (folder / "a.bvh").read_text()
    assert (folder / "a.trc").read_text().splitlines()[2].split("\t")[6:] == ["6", "7"]
    assert frames_of(folder / "a.mp4") == 7


def test_keyframes_of_a_range_count_from_its_start():
    cut = cut_motion(make_motion(60), slice(20, 41))  # keyframes at 0 and 30
    assert cut.keyframes.tolist() == [10]


@pytest.mark.parametrize(
    ("frames", "words"),
    [("5-40", "has frames 0 to 19"), ("9-3", "has frames 0 to 19"), ("7", "such as 120-180")],
)
def test_a_range_that_cannot_be_is_told(project, frames, words):
    folder = project.folder.parent
    with pytest.raises(KeyreconError, match=words):
        export(project, [folder / "a.bvh"], silent, frames)
    assert not (folder / "a.bvh").exists()


def test_slow_motion_plays_the_same_frames_slower(project):
    folder = project.folder.parent
    export(project, [folder / "a.mp4"], silent)
    export(project, [folder / "b.mp4"], silent, None, OverlayOptions(slowmo=4.0))
    usual, slow = open_video(folder / "a.mp4"), open_video(folder / "b.mp4")
    assert len(usual) == len(slow)
    assert slow.fps == pytest.approx(usual.fps / 4, rel=1e-3)


def on_the_court(project):
    """The project's motion, written with its joints in the world."""
    motion = read_motion(project.motion_file)
    world = motion.points3d[..., [0, 2, 1]] * [1, 1, -1]
    count = len(motion.time)
    camera = court_camera(camera_at((2, -20, 3), (0, -9, 0.8), 1.6), count)
    roots, contact = world.mean(axis=1), np.zeros((count, 2), bool)
    write_motion(project.motion_file, motion, (WorldMotion(world, roots, contact, 1.0), camera))
    return motion


def test_files_of_one_export_are_of_one_run(project, monkeypatch):
    folder, motion = project.folder.parent, on_the_court(project)
    courts = []

    def overlay(file, video, motion, progress, options, shown, court, club):
        courts.append(court)
        write_motion(project.motion_file, motion)  # a run without the court ends meanwhile

    monkeypatch.setattr(exporting, "write_overlay", overlay)
    export(project, [folder / "a.mp4", folder / "b.mp4", folder / "a.csv"], silent)
    assert all(court is not None for court in courts) and len(courts) == 2
    assert "neck_world_y" in (folder / "a.csv").read_text()
    on_the_court(project)
    read = exporting.load_whole_motion

    def then_replaced(path):
        whole = read(path)
        write_motion(project.motion_file, motion)
        return whole

    monkeypatch.setattr(exporting, "load_whole_motion", then_replaced)
    export(project, [folder / "b.csv"], silent)
    assert "neck_world_y" in (folder / "b.csv").read_text()


NAMES = ["a.bvh", "a.glb", "a.trc", "a.c3d", "a.csv", "a.nc", "a.npz", "a.json", "a.mp4"]


@pytest.mark.parametrize("name", NAMES)
def test_frames_of_a_shot_that_is_left_out_are_refused_alike(project, name):
    motion, gone = make_motion(20), np.arange(20) < 8
    arrays = {
        key: np.where(gone.reshape(-1, *[1] * (values.ndim - 1)), np.nan, values)
        for key in ("points3d", "points2d", "points2d_propagated", "scale")
        if (values := getattr(motion, key)) is not None
    }
    confidence = np.where(gone[:, None], 0, motion.confidence)
    motion = replace(motion, **arrays, confidence=confidence, cuts=np.array([8]))
    write_motion(project.motion_file, motion)
    file = project.folder.parent / name
    with pytest.raises(KeyreconError, match="No usable shot is among these frames"):
        export(project, [file], silent, "2-6")
    assert not file.exists()
    assert len(export(project, [file], silent, "5-12")) == 1


def test_a_calibration_is_of_the_frames_asked_for(project):
    file = project.folder.parent / "a.toml"
    camera = court_camera(camera_at((2, -20, 3), (0, -9, 0.8), 1.6), 20)
    found = np.arange(20) > 4
    zoom = camera.K * np.linspace(1, 2, 20)[:, None, None]
    write_camera(project.camera_file, replace(camera, K=zoom, found=found))
    assert "of frame 12: the camera moves" in export(project, [file], silent)[0]
    assert "of frame 9: the camera moves" in export(project, [file], silent, "8-10")[0]
    kept = file.read_bytes()
    with pytest.raises(KeyreconError, match=r"no camera in frames 1-3"):
        export(project, [file], silent, "1-3")
    with pytest.raises(KeyreconError, match=r"such as 120-180; got '9000-nonsense'"):
        export(project, [file], silent, "9000-nonsense")
    assert file.read_bytes() == kept


def test_a_calibration_is_in_the_metres_of_the_motion(project):
    """Whose player was taller when the camera was found."""
    file, motion = project.folder.parent / "a.toml", read_motion(project.motion_file)
    camera = court_camera(camera_at((2, -20, 3), (0, -9, 0.8), 1.6), 20)
    stature = 1.25 * given_height(motion)
    camera = replace(camera, origin=GROUND, stature=stature, sd_tilt=np.full(20, 0.01))
    write_camera(project.camera_file, camera)

    def shift():
        return np.array(tomllib.loads(file.read_text())["cam_01"]["translation"])

    line = export(project, [file], silent)[0]
    assert np.allclose(shift(), camera.t[0] / 1.25)
    assert f"scaled with the player, who is {given_height(motion):.2f} m tall now" in line
    export(project, [project.folder.parent / "b.csv", file], silent)
    assert np.allclose(shift(), camera.t[0] / 1.25)
    project.motion_file.unlink()
    assert "scaled" not in export(project, [file], silent)[0]
    assert np.allclose(shift(), camera.t[0])


@pytest.mark.parametrize("slowmo", [0.0, -1.0, float("nan"), float("inf"), 1e6])
def test_a_speed_that_cannot_be_is_told(project, slowmo):
    with pytest.raises(KeyreconError, match="--slowmo says how many times"):
        folder = project.folder.parent
        export(project, [folder / "a.mp4"], silent, None, OverlayOptions(slowmo=slowmo))


def test_views_stand_beside_the_video_at_the_size_asked_for(project):
    folder = project.folder.parent
    options = OverlayOptions(view=("camera", "right", "above"), size=96)
    export(project, [folder / "a.mp4"], silent, None, options)
    video = open_video(folder / "a.mp4")
    assert video.height == 96
    assert video.width > 1.5 * 96 * 128 / 64 / 1.5 + 2 * 60


def test_choices_for_the_overlay_without_an_overlay_are_told(project):
    with pytest.raises(KeyreconError, match=r"for the overlay video; name an \.mp4"):
        export(project, [project.folder.parent / "a.bvh"], silent, None, OverlayOptions(slowmo=2.0))


def test_the_page_tells_what_a_file_holds_by_its_name(project):
    text = job_commands(project.folder)["export"]({"formats": (".bvh", ".csv")}, silent)
    bvh, csv = text.splitlines()
    assert re.match(r"Wrote p\.bvh: \S+", bvh) and re.match(r"Wrote p\.csv: \S+", csv)
    (line,) = export(project, [project.exports / "p.bvh"], silent)
    assert line.removeprefix(f"Wrote {project.exports}/") == bvh.removeprefix("Wrote ")


def test_a_motion_on_the_court_is_exported_where_it_stands(project):
    folder, motion = project.folder.parent, read_motion(project.motion_file)
    with np.load(project.motion_file) as stored:
        data = dict(stored)
    x, y, z = motion.points3d.transpose(2, 0, 1)
    court = np.stack([x + 3, z - 20, 1.2 - y], axis=2)
    np.savez(project.motion_file, **data, points3d_world=court)
    told = export(project, [folder / "a.trc"], silent, "5-9")
    assert "on the court: origin on the ground at the middle of the net" in told[0]
    row = (folder / "a.trc").read_text().splitlines()[6].split("\t")
    neck = 2 + 3 * motion.skeleton.index("neck")
    x, y, z = court[5, motion.skeleton.index("neck")]
    assert [float(n) for n in row[neck : neck + 3]] == pytest.approx([x, z, -y], abs=1e-5)
    court[7] = np.nan  # the camera was lost for a frame
    np.savez(project.motion_file, **data, points3d_world=court)
    told = export(project, [folder / "a.trc", folder / "a.bvh"], silent, "5-9")
    assert "left out are 1 of 5 frames" in told[0] and "1 of 5 frames, which are bridged" in told[1]
    rows = [line.split("\t") for line in (folder / "a.trc").read_text().splitlines()[6:]]
    assert ["" in row for row in rows] == [False, False, True, False, False]
    assert "feet on the floor at 0" in export(project, [folder / "a.trc"], silent, "7-9")[0]
    assert "on the court" in export(project, [folder / "a.trc"], silent, "10-19")[0]


def test_a_motion_where_there_is_no_court_says_where_its_origin_is(project):
    folder, motion = project.folder.parent, read_motion(project.motion_file)
    with np.load(project.motion_file) as stored:
        data = dict(stored)
    world = motion.points3d[..., [0, 2, 1]] * [1, 1, -1]
    np.savez(project.motion_file, **data, points3d_world=world, origin="ground")
    told = export(project, [folder / "a.trc", folder / "a.csv"], silent)
    assert "on the ground: origin under the player's first stance, x to the right" in told[0]
    assert "m, origin on the ground under the player's" in (folder / "a.csv").read_text()
    np.savez(project.motion_file, **data, points3d_world=world, origin="moon")
    with pytest.raises(KeyreconError, match="'moon' is no origin"):
        export(project, [folder / "a.trc"], silent)


def test_a_motion_file_keeps_all_that_is_known_of_its_frames(project):
    folder, count = project.folder.parent, 20
    rng = np.random.default_rng(0)
    per_frame = {
        "points3d_world": (count, 14, 3), "root_world": (count, 3), "contact": (count, 2),
        "camera_K": (count, 3, 3), "club3d": (count, 2, 3), "club_seen": (count,),
    }  # fmt: skip
    more = {name: rng.random(shape) for name, shape in per_frame.items()}
    more |= {"vertical": np.array([0, -1.0, 0]), "key_postures": np.array([4, 6.5, 8, 30])}
    more |= {"key_posture_names": np.array(["address", "top", "hit", "finish"])}
    write_motion(project.motion_file, read_motion(project.motion_file), more=more)
    export(project, [folder / "a.npz"], silent)
    with np.load(project.motion_file) as whole, np.load(folder / "a.npz") as copy:
        assert whole.files == copy.files
        for name in whole.files:
            np.testing.assert_array_equal(whole[name], copy[name])
    export(project, [folder / "b.npz", folder / "b.csv"], silent, "5-11")
    with np.load(folder / "b.npz") as part:
        assert all(np.array_equal(part[name], more[name][5:12]) for name in per_frame)
        assert part["key_postures"].tolist() == [-1, 1.5, 3, 25]
        assert part["vertical"].tolist() == [0, -1, 0]
    table = [row.split(",") for row in (folder / "b.csv").read_text().splitlines() if row[0] != "#"]
    cell = table[3][table[0].index("neck_world_y")]
    assert float(cell) == pytest.approx(more["points3d_world"][7, 12, 1], rel=1e-4)


def test_a_line_says_what_was_done_to_each_file(project):
    folder = project.folder.parent
    told = export(project, [folder / "a.bvh", folder / "a.csv"], silent)
    assert "feet on the floor at 0" in told[0]
    assert "20 frames, those of the video" in told[0]
    assert "camera axes; 20 frames" in told[1]


def test_a_link_to_the_video_is_the_video(project):
    (project.folder / "overlay.mp4").symlink_to(project.folder.parent / "rally.mp4")
    assert_refused(project, "p/overlay.mp4", match="belongs to the project")


def test_a_name_without_a_suffix_is_told_in_plain_words(project):
    assert_refused(project, "motion", match=r"motion has no suffix, .* add one of \.bvh, .*\.trc\.")


def test_one_name_that_cannot_be_keeps_all_from_being_written(project):
    assert_refused(project, "a.bvh", "b.xyz", match=r"no export to '.xyz'; use .*\.mp4")
    assert_refused(project, "a.bvh", "nowhere/b.trc", match="There is no folder .*nowhere")
    assert_refused(project, match="No file was named")


def test_suffixes_may_be_written_in_capitals(project):
    folder = project.folder.parent
    told = export(project, [folder / "A.BVH", folder / "OVERLAY.MP4", folder / "a.json"], silent)
    names = [re.split(r"[:]|[.]$", line.split("/")[-1])[0] for line in told]
    assert names == ["A.BVH", "OVERLAY.MP4", "a.json"]
    assert frames_of(folder / "OVERLAY.MP4") == 20


def test_an_overlay_that_breaks_off_leaves_the_one_there_was(project):
    folder = project.folder.parent
    export(project, [folder / "overlay.mp4"], silent)

    def impatient(items, *_):
        yield from (item for n, item in enumerate(items) if n < 5 or stop())

    def stop():
        raise KeyboardInterrupt

    before = contents(folder)
    with pytest.raises(KeyboardInterrupt):
        export(project, [folder / "overlay.mp4"], impatient)
    assert contents(folder) == before
