"""What keyrecon court and keyrecon run do to a project's motion."""

from dataclasses import replace

import numpy as np
import pytest
from court_walker import court_camera, lifted, walk
from painted_court import camera_at, paint

from keyrecon import cli
from keyrecon.annotate.assist.court_views import describe_court
from keyrecon.annotate.server.descriptions import describe_run
from keyrecon.annotate.server.page_words import in_page_words
from keyrecon.app import court as appcourt
from keyrecon.app.annotator import _motion_notes, job_commands
from keyrecon.app.court import calibrate, court_click, describe_camera
from keyrecon.app.placing import outdated_report_lines, place_stored_motion, write_placed_motion
from keyrecon.app.project import start
from keyrecon.commands import court as commands
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.camera_file import read_camera, write_camera
from keyrecon.io.formats.motion_file import write_motion
from keyrecon.io.provenance import RunNotes, camera_digest, note_run
from keyrecon.io.video_writer import write_video
from keyrecon.io.workspace import COURT, Workspace
from keyrecon.pipeline import Options
from keyrecon.progress import silent
from keyrecon.world.calibration import CalibrationOptions
from keyrecon.world.court import POINTS, CourtOptions
from keyrecon.world.records import CourtClick

PINHOLE = camera_at((2, -20, 3), (0, -9, 0.8), 1.6)
BROADCAST = camera_at((0.4, -32, 9), (0, -2, 0), 1.5)


@pytest.fixture(scope="module")
def motion():
    return lifted(walk()[0], PINHOLE)


def stored(workspace):
    with np.load(workspace.motion_file) as file:
        return {name: file[name] for name in file.files}


def test_without_a_camera_the_motion_is_as_it_was(bare, motion):
    workspace = Workspace(bare)
    assert write_placed_motion(workspace, motion).lines == ()
    assert "points3d_world" not in stored(workspace)


def test_with_a_camera_the_motion_is_on_the_court_too(bare, motion):
    workspace = Workspace(bare)
    write_placed_motion(workspace, motion)
    before = stored(workspace)
    write_camera(workspace.camera_file, court_camera(PINHOLE, len(motion.time)))
    placed = write_placed_motion(workspace, motion)
    (line,) = placed.lines
    assert "m run, top speed" in line
    assert placed.doubts == ()
    after = stored(workspace)
    assert all(np.array_equal(before[name], after[name]) for name in before)
    assert after["root_world"].shape == (len(motion.time), 3)


def test_a_report_does_not_know_a_camera_that_came_after_it(bare, motion):
    workspace = Workspace(bare)
    (bare / "cache").mkdir(exist_ok=True)
    write_camera(workspace.camera_file, court_camera(PINHOLE, len(motion.time)))
    placed = write_placed_motion(workspace, motion)
    assert outdated_report_lines(workspace, placed) == []  # there is no report
    workspace.report_file.write_text("a report")
    for camera, lacks, count in (("", "court", 1), (camera_digest(workspace), None, 0)):
        note_run(workspace, RunNotes("marks", (), (), camera))
        assert describe_run(workspace, 1, None)["report_lacks"] == lacks
        lines = outdated_report_lines(workspace, placed)
        assert len(lines) == count
    (line,) = _motion_notes("\n".join(["Court found in 100.0% of 7 frames.", *placed.lines]))
    assert "m run, top speed" in line and "way.jpg" not in line


def test_no_run_is_asked_for_to_mend_the_report_of_a_golf_fit(bare, motion):
    """It would make another motion, of keyframes, and no report of a swing knows a camera."""
    workspace = Workspace(bare)
    workspace.become_golf()
    workspace.report_file.write_text("the report of a fit")
    write_camera(workspace.camera_file, court_camera(PINHOLE, len(motion.time)))
    placed = write_placed_motion(workspace, motion)
    assert outdated_report_lines(workspace, placed) == []
    (bare / "cache").mkdir(exist_ok=True)
    note_run(workspace, RunNotes("marks", (), (), ""))  # the motion and the report are of a run
    assert len(outdated_report_lines(workspace, placed)) == 1


def test_a_camera_that_makes_a_giant_of_the_player_puts_nothing_on_the_court(bare, motion):
    workspace = Workspace(bare)
    far = replace(PINHOLE, centre=PINHOLE.centre * [1, 1, 2.0])
    write_camera(workspace.camera_file, court_camera(far, len(motion.time)))
    (line,) = write_placed_motion(workspace, motion).lines
    assert "times the height given" in line
    assert "points3d_world" not in stored(workspace)


def test_a_camera_of_another_trim_is_told_of(bare, motion):
    workspace = Workspace(bare)
    write_camera(workspace.camera_file, court_camera(PINHOLE, 7))
    placed = write_placed_motion(workspace, motion)
    (line,) = placed.doubts
    assert placed.lines == (line,)
    assert "made for 7 frames" in line
    assert "points3d_world" not in stored(workspace)


def test_frames_without_the_court_are_listed():
    camera = court_camera(PINHOLE, 20)
    found = camera.found.copy()
    found[5:8] = False
    lines = describe_camera(replace(camera, found=found))
    assert "20.0 m from the net, 2.0 m to the right" in lines[0]
    assert lines[1] == "No court seen in frames 5-7."


def test_a_shot_of_the_court_from_another_place_is_not_said_to_show_none():
    camera = court_camera(PINHOLE, 20)
    found = camera.found.copy()
    found[5:15] = False
    told = describe_camera(replace(camera, found=found, elsewhere=(8,)), (8, 15))
    assert told[1] == "No court seen in frames 5-7."
    assert "Shot 2 (frames 8-14) shows the court from another place" in told[2]


def test_a_point_is_named_framed_and_placed():
    click = court_click("near-left:12:40.5,300")
    assert (click.name, click.frame, click.x, click.y) == ("near-left", 12, 40.5, 300.0)
    with pytest.raises(KeyreconError, match="NAME:FRAME:X,Y"):
        court_click("near-left:40,300")


@pytest.fixture
def filmed(tmp_path):
    """A project of a short film of a court, by a camera that stands still."""
    pictures = [np.repeat(paint(BROADCAST, seed=t)[..., None], 3, axis=2) for t in range(4)]
    write_video(tmp_path / "v.mp4", pictures, 25.0)
    start(tmp_path / "v.mp4", tmp_path / "p")
    return tmp_path / "p"


def clicks_on(*names, aside=0.0):
    """Clicks on points of the court in frame 1; the last one lies `aside` px beside its point."""
    pixels = BROADCAST.project(np.array([POINTS[name] for name in names]))
    pixels[-1, 0] += aside
    return [CourtClick(n, 1, float(x), float(y)) for n, (x, y) in zip(names, pixels, strict=True)]


def calibrated(folder, *clicks, forget=()):
    return calibrate(Workspace(folder), clicks, CalibrationOptions(), silent, forget)


def test_points_that_were_clicked_are_kept_and_used_again(filmed):
    calibrated(filmed, *clicks_on("near-left", "near-right"))
    first = clicks_on("near-left", "near-right")
    assert Workspace(filmed).court_clicks() == tuple(first)
    assert "By 4 clicked points" in calibrated(filmed, *clicks_on("net-middle", "far-left"))
    assert "By 4 clicked points" in calibrated(filmed)
    again = calibrated(filmed, *clicks_on("far-left", aside=0.5), forget=["near-left"])
    assert "By 3 clicked points" in again
    assert "By" not in calibrated(filmed, forget=["all"])
    with pytest.raises(KeyreconError, match="no click on near-left to forget; it has none"):
        calibrated(filmed, forget=["near-left"])


def test_the_page_tells_why_there_is_no_way_on_the_court(filmed, motion):
    workspace = Workspace(filmed)
    find_court = job_commands(filmed)["court"]
    assert find_court({}, silent) == ""
    write_motion(workspace.motion_file, motion)
    text = find_court({}, silent)
    assert text.startswith("No way on the court: camera.npz was made for 4 frames")
    assert "keyrecon" not in in_page_words(text)


def test_how_lines_are_painted_is_remembered(filmed):
    middles = CalibrationOptions(CourtOptions(0.0, 0.0))
    calibrate(Workspace(filmed), (), middles, silent)
    to_middles = read_camera(Workspace(filmed).camera_file)
    workspace = Workspace(filmed)
    calibrated(filmed)
    assert np.array_equal(read_camera(workspace.camera_file).t, to_middles.t)
    assert workspace.options(Options(), Options()) == Options()


@pytest.mark.parametrize("typed", ["5", "1e9", "-1", "nan", "0.31"])
def test_a_width_that_no_line_has_is_refused_and_not_remembered(bare, monkeypatch, capsys, typed):
    before = (bare / "project.toml").read_text()
    for flag in ("--line-width", "--baseline-width"):
        monkeypatch.setattr("sys.argv", ["keyrecon", "court", str(bare), flag, typed])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        assert ended.value.code == 1
        told = capsys.readouterr().err
        assert f"{flag} cannot be {float(typed)}; it is a number from 0 to 0.3." in told
        assert (bare / "project.toml").read_text() == before


def test_a_width_that_the_project_remembers_is_told(filmed):
    assert "project.toml" not in calibrated(filmed)
    kept = CalibrationOptions(CourtOptions(baseline_width=0.05))
    calibrate(Workspace(filmed), (), kept, silent)
    told = calibrated(filmed)
    assert "project.toml remembers --baseline-width 0.05 (usual: 0.1)" in told


def test_a_remembered_width_that_no_line_has_is_named_as_it_stands_in_the_file(bare):
    with (bare / "project.toml").open("a") as file:
        file.write("\n[options]\ncourt.court.baseline_width = 5.0\n")
    with pytest.raises(
        KeyreconError, match=r"options\.court\.court\.baseline_width cannot be 5\.0"
    ):
        calibrated(bare)


def test_a_width_that_is_typed_counts_also_where_it_is_the_usual_one(bare, monkeypatch):
    counted, usual = [], CalibrationOptions()
    narrow = CalibrationOptions(CourtOptions(line_width=0.03, baseline_width=0.05))
    Workspace(bare).remember(narrow, usual, COURT)

    def spy(workspace, clicks, options, progress, forget, typed):
        counted.append(workspace.options(options, usual, COURT, typed))

    monkeypatch.setattr(commands, "calibrate", spy)
    monkeypatch.setattr("sys.argv", ["keyrecon", "court", str(bare), "--line-width", "0.05"])
    cli.main()
    assert counted == [CalibrationOptions(CourtOptions(line_width=0.05, baseline_width=0.05))]


@pytest.fixture
def grey(tmp_path, motion):
    """A project of a film without a court, with a camera that clicks told and a motion there."""
    pictures = [np.full((64, 128, 3), 90, np.uint8)] * len(motion.time)
    write_video(tmp_path / "v.mp4", pictures, 50.0)
    start(tmp_path / "v.mp4", tmp_path / "p")
    workspace = Workspace(tmp_path / "p")
    workspace.change_court_clicks(ON_GREY)
    write_camera(workspace.camera_file, court_camera(PINHOLE, len(motion.time)))
    write_placed_motion(workspace, motion)
    workspace.report_file.write_text("with the court")
    return workspace


ON_GREY = [CourtClick("near-left", 0, 20.0, 30.0), CourtClick("net-middle", 0, 60.0, 20.0)]


def test_the_camera_of_clicks_that_were_taken_away_is_set_aside_where_no_other_is_found(grey):
    with pytest.raises(KeyreconError, match=r"set aside as camera.old-1.npz.*without the court"):
        calibrated(grey.folder, forget=["net-middle"])
    assert not grey.camera_file.exists() and not (grey.folder / "way.jpg").exists()
    assert read_camera(grey.folder / "camera.old-1.npz").found.all()
    assert "points3d_world" not in stored(grey)
    with pytest.raises(KeyreconError) as told:
        calibrated(grey.folder, forget=["all"])
    assert "set aside" not in str(told.value)


def test_clicks_that_were_taken_away_on_the_page_count_no_more_either(grey):
    with pytest.raises(KeyreconError) as told:
        calibrated(grey.folder)
    assert "set aside" not in str(told.value) and grey.camera_file.is_file()
    grey.change_court_clicks(dropped=ON_GREY)
    with pytest.raises(KeyreconError, match=r"set aside as camera.old-1.npz"):
        job_commands(grey.folder)["court"]({}, silent)
    assert not grey.camera_file.exists()


def test_a_click_made_while_the_court_is_looked_for_is_newer_than_the_camera(grey, monkeypatch):
    def find(*_):
        Workspace(grey.folder).change_court_clicks([CourtClick("net-middle", 0, 64.0, 30.0)])
        return court_camera(PINHOLE, 150), ()

    monkeypatch.setattr(appcourt, "_find_camera", find)
    calibrated(grey.folder)
    assert describe_court(grey)["changed"]
    monkeypatch.setattr(appcourt, "_find_camera", lambda *_: (court_camera(PINHOLE, 150), ()))
    calibrated(grey.folder)
    assert not describe_court(grey)["changed"]


def test_a_motion_that_comes_off_the_court_leaves_no_way_and_an_old_report(grey):
    assert (grey.folder / "way.jpg").is_file()
    far = replace(PINHOLE, centre=PINHOLE.centre * [1, 1, 2.0])
    write_camera(grey.camera_file, court_camera(far, 150))
    placed = place_stored_motion(grey)
    assert not (grey.folder / "way.jpg").exists()
    assert outdated_report_lines(grey, placed) == [
        f"For a report without the court: keyrecon run {grey.folder}"
    ]
    assert outdated_report_lines(grey, place_stored_motion(grey)) == []
    grey.camera_file.unlink()
    assert outdated_report_lines(grey, place_stored_motion(grey)) == []


def test_a_camera_of_more_frames_than_the_motion_asks_for_the_motion(bare, motion):
    workspace = Workspace(bare)
    write_camera(workspace.camera_file, court_camera(PINHOLE, len(motion.time) + 60))
    (line,) = write_placed_motion(workspace, motion).doubts
    assert "made for 210 frames and the motion has 150; make the motion anew with key" in line


def test_a_click_that_contradicts_the_lines_is_named_and_not_kept(filmed):
    good = clicks_on("near-left", "near-right", "net-middle")
    wrong = clicks_on("near-service", aside=60.0)
    for before in ([], good):
        with pytest.raises(KeyreconError, match="The click on near-service contradicts"):
            calibrated(filmed, *before, *wrong)
        assert Workspace(filmed).court_clicks() == ()
    calibrated(filmed, *good)
    with pytest.raises(KeyreconError, match="Clicks of former calls: near-left, near-right, net-m"):
        calibrated(filmed, *wrong)
    assert len(Workspace(filmed).court_clicks()) == 3
