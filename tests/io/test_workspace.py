import os

import pytest

from keyrecon import KeyreconError
from keyrecon.app.project import add_video
from keyrecon.app.running import run_options
from keyrecon.commands.arguments import typed_options
from keyrecon.io.formats.picks import read_picks
from keyrecon.io.video import open_video
from keyrecon.io.work_lock import lock_annotation
from keyrecon.io.workspace import Workspace
from keyrecon.keyframes.selection import KeyframeOptions
from keyrecon.pipeline import Options, with_height
from keyrecon.records import Pick


@pytest.fixture
def project(tmp_path, write_numbered):
    path = tmp_path / "video.mp4"
    path.write_bytes(write_numbered("v.mp4", list(range(0, 240, 12))).read_bytes())
    return Workspace.create(tmp_path / "project", open_video(path), path, {"end": 15})


def test_a_project_finds_its_video_and_trim(project):
    assert len(project.video()) == 15
    assert len(Workspace(project.folder).video()) == 15


def test_a_folder_without_a_project_says_how_to_make_one(tmp_path):
    with pytest.raises(KeyreconError, match="keyrecon new"):
        Workspace(tmp_path)


def test_a_new_project_never_replaces_one(project, tmp_path):
    video = tmp_path / "video.mp4"
    with pytest.raises(KeyreconError, match="exists already"):
        Workspace.create(project.folder, open_video(video), video, {})


def test_a_damaged_project_file_is_not_taken_for_an_empty_one(project):
    project.project_file.write_text("[video\n")
    with pytest.raises(KeyreconError, match="is not a project file"):
        Workspace(project.folder)


def test_a_project_moved_with_its_video_still_opens(project, tmp_path):
    moved = tmp_path / "elsewhere" / "deeper"
    moved.mkdir(parents=True)
    project.folder.rename(moved / "project")
    (tmp_path / "video.mp4").rename(moved / "video.mp4")
    assert len(Workspace(moved / "project").video()) == 15


def test_a_moved_video_is_asked_for_and_relinked_by_fingerprint(project, tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "video.mp4").rename(tmp_path / "far" / "renamed.mp4")
    with pytest.raises(KeyreconError, match="keyrecon relink"):
        project.video()
    project.relink(tmp_path / "far" / "renamed.mp4")
    assert len(Workspace(project.folder).video()) == 15


def test_a_changed_video_is_refused(project, tmp_path, write_numbered):
    other = write_numbered("w.mp4", list(range(0, 480, 12)))
    (tmp_path / "video.mp4").write_bytes(other.read_bytes())
    with pytest.raises(KeyreconError, match="changed since"):
        project.video()
    with pytest.raises(KeyreconError, match="not the video of this project"):
        project.relink(other)


@pytest.fixture
def second(tmp_path, write_numbered):
    path = tmp_path / "second.mp4"
    path.write_bytes(write_numbered("w.mp4", list(range(0, 120, 12))).read_bytes())
    return path


def test_a_video_is_added_behind_the_first_and_what_a_person_wrote_stays(project, second):
    project.project_file.write_text(project.project_file.read_text() + "# my note\n")
    assert len(project.add_video(second, {"start": 2})) == 15 + 8
    again = Workspace(project.folder)
    assert again.video().file_starts == (15,)
    assert "# my note" in project.project_file.read_text()
    assert again.reserves(second)


def test_another_part_of_the_same_file_may_be_added_once(project, tmp_path):
    assert len(project.add_video(tmp_path / "video.mp4", {"start": 15})) == 20
    with pytest.raises(KeyreconError, match="in the project already"):
        project.add_video(tmp_path / "video.mp4", {"start": 18})


def test_an_added_video_that_moved_is_relinked(project, second, tmp_path):
    project.add_video(second, {})
    (tmp_path / "far").mkdir()
    second.rename(tmp_path / "far" / "renamed.mp4")
    with pytest.raises(KeyreconError, match=r"second\.mp4 is not where"):
        project.video()
    project.relink(tmp_path / "far" / "renamed.mp4")
    assert len(Workspace(project.folder).video()) == 15 + 10


def test_nothing_is_added_while_the_page_knows_the_video_as_it_was(project, second):
    page = lock_annotation(project.folder, "use it")
    with pytest.raises(KeyreconError, match="Stop that keyrecon annotate, add the file"):
        add_video(project, second, (0, None))
    assert len(Workspace(project.folder).video()) == 15
    page.release()
    assert "25 in all" in add_video(project, second, (0, None))


def test_all_parts_of_a_file_that_moved_are_relinked(project, tmp_path):
    project.add_video(tmp_path / "video.mp4", {"start": 15})
    (tmp_path / "far").mkdir()
    (tmp_path / "video.mp4").rename(tmp_path / "far" / "video.mp4")
    project.relink(tmp_path / "far" / "video.mp4")
    assert len(Workspace(project.folder).video()) == 20


def test_a_video_that_cannot_be_added_changes_nothing(project, tmp_path, write_numbered):
    before = project.project_file.read_bytes()
    for file in (tmp_path / "video.mp4", write_numbered("slow.mp4", [0, 24, 48])):
        with pytest.raises(KeyreconError):
            project.add_video(file, {})
    assert project.project_file.read_bytes() == before


def test_picks_add_up(project):
    with pytest.raises(KeyreconError, match="no picks yet"):
        project.picks()
    project.add_picks([Pick(0, "head", 10.0, 20.0)])
    project.add_picks([Pick(3, "foot", 1.5, 2.0), Pick(0, "head", 10.0, 20.0)])
    assert read_picks(project.picks_file) == (
        Pick(0, "head", 10.0, 20.0),
        Pick(3, "foot", 1.5, 2.0),
    )


def test_picks_that_do_not_parse_are_left_alone(project):
    project.picks_file.write_text('{"picks": [')
    with pytest.raises(KeyreconError, match="not a file of picks"):
        project.add_picks([Pick(0, "head", 1.0, 1.0)])
    assert project.picks_file.read_text() == '{"picks": ['


def test_the_order_of_clicks_makes_no_difference(project):
    clicks = [Pick(3, "shirt", 4.0, 5.0), Pick(3, "head", 1.0, 2.0), Pick(0, "shirt", 4.0, 5.0)]
    project.add_picks(clicks)
    found = project.picks()
    project.picks_file.unlink()
    project.add_picks(clicks[::-1])
    assert project.picks() == found


def test_what_is_told_now_goes_before_what_the_project_has_set(project):
    def options(budget, reach):
        return Options(keyframes=KeyframeOptions(budget=budget, reach=reach))

    usual = Options().keyframes
    project.remember(options(0.05, 12), Options())
    told = options(0.03, usual.reach)
    assert project.options(told, Options()) == options(0.03, 12)
    assert project.options(Options(), Options()) == options(0.05, 12)
    typed = typed_options(["keyrecon", "--keyframes.reach=10", "--lift.no-x", "--a.b-c", "3"])
    assert typed == {"keyframes.reach", "lift.no_x", "lift.x", "a.b_c"}
    back = project.options(Options(), Options(), typed=typed)
    assert back == options(0.05, usual.reach)


def test_an_option_that_may_be_without_a_value_is_unset_by_none(project):
    project.remember(run_options(project, Options(), 1.8), Options())
    typed = typed_options(["keyrecon", "--lift.height", "None"])
    unset = run_options(Workspace(project.folder), Options(), typed=typed)
    assert unset.lift.height is None
    Workspace(project.folder).remember(unset, Options())
    assert Workspace(project.folder).options(Options(), Options()).lift.height is None


def test_the_athletes_height_is_remembered(project):
    for height in (1.7, 0.5, 2.6):
        project.remember(run_options(project, Options(), height), Options())
        assert run_options(Workspace(project.folder), Options()).lift.height == height


def test_options_are_remembered_while_they_are_worked_with_and_not_when_refused(project):
    file = project.project_file
    file.write_text(file.read_text() + "\n[options]\nkeyframes.budget = 0.05  # mine\n")
    workspace, before = Workspace(project.folder), file.read_text()
    with (
        pytest.raises(KeyreconError, match="refused"),
        workspace.remembering(with_height(Options(), 1.7), Options()),
    ):
        assert run_options(Workspace(project.folder), Options()) == with_height(Options(), 1.7)
        raise KeyreconError("refused")
    assert file.read_text() == before
    assert run_options(workspace, Options()).keyframes.budget == 0.05
    with (
        pytest.raises(KeyboardInterrupt),
        workspace.remembering(with_height(Options(), 1.7), Options()),
    ):
        raise KeyboardInterrupt
    assert run_options(workspace, Options()).lift.height == 1.7


def test_what_somebody_writes_meanwhile_is_kept_where_options_are_refused(
    project,
):
    file = project.project_file
    with (
        pytest.raises(KeyreconError, match="refused"),
        project.remembering(with_height(Options(), 1.7), Options()),
    ):
        file.write_text(file.read_text() + "# mine\n")
        raise KeyreconError("refused")
    assert "# mine" in file.read_text()


@pytest.mark.parametrize("height", [0.2, 170.0])
def test_a_height_that_nobody_has_is_not_remembered(project, height):
    with pytest.raises(KeyreconError, match="height in metres"):
        run_options(project, Options(), height)
    assert run_options(Workspace(project.folder), Options()) == Options()


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ('track.method = "papr"', r"options.track.method cannot be 'papr'; it is one of 'filters'"),
        ('keyframes.form = "median"', "options.keyframes.form cannot be 'median'; it is one of"),
        ("keyframes.budget = true", "options.keyframes.budget cannot be True; it is a number"),
        ("propagate.rounds = 2.7", "options.propagate.rounds cannot be 2.7; it is a whole number"),
        ("keyframes = 5", "options.keyframes must be a table; found 5"),
        ("keyframes.budgte = 0.02", "options.keyframes.budgte, which does not exist"),
    ],
)
def test_options_in_the_project_file_are_held_against_their_types(bare, line, wanted):
    file = bare / "project.toml"
    file.write_text(f"{file.read_text()}\n[options]\n{line}\n")
    with pytest.raises(KeyreconError, match=wanted):
        Workspace(bare).options(Options(), Options())


def test_whole_numbers_serve_where_numbers_are_wanted(bare):
    file = bare / "project.toml"
    file.write_text(f"{file.read_text()}\n[options]\nlift.height = 2\n")
    assert Workspace(bare).options(Options(), Options()).lift.height == 2


def test_a_project_that_sets_options_under_their_former_names_keeps_them(bare):
    file = bare / "project.toml"
    lines = "lift.flips.votes = 0.5\nlift.flips.jerk = 0.2\nlift.depth_signs.annotated = 9.0\n"
    file.write_text(f"{file.read_text()}\n[options]\n{lines}")
    signs = Workspace(bare).options(Options(), Options()).lift.depth_signs
    assert (signs.exemplars, signs.acceleration, signs.annotated) == (0.5, 0.2, 9.0)


@pytest.mark.parametrize("line", ["path='{}'", 'path="{}"', "path   =  '''{}''' # there"])
def test_a_video_is_relinked_however_its_path_is_written(project, tmp_path, line):
    text = project.project_file.read_text()
    old = next(text for text in text.splitlines() if text.startswith("path"))
    written = line.format("../gone.mp4")
    project.project_file.write_text(text.replace(old, written))
    Workspace(project.folder).relink(tmp_path / "video.mp4")
    assert len(Workspace(project.folder).video()) == 15
    assert ("# there" in project.project_file.read_text()) == ("# there" in line)


@pytest.mark.parametrize("name", ["\N{TENNIS RACQUET AND BALL} é.mp4", 'a "b" \\c.mp4'])
def test_any_name_of_a_video_gives_a_project_that_opens(project, tmp_path, name):
    path = (tmp_path / "video.mp4").rename(tmp_path / name)
    made = Workspace.create(tmp_path / "other", open_video(path), path, {"start": None})
    assert len(Workspace(made.folder).video()) == 20


def test_a_name_that_is_no_text_is_refused_before_anything_is_made(project, tmp_path):
    path = (tmp_path / "video.mp4").rename(tmp_path / os.fsdecode(b"v\xff.mp4"))
    with pytest.raises(KeyreconError, match="rename the video"):
        Workspace.create(tmp_path / "other", open_video(path), path, {})
    assert not (tmp_path / "other").exists()
