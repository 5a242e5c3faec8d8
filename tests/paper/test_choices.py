"""The table of choices: whole rows, flags that exist, and the numbers of the printed form."""

import re
import sys
from importlib.resources import files

import pytest

from keyrecon import cli
from keyrecon.paper.sliding_windows import WindowOptions
from keyrecon.pipeline import as_printed

TEXT = files("keyrecon.paper").joinpath("choices.md").read_text()
ROWS = [re.split(r"(?<!\\)\|", line)[1:-1] for line in TEXT.splitlines() if line.startswith("|")]
PRINTED, WINDOWS = as_printed(), WindowOptions()
LENGTHS, REFINE = PRINTED.lift.lengths, PRINTED.lift.refine


def test_every_row_tells_where_what_is_open_what_was_chosen_and_why():
    assert len(ROWS) > 80
    for row in ROWS:
        assert len(row) == 4, row
        assert all(cell.strip() for cell in row), row


def test_a_place_and_what_is_open_there_stand_in_one_row():
    questions = [(row[0], row[1]) for row in ROWS]
    assert len(set(questions)) == len(questions)


@pytest.mark.parametrize("verb", [("keyframes",), ("golf", "fit")])
def test_flags_that_the_table_names_exist(verb, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["keyrecon", *verb, "--help-all"])
    with pytest.raises(SystemExit):
        cli.main()
    known = set(re.findall(r"--[a-z][a-z.-]+", capsys.readouterr().out))
    named = set(re.findall(r"`(--keyframes[a-z.-]+)", TEXT)) if verb == ("keyframes",) else set()
    assert {*named, "--method"} <= known


@pytest.mark.parametrize(
    ("question", "told"),
    [
        ("size of the picture that is searched", f"{PRINTED.find.player:g} px"),
        ("most temporally consistent path", f"{PRINTED.find.head_speed:g} (head)"),
        ("most temporally consistent path", f"{PRINTED.find.foot_speed:g} (feet)"),
        ("the standing height", f"over {PRINTED.find.envelope:g} s"),
        ("sampled at regular intervals", f"{PRINTED.edges.step:g}"[1:] + " heights"),
        ("sampled at regular intervals", f"{PRINTED.edges.most} elements"),
        ("how far a match may be", f"{PRINTED.compare.reach:g}"[1:] + " heights"),
        ("matching all pairs", f"1/{1 / PRINTED.compare.cell:g} height"),
        ("matching all pairs", f"{PRINTED.compare.directions} directions"),
        ("max B", f"{PRINTED.compare.most} frames"),
        ("T at other frame rates", f"T = {PRINTED.keyframes.reach} at 50"),
        ("lengths of limbs", f"({LENGTHS.spread:.0%})".replace("%", " %")),
        ("the scale s", f"({LENGTHS.scale_spread:.0%})".replace("%", " %")),
        ("depth of a limb near", f"{LENGTHS.click_noise:g}"[1:] + " heights"),
        ("the low-pass", f"Gaussian of {REFINE.sigma:g} frames"),
        ("until convergence", f"{REFINE.descents} iterations"),
        ("f; how far groups slide", f"{WINDOWS.frames}; by one frame"),
        ("the minimiser", f"{WINDOWS.steps} steps"),
        ("w_G, w_mu, w_alpha", f"{WINDOWS.root:g}"[1:] + " (m, rad)"),
        ("w_G, w_mu, w_alpha", f"{WINDOWS.joint:g}"[1:] + " heights for joints"),
    ],
)
def test_the_table_tells_the_numbers_of_the_printed_form(question, told):
    assert any(question in row[1] and told in row[2] for row in ROWS), told
