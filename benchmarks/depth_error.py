"""How far a depth model is off for players that it has not learnt from, bone by bone.

    python benchmarks/depth_error.py [--mocap DIR] [--without PLAYER ...] [--poses N]

Learns from all captures but those of the players (jarua and adorozco unless told otherwise), films
theirs from all around as `keyrecon.body_models.depth_training` does, without turned limbs, and
prints the root mean square error of depth in lengths of the bone: what `depth_spread` holds.
"""

import argparse
from pathlib import Path

import numpy as np
from sequences import DATA
from unseen import captures_without

from keyrecon.app.console import show
from keyrecon.app.depth_training import RATE, learn_from_files, read_poses
from keyrecon.body import LSP14
from keyrecon.body_models.depth_training import DepthTrainingOptions, draw_windows, gather

FILMED = 20_000


def main() -> None:
    """Learn, film, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mocap", type=Path, default=DATA / "mocap")
    parser.add_argument("--without", nargs="+", default=["jarua", "adorozco"])
    parser.add_argument("--poses", type=int, default=DepthTrainingOptions().poses)
    words = parser.parse_args()
    theirs, others = captures_without(set(words.without), words.mocap)
    model = learn_from_files(others, DepthTrainingOptions(poses=words.poses), show)
    as_they_are = DepthTrainingOptions(limb_turn=0.0, pace=0.0, still=0.0)
    source = gather([read_poses(file) for file in theirs])
    rng = np.random.default_rng(1)
    windows = draw_windows(source, RATE, FILMED, rng, as_they_are)
    told = model.forward(windows.inputs)[:, : len(LSP14.bones)]
    error = np.sqrt(((told - windows.depth_shares) ** 2).mean(axis=0))
    for (_, child), off in zip(LSP14.bones, error, strict=True):
        print(f"{LSP14.names[child]:<16}{off:6.3f}")
    print(f"{'all':<16}{np.sqrt((error**2).mean()):6.3f}")


if __name__ == "__main__":
    main()
