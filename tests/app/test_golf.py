"""A golf fit in its project folder: kept, resumed, exported, and read from the video once."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import pytest
from small_swing import QUICK, count_decoded, fit

from keyrecon.app import golf as app
from keyrecon.app.exporting import export
from keyrecon.app.golf import GolfFit, fit_file, fit_video
from keyrecon.app.golf_comparing import compare
from keyrecon.app.project import start
from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.golf.records import NO_MARKS, MotionModel, SwingMarks
from keyrecon.golf.swing_fit import GolfOptions
from keyrecon.io.formats.clicks import read_clicks
from keyrecon.io.formats.golf_marks import write_golf_marks
from keyrecon.io.formats.model_file import read_motion_model
from keyrecon.io.formats.motion_file import read_motion
from keyrecon.io.formats.swing_file import read_swing
from keyrecon.io.held_video import mirror_video
from keyrecon.io.provenance import RunNotes, note_run, read_run
from keyrecon.io.stages import StageStore
from keyrecon.io.video import Video, open_video
from keyrecon.io.video_writer import write_video
from keyrecon.io.workspace import GOLF, Workspace
from keyrecon.lifting.lifting import LiftOptions
from keyrecon.metrics import read_truth
from keyrecon.pipeline import Options
from keyrecon.progress import silent
from keyrecon.records import SOURCES


@pytest.fixture(scope="module")
def swing(tmp_path_factory, fitted_swing):
    """A small film of a swing, its clicks, and in `project` a finished fit that may be changed."""
    return shutil.copytree(fitted_swing, tmp_path_factory.mktemp("golf") / "swing")


@pytest.fixture(scope="module")
def first_fit(swing):
    """What the fit in `project` told, and how many frames it decoded."""
    told = json.loads((swing / "told.json").read_text())
    return told["said"], told["decoded"]


def test_a_fit_decodes_its_video_at_most_twice(swing, first_fit):
    frames = len(open_video(swing / "video.mp4"))
    assert frames <= first_fit[1] <= 2 * frames


def test_a_fit_that_is_repeated_tells_the_same_and_decodes_nothing(swing, first_fit):
    with count_decoded() as decoded:
        assert fit(swing, swing / "project").split("\n")[0] == first_fit[0].split("\n")[0]
    assert len(decoded) == 0


def test_a_fit_tells_the_frames_of_the_key_postures(swing, first_fit):
    assert first_fit[0].startswith("Upswing from frame ")
    keys = np.array([float(part.split(" ")[-1]) for part in first_fit[0].split(";")[0].split(",")])
    assert np.abs(keys - read_truth(swing / "truth.npz")["keys"]).max() < 8


def test_a_doubtful_fit_tells_no_tempo(swing):
    """Its report and its page show none either."""
    kept = read_swing(swing / "project" / "motion.npz")
    assert "tempo" in app.describe_tempo(replace(kept, doubts=()))
    told = app.describe_tempo(replace(kept, doubts=("only 40% of the joints lie on the player",)))
    assert "hit" in told and "tempo" not in told and " s up" not in told


def test_a_fit_lives_in_a_project_like_any_other(swing):
    folder = swing / "project"
    names = {file.name for file in folder.iterdir()}
    assert names >= {
        "project.toml", "golf_clicks.json", "cache", "motion.npz", "golf.csv", "overlay.mp4",
        "report.html",
    }  # fmt: skip
    workspace = Workspace(folder)
    assert workspace.options(GolfOptions(), GolfOptions(), GOLF) == QUICK
    export(workspace, [folder / "swing.csv"], silent)
    assert len((folder / "swing.csv").read_text().splitlines()) > len(workspace.video())


def test_motion_npz_tells_club_and_key_postures(swing):
    kept = read_swing(swing / "project" / "motion.npz")
    assert np.abs(kept.keys - read_truth(swing / "truth.npz")["keys"]).max() < 8
    length = np.linalg.norm(kept.club[:, 1] - kept.club[:, 0], axis=1)
    np.testing.assert_allclose(length, length[0], rtol=1e-6)
    assert not kept.left_handed


def test_two_fits_stand_side_by_side_on_a_page(swing, tmp_path, chromium):
    """The page shows both swings in the same posture, and its script has nothing to complain of."""
    project = swing / "project"
    page, complaints = chromium.new_page(), []
    page.on("pageerror", lambda fault: complaints.append(str(fault)))
    compare(project, project, tmp_path / "two.html", silent)
    for file, count in ((tmp_path / "two.html", 2), (project / "report.html", 1)):
        page.goto(file.as_uri())
        page.wait_for_function("document.querySelector('[data-now]').textContent")
        page.click("[data-key='2']")
        shown = page.eval_on_selector_all("[data-now]", "all => all.map(e => e.textContent)")
        assert len(shown) == count
        assert len(set(shown)) == 1
        assert shown[0].endswith("hit")
    page.close()
    assert complaints == []


def test_a_mirrored_film_of_a_left_hander_gives_the_mirrored_swing_to_the_digit(swing, tmp_path):
    """Its stages are those of the film as it was: all are found, none is run."""
    store = StageStore(shutil.copytree(swing / "project" / "cache", tmp_path / "cache"))
    clicks = read_clicks(swing / "clicks.json")
    other = {"right": "left", "left": "right"}
    joints = {}
    for name, (x, y) in clicks.joints.items():
        side, _, rest = name.partition("_")
        joints[f"{other[side]}_{rest}" if side in other else name] = (clicks.size[0] - 1 - x, y)
    clicks = replace(clicks, joints=joints, left_handed=True)
    video = mirror_video(open_video(swing / "video.mp4"))
    ours = fit_video(video, clicks, read_motion_model(), QUICK, store.keep)
    assert set(store.seconds) == {"mirrored"}
    theirs = read_swing(swing / "project" / "motion.npz")
    mirror, flip = LSP14.mirror, [-1.0, 1.0, 1.0]
    assert np.array_equal(ours.fitted.motion.points3d[:, mirror] * flip, theirs.motion.points3d)
    assert np.array_equal(ours.fitted.club * flip, theirs.club)
    assert np.array_equal(ours.fitted.keys, theirs.keys)
    across = clicks.size[0] - 1 - ours.fitted.motion.points2d[:, mirror, 0]
    np.testing.assert_allclose(across, theirs.motion.points2d[..., 0], atol=1e-9)
    assert ours.observations.left_handed


def test_a_page_never_takes_the_place_of_a_report(swing):
    project = swing / "project"
    with pytest.raises(KeyreconError, match="belongs to the project"):
        compare(project, project, project / "report.html", silent)


def test_an_interrupted_fit_goes_on_where_it_stopped(swing, tmp_path):
    project = shutil.copytree(swing / "project", tmp_path / "p")
    (result,) = (project / "cache").glob("result_1-*.npz")
    result.unlink()
    (project / "motion.npz").unlink()
    before = {file: file.stat().st_mtime_ns for file in (project / "cache").glob("*.npz")}
    # camera, film, scene, hands, search, observe_1, fit_1, guided_1_1, timing_1, found
    assert len(before) == 10
    fit(swing, project)
    assert result.is_file() and all(f.stat().st_mtime_ns == at for f, at in before.items())
    ours, theirs = (read_motion(f / "motion.npz") for f in (project, swing / "project"))
    assert np.array_equal(ours.points3d, theirs.points3d)


def test_a_fit_forgets_what_was_noted_of_the_run_whose_motion_it_replaces(bare, monkeypatch):
    (bare / "cache").mkdir()
    note_run(Workspace(bare), RunNotes("of another motion", ("The player found jumps",)))
    writers = ("_record", "write_golf_overlay", "write_golf_report", "write_golf_table")
    for name in (*writers, "write_swing"):
        monkeypatch.setattr(app, name, lambda *_: None)
    inputs = [MagicMock() for _ in range(3)]
    for made_up, kind in zip(inputs, (Video, GolfFit, MotionModel), strict=True):
        made_up.__class__ = kind
    app.write_results(Workspace(bare), *inputs, silent)
    assert read_run(Workspace(bare)) is None


def test_a_project_of_another_video_is_left_alone(swing, tmp_path):
    other = tmp_path / "other.mp4"
    size = open_video(swing / "video.mp4")
    picture = np.zeros((size.height, size.width, 3), np.uint8)
    write_video(other, (picture for _ in range(25)), 24.0)
    with pytest.raises(KeyreconError, match="is the project of another video"):
        fit_file(other, swing / "clicks.json", swing / "project", options=QUICK)


def test_a_project_with_keyframes_takes_a_fit_too_and_keeps_the_options_of_both(swing, tmp_path):
    video = open_video(swing / "video.mp4")
    workspace = Workspace.create(tmp_path / "p", video, Path(swing / "video.mp4"), {})
    assert not workspace.is_golf
    height = Options(lift=LiftOptions(height=1.7))
    workspace.remember(height, Options())
    shutil.copytree(swing / "project" / "cache", tmp_path / "p" / "cache")
    fit(swing, tmp_path / "p")
    workspace = Workspace(tmp_path / "p")
    assert workspace.is_golf
    assert workspace.options(GolfOptions(), GolfOptions(), GOLF) == QUICK
    assert workspace.options(Options(), Options()) == height


def test_a_project_with_keyframes_gets_the_pages_of_a_swing_when_a_fit_is_asked_for(
    swing, tmp_path
):
    video = open_video(swing / "video.mp4")
    Workspace.create(tmp_path / "p", video, Path(swing / "video.mp4"), {})
    file = tmp_path / "p" / "project.toml"
    file.write_text(f"# mine\n{file.read_text()}\n[options]\nkeyframes.budget = 0.05 # mine too\n")
    with pytest.raises(KeyreconError, match="on the page"):
        fit_file(swing / "video.mp4", None, tmp_path / "p", options=QUICK)
    workspace = Workspace(tmp_path / "p")
    assert workspace.is_golf
    assert workspace.options(Options(), Options()).keyframes.budget == 0.05
    assert file.read_text().count("mine") == 2


def test_options_of_a_former_golf_project_are_still_known(swing, tmp_path):
    video = open_video(swing / "video.mp4")
    workspace = Workspace.create(tmp_path / "p", video, Path(swing / "video.mp4"), {})
    with workspace.project_file.open("a") as file:
        file.write(
            "[options]\nfit.components = 4\nfit.steps = 3\nguided_rounds = 1\ncandidates = 1\n"
        )
    workspace = Workspace(tmp_path / "p")
    assert workspace.options(GolfOptions(), GolfOptions(), GOLF) == QUICK
    assert workspace.options(Options(), Options()) == Options()
    workspace.remember(GolfOptions(candidates=2), GolfOptions(), GOLF)
    assert "golf.candidates = 2" in workspace.project_file.read_text()
    assert "fit." not in workspace.project_file.read_text()


def test_without_clicks_a_project_is_made_and_it_says_where_to_click(swing, tmp_path):
    with pytest.raises(KeyreconError, match="Click six joints of the address on the page"):
        fit_file(swing / "video.mp4", None, tmp_path / "p", options=QUICK)
    assert Workspace(tmp_path / "p").is_golf


def test_a_fit_without_a_file_takes_the_clicks_of_its_project(swing, first_fit):
    told = fit_file(swing / "video.mp4", None, swing / "project", options=QUICK)
    assert told.split("\n")[0] == first_fit[0].split("\n")[0]


def test_a_new_golf_project_tells_of_its_page(swing, tmp_path):
    told = start(swing / "video.mp4", tmp_path / "p", golf=True)
    assert "keyrecon annotate" in told
    assert Workspace(tmp_path / "p").is_golf
    with pytest.raises(KeyreconError, match="its own skeleton"):
        start(swing / "video.mp4", tmp_path / "q", skeleton=tmp_path / "s.json", golf=True)


def test_what_a_person_marked_holds(swing, tmp_path):
    """Joints to 5 px though they are marked 17 px off, shafts, and instants exactly, others in
    order."""
    project = shutil.copytree(swing / "project", tmp_path / "p")
    video, truth = open_video(swing / "video.mp4"), read_truth(swing / "truth.npz")
    top = round(float(truth["keys"][1])) + 2
    frames = np.array([top - 6, top, top + 4])
    joints = np.full((3, 14, 2), np.nan)
    for name in ("left_wrist", "left_elbow", "right_knee"):
        joints[:, LSP14.index(name)] = truth["points2d"][frames, LSP14.index(name)] + (15, -9)
    shafts = np.full((3, 2, 2), np.nan)
    shafts[2] = truth["club2d"][frames[2]]
    marks = SwingMarks(frames, joints, shafts, np.array([np.nan, top, np.nan, np.nan]))
    write_golf_marks(Workspace(project).golf_marks_file, marks, (video.width, video.height))
    text = fit(swing, project)
    assert f"top {top}, hit" in text
    kept = read_swing(project / "motion.npz")
    away = np.linalg.norm(kept.motion.points2d[frames] - joints, axis=2)
    assert np.nanmax(away) < 5
    assert (np.diff(kept.keys) > 0).all() and kept.keys[1] == top
    marked = np.isfinite(joints[..., 0])
    assert (kept.motion.source[frames][marked] == SOURCES.index("annotated")).all()
    np.testing.assert_allclose(kept.club2d[frames[2]], shafts[2], atol=1.0)


def test_marks_of_another_video_are_refused(swing, tmp_path):
    project = shutil.copytree(swing / "project", tmp_path / "p")
    write_golf_marks(Workspace(project).golf_marks_file, NO_MARKS, (64, 48))
    with pytest.raises(KeyreconError, match="marks were made on pictures of 64 x 48"):
        fit(swing, project)


def test_a_slow_motion_may_be_told_later_and_another_needs_another_folder(swing, tmp_path):
    project, video = shutil.copytree(swing / "project", tmp_path / "p"), swing / "video.mp4"
    opened = app.open_golf_project(project, open_video(video), None, slow_motion=1.5)
    assert opened.project["video"]["slow_motion"] == 1.5
    with pytest.raises(KeyreconError, match=r"made with --slowmo 1\.5"):
        app.open_golf_project(project, open_video(video), None, slow_motion=2.0)


def test_other_clicks_stay_beside_the_new_ones(swing, tmp_path):
    video = open_video(swing / "video.mp4")
    clicks = swing / "clicks.json"
    app.open_golf_project(tmp_path / "p", video, clicks)
    moved = tmp_path / "moved.json"
    moved.write_text(clicks.read_text() + "\n")
    app.open_golf_project(tmp_path / "p", video, moved)
    assert (tmp_path / "p" / "golf_clicks.json").read_text() == moved.read_text()
    assert (tmp_path / "p" / "golf_clicks.old-1.json").read_text() == clicks.read_text()
