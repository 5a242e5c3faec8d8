"""How well exports stand on the floor: the lower ankle's height over it against the truth.

    python benchmarks/floor.py FOLDER=TRUTH.npz ...

takes motions of rendered sequences (project folders or motion.npz) with their truths, and prints
for each the camera's true and estimated pitch, and the error of the lower ankle's height (root mean
square and 95th percentile, cm): with the floor of exports, and with one floor for the whole clip.
`jumps` is the mean error while both ankles are .1 m over their usual height.
"""

import sys
from pathlib import Path

import numpy as np

from keyrecon.app.project import load_motion
from keyrecon.io.formats.conventions import camera_pitch, stand_on_floor

JUMP = 0.10
"""Height of the lower ankle over its median from which a player is in the air, metres."""


def measure(motion_path: Path, truth_path: Path) -> str:
    """One row of the table."""
    motion = load_motion(motion_path)
    names = motion.skeleton.names
    ankles = [names.index("right_ankle"), names.index("left_ankle")]
    with np.load(truth_path) as truth:
        rotation, center = truth["rotation"], truth["center"]
        told = truth["joint_names"].tolist()
        joints = truth["points3d"][:, [told.index(names[j]) for j in ankles]]
    true = (np.einsum("tji,tkj->tki", rotation, joints) + center)[..., 1].min(axis=1)
    pitch = np.degrees(np.arctan2(-rotation[:, 2, 1], -rotation[:, 1, 1])).mean()
    found = stand_on_floor(motion).points[:, ankles, 1].min(axis=1)
    camera = -motion.points3d[:, ankles, 1].max(axis=1)
    one = camera - np.median(camera) + np.median(true)
    jumping = true > np.median(true) + JUMP
    cells = [f"{pitch:.0f} / {np.degrees(camera_pitch(motion)):.0f}"]
    for heights in (found, one):
        error = 100 * (heights - true)
        jump = f"{error[jumping].mean():+.1f}" if jumping.any() else "-"
        spread = np.quantile(np.abs(error), 0.95)
        cells.append(f"{np.sqrt(np.mean(error**2)):.1f} / {spread:.1f}, jumps {jump}")
    return f"| {motion_path.name} | {' | '.join(cells)} |"


def main() -> None:
    """Print the table."""
    print("| sequence | camera's pitch, true / found | floor of exports | one floor |")
    print("|---|---|---|---|")
    for pair in sys.argv[1:]:
        motion, _, truth = pair.partition("=")
        print(measure(Path(motion), Path(truth)))


if __name__ == "__main__":
    main()
