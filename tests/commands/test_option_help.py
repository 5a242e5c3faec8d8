"""The help: what an option does, in a line or two; figures that chose a value stand in the code."""

import re

import pytest
from tyro import cli as typed

from keyrecon import cli
from keyrecon.commands.option_help import described_options, explained
from keyrecon.lifting.lifting import LiftOptions
from keyrecon.tracking.mark_flow import FlowOptions

VERBS = [
    (name, *rest)
    for name, command in cli.COMMANDS.items()
    for rest in ([(below,) for below in command] if isinstance(command, dict) else [()])
]
EVIDENCE = re.compile(
    r"\b(tried|measured|points, |mm (worse|better)|on one clip|benchmarks/)", re.I
)
JARGON = re.compile(r"\b(nats|lambda|beta|slerp\w*|Eq\. \d|Section \d)", re.I)
SCREEN = 50
"""Lines of a terminal window that is opened for reading."""


@pytest.fixture
def told(monkeypatch, capsys):
    """The help of a command as plain lines, as wide as a usual terminal."""

    def ask(*words):
        monkeypatch.setattr("sys.argv", ["keyrecon", *words])
        monkeypatch.setenv("COLUMNS", "80")
        with pytest.raises(SystemExit) as stop:
            cli.main()
        assert not stop.value.code
        return capsys.readouterr().out.splitlines()

    return ask


@pytest.mark.parametrize("words", VERBS, ids=" ".join)
def test_no_help_tells_how_a_value_was_chosen(told, words):
    for line in told(*words, "--help-all"):
        assert not EVIDENCE.search(line), line
        assert not JARGON.search(re.sub(r"--\S+", "", line)), line


@pytest.mark.parametrize("words", [(), ("golf",), *VERBS], ids=" ".join)
def test_a_help_fits_a_screen(told, words):
    lines = told(*words, "--help")
    assert len(lines) <= (60 if words == ("synth",) else SCREEN)
    assert "{None}" not in "".join(lines)


def test_options_of_single_stages_are_shown_where_they_are_asked_for(told):
    assert "--help-all" in " ".join(told("run", "--help"))
    assert not any("--lift." in line for line in told("run", "--help"))
    assert any("--lift.height" in line for line in told("run", "--help-all"))


@pytest.mark.parametrize("words", [("run",), ("keyframes",), ("depths",)], ids=" ".join)
def test_every_option_is_explained(told, words):
    text = " ".join(re.sub(r"[│╭╮╰╯─]", " ", "\n".join(told(*words, "--help-all"))).split())
    for option in re.findall(r"(?<!\S)--[a-z.-]+ [A-Z{][^-]{0,60}", text):
        assert re.search(r"[a-z]{4,}.*[a-z]{2,}", option), option


def test_the_help_is_the_first_paragraph_under_a_field(capsys):
    assert explained(FlowOptions)["player"].endswith("px; smaller is faster.")
    with pytest.raises(SystemExit):
        typed(FlowOptions, args=["--help"], registry=described_options(True))
    out = capsys.readouterr().out
    assert "faster. (default: 160.0)" in " ".join(out.split())
    assert "Tried" not in out


def test_records_are_made_of_what_is_typed():
    registry = described_options(False)
    assert typed(FlowOptions, args=["--player", "80"], registry=registry) == FlowOptions(80.0)
    chosen = typed(LiftOptions, args=["--height", "2"], registry=registry, default=LiftOptions(1.0))
    assert chosen == LiftOptions(2.0)
