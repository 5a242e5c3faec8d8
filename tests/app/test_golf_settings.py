"""What is told of a golf fit counts at once, and until something else is told."""

import shutil
from dataclasses import replace

import pytest
from small_swing import QUICK

from keyrecon.app import golf as app
from keyrecon.app.annotator import job_commands
from keyrecon.app.golf import BUILT_IN, GolfSettings, fit_file, open_golf_project
from keyrecon.app.project import start
from keyrecon.errors import KeyreconError
from keyrecon.golf.swing_fit import GolfOptions
from keyrecon.io.formats.model_file import read_motion_model, write_motion_model
from keyrecon.io.provenance import golf_digest, is_fitted, note_fitted
from keyrecon.io.video import open_video
from keyrecon.io.workspace import GOLF, Workspace
from keyrecon.progress import silent


@pytest.fixture
def swing(tmp_path, fitted_swing):
    """A film in a folder with its project."""
    return shutil.copytree(fitted_swing, tmp_path / "swing")


@pytest.fixture
def fitted_with(monkeypatch):
    """Options and prior of every fit; what is really made is the one that the project holds."""
    seen, fit_video = [], app.fit_video

    def spy(video, clicks, model, options, *more):
        seen.append((options, model))
        return fit_video(video, clicks, read_motion_model(), QUICK, *more)

    monkeypatch.setattr(app, "fit_video", spy)
    return seen


def test_a_method_that_is_told_counts_also_where_it_is_the_usual_one(swing, fitted_with):
    for method in ("windows", None, "swing", None):
        told = GolfSettings(method)
        fit_file(swing / "video.mp4", None, swing / "project", settings=told)
    methods = [options.method for options, _ in fitted_with]
    assert methods == ["windows", "windows", "swing", "swing"]
    most = GolfOptions().fit.components
    fit_file(swing / "video.mp4", None, swing / "project", settings=GolfSettings(components=most))
    assert fitted_with[-1][0].fit.components == most
    remembered = Workspace(swing / "project").options(GolfOptions(), GolfOptions(), GOLF)
    assert remembered == replace(QUICK, fit=replace(QUICK.fit, components=most))


def test_a_fit_that_was_interrupted_leaves_the_one_before_out_of_date(swing, monkeypatch):
    """The project keeps what was told of the new one, which made nothing yet."""
    project = Workspace(swing / "project")

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(app, "fit_video", interrupted)
    note_fitted(project, golf_digest(project))
    assert is_fitted(project)
    with pytest.raises(KeyboardInterrupt):
        fit_file(swing / "video.mp4", None, project.folder, settings=GolfSettings("windows"))
    assert not is_fitted(project)


def test_a_fit_is_out_of_date_when_slow_motion_is_said_not_to_be(swing):
    project = Workspace(swing / "project")
    note_fitted(project, golf_digest(project))
    project.set_slow_motion(1.0)
    assert not is_fitted(project)


def test_a_fit_on_the_page_goes_on_with_the_prior_of_the_project(swing, fitted_with):
    project, model = swing / "project", read_motion_model()
    few = replace(model, components=model.components[:5], explained=model.explained[:5])
    write_motion_model(swing / "mine.npz", few)
    fit_file(swing / "video.mp4", None, project, settings=GolfSettings(prior=swing / "mine.npz"))
    assert 'prior = "../mine.npz"' in (project / "project.toml").read_text()
    job_commands(project)["golf"]({}, silent)
    assert [len(model.components) for _, model in fitted_with] == [5, 5]
    (swing / "mine.npz").unlink()
    with pytest.raises(KeyreconError, match=r"no swing prior at .*mine\.npz; name .*--prior FILE"):
        job_commands(project)["golf"]({}, silent)
    fit_file(swing / "video.mp4", None, project, settings=GolfSettings(prior=BUILT_IN))
    assert len(fitted_with[-1][1].components) == len(model.components)
    assert "prior" not in (project / "project.toml").read_text()


@pytest.mark.parametrize(("told", "searched"), [(None, True), (1.0, False)])
def test_slow_motion_is_searched_for_unless_somebody_told_of_it(swing, fitted_with, told, searched):
    project = swing / "project"
    fit_file(swing / "video.mp4", None, project, slow_motion=told)
    job_commands(project)["golf"]({}, silent)
    found = [options.observation.find_slow_motion for options, _ in fitted_with]
    assert found == [searched, searched]
    assert ("slow_motion = 1" in (project / "project.toml").read_text()) == (told is not None)
    assert "find_slow_motion" not in (project / "project.toml").read_text()


def test_a_new_project_keeps_a_speed_that_is_told(swing, tmp_path):
    for number, told in enumerate((None, 1.0)):
        start(swing / "video.mp4", tmp_path / str(number), slow_motion=told, golf=True)
        kept = Workspace(tmp_path / str(number)).project["video"].get("slow_motion")
        assert kept == told
    open_golf_project(tmp_path / "2", open_video(swing / "video.mp4"), None, slow_motion=1.0)
    assert Workspace(tmp_path / "2").project["video"]["slow_motion"] == 1


def test_a_slow_motion_that_is_told_is_never_passed_over(swing):
    file = swing / "project" / "project.toml"
    file.write_text(file.read_text().replace("[video]\n", "[video]\nslow_motion = 1.5\n"))
    with pytest.raises(KeyreconError, match=r"made with --slowmo 1\.5; .* for --slowmo 1"):
        fit_file(swing / "video.mp4", None, swing / "project", 1.0)
