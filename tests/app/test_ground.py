"""What keyrecon ground does to a project, and what it says."""

import re
from dataclasses import replace

import numpy as np
import pytest
from court_walker import court_camera
from ground_walker import CAMERA, SIZE, mark, posts, seen, standing, walks

from keyrecon import lens
from keyrecon.annotate.assist.ground_views import describe_ground
from keyrecon.app import ground
from keyrecon.app.ground import find_ground, ground_mark
from keyrecon.app.placing import write_placed_motion
from keyrecon.app.project import start
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.camera_file import read_camera, write_camera
from keyrecon.io.formats.motion_file import motion_on_court, read_further_arrays, write_motion
from keyrecon.io.video_writer import write_video
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options, with_field_of_view
from keyrecon.progress import silent
from keyrecon.world.ground_calibration import calibrate_ground
from keyrecon.world.placement import stature_in_units
from keyrecon.world.records import GROUND, GroundMark, GroundMarks


def project(tmp_path_factory, points):
    """A project with a motion, and a film of nothing by a camera that stands still."""
    folder = tmp_path_factory.mktemp("ground")
    picture = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    picture[::40, ::40] = 200
    write_video(folder / "v.mp4", [picture] * len(points), 50.0)
    start(folder / "v.mp4", folder / "p")
    write_motion(folder / "p" / "motion.npz", seen(points))
    return folder / "p"


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    return project(tmp_path_factory, WAY)


@pytest.fixture(scope="module")
def stood(tmp_path_factory):
    return project(tmp_path_factory, standing(steps=6))


WAY = walks(((-1.0, 6.5, 75),), 12, 0.6)
"""Away from the camera, from 6.5 to 13.5 m."""


def on_ground(workspace):
    """The motion in the world and the camera, as they are stored."""
    return motion_on_court(read_further_arrays(workspace.motion_file), workspace.motion_file)


def told(folder, marks=(), fov=None, forget=()):
    return find_ground(Workspace(folder), GroundMarks(tuple(marks), fov), silent, forget)


def test_the_motion_comes_to_stand_on_the_ground(walked):
    text = told(walked, posts(), 2 * np.degrees(np.arctan(640 / 1100)))
    high = re.search(r"The camera is (\d\.\d\d) m high", text)
    assert abs(float(high[1]) - CAMERA.centre[2]) < 0.05 and "2 upright things" in text
    workspace = Workspace(walked)
    camera = read_camera(workspace.camera_file)
    assert camera.origin == GROUND
    assert abs(camera.centre[0, 2] - CAMERA.centre[2]) < 0.15
    world, stored = on_ground(workspace)
    assert stored.origin == GROUND
    feet = world.points[:, [0, 5]][world.contact]
    assert np.abs(feet[:, 2]).max() < 0.2
    assert np.linalg.norm(world.points[0, [0, 5], :2].mean(axis=0)) < 0.5
    assert (walked / "ground.jpg").is_file() and (walked / "way.jpg").is_file()
    assert "On the ground: " in text
    assert "On the ground: " in write_placed_motion(workspace, seen(WAY)).lines[0]  # run again


def test_a_player_of_another_height_takes_the_cameras_metres_with_him(walked):
    workspace, motion = Workspace(walked), seen(WAY)
    write_motion(workspace.motion_file, motion)
    told(walked, posts(), 60.4)
    assert not describe_ground(workspace)["changed"]
    taller = replace(motion, points3d=1.12 * motion.points3d, scale=motion.scale / 1.12)
    placed = write_placed_motion(workspace, taller)
    assert "with a player 1.81 m tall who is 2.03 m now" in placed.lines[1]
    world, camera = on_ground(workspace)
    size = stature_in_units(replace(motion, points3d=world.points))
    assert size == pytest.approx(stature_in_units(taller), rel=0.02)
    assert camera.centre[0] == pytest.approx(
        1.12 * read_camera(workspace.camera_file).centre[0], rel=1e-6
    )
    assert describe_ground(workspace)["changed"]
    told(walked)
    assert not describe_ground(workspace)["changed"]
    assert len(write_placed_motion(workspace, taller).lines) == 1
    write_motion(workspace.motion_file, motion)


def test_arms_that_more_marks_have_made_longer_move_no_camera(walked):
    told(walked, posts(), 60.4)
    workspace, motion = Workspace(walked), seen(WAY)
    camera, names = read_camera(workspace.camera_file), motion.skeleton.names
    points = motion.points3d.copy()
    for side in ("left", "right"):
        elbow, wrist = (names.index(f"{side}_{part}") for part in ("elbow", "wrist"))
        points[:, wrist] += 0.3 * (points[:, wrist] - points[:, elbow])
    placed = write_placed_motion(workspace, replace(motion, points3d=points))
    assert len(placed.lines) == 1
    assert np.array_equal(placed.court[1].t, camera.t)
    write_motion(workspace.motion_file, motion)


def test_metres_of_a_marked_length_stay_when_the_player_grows(walked):
    length = mark("length", [(-1.0, 8, 0), (2.0, 8, 0)], 3.0)
    told(walked, [length])
    workspace = Workspace(walked)
    camera = read_camera(workspace.camera_file)
    assert camera.stature is None
    taller = replace(seen(WAY), points3d=1.05 * seen(WAY).points3d, scale=seen(WAY).scale / 1.05)
    _, used = write_placed_motion(workspace, taller).court
    assert np.array_equal(used.t, camera.t)
    told(walked, forget=["length-1"])


def test_a_camera_file_that_does_not_say_what_told_its_metres_is_read(walked):
    told(walked, posts(), 60.4)
    file = Workspace(walked).camera_file
    kept = file.read_bytes()
    with np.load(file) as data:
        former = {name: data[name] for name in data.files if name != "stature"}
    assert len(former) == len(data.files) - 1
    np.savez(file, **former)
    assert read_camera(file).stature is None
    assert len(write_placed_motion(Workspace(walked), seen(WAY)).lines) == 1
    np.savez(file, **former, stature=np.nan)
    with pytest.raises(KeyreconError, match="stature is nan"):
        read_camera(file)
    file.write_bytes(kept)


def test_one_spot_is_told_and_the_motion_stays_as_it_is(stood):
    with np.load(stood / "motion.npz") as file:
        before = {name: file[name] for name in file.files}
    text = told(stood)
    assert "The focal length cannot be told from this" in text
    assert "stays on one spot" in text
    assert "Mark two upright things" in text and "--vertical FRAME:X,Y:X,Y --vertical" in text
    assert "No way on the ground: how far the camera looks down is open by" in text
    with np.load(stood / "motion.npz") as file:
        assert set(file.files) == set(before)
        assert all(np.array_equal(file[name], before[name]) for name in before)


def test_what_else_a_motion_holds_stays(walked):
    workspace = Workspace(walked)
    motion = seen(WAY)
    club = np.zeros((len(motion.time), 2, 2))
    write_motion(workspace.motion_file, motion, more={"club2d": club})
    told(walked, posts(), 60.4)
    assert set(read_further_arrays(workspace.motion_file)) >= {"club2d", "points3d_world"}


def test_marks_are_kept_named_and_forgotten(stood):
    told(stood, posts())
    assert Workspace(stood).ground_marks().marks == posts()
    text = told(stood, fov=60.0)
    assert "vertical-1 (frame 0" in text and "the field of view of 60 degrees" in text
    with pytest.raises(KeyreconError, match="no mark horizon-1 to forget; it has vertical-1, vert"):
        told(stood, forget=["horizon-1"])
    told(stood, forget=["vertical-2", "fov"])
    assert Workspace(stood).ground_marks() == GroundMarks(posts()[:1])
    assert "Kept marks" not in told(stood, forget=["all"])


def test_what_a_person_changes_meanwhile_stays_changed(stood, monkeypatch):
    told(stood, posts(), forget=["all"])
    meanwhile = GroundMark("vertical", 0, (640.0, 100.0), (640.0, 600.0))

    def calibrate(*evidence):
        removed = GroundMarks(posts()[:1])
        Workspace(stood).change_ground_marks(GroundMarks((meanwhile,)), removed)
        return calibrate_ground(*evidence)

    monkeypatch.setattr(ground, "calibrate_ground", calibrate)
    told(stood, fov=60.0)
    workspace = Workspace(stood)
    assert workspace.ground_marks() == GroundMarks((posts()[1], meanwhile), 60.0)
    assert describe_ground(workspace)["changed"]
    monkeypatch.undo()
    told(stood)
    assert not describe_ground(workspace)["changed"]
    told(stood, forget=["all"])


def test_marks_that_contradict_one_another_are_named_and_not_kept(stood):
    told(stood, forget=["all"] if Workspace(stood).ground_marks().marks else ())
    third = GroundMark("vertical", 0, (640.0, 100.0), (640.0, 600.0))
    leaning = posts(leaning=1.0)[1]
    told(stood, [third, posts()[0]])
    with pytest.raises(
        KeyreconError, match=f"at {leaning.start[0]:g}.*The new marks were not kept"
    ):
        told(stood, [leaning])
    workspace = Workspace(stood)
    assert len(workspace.ground_marks().marks) == 2
    workspace.change_ground_marks(GroundMarks((leaning,)))  # as the page does
    with pytest.raises(KeyreconError, match=r"in frame 0 \(vertical-3\)"):
        told(stood)
    told(stood, forget=["all"])


@pytest.mark.parametrize(
    ("mark", "words"),
    [
        (
            GroundMark("vertical", 0, (10.0, 10.0), (10.0, 11.0)),
            "Both ends of the vertical .* in one place",
        ),
        (GroundMark("length", 0, (10.0, 10.0), (90.0, 11.0), 0.0), "A length of 0 m cannot be"),
        (
            GroundMark("vertical", 0, (10.0, 10.0), (10.0, 900.0)),
            "10,900 in frame 0 is outside the picture",
        ),
        (
            GroundMark("horizon", 7000, (10.0, 10.0), (90.0, 11.0)),
            "Frame 7000 is outside the video",
        ),
    ],
)
def test_a_mark_that_cannot_be_is_told(stood, mark, words):
    with pytest.raises(KeyreconError, match=words):
        told(stood, [mark])


def test_a_field_of_view_that_no_camera_has_is_told(stood):
    with pytest.raises(KeyreconError, match="--fov is the angle across"):
        told(stood, fov=0.0)


def test_the_lens_that_a_phone_wrote_into_the_file_counts(stood, monkeypatch):
    monkeypatch.setattr(lens, "lens_focal", lambda path, size: 1100.0)
    assert "the lens that the file names" in told(stood)
    assert "the lens" not in told(stood, fov=60.0)
    told(stood, forget=["fov"])


def test_the_lens_that_the_run_was_told_counts_where_ground_was_told_none(stood, monkeypatch):
    monkeypatch.setattr(lens, "lens_focal", lambda path, size: 1100.0)
    workspace = Workspace(stood)
    workspace.remember(with_field_of_view(Options(), 60.0), Options())
    text = told(Workspace(stood).folder)
    assert "the field of view of 60 degrees that keyrecon run was told" in text
    assert "the lens" not in text
    assert np.allclose(read_camera(workspace.camera_file).focal, 640 / np.tan(np.pi / 6), rtol=0.1)
    assert re.search("the field of view of 90 degrees[.,]", told(stood, fov=90.0))
    told(stood, forget=["fov"])
    Workspace(stood).remember(Options(), Options())
    assert "the lens that the file names" in told(stood)


def test_a_camera_from_a_court_is_kept(stood):
    file = Workspace(stood).camera_file
    kept = file.read_bytes()
    write_camera(file, court_camera(CAMERA, 3))
    with pytest.raises(KeyreconError, match=r"camera.npz has the camera from a court"):
        told(stood)
    file.write_bytes(kept)


def test_without_a_motion_the_way_to_one_is_told(stood):
    file = stood / "motion.npz"
    kept = file.read_bytes()
    file.unlink()
    with pytest.raises(KeyreconError, match="There is no motion yet"):
        told(stood)
    file.write_bytes(kept)


def test_marks_are_typed():
    assert ground_mark("vertical", "3:1,2:1.5,90") == GroundMark(
        "vertical", 3, (1.0, 2.0), (1.5, 90.0)
    )
    assert ground_mark("length", "0:1,2:3,4:2.5").metres == 2.5
    wrong = (("vertical", "3:1,2"), ("length", "0:1,2:3,4"), ("horizon", "0:1,2:3,4:5"))
    for kind, text in (*wrong, ("vertical", "0:1,2:3,4:2.44:3")):
        with pytest.raises(KeyreconError, match=f"--{kind} needs FRAME:X,Y:X,Y"):
            ground_mark(kind, text)
