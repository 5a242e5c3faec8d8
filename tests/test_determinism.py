"""Identical input gives identical bits, however many cores there are and wherever arrays lie."""

import hashlib
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn_player import film

from keyrecon.app.golf_demo import SEED, click_first_frame, draw_swing
from keyrecon.io.formats.clicks import write_clicks
from keyrecon.io.formats.model_file import read_motion_model
from keyrecon.metrics import read_truth
from keyrecon.synthetic.golf import SwingFilm, film_swing
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

video, folder = Path(sys.argv[1]), Path(sys.argv[2])
project.start(video, folder)
workspace = Workspace(folder)
workspace.add_picks(picks(24, True))
keyframing.find_keyframes(workspace, Options(), keyframing.KeyframeSettings(budget=0.2), silent)
frames = read_keyframes(workspace.keyframes_file).frames
places = (heads(24) - corners(24, True))[frames, None] + OFFSETS
seen, nearer = np.ones(places.shape[:2], bool), np.zeros((len(frames), 13), np.int64)
marks = Annotations(LSP14, frames, places, seen, nearer)
write_coco(workspace.annotations_file, marks, (320, 180))
running.run(workspace, running.settings(workspace, Options(), 1.8), silent)
names = ["m.bvh", "m.trc", "m.csv", "m.glb", "m.json", "m.npz", "m.mp4", "m.c3d"]
exporting.export(workspace, [folder / name for name in names], silent)
few, assistant = Annotations(LSP14, frames[:2], places[:2], seen[:2], nearer[:2]), None
assistant = make_assistant(workspace)
told = [assistant.suggestion(few, int(frame)) for frame in (frames[2], 15)]
(folder / "suggestions.json").write_text(repr([told, assistant.next_frames(few, frozenset())]))
"""
SWING = """
import sys
from pathlib import Path
from keyrecon.app.golf import fit_file
from keyrecon.golf.fit.fitting import FitOptions
from keyrecon.golf.swing_fit import GolfOptions

options = GolfOptions(fit=FitOptions(components=4, steps=3), guided_rounds=1, candidates=1)
video, folder = Path(sys.argv[1]), Path(sys.argv[2])
fit_file(video, video.with_name("clicks.json"), folder, options=options)
"""
TIMED = ("report.html", "project.toml", "annotator.json")
"""Files that tell how long something took, or where the video lies from there."""


def made_by(script: str, video: Path, folder: Path, cores: set[int]) -> dict[str, str]:
    """Digests of all files that a script makes in a folder, on some cores."""
    support = [path for path in sys.path if path]
    environment = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
    ran = subprocess.run(
        [sys.executable, "-c", script, str(video), str(folder)],
        capture_output=True,
        text=True,
        env={**environment, "PYTHONPATH": os.pathsep.join([*support, str(ASSIST)])},
        preexec_fn=lambda: os.sched_setaffinity(0, cores),
    )
    assert ran.returncode == 0, ran.stderr
    files = (path for path in folder.rglob("*") if path.is_file() and path.name not in TIMED)
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in files
    }


@pytest.fixture(scope="module")
def videos(tmp_path_factory):
    """A drawn player before a panning camera, and a rendered swing with its clicks."""
    folder = tmp_path_factory.mktemp("videos")
    film(folder / "rally.mp4", 24, True)
    swing = SwingFilm(fps=24.0, before=0.3, after=0.2)
    camera = replace(swing.scene.camera, width=400, height=300, player_px=190.0)
    swing = replace(swing, scene=replace(swing.scene, camera=camera, workers=1))
    film_swing(draw_swing(read_motion_model(), SEED), swing, folder)
    write_clicks(folder / "clicks.json", click_first_frame(read_truth(folder / "truth.npz")))
    return folder


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="cores cannot be chosen here")
@pytest.mark.parametrize(("script", "video"), [(RALLY, "rally.mp4"), (SWING, "video.mp4")])
def test_one_core_and_all_cores_make_the_same_files_and_so_does_a_second_time(
    videos, tmp_path, script, video
):
    cores = os.sched_getaffinity(0)
    one = made_by(script, videos / video, tmp_path / "one", {min(cores)})
    assert len(one) > 5
    for name in ("all", "again"):
        other = made_by(script, videos / video, tmp_path / name, cores)
        assert {file for file in one.keys() | other.keys() if one.get(file) != other.get(file)} == (
            set()
        )


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
