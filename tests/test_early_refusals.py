"""What cannot be is refused before any work is done, in one line that names the way on."""

import json
import sys

import numpy as np
import pytest
from command_line import keyrecon as call
from small_motion import make_motion

from keyrecon.errors import KeyreconError
from keyrecon.io.formats.motion_file import write_motion
from keyrecon.io.workspace import Workspace
from keyrecon.records import CameraPath, Colors, TrackAnchors
from keyrecon.shots.following import FollowOptions, follow_player
from keyrecon.tracking.shot_sorting import ShotOptions


@pytest.fixture
def keyrecon(capsys):
    """Run a command line; returns (exit code, stdout, stderr)."""

    def run(*words):
        capsys.readouterr()
        code = call(*words)
        return code, *capsys.readouterr()

    return run


@pytest.fixture
def project(tmp_path, write_numbered, keyrecon):
    video = tmp_path / "video.mp4"
    video.write_bytes(write_numbered("v.mp4", list(range(0, 240, 12))).read_bytes())
    assert keyrecon("new", video, "--project", tmp_path / "p")[0] == 0
    return tmp_path / "p"


def one_line(told, *words, code=1):
    found, _, err = told
    assert found == code
    assert err.count("\n") == 1, err
    for word in words:
        assert word in err
    return True


def marks(x=10.0):
    return {
        "images": [{"id": 1, "file_name": "f.png", "width": 128, "height": 64, "frame": 3}],
        "annotations": [{"id": 1, "image_id": 1, "category_id": 1, "keypoints": [x, 20, 2]}],
        "categories": [{"id": 1, "name": "person", "keypoints": ["neck"], "skeleton": []}],
    }


@pytest.mark.parametrize(("suffix", "extra"), [(".c3d", "[c3d]"), (".nc", "[netcdf]")])
def test_a_format_whose_package_is_missing_is_told_before_any_file_is_written(
    keyrecon, project, tmp_path, monkeypatch, suffix, extra
):
    write_motion(project / "motion.npz", make_motion(20))
    monkeypatch.setitem(sys.modules, "c3d", None)
    monkeypatch.setitem(sys.modules, "h5netcdf", None)
    told = keyrecon("export", project, tmp_path / "a.trc", tmp_path / f"a{suffix}")
    assert one_line(told, extra, "pip install")
    assert not (tmp_path / "a.trc").exists()


@pytest.mark.parametrize("model", ["--depths", "--sides"])
def test_a_model_that_is_not_there_is_told_before_any_stage(keyrecon, project, model):
    assert one_line(keyrecon("run", project, model, "nope.npz"), "nope.npz")


@pytest.mark.parametrize("shots", [ShotOptions(use="7"), ShotOptions(skip="7")])
@pytest.mark.parametrize("cuts", [(), (10,)])
def test_a_shot_that_is_not_there_is_told_as_soon_as_shots_are_known(shots, cuts, project):
    def keep(*_, **__):
        raise AssertionError("a stage was run")

    camera, colors = object.__new__(CameraPath), object.__new__(Colors)
    object.__setattr__(camera, "cuts", cuts)
    video = Workspace(project).video()
    options = FollowOptions(shots=shots)
    with pytest.raises(KeyreconError, match="got '7'"):
        follow_player(video, camera, colors, (), TrackAnchors.none(), options, keep)


@pytest.mark.parametrize("verb", ["run", "keyframes"])
def test_a_project_that_cannot_be_written_is_told_first(keyrecon, project, verb):
    (project / ".change.lock").mkdir()  # not even who runs as root can write that file
    assert one_line(keyrecon(verb, project), "make it writable")


@pytest.mark.parametrize("height", ["1.88", "188", "1.88m", "188cm", "1,88"])
def test_a_height_is_told_in_metres_or_centimetres(keyrecon, project, height, monkeypatch):
    heard = []
    monkeypatch.setattr(
        "keyrecon.app.running.run", lambda _, chosen, *__, **___: heard.append(chosen) or ""
    )
    code, _, err = keyrecon("run", project, f"--height={height}")
    assert (code, err) == (0, "")
    assert heard[0].lift.height == pytest.approx(1.88)


def test_the_angle_of_the_camera_reaches_the_lift(keyrecon, project, monkeypatch):
    heard = []
    monkeypatch.setattr(
        "keyrecon.app.running.run", lambda _, chosen, *__, **___: heard.append(chosen) or ""
    )
    assert keyrecon("run", project, "--fov", "36")[0] == 0
    assert heard[0].lift.field_of_view == 36
    assert one_line(keyrecon("run", project, "--fov", "0"), "--fov is the angle across")


@pytest.mark.parametrize("height", ["tall", "18.8", "0.3", "nan", "400"])
def test_a_height_that_nobody_has_is_told_with_those_there_are(keyrecon, project, height):
    told = keyrecon("run", project, "--height", height)
    assert one_line(told, f"'{height}'", "0.5 to 2.6 metres", "50 to 260 centimetres")


def test_an_example_of_picks_has_both_feet(keyrecon, project):
    assert keyrecon("pick", "--help")[1].count("--foot 6") == 2
    assert keyrecon("keyframes", project)[2].count("--foot X,Y") == 2


def test_a_video_in_the_place_of_a_project_leads_to_a_new_project(keyrecon, project, tmp_path):
    told = keyrecon("run", tmp_path / "video.mp4")
    assert one_line(told, "is a file", f"keyrecon new {tmp_path}/video.mp4 --project ")
    assert f"--project {tmp_path}/video.mp4" not in told[2]


def test_a_video_that_is_not_there_is_told_with_the_way_on(keyrecon, tmp_path):
    assert one_line(keyrecon("new", tmp_path, "--project", tmp_path / "p"), "is a folder", "file")
    told = keyrecon("new", tmp_path / "nope.mp4", "--project", tmp_path / "p")
    assert one_line(told, "no video at", "check the path")


def test_a_project_without_a_swing_is_not_proposed_as_the_place_of_a_fit(keyrecon, project):
    write_motion(project / "motion.npz", make_motion(20))
    told = keyrecon("golf", "compare", project, project)
    assert one_line(told, "golf fit", "--out FOLDER")


def test_an_emptied_file_of_marks_is_told_with_what_restores_it(keyrecon, project, tmp_path):
    file = tmp_path / "marks.json"
    for x in (10.0, 90.0):
        file.write_text(json.dumps(marks(x)))
        assert keyrecon("import", project, file, "--replace")[0] == 0
    (project / "annotations.json").write_text("")
    assert one_line(
        keyrecon("keyframes", project), "annotations.old-1.json", f"keyrecon import {project} FILE"
    )


def test_a_mark_far_outside_the_picture_is_to_be_mended_first(keyrecon, project, tmp_path):
    from keyrecon.body import LSP14
    from keyrecon.io.formats.coco import write_coco
    from keyrecon.records import Annotations

    joints = np.full((1, 14, 2), np.nan)
    joints[0, :] = np.linspace((30, 12), (38, 52), 14)
    signs = np.zeros((1, len(LSP14.bones)), dtype=np.int64)
    seen = np.ones((1, 14), dtype=bool)

    def imported():
        body = Annotations(LSP14, np.array([3]), joints, seen, signs)
        write_coco(tmp_path / "marks.json", body, (128, 64))
        return keyrecon("import", project, tmp_path / "marks.json", "--replace")[1]

    assert "mend" not in imported()
    joints[0, 3] = 250, 50
    assert "Next: mend" in imported()


def test_a_share_that_is_none_is_told_by_the_option_that_was_typed(keyrecon, project):
    told = keyrecon("keyframes", project, "--coverage", "95")
    assert one_line(told, "--coverage cannot be 95", "from 0.01 to 1")
    told = keyrecon("keyframes", project, "--reach", "0")
    assert one_line(told, "--reach cannot be 0")


@pytest.mark.parametrize("verb", ["run", "keyframes"])
@pytest.mark.parametrize(
    ("option", "value"),
    [("depths", "mine.npz"), ("depths", "built-in"), ("track.method", "filters")],
)
def test_an_option_that_the_printed_forms_replace_is_refused_beside_them(
    keyrecon, project, verb, option, value
):
    told = keyrecon(verb, project, "--method", "paper", f"--{option}", value)
    assert one_line(told, f"--{option} {value}", "--method paper", "leave out one of the two")
    told = keyrecon(verb, project, "--method", "paper", "--depths", "none")
    assert one_line(told, "no picks yet" if verb == "keyframes" else "keyrecon pick")


VERBS = {
    "run": ("keyrecon.app.running.prepare_project", ("--height", "1.75", "--fov", "60")),
    "keyframes": ("keyrecon.app.keyframing.prepare_project", ("--budget", "0.05")),
    "court": ("keyrecon.app.court.estimate_camera_motion", ("--line-width", "0.04")),
}


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize(("ending", "code"), [(KeyboardInterrupt, 130), (KeyreconError, 1)])
def test_options_of_a_command_that_was_interrupted_are_kept_and_of_a_refused_one_not(
    keyrecon, project, monkeypatch, verb, ending, code
):
    def end(*_, **__):
        raise ending("in the middle of it")

    work, words = VERBS[verb]
    before = (project / "project.toml").read_text()
    monkeypatch.setattr(work, end)
    monkeypatch.setattr("keyrecon.app.running.asked_for", lambda *_: None)
    monkeypatch.setattr("keyrecon.app.running.annotated", lambda *_: None)
    assert keyrecon(verb, project, *words)[0] == code
    after = (project / "project.toml").read_text()
    if ending is KeyreconError:
        assert after == before
    else:
        assert all(value in after for value in words if value[0] != "-")
