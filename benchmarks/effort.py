"""What a keyframe costs a person on the annotator's page, on real clips marked by eye.

    python benchmarks/effort.py [--only NAME ...] [--work DIR]

Of each clip one whole body is marked in a clear frame, by clicks; the program chooses keyframes;
each half of them is marked on the page, in a driven browser, where the nearest frame with all
joints marked by eye is. What the page suggests is taken where it is within 2 % of the player's
height of the mark by eye; other joints are dragged there, or clicked where nothing is suggested.
Clicks, drags and keys are counted, those for depth too (the best of the readings is taken). Prints
for every clip actions per keyframe half, median and worst, how many of them go to depth, and how
long the program took for the keyframes.
"""

import argparse
import shutil
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from annotator import MAX_SUGGESTION_ERROR, Answers, correct_suggestion, mark_all
from real import DEVELOP, VIDEOS, Clip, choose_bodies, load_clip, nearest_rows, take

from keyrecon.app import keyframing, project
from keyrecon.app.console import show
from keyrecon.io.formats.coco import write_coco
from keyrecon.io.formats.keyframes import keyframes_from_json
from keyrecon.io.workspace import Workspace
from keyrecon.pipeline import Options


@dataclass(frozen=True)
class Effort:
    """What the keyframes of one clip cost."""

    actions: list[float]
    """Per half, of every marked frame."""
    depth: float
    """Of these, mean keys for depth."""
    seconds: float
    """For the keyframes, without a person."""


def with_every_joint(clip: Clip) -> Clip:
    """The clip with those marks by eye alone that have all joints."""
    rows = np.isfinite(clip.truth.joints[..., 0]).all(axis=1)
    of_frames = ("frames", "joints", "visible", "nearer")
    kept = replace(clip.truth, **{name: getattr(clip.truth, name)[rows] for name in of_frames})
    return replace(clip, truth=kept, seen=clip.seen[rows], action=clip.action[rows])


def begin(clip: Clip, work: Path) -> tuple[Path, np.ndarray, float]:
    """A project with one marked body and keyframes; rows of the truth to mark; seconds it took."""
    folder = work / clip.name
    shutil.rmtree(folder, ignore_errors=True)
    project.start(VIDEOS / f"{clip.name}.mp4", folder)
    workspace, first = Workspace(folder), choose_bodies(clip, 1)
    size = clip.video.width, clip.video.height
    write_coco(workspace.annotations_file, take(clip, first, first), size)
    began = time.perf_counter()
    keyframing.find_keyframes(workspace, Options(), keyframing.KeyframeSettings(), show)
    seconds = time.perf_counter() - began
    asked = keyframes_from_json(workspace.keyframes_file.read_text())
    return folder, np.setdiff1d(nearest_rows(clip, asked.frames), first), seconds


def measure(name: str, work: Path) -> Effort:
    """Mark the keyframes of a clip on the page."""
    clip = with_every_joint(load_clip(name))
    folder, rows, seconds = begin(clip, work)
    frames = clip.truth.frames[rows].tolist()
    tall = np.ptp(clip.truth.joints[..., 1], axis=1).max()
    way = partial(
        correct_suggestion, answers=Answers(clip.truth), max_error=MAX_SUGGESTION_ERROR * tall
    )
    done, _ = mark_all(folder, frames, way, own=frames)
    actions = [(one.placing + one.depth_keys) / 2 for one in done]
    depth = float(np.mean([one.depth_keys / 2 for one in done]))
    return Effort(actions, depth, seconds)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", default=DEVELOP, help="names of clips")
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work/effort"))
    words = parser.parse_args()
    print(f"{'clip':<26}{'halves':>8}{'median':>8}{'worst':>8}{'depth':>8}{'s':>8}")
    every: list[float] = []
    for name in words.only:
        effort = measure(name, words.work)
        every += effort.actions
        print(
            f"{name:<26}{2 * len(effort.actions):>8}{np.median(effort.actions):>8.1f}"
            f"{max(effort.actions):>8.1f}{effort.depth:>8.1f}{effort.seconds:>8.0f}",
            flush=True,
        )
    print(f"{'all':<26}{2 * len(every):>8}{np.median(every):>8.1f}{max(every):>8.1f}")


if __name__ == "__main__":
    main()
