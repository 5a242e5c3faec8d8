"""The main job on a sequence that the project makes itself, against the known truth.

Renders 36 s of tennis from the built-in motion, then does what a user would do: a project,
picks, keyframes, marks, the run. Picks and marks are those kept in `annotations/`; marks were
made once on the keyframes of this sequence. A keyframe for which none is kept (another version
of the video encoder may lead to other keyframes) is marked anew from the truth with the click
noise of a careful person, and the demo says so.
"""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from keyrecon.app.keyframing import KeyframeSettings, find_keyframes
from keyrecon.app.project import evaluate, start
from keyrecon.app.running import prepared, run, run_options
from keyrecon.body import LSP14
from keyrecon.io.durable import put_aside, write_durably
from keyrecon.io.formats.annotations import marks_asked_for, merge_annotations, missing_marks
from keyrecon.io.formats.coco import coco_text, read_coco
from keyrecon.io.formats.picks import read_picks
from keyrecon.io.work_lock import lock_project
from keyrecon.io.workspace import Workspace
from keyrecon.metrics import read_truth
from keyrecon.pipeline import Options
from keyrecon.progress import Progress
from keyrecon.synthetic.marks import MarkOptions, mark_from_truth
from keyrecon.synthetic.sequence import SynthOptions, synthesize

KEPT = Path(__file__).parent.parent.parent / "annotations"
if not KEPT.is_dir():  # installed as a package
    KEPT = Path(__file__).parent.parent / "annotations"

CLICK_NOISE = 2.0
"""Standard deviation of marks made from the truth, px."""


def run_demo(name: str, out: Path, progress: Progress, say: Callable[[str], None]) -> None:
    """Render, prepare, mark, reconstruct, evaluate; writes into `out`."""
    began = time.perf_counter()
    sequence = out / "sequence"
    if not (sequence / "truth.npz").is_file():
        say(f"Rendering 36 s of {name} into {sequence}.")
        synthesize(sequence, (), SynthOptions(), progress)
    rendered = time.perf_counter() - began
    truth = read_truth(sequence / "truth.npz")
    workspace = _project(sequence / "video.mp4", out / "project")
    with lock_project(workspace.folder, "keyrecon demo"):
        workspace.add_picks(read_picks(KEPT / f"demo_{name}.picks.json"))
        say(find_keyframes(workspace, Options(), KeyframeSettings(), progress).split("\nNext")[0])
        say(_mark(workspace, truth, KEPT / f"demo_{name}.json", progress))
        options = run_options(workspace, Options(), round(float(truth["height_m"]), 2))
        say(run(workspace, options, progress, truth=truth))
    say("\nAccuracy against the truth")
    say(evaluate(workspace.folder, sequence / "truth.npz"))
    spent = {"rendering": rendered, **workspace.stages.seconds}
    say("\nSeconds by stage")
    say("\n".join(f"{stage:<24}{seconds:>10.1f}" for stage, seconds in spent.items()))
    say(f"{'everything':<24}{time.perf_counter() - began:>10.1f}")
    say(f"\nReport: {workspace.report_file}")


def _project(video_file: Path, folder: Path) -> Workspace:
    """The demo's project, begun if it is not there."""
    if not (folder / "project.toml").is_file():
        start(video_file, folder)
    return Workspace(folder)


def _mark(
    workspace: Workspace, truth: dict[str, np.ndarray], kept: Path, progress: Progress
) -> str:
    """Annotate the keyframes; tells where the marks come from."""
    preparation = prepared(workspace, Options(), progress)
    video, keyframes = preparation.video, preparation.keyframes
    size = (video.width, video.height)
    fresh = mark_from_truth(
        keyframes, truth["points2d"], truth["points3d"], truth["visible"], MarkOptions(CLICK_NOISE)
    )
    asked = (keyframes.upper.frames, keyframes.lower.frames)
    known = read_coco(kept, LSP14, len(video), size) if kept.is_file() else None
    known = marks_asked_for(known, *asked) if known else None
    missing = missing_marks(known, *asked)
    marks = merge_annotations(fresh, known) if known else fresh
    aside = _write_marks(workspace, coco_text(marks, size).encode())
    text = f"Marks of {len(keyframes.frames) - len(missing)} keyframes from {kept.name}"
    made = f", of {len(missing)} made from the truth" if missing else ""
    return f"{text}{made}.{aside}"


def _write_marks(workspace: Workspace, content: bytes) -> str:
    """Write annotations.json; tells of others that were there, which stay beside it."""
    file = workspace.annotations_file
    with workspace.exclusive():
        is_other = file.is_file() and file.read_bytes() != content
        note = (
            f" Other marks that were there are kept in {put_aside(file).name}." if is_other else ""
        )
        write_durably(file, content)
    return note
