"""The table of choices: whole rows, flags that exist, and the numbers of the printed form."""

import re
import sys
from importlib.resources import files

import pytest

from keyrecon import cli
from keyrecon.annotation_budget import LONG_SHARE, SHORT_SHARE
from keyrecon.golf.observe.film import MOST_FPS
from keyrecon.lifting.lifting import MIN_SPIKE_DEVIATION
from keyrecon.paper.joint_transfer import POSITION_SPREAD
from keyrecon.paper.sliding_windows import WindowOptions
from keyrecon.pipeline import Options, as_printed
from keyrecon.segmentation.part_labels import GROWTH, MAX_GAP
from keyrecon.tracking.camera_motion import MAX_OVERLAY_SHARE
from keyrecon.tracking.exposure import EVEN
from keyrecon.tracking.linking import MAX_GAP_SECONDS
from keyrecon.tracking.shots import SAME_SCENE

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


def test_printed_key_poses_are_slerped_whatever_prior_a_project_has():
    assert as_printed(Options(prior="golf")).prior == "none"


def test_the_printed_tracker_does_not_ask_what_is_beneath_a_head():
    assert PRINTED.find.other_trunk == 1
    assert PRINTED.find.doubtful == 0


@pytest.mark.parametrize("verb", ["keyframes", "run"])
def test_the_printed_form_and_the_golf_prior_are_not_had_together(
    verb, tmp_path, monkeypatch, capsys
):
    words = ["keyrecon", verb, str(tmp_path), "--method", "paper", "--prior", "golf"]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as stop:
        cli.main()
    said = capsys.readouterr().err
    assert stop.value.code == 1 and said.count("\n") == 1
    assert "--prior golf" in said and "--method paper" in said


@pytest.mark.parametrize(
    ("question", "told"),
    [
        ("size of the picture that is searched", f"{PRINTED.find.player:g} px"),
        ("most temporally consistent path", f"{PRINTED.find.head_speed:g} (head)"),
        ("most temporally consistent path", f"{PRINTED.find.foot_speed:g} (feet)"),
        (
            "head that is hardly ever found",
            f"less than {PRINTED.find.detected:.0%}".replace("%", " %"),
        ),
        ("without the player", f"median of {PRINTED.background.samples} frames"),
        ("laid over the picture", f"more than {MAX_OVERLAY_SHARE:.0%}".replace("%", " %")),
        ("where one shot ends", f"less than {SAME_SCENE:g}".replace("0.", ".")),
        ("budget, where none", f"{LONG_SHARE:.1%} of".replace("%", " %")),
        ("budget, where none", f"{SHORT_SHARE:.0%} at most".replace("%", " %")),
        ("which frames of the video", f"more than {MOST_FPS:g} frames per second"),
        ("frames without a candidate", f"up to {MAX_GAP_SECONDS:g} s for head and feet"),
        ("pixels of the player of none", f"{GROWTH:g}"[1:] + " heights into what differs"),
        ("pixels of the player of none", f"{MAX_GAP:g}"[1:] + " heights from the body"),
        ("light that changes", f"{EVEN:.0%}".replace("%", " %")),
        (
            "what of a video of several shots",
            f"shorter than {PRINTED.shots.shortest:g} s".replace("0.", "."),
        ),
        ("the standing height", f"over {PRINTED.find.envelope:g} s"),
        ("sampled at regular intervals", f"{PRINTED.edges.step:g}"[1:] + " heights"),
        ("sampled at regular intervals", f"{PRINTED.edges.most} elements"),
        ("how far a match may be", f"{PRINTED.compare.reach:g}"[1:] + " heights"),
        ("matching all pairs", f"1/{1 / PRINTED.compare.cell:g} height"),
        ("matching all pairs", f"{PRINTED.compare.directions} directions"),
        ("max B", f"{PRINTED.compare.most} frames"),
        ("more than 4000 frames", f"{PRINTED.compare.most} at most"),
        ("how far appearance may move", " to ".join(f"{s:g}"[1:] for s in POSITION_SPREAD)),
        ("discontinuities", f"{MIN_SPIKE_DEVIATION * LENGTHS.track_noise:g}"[1:] + " body heights"),
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
