"""The whole job on a small rendered clip: what a user types, and what comes out."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from command_line import keyrecon
from court_walker import court_camera
from painted_court import camera_at

from keyrecon.annotate.assist.answers import project_motion_digest
from keyrecon.app import running
from keyrecon.app.annotator import job_commands
from keyrecon.body import LSP14
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.camera_file import write_camera
from keyrecon.io.formats.coco import write_coco
from keyrecon.io.formats.keyframes import keyframes_from_json
from keyrecon.io.formats.motion_file import read_motion
from keyrecon.io.formats.picks import read_picks
from keyrecon.io.provenance import read_run
from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.io.workspace import Workspace
from keyrecon.metrics import evaluate_motion, read_truth
from keyrecon.pipeline import Options
from keyrecon.progress import silent
from keyrecon.records import HalfKeyframes, Keyframes, Pick
from keyrecon.synthetic.cameras import CameraPlanOptions
from keyrecon.synthetic.clips import JoinOptions
from keyrecon.synthetic.marks import MarkOptions, mark_from_truth
from keyrecon.synthetic.sequence import SceneOptions, SynthOptions, synthesize

SIZE = (480, 270)
FRAMES = 90


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """A rendered clip, its project with keyframes, and marks from the truth."""
    folder = tmp_path_factory.mktemp("clip")
    camera = CameraPlanOptions(width=SIZE[0], height=SIZE[1], player_px=150.0)
    scene = SceneOptions(seed=2, camera=camera, workers=1)
    synthesize(folder, (), SynthOptions(scene, JoinOptions(seconds=FRAMES / 30, fps=30.0)))
    made = folder / "project"
    assert keyrecon("new", folder / "video.mp4", "--project", made) == 0
    Workspace(made).add_picks(read_picks(folder / "picks.json"))
    assert keyrecon("keyframes", made, "--budget", "0.06") == 0
    return folder


def new_project(clip, folder, *words):
    """A project of the clip that finds what was made of the clip before."""
    assert keyrecon("new", clip / "video.mp4", "--project", folder, *words) == 0
    shutil.copytree(clip / "project" / "cache", folder / "cache", dirs_exist_ok=True)
    return folder


@pytest.fixture(scope="module")
def solved(clip):
    """The motion after annotation."""
    made = clip / "project"
    truth = read_truth(clip / "truth.npz")
    asked = keyframes_from_json((made / "keyframes.json").read_text())
    marks = mark_from_truth(
        asked, truth["points2d"], truth["points3d"], truth["visible"], MarkOptions(noise=1.0)
    )
    write_coco(clip / "marks.json", marks, SIZE)
    assert keyrecon("import", made, clip / "marks.json") == 0
    assert keyrecon("run", made, "--height", f"{float(truth['height_m']):.2f}") == 0
    return read_motion(made / "motion.npz"), truth


def test_a_head_clicked_on_the_scenery_is_named_and_left_aside(clip, tmp_path, capsys):
    made = new_project(clip, tmp_path / "project")
    right = read_picks(clip / "picks.json")
    Workspace(made).add_picks(right)
    Workspace(made).add_picks([Pick(70, "head", 30.0, 30.0)])
    assert keyrecon("keyframes", made, "--budget", "0.06") == 0
    said = capsys.readouterr().out
    assert said.count("clicked in frame") == 1
    assert "The head clicked in frame 70 (30, 30) lies" in said
    assert "was left aside" in said
    assert len(Workspace(made).picks()) == len(right) + 1


def test_keyframes_meet_the_budget_and_are_pictured(clip):
    data = json.loads((clip / "project" / "keyframes.json").read_text())
    assert data["n_frames"] == FRAMES
    assert (len(data["upper"]) + len(data["lower"])) / 2 / FRAMES <= 0.06
    assert data["frames"] == sorted({*data["upper"], *data["lower"]})
    pictures = {p.name for p in (clip / "project" / "keyframes").iterdir()}
    assert pictures == {f"frame_{n:06d}.png" for n in data["frames"]}


def test_the_motion_is_near_the_truth(solved):
    motion, truth = solved
    scores = evaluate_motion(motion, truth)
    assert motion.units == "m"
    assert scores.pck >= 0.9
    assert scores.pa_mpjpe <= 90
    assert scores.limb_variation_max <= 1e-3


def test_every_joint_tells_where_it_comes_from(solved):
    motion, _ = solved
    assert set(np.unique(motion.source)) <= {0, 1, 2, 3}
    assert (motion.source == 0).any(axis=1).sum() == len(motion.keyframes)
    assert np.isfinite(motion.points3d).all()
    assert ((motion.confidence >= 0) & (motion.confidence <= 1)).all()


def test_the_report_and_exports_are_written(clip, solved, tmp_path):
    assert "<html" in (clip / "project" / "report.html").read_text()[:400]
    names = ["m.bvh", "m.trc", "m.csv", "m.glb", "m.json", "m.npz", "m.mp4", "m.c3d", "m.nc"]
    assert keyrecon("export", clip / "project", *(tmp_path / n for n in names)) == 0
    assert all((tmp_path / n).stat().st_size > 1000 for n in names)


def test_a_second_run_makes_no_stage_again(clip, solved):
    workspace = Workspace(clip / "project")
    chosen = running.run_options(workspace, Options(), 1.7)
    running.run(workspace, chosen, silent)
    assert set(workspace.stages.seconds) <= {"lift"}
    digest = project_motion_digest(workspace.folder, workspace.video())
    assert read_run(workspace).evidence == digest


def test_why_there_is_no_way_on_the_court_is_in_the_report_and_on_the_page(clip, solved, tmp_path):
    made = shutil.copytree(clip / "project", tmp_path / "p")
    shutil.copy(clip / "video.mp4", tmp_path)
    write_camera(made / "camera.npz", court_camera(camera_at((2, -20, 3), (0, -9, 0.8), 1.6), 7))
    text = job_commands(made)["run"]({}, silent)
    assert "No way on the court: camera.npz was made for 7 frames" in text
    report = (made / "report.html").read_text()
    assert "No way on the court: camera.npz was made for 7 frames" in report


def test_the_paper_form_runs_too(clip, solved, capsys):
    _, truth = solved
    assert keyrecon("run", clip / "project", "--method", "paper") == 0
    said = [line for line in capsys.readouterr().out.splitlines() if "Eq. 2-4" in line]
    assert len(said) == 1
    assert said[0].startswith("The keyframes of this project were not chosen by Eq. 2-4 as printed")
    assert f"keyrecon keyframes {clip / 'project'} --method paper" in said[0]
    motion = read_motion(clip / "project" / "motion.npz")
    assert motion.units == "m"  # the height of the run before is remembered
    scores = evaluate_motion(motion, truth)
    assert scores.pa_mpjpe <= 250


def test_a_run_by_the_paper_takes_the_keyframes_that_the_paper_chose(clip, tmp_path, capsys):
    made, truth = new_project(clip, tmp_path / "p"), read_truth(clip / "truth.npz")
    Workspace(made).add_picks(read_picks(clip / "picks.json"))
    assert keyrecon("keyframes", made, "--budget", "0.06", "--method", "paper") == 0
    assert "chosen by Eq. 2-4 as printed" in capsys.readouterr().out
    asked = keyframes_from_json((made / "keyframes.json").read_text())
    assert asked.method == "paper"
    marks = mark_from_truth(
        asked, truth["points2d"], truth["points3d"], truth["visible"], MarkOptions(noise=1.0)
    )
    write_coco(made / "annotations.json", marks, SIZE)
    workspace = Workspace(made)
    options = running.run_options(workspace, Options())
    assert options.keyframes.method == "coverage"  # a run by our forms is not bound
    said = running.run(workspace, options, silent, printed=True)
    assert "Eq. 2-4" not in said
    assert set(workspace.stages.seconds) == {"propagate", "lift"}


def test_keyframes_without_marks_are_named(clip, solved):
    workspace = Workspace(clip / "project")
    data = json.loads(workspace.annotations_file.read_text())
    gone = data["annotations"].pop(0)["image_id"]
    workspace.annotations_file.rename(clip / "aside.json")
    try:
        workspace.annotations_file.write_text(json.dumps(data))
        with pytest.raises(KeyreconError, match=rf"1 of .* not marked yet: frame {gone} "):
            running.run(workspace, workspace.options(Options(), Options()), silent)
        workspace.annotations_file.unlink()
        with pytest.raises(KeyreconError, match="not marked yet"):
            running.run(workspace, workspace.options(Options(), Options()), silent)
    finally:
        (clip / "aside.json").rename(workspace.annotations_file)


@pytest.mark.parametrize("budget", ["1.5", "-0.1", "nan"])
def test_a_budget_in_per_cent_is_told_what_a_budget_is(clip, capsys, budget):
    assert keyrecon("keyframes", clip / "project", "--budget", budget) == 1
    assert "--budget is a share of the frames, 0.015 for 1.5 %" in capsys.readouterr().err


def test_a_budget_that_cannot_be_met_says_what_would_do(clip, capsys):
    assert keyrecon("keyframes", clip / "project", "--budget", "0.001") == 1
    assert "--budget" in capsys.readouterr().err


def test_a_video_without_the_player_is_told_apart(clip, tmp_path, capsys):
    """The player is there to be clicked on frame 0 and gone for the rest."""
    with_player = open_video(clip / "video.mp4").frame(0)
    rng = np.random.default_rng(0)
    empty = np.full_like(with_player, 90) + rng.integers(0, 6, with_player.shape, np.uint8)
    write_video(tmp_path / "gone.mp4", [with_player, *[empty] * 39], 30.0)
    picks = [p for p in read_picks(clip / "picks.json") if p.frame == 12]
    made = tmp_path / "p"
    assert keyrecon("new", tmp_path / "gone.mp4", "--project", made) == 0
    shift = known_joints(clip)[0].mean(axis=0) - known_joints(clip)[12].mean(axis=0)
    Workspace(made).add_picks(
        [replace(p, frame=0, x=p.x + float(shift[0]), y=p.y + float(shift[1])) for p in picks]
    )
    assert keyrecon("keyframes", made, "--budget", "0.06") == 1
    assert "head" in capsys.readouterr().err
    assert not (made / "keyframes.json").exists()


def known_joints(clip):
    return read_truth(clip / "truth.npz")["points2d"]


def test_joints_of_the_skeleton_are_all_there(solved):
    motion, _ = solved
    assert motion.skeleton.names == LSP14.names


def test_a_skeleton_of_ones_own_goes_through(clip, tmp_path):
    """With joints beyond the ends of the legs and of the arms."""
    toes = [("right_toe", "right_ankle", 0.11), ("left_toe", "left_ankle", 0.11)]
    hands = [("right_hand", "right_wrist", 0.05), ("left_hand", "left_wrist", 0.05)]
    joints = [
        {"name": n, "parent": None if p < 0 else LSP14.names[p], "length": length}
        for n, p, length in zip(LSP14.names, LSP14.parents, LSP14.proportions, strict=True)
    ]
    joints += [{"name": n, "parent": p, "length": length} for n, p, length in toes + hands]
    lower = [LSP14.names[i] for i in LSP14.lower] + [n for n, _, _ in toes]
    (tmp_path / "toes.json").write_text(json.dumps({"joints": joints, "lower": lower}))
    made = new_project(clip, tmp_path / "p", "--skeleton", tmp_path / "toes.json")
    Workspace(made).add_picks(read_picks(clip / "picks.json"))
    assert keyrecon("keyframes", made, "--budget", "0.06") == 0
    truth = read_truth(clip / "truth.npz")
    ends = [LSP14.index(parent) for _, parent, _ in toes + hands]
    points3d, points2d = (
        np.concatenate([truth[name], truth[name][:, ends] + step], axis=1)
        for name, step in (("points3d", [0.1, 0.03, 0.0]), ("points2d", [10.0, 3.0]))
    )
    skeleton = Workspace(made).skeleton
    asked = keyframes_from_json((made / "keyframes.json").read_text())
    marks = mark_from_truth(asked, points2d, points3d, None, MarkOptions(noise=1.0), skeleton)
    write_coco(tmp_path / "marks.json", marks, SIZE)
    assert keyrecon("import", made, tmp_path / "marks.json") == 0
    assert keyrecon("run", made) == 0
    motion = read_motion(made / "motion.npz")
    added = ("right_toe", "left_toe", "right_hand", "left_hand")
    assert motion.skeleton.names[-4:] == added
    assert np.median(np.abs(motion.points2d - points2d)[:, -4:]) < 0.03 * 150


def whole_body(truth, *frames):
    """Every joint of some frames, marked."""
    both = HalfKeyframes(
        frames=np.array(frames),
        nearest=np.zeros(FRAMES, dtype=np.int64),
        represented=np.zeros(FRAMES, dtype=bool),
        coverage=0.0,
        beta=1.0,
        distance=np.zeros(FRAMES),
        printed_count=1,
    )
    asked = Keyframes(both, both, 10, 0.95)
    return mark_from_truth(
        asked, truth["points2d"], truth["points3d"], None, MarkOptions(noise=1.0, signs=False)
    )


def test_one_marked_body_serves_in_place_of_clicks(clip, tmp_path, capsys):
    made, truth = tmp_path / "marked", read_truth(clip / "truth.npz")
    assert keyrecon("new", clip / "video.mp4", "--project", made) == 0
    assert keyrecon("keyframes", made) == 1
    assert "no picks yet, and no marked body" in capsys.readouterr().err
    write_coco(tmp_path / "body.json", whole_body(truth, 25, 70), SIZE)
    assert keyrecon("import", made, tmp_path / "body.json") == 0
    assert keyrecon("keyframes", made, "--budget", "0.06") == 0
    asked = keyframes_from_json((made / "keyframes.json").read_text())
    assert {25, 70} <= set(asked.upper.frames.tolist()) & set(asked.lower.frames.tolist())
    marks = mark_from_truth(
        asked, truth["points2d"], truth["points3d"], truth["visible"], MarkOptions(noise=1.0)
    )
    write_coco(tmp_path / "marks.json", marks, SIZE)
    assert keyrecon("import", made, tmp_path / "marks.json", "--replace") == 0
    assert keyrecon("run", made, "--height", f"{float(truth['height_m']):.2f}") == 0
    scores = evaluate_motion(read_motion(made / "motion.npz"), truth)
    assert scores.pck > 0.9
