"""What the command line says to wrong input: one line, exit code 1, nothing written over."""

import ast
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

import pytest
from small_motion import make_motion

import keyrecon as package
from keyrecon import cli
from keyrecon.io.formats.motion_file import write_motion
from keyrecon.io.video import open_video


@pytest.fixture
def keyrecon(monkeypatch, capsys):
    """Run a command line; returns (exit code, stdout, stderr)."""

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["keyrecon", *map(str, words)])
        try:
            cli.main()
            code = 0
        except SystemExit as stop:
            code = stop.code or 0
        out, err = capsys.readouterr()
        return code, out, err

    return call


@pytest.fixture
def project(tmp_path, write_numbered, keyrecon):
    video = tmp_path / "video.mp4"
    video.write_bytes(write_numbered("v.mp4", list(range(0, 240, 12))).read_bytes())
    code, out, _ = keyrecon("new", video, "--project", tmp_path / "p")
    assert code == 0
    assert "20 frames of 128x64" in out
    return tmp_path / "p"


def one_line(code, err, *words):
    assert code == 1
    assert err.count("\n") == 1, err
    for word in words:
        assert word in err
    return True


@pytest.mark.parametrize(
    "verb",
    [
        *("demo", "new", "pick", "keyframes", "annotate", "import"),
        *("run", "export", "evaluate", "synth", "relink", "add"),
    ],
)
def test_every_command_explains_itself(keyrecon, verb):
    code, out, _ = keyrecon(verb, "--help")
    assert code == 0
    assert f"keyrecon {verb}" in out


def test_bad_usage_exits_with_2(keyrecon):
    assert keyrecon("pick")[0] == 2
    assert keyrecon("nonsense")[0] == 2


def test_a_video_that_is_not_one(keyrecon, tmp_path):
    (tmp_path / "a.mp4").write_text("text")
    code, _, err = keyrecon("new", tmp_path / "a.mp4", "--project", tmp_path / "p")
    assert one_line(code, err, "cannot be read as a video")
    assert not (tmp_path / "p").exists()


def test_a_project_cannot_be_where_a_file_is_or_below_one(keyrecon, tmp_path, write_numbered):
    video = write_numbered("v.mp4", list(range(0, 240, 12)))
    (tmp_path / "notes").write_text("mine")
    for folder in (tmp_path / "notes", tmp_path / "notes" / "p"):
        code, _, err = keyrecon("new", video, "--project", folder)
        assert one_line(code, err, "cannot be made", "choose another place")
    assert (tmp_path / "notes").read_text() == "mine"


def test_frames_that_the_video_does_not_have_are_told(keyrecon, tmp_path, write_numbered):
    video = write_numbered("v.mp4", list(range(0, 240, 12)))
    for trim, words in (
        (("--start", "50"), ("has 20 frames", "from frame 50 on")),
        (("--end", "21"), ("has 20 frames", "from frame 0 up to before frame 21")),
    ):
        code, _, err = keyrecon("new", video, "--project", tmp_path / "p", *trim)
        assert one_line(code, err, *words)


def test_a_proposed_command_can_be_pasted_whatever_the_folder_is_called(
    keyrecon, tmp_path, write_numbered
):
    video = write_numbered("v.mp4", list(range(0, 240, 12)))
    folder = tmp_path / "Käfer & Söhne (2)"
    _, out, _ = keyrecon("new", video, "--project", folder)
    assert f"keyrecon annotate {shlex.quote(str(folder))} " in out


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("start = 'x'", ("video.start cannot be 'x'",)),
        ("end = true", ("video.end cannot be True",)),
        ("video = 3", ("project.toml is not a project file",)),
        ("[options]\nlift = 3", ("options.lift must be a table; found 3",)),
        ("[options.lift]\nheigth = 2.0", ("options.lift.heigth", "does not exist")),
        ("[", ("project.toml is not a project file",)),
    ],
)
def test_a_project_file_with_a_slip_is_told(keyrecon, project, line, words):
    file = project / "project.toml"
    text = file.read_text()
    file.write_text(f"{line}\n" if line.startswith("video") else f"{text}\n{line}\n")
    code, _, err = keyrecon("keyframes", project)
    assert one_line(code, err, *words)


@pytest.mark.parametrize("text", ["{", '{"picks": 3}', '{"picks": [{}]}', ""])
def test_a_file_in_the_project_that_is_not_what_it_was_is_told_in_plain_words(
    keyrecon, project, text
):
    for name in ("picks.json", "keyframes.json"):
        (project / name).write_text(text)
        code, _, err = keyrecon("run", project)
        assert one_line(code, err, name)
        assert "Error(" not in err
        (project / name).unlink()


def test_a_file_that_is_no_motion_is_told_without_advice_to_load_it_unsafely(
    keyrecon, project, tmp_path
):
    (project / "motion.npz").write_text("text")
    for words in (
        ("export", project, tmp_path / "m.bvh"),
        ("evaluate", project, "--truth", tmp_path / "truth.npz"),
    ):
        code, _, err = keyrecon(*words)
        assert one_line(code, err, "motion.npz is not a motion (another format)")


def test_no_picks_yet(keyrecon, project):
    code, _, err = keyrecon("keyframes", project)
    assert one_line(code, err, "no picks yet", "keyrecon pick")


def test_a_pick_outside_the_picture_or_video_changes_nothing(keyrecon, project):
    code, _, err = keyrecon("pick", project, "--frame", 3, "--head", "500,20")
    assert one_line(code, err, "outside the picture of 128x64")
    code, _, err = keyrecon("pick", project, "--frame", 99, "--head", "5,20")
    assert one_line(code, err, "outside the video", "0 to 19")
    code, _, err = keyrecon("pick", project, "--frame", 3, "--head", "5;20")
    assert one_line(code, err, "X,Y")
    assert not (project / "picks.json").exists()


def test_picks_of_several_frames_add_up(keyrecon, project):
    assert keyrecon("pick", project, "--frame", 0, "--head", "5,20", "--foot", "5,60")[0] == 0
    code, out, _ = keyrecon("pick", project, "--frame", 9, "--region", "Shirt:7,30")
    assert code == 0
    assert "1 foot, 1 head, 1 shirt" in out
    assert len(json.loads((project / "picks.json").read_text())["picks"]) == 3


def test_run_before_keyframes(keyrecon, project):
    keyrecon("pick", project, "--frame", 0, "--head", "5,20")
    code, _, err = keyrecon("run", project)
    assert one_line(code, err, "keyrecon keyframes")


def test_an_impossible_height(keyrecon, project):
    code, _, err = keyrecon("run", project, "--height", "18.3")
    assert one_line(code, err, "metres", "18.3")


def coco(frame, name="neck", x=10.0):
    return {
        "images": [{"id": 1, "file_name": "f.png", "width": 128, "height": 64, "frame": frame}],
        "annotations": [
            {"id": 1, "image_id": 1, "category_id": 1, "keypoints": [x, 20, 2], "num_keypoints": 1}
        ],
        "categories": [{"id": 1, "name": "person", "keypoints": [name], "skeleton": []}],
    }


def test_annotations_that_do_not_fit_are_refused_by_frame_and_joint(keyrecon, project, tmp_path):
    file = tmp_path / "marks.json"
    for data, words in (
        (coco(77), ("77",)),
        (coco(3, name="tail"), ("tail",)),
        (coco(3, x=float("nan")), ("NaN",)),
        ({"images": []}, ("marks.json",)),
    ):
        file.write_text(json.dumps(data))
        code, _, err = keyrecon("import", project, file)
        assert one_line(code, err, *words)
        assert not (project / "annotations.json").exists()


def test_marks_that_differ_are_refused_unless_replaced_and_the_old_file_is_kept(
    keyrecon, project, tmp_path
):
    file = tmp_path / "marks.json"
    file.write_text(json.dumps(coco(3, x=10.0)))
    assert keyrecon("import", project, file)[0] == 0
    before = (project / "annotations.json").read_text()
    file.write_text(json.dumps(coco(3, x=90.0)))
    code, _, err = keyrecon("import", project, file)
    assert one_line(code, err, "frame 3 neck", "nothing was changed")
    assert (project / "annotations.json").read_text() == before
    assert keyrecon("import", project, file, "--replace")[0] == 0
    assert (project / "annotations.old-1.json").read_text() == before


def test_a_moved_video_is_relinked(keyrecon, project, tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "video.mp4").rename(tmp_path / "far" / "v.mp4")
    code, _, err = keyrecon("pick", project, "--frame", 0, "--head", "5,20")
    assert one_line(code, err, "keyrecon relink")
    assert keyrecon("relink", project, tmp_path / "far" / "v.mp4")[0] == 0
    assert keyrecon("pick", project, "--frame", 0, "--head", "5,20")[0] == 0


def test_another_file_is_added_and_its_frames_numbered_on(keyrecon, project, write_numbered):
    second = write_numbered("second.mp4", list(range(0, 120, 12)))
    code, out, _ = keyrecon("add", second, "--project", project, "--start", 2)
    assert code == 0
    assert "8 frames" in out
    assert "numbered from 20 on; 28 in all" in out
    assert keyrecon("pick", project, "--frame", 27, "--head", "5,20")[0] == 0
    assert one_line(*keyrecon("pick", project, "--frame", 28, "--head", "5,20")[::2], "0 to 27")


def test_a_motion_that_is_not_there(keyrecon, project, tmp_path):
    code, _, err = keyrecon("export", project, tmp_path / "m.bvh")
    assert one_line(code, err, "keyrecon run")
    code, _, err = keyrecon("evaluate", project, "--truth", tmp_path / "truth.npz")
    assert one_line(code, err, "keyrecon run")


def test_an_overlay_takes_a_range_views_slow_motion_and_limbs(keyrecon, project, tmp_path):
    write_motion(project / "motion.npz", make_motion(20))
    words = [
        "--frames",
        "2-5",
        "--view",
        "camera",
        "right",
        "--slowmo",
        "2",
        "--skeleton",
        "upper",
        "--size",
        "96",
    ]
    code, out, _ = keyrecon("export", project, tmp_path / "a.mp4", *words)
    assert (code, out) == (0, f"Wrote {tmp_path / 'a.mp4'}.\n")
    made = open_video(tmp_path / "a.mp4")
    assert (len(made), made.height) == (4, 96)
    code, _, err = keyrecon("export", project, tmp_path / "a.fbx")
    assert one_line(code, err, "Blender")


def test_the_package_runs_as_a_module():
    told = subprocess.run(
        [sys.executable, "-m", "keyrecon", "keyframes", "nowhere"], capture_output=True, text=True
    )
    assert told.returncode == 1
    assert "nowhere" in told.stderr
    assert told.stderr.count("\n") == 1


HEAVY = "{'numpy', 'scipy', 'cv2', 'av', 'skimage', 'plotly', 'starlette', 'uvicorn', 'jaxtyping'}"


@pytest.mark.parametrize(
    ("words", "allowed"),
    [
        (("--help",), set()),
        (("nonsense",), set()),
        (("new", "--help"), set()),
        (("pick", "--help"), set()),
        (("annotate", "--help"), set()),
        (("add", "--help"), set()),
        (("ground", "--help"), set()),
        (("relink", "nowhere", "v.mp4"), {"numpy", "jaxtyping"}),
    ],
)
def test_a_command_imports_only_what_it_needs(words, allowed):
    code = (
        f"import sys; sys.argv = ['keyrecon', *{list(words)!r}]\n"
        "from keyrecon import cli\n"
        "try:\n    cli.main()\nexcept SystemExit:\n"
        f"    print('loaded', *({HEAVY} & set(sys.modules)))"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(told.stdout.splitlines()[-1].split()) - {"loaded"} <= allowed


def test_a_command_does_its_linear_algebra_on_one_thread():
    """Threads of it wait for one another without rest, and sums are formed in another order."""
    code = (
        "import sys; sys.argv = ['keyrecon', 'relink', 'nowhere', 'v.mp4']\n"
        "from keyrecon import cli\n"
        "try:\n    cli.main()\nexcept SystemExit:\n"
        "    import scipy.linalg, threadpoolctl\n"
        "    libraries = threadpoolctl.threadpool_info()\n"
        "    print({own['num_threads'] for own in libraries if own['user_api'] == 'blas'})"
    )
    environment = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
    told = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
    )
    assert told.stdout.splitlines()[-1] == "{1}"


def test_the_help_shows_every_command_by_the_first_line_of_its_docstring(keyrecon):
    _, out, _ = keyrecon("--help")
    shown = " ".join(re.sub(r"[│•]", " ", out).split())
    for name, command in cli.COMMANDS.items():
        if isinstance(command, dict):
            assert f"{name} {cli.SUMMARIES[name]}" in shown
        else:
            module = import_module(f"{command.package}.{command.module}")
            assert f"{name} {getattr(module, command.name).__doc__.splitlines()[0]}" in shown


def test_a_reader_who_goes_away_is_no_fault():
    reading, writing = os.pipe()
    os.close(reading)
    told = subprocess.run(
        [sys.executable, "-m", "keyrecon", "--help"], stdout=writing, stderr=subprocess.PIPE
    )
    os.close(writing)
    assert (told.returncode, told.stderr) == (141, b"")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_annotator_ends_alike_by_a_key_and_by_a_signal(project, number):
    command = [sys.executable, "-m", "keyrecon", "annotate", str(project), "--no-browser"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert "Open in a browser" in process.stdout.readline()
        process.stdout.readline()
        time.sleep(0.3)
        process.send_signal(number)
        out, err = process.communicate(timeout=30)
    assert out == "Stopped. Everything that was marked is kept.\n"
    assert (process.returncode, err) == (0, "")


def test_a_signal_ends_work_like_a_key(keyrecon, project, monkeypatch):
    monkeypatch.setattr("keyrecon.app.running.run", lambda *_, **__: os.kill(os.getpid(), 15))
    code, _, err = keyrecon("run", project)
    assert code == 130
    assert "finished stages are kept" in err
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_public_names_are_there_for_programs_and_for_type_checkers():
    for name in package.__all__:
        assert getattr(package, name) is not None
    tree = ast.parse(Path(package.__file__).read_text())
    checked = next(node for node in tree.body if isinstance(node, ast.If))
    imported = [
        alias.asname for node in checked.body if hasattr(node, "names") for alias in node.names
    ]
    assert sorted([*imported, "__version__"]) == sorted(package.__all__)


@pytest.mark.parametrize(
    "words",
    [
        ("run", "{p}", "--height", "1.8", "--depths", "{p}/bad.npz"),
        ("run", "{p}", "--lift.height", "inf"),
        ("run", "{p}", "--propagate.rounds", "-3"),
        ("keyframes", "{p}", "--budget", "nan"),
        ("keyframes", "{p}", "--budget", "0.2"),
        ("keyframes", "{p}", "--camera.width", "1000000000"),
        ("import", "{p}", "{p}/bad.npz"),
        ("relink", "{p}", "{p}/bad.npz"),
        ("add", "{p}/bad.npz", "--project", "{p}"),
        ("add", "{p}/../video.mp4", "--project", "{p}"),
    ],
)
def test_a_refused_command_leaves_the_project_as_it_was(project, keyrecon, words):
    (project / "bad.npz").write_bytes(b"PK\x03\x04" + b"\xff" * 300)
    before = {p: p.read_bytes() for p in project.rglob("*") if p.is_file()}
    code, _, err = keyrecon(*(word.format(p=project) for word in words))
    assert one_line(code, err)
    after = {p: p.read_bytes() for p in project.rglob("*") if p.is_file() and p.suffix != ".lock"}
    assert {p: d for p, d in after.items() if "cache" not in p.parts} == before
