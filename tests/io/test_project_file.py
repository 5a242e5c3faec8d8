"""What a person wrote into project.toml stays there, whatever the program changes or refuses."""

import tomllib

import pytest

from keyrecon import KeyreconError
from keyrecon.app.running import run_options
from keyrecon.io.option_tables import former_names
from keyrecon.io.workspace import Workspace
from keyrecon.keyframes.selection import KeyframeOptions
from keyrecon.pipeline import Options, with_height

VIDEO = '[video]\npath = "v.mp4"\nfingerprint = "x"\n'


def budget(value):
    return Options(keyframes=KeyframeOptions(budget=value))


FORMS = {
    "no options": VIDEO,
    "another comment": f"{VIDEO}\n# mine\n[options]\nkeyframes.budget = 0.03 # few\n",
    "no comment": f"{VIDEO}\n[options]\nkeyframes.budget = 0.03\nlift.height = 1.7\n",
    "tables": f"[options.keyframes]\nbudget = 0.03\n\n{VIDEO}\n[notes]\nplayer = 'Ann'\n",
    "pieces": f"[options.keyframes]\nreach = 12\n\n{VIDEO}\n[options.lift]\nheight = 1.7\n",
    "one line": f"options = {{keyframes = {{budget = 0.03}}}}\n{VIDEO}",
    "dotted": f"options.keyframes.budget = 0.03\n{VIDEO}",
    "former names": f"{VIDEO}\n[options]\nlift.flips.votes = 0.5\n",
    "a table behind": f"{VIDEO}\n[options]\nlift.height = 1.7\n\n[notes]\nplayer = 'Ann' # 19\n",
}


@pytest.mark.parametrize("form", FORMS)
def test_options_are_remembered_in_whatever_form_the_file_has_and_the_rest_stays(bare, form):
    (bare / "project.toml").write_text(FORMS[form])
    workspace = Workspace(bare)
    before = workspace.options(Options(), Options())
    told = workspace.options(budget(0.07), Options())
    workspace.remember(told, Options())
    text = (bare / "project.toml").read_text()
    again = Workspace(bare).options(Options(), Options())
    assert again == told
    assert again.keyframes.budget == 0.07
    assert again.lift == before.lift
    for kept in ("# mine", "# few", "[notes]\nplayer = 'Ann'", "# 19", "fingerprint"):
        assert (kept in FORMS[form]) == (kept in text), kept


@pytest.mark.parametrize("form", FORMS)
def test_an_option_that_is_set_back_goes_and_one_that_is_as_it_was_changes_nothing(bare, form):
    (bare / "project.toml").write_text(FORMS[form])
    workspace = Workspace(bare)
    workspace.remember(workspace.options(Options(), Options()), Options())
    assert (bare / "project.toml").read_text() == FORMS[form]
    workspace.remember(Options(), Options())
    assert Workspace(bare).options(Options(), Options()) == Options()
    assert tomllib.loads((bare / "project.toml").read_text())["video"]["path"] == "v.mp4"


def test_what_a_person_writes_while_a_command_works_stays(bare):
    file = bare / "project.toml"
    file.write_text(f"{VIDEO}\n[options]\nlift.height = 1.8\nkeyframes.reach = 12\n")
    running = Workspace(bare)
    told = with_height(running.options(Options(), Options()), 1.85)
    meanwhile = file.read_text().replace("keyframes.reach = 12", "keyframes.budget = 0.05 # few")
    file.write_text(meanwhile)
    running.remember(told, Options())
    assert file.read_text() == meanwhile.replace("1.8", "1.85")
    running.remember(with_height(told, None), Options())  # what it knew of is still the former
    assert tomllib.loads(file.read_text())["options"] == {"keyframes": {"budget": 0.05}}


def test_former_names_of_an_option_are_found_through_all_versions():
    assert former_names("lift.depth_signs.exemplars") == [
        "lift.depth_signs.votes",
        "lift.flips.exemplars",
        "lift.flips.votes",
    ]


@pytest.mark.parametrize("value", [float("inf"), float("nan"), -1.0])
def test_what_an_option_cannot_be_is_neither_taken_nor_remembered(bare, value):
    before = (bare / "project.toml").read_bytes()
    workspace = Workspace(bare)
    with pytest.raises(KeyreconError, match=r"keyframes.budget cannot be"):
        workspace.options(budget(value), Options())
    with pytest.raises(KeyreconError, match=r"keyframes.budget cannot be"):
        workspace.remember(budget(value), Options())
    assert (bare / "project.toml").read_bytes() == before


@pytest.mark.parametrize("word", ["inf", "nan", "1979-05-27", "'big'", "[1]", "true", "{a = 1}"])
def test_what_a_person_wrote_that_an_option_cannot_be_is_named_in_one_line(bare, word):
    file = bare / "project.toml"
    file.write_text(f"{VIDEO}\n[options]\nkeyframes.budget = {word}\n")
    with pytest.raises(KeyreconError, match=r"options\.keyframes\.budget") as told:
        run_options(Workspace(bare), Options())
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    "text",
    [
        f"version = 2\n{VIDEO}",
        f"version = 'one'\n{VIDEO}",
        f"options = 5\n{VIDEO}",
        f"{VIDEO}slow_motion = nan\n",
        f"{VIDEO}start = 1979-05-27\n",
        "[video\n",
        'video = "v.mp4"\n',
        "a = " + "[" * 2000 + "]" * 2000,
        "",
    ],
)
def test_a_project_file_that_is_none_is_named_in_one_line(bare, text):
    (bare / "project.toml").write_text(text)
    with pytest.raises(KeyreconError, match=r"project\.toml") as told:
        Workspace(bare)
    assert "\n" not in str(told.value)
    assert len(str(told.value)) < 400


def test_a_byte_that_is_no_text_is_named(bare):
    (bare / "project.toml").write_bytes(VIDEO.encode() + b"# caf\xe9\n")
    with pytest.raises(KeyreconError, match="is not utf-8 text"):
        Workspace(bare)
