"""A command line that cannot be is refused in one line that names what is wrong and the nearest."""

import re
from importlib.metadata import version

import pytest
from command_line import keyrecon

from keyrecon import cli
from keyrecon.commands.refusals import explain_refusal

FRAMES = (
    """╭─ Required options ────────────╮
│ Missing from keyrecon pick:   │
│     --frame INT               │
│         Frame number the      │
│ ───────────────────────────── │
│ For full helptext, run:       │
╰───────────────────────────────╯""",
    """ Required options
 -----------------------------
  Missing from keyrecon pick:
      --frame INT
          Frame number the
  -----------------------------
  For full helptext, run:""",
)
"""What the parser says on terminals with and without characters for frames."""
REFUSED = [
    ("", "No command was named", "there are demo, new,"),
    ("nope", "There is no command nope;", "there are demo, new,"),
    ("nope --help", "There is no command nope;", "keyrecon --help"),
    ("rnu rally", "There is no command rnu; the nearest is run;"),
    ("golf", "No command was named; there are fit, compare, train.", "keyrecon golf --help"),
    ("golf fitt --help", "There is no command golf fitt; the nearest is golf fit;"),
    ("--verbose", "There is no option --verbose"),
    ("run rally --hieght 1.8", "There is no option --hieght; the nearest is --height;"),
    ("run --hieght=1.8", "There is no option --hieght; the nearest is --height;"),
    ("run rally --lift.hieght 2", "There is no option --lift.hieght; the nearest is --lift.height"),
    ("run rally --budget 0.02", "There is no option --budget; the nearest is --keyframes.budget"),
    ("run rally other", "'other' is one word too many;"),
    ("run", "What is missing: PROJECT;", "keyrecon run --help"),
    ("pick rally", "What is missing: --frame INT;"),
    ("run rally --height", "--height needs METRES behind it;"),
    ("keyframes rally --budget much", "--budget needs a number; got 'much';"),
    ("pick rally --frame=1.5", "--frame needs a whole number; got '1.5';"),
    ("run rally --method printed", "--method cannot be 'printed'; it is one of best, paper;"),
    ("golf fit a.mp4 --out b --method c", "--method cannot be 'c'; it is one of swing, windows;"),
]


@pytest.mark.parametrize(("line", "said", "more"), [(*r, "--help")[:3] for r in REFUSED])
def test_what_cannot_be_typed_is_refused_in_one_line(capsys, line, said, more):
    assert keyrecon(*line.split()) == 2
    out, err = capsys.readouterr()
    assert not out
    assert err.count("\n") == 1
    assert err.startswith(f"keyrecon: {said}")
    assert more in err


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("colour", ["", "\x1b[31m"])
def test_a_refusal_is_read_whatever_the_terminal_shows(frame, colour):
    told = explain_refusal("keyrecon pick", [], colour + frame.replace("\n", "\n" + colour), "")
    assert told == "What is missing: --frame INT; see keyrecon pick --help."


@pytest.mark.parametrize("choices", ["'swing', 'windows'", "'windows', 'swing'"])
def test_choices_are_told_in_the_order_of_the_help(choices):
    refusal = f"""╭─ Invalid choice ────────────╮
│ invalid choice 'c' for argument '--method'. Expected one of ({choices}, 'None'). │
│ ───────────────────────────── │
╰───────────────────────────────╯"""
    for listed, told in (("{windows,swing}", "windows, swing"), ("X", "swing, windows")):
        line = explain_refusal("keyrecon golf fit", [], refusal, f"  --method {listed}   How")
        assert line.startswith(f"--method cannot be 'c'; it is one of {told};")


def test_no_option_that_there_is_is_taken_for_one_that_there_is_not(capsys):
    keyrecon("run", "--help-all")
    shown = capsys.readouterr().out
    flags = {*re.findall(r"^[│ ]*(--[\w.-]+)", shown, re.MULTILINE)}
    assert len(flags) > 100
    for flag in sorted(flags)[::20]:
        assert keyrecon("run", flag, "x", "y", "z") in (1, 2)
        assert "There is no option" not in capsys.readouterr().err


def test_the_version_is_that_of_the_package(capsys):
    assert keyrecon("--version") == 0
    assert capsys.readouterr().out == f"keyrecon {version('keyrecon')}\n"


def test_what_a_command_writes_to_stderr_is_shown_while_it_works(monkeypatch, capsys):
    def court(project: str) -> None:
        """Say something."""
        assert cli.sys.stderr.write("at work\n")
        assert capsys.readouterr().err == "at work\n"

    monkeypatch.setattr(cli, "_function", lambda command: court)
    assert keyrecon("court", "--project", "rally") == 0
