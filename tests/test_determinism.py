"""Identical input gives identical bits, however many cores there are and wherever arrays lie."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from drawn_player import film

from keyrecon.tracking.radial_symmetry import gradient_field

ASSIST = Path(__file__).parent / "annotate" / "assist"
RALLY = """
import sys
from pathlib import Path
import numpy as np
from drawn_player import heads, corners, picks
from test_answers import OFFSETS
from keyrecon.annotate.assist.answers import make_assistant
from keyrecon.app import exporting, keyframing, project, running
from keyrecon.body import LSP14
from keyrecon.io.formats.coco import write_coco
from keyrecon.io.formats.keyframes import read_keyframes
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options
from keyrecon.progress import silent
from keyrecon.records import Annotations

def make(video, folder):
    project.start(video, folder)
    workspace = Workspace(folder)
    workspace.add_picks(picks(24, True))
    keyframing.find_keyframes(workspace, Options(), keyframing.KeyframeSettings(budget=0.2), silent)
    frames = read_keyframes(workspace.keyframes_file).frames
    places = (heads(24) - corners(24, True))[frames, None] + OFFSETS
    seen, nearer = np.ones(places.shape[:2], bool), np.zeros((len(frames), 13), np.int64)
    marks = Annotations(LSP14, frames, places, seen, nearer)
    write_coco(workspace.annotations_file, marks, (320, 180))
    running.run(workspace, running.run_options(workspace, Options(), 1.8), silent)
    names = ["m.bvh", "m.trc", "m.csv", "m.glb", "m.json", "m.npz", "m.mp4", "m.c3d"]
    exporting.export(workspace, [folder / name for name in names], silent)
    few, assistant = Annotations(LSP14, frames[:2], places[:2], seen[:2], nearer[:2]), None
    assistant = make_assistant(workspace)
    told = [assistant.suggestion(few, int(frame)) for frame in (frames[2], 15)]
    (folder / "suggestions.json").write_text(repr([told, assistant.next_frames(few, frozenset())]))

for folder in sys.argv[2:]:
    make(Path(sys.argv[1]), Path(folder))
"""
SWING = """
import sys
from pathlib import Path
from keyrecon.app.golf import fit_file
from small_swing import QUICK

video, folder = Path(sys.argv[1]), Path(sys.argv[2])
fit_file(video, video.with_name("clicks.json"), folder, options=QUICK)
"""
TIMED = ("report.html", "project.toml", "annotator.json", "exports.json")
"""Files that tell how long something took, when a file was written, or where the video lies."""


def made_by(script: str, video: Path, folders: list[Path], cores: set[int]) -> list[dict[str, str]]:
    """Digests of all files that a script makes in each of some folders, on some cores."""
    support = [path for path in sys.path if path]
    environment = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
    ran = subprocess.run(
        [sys.executable, "-c", script, str(video), *map(str, folders)],
        capture_output=True,
        text=True,
        env={**environment, "PYTHONPATH": os.pathsep.join([*support, str(ASSIST)])},
        preexec_fn=lambda: os.sched_setaffinity(0, cores),
    )
    assert ran.returncode == 0, ran.stderr
    return [digests(folder) for folder in folders]


def digests(folder: Path) -> dict[str, str]:
    """Of all files in a folder, by name."""
    files = (path for path in folder.rglob("*") if path.is_file() and path.name not in TIMED)
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in files
    }


def differing(one: dict[str, str], other: dict[str, str]) -> set[str]:
    """Files that are not the same, or not there."""
    return {file for file in one.keys() | other.keys() if one.get(file) != other.get(file)}


several_cores = pytest.mark.skipif(
    not hasattr(os, "sched_setaffinity"), reason="cores cannot be chosen here"
)


@several_cores
def test_one_core_and_all_cores_make_the_same_files_and_so_does_a_second_time(tmp_path):
    film(tmp_path / "rally.mp4", 24, True)
    cores = os.sched_getaffinity(0)
    (one,) = made_by(RALLY, tmp_path / "rally.mp4", [tmp_path / "one"], {min(cores)})
    assert len(one) > 5
    others = [tmp_path / "all", tmp_path / "again"]
    for other in made_by(RALLY, tmp_path / "rally.mp4", others, cores):
        assert differing(one, other) == set()


@several_cores
def test_so_they_do_of_a_swing_and_so_does_another_program(fitted_swing, tmp_path):
    """The one at hand was fitted on all cores, linear algebra included."""
    here, one_core = digests(fitted_swing / "project"), {min(os.sched_getaffinity(0))}
    assert len(here) > 5
    (other,) = made_by(SWING, fitted_swing / "video.mp4", [tmp_path / "one"], one_core)
    assert differing(here, other) == set()


def test_gradients_do_not_depend_on_where_their_picture_lies_in_memory():
    picture = np.random.default_rng(0).random((61, 67)).astype(np.float32)
    first = gradient_field(picture)
    for shift in range(1, 16):
        room = np.empty(picture.size + 16, np.float32)
        moved = room[shift : shift + picture.size].reshape(picture.shape)
        moved[:] = picture
        again = gradient_field(moved)
        np.testing.assert_array_equal(again.gx, first.gx)
        np.testing.assert_array_equal(again.x, first.x)
