"""Legs that are exchanged, frame by frame, on real clips where a player runs across the picture.

    python benchmarks/leg_order.py [--draws 3] [--mirrored] [--keep 1] [--cost 0.06] [--work DIR]

`benchmarks/real.py` holds 36 frames of a clip against marks by eye; a runner's step takes six. Here
`annotations/leg_order.json` tells of every frame which ankle is on the left. The clips are prepared
and marked as in benchmarks/draws.py, several choices of marks each, of which one in `--keep` frames
is kept. Prints for each choice the frames in which the ankles lie the other way round by more than
a twentieth of the player's height, of all that are told, and those of the longest run.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import real
from draws import mark_draw, prepare_clip

from keyrecon.app.console import show
from keyrecon.body import LSP14
from keyrecon.io import stages
from keyrecon.library import carry_joints
from keyrecon.records import Annotations

ORDER = real.TRUTH.parent / "leg_order.json"
APART = 0.05
"""Ankles nearer than this, in player heights, lie in no order."""


def thin(marks: Annotations, keep: int) -> Annotations:
    """One in `keep` frames of the marks of each half of the body."""
    joints = marks.joints.copy()
    for half in (LSP14.is_lower, ~LSP14.is_lower):
        rows = np.flatnonzero(np.isfinite(joints[:, half, 0]).any(axis=1))
        dropped = np.setdiff1d(rows, rows[::keep])
        joints[np.ix_(dropped, half)] = np.nan
    rows = np.flatnonzero(np.isfinite(joints[..., 0]).any(axis=1))
    seen = marks.visible & np.isfinite(joints[..., 0])
    return replace(
        marks,
        frames=marks.frames[rows],
        joints=joints[rows],
        visible=seen[rows],
        nearer=marks.nearer[rows],
    )


def find_exchanged(joints: np.ndarray, height: np.ndarray, order: list) -> np.ndarray:
    """Frames whose ankles lie the other way round than `order` tells."""
    left, right = (joints[:, LSP14.index(f"{side}_ankle"), 0] for side in ("left", "right"))
    wrong = np.zeros(len(joints), bool)
    for first, last, side in order:
        part = slice(first, last + 1)
        beyond = (left - right)[part] / height[part]
        wrong[part] = (beyond if side == "left" else -beyond) > APART
    return np.flatnonzero(wrong)


def longest_run(frames: np.ndarray) -> int:
    """Frames of the longest run."""
    runs = np.split(frames, np.flatnonzero(np.diff(frames) > 1) + 1)
    return max(len(run) for run in runs)


def main() -> None:
    """Print a line for every choice of marks."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=3)
    parser.add_argument("--mirrored", action="store_true", help="show every clip in a mirror")
    parser.add_argument("--keep", type=int, default=1, help="keep one in so many marks")
    parser.add_argument("--cost", type=float, default=0.06, help="annotation cost asked for")
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work/real"))
    words = parser.parse_args()
    with patch.object(stages, "KEPT_RESULTS", words.draws + stages.KEPT_RESULTS):
        for name, order in json.loads(ORDER.read_text())["clips"].items():
            prepared = prepare_clip(real.load_clip(name, words.mirrored), words.cost, words.work)
            told = sum(last - first + 1 for first, last, _ in order)
            for seed in range(words.draws):
                made, marks = mark_draw(prepared, seed)
                marks = thin(marks, words.keep)
                tracks = carry_joints(made, marks, prepared.options, prepared.store.keep, show)
                wrong = find_exchanged(tracks.joints, made.track.height, order)
                print(
                    f"{prepared.clip.name:<34}{len(marks.frames):4d} marked frames"
                    f"{len(wrong):5d} of {told} exchanged, longest run {longest_run(wrong)}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
