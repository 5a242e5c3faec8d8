"""How the automatic tool that a user would try instead does on a rendered sequence.

MediaPipe Pose lives in an environment of its own; its interpreter is called on a script that
knows nothing of keyrecon, and what it writes is scored like our own motion. Frames in which it
finds nobody are left out of its errors and counted.
"""

import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from keyrecon.metrics import acceleration_error, n_mpjpe, pa_mpjpe, pck

SCRIPT = Path(__file__).parent / "mediapipe_peer.py"


@dataclass(frozen=True)
class PeerScores:
    """Accuracy of MediaPipe Pose over the joints that it shares with us."""

    found: float
    """Share of frames with a person."""
    pck: float
    pa_mpjpe: float
    n_mpjpe: float
    acceleration: float


def run_mediapipe(video: Path, python: Path, kept: Path) -> dict[str, np.ndarray]:
    """Joints by MediaPipe Pose, kept beside the video."""
    if not kept.is_file():
        subprocess.run([python, SCRIPT, video, kept], check=True, capture_output=True)
    with np.load(kept, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


def score_mediapipe(folder: Path, python: Path, truth: dict[str, np.ndarray]) -> PeerScores:
    """Scores on the sequence rendered in `folder`."""
    found = run_mediapipe(folder / "video.mp4", python, folder / "mediapipe.npz")
    known = [str(name) for name in truth["joint_names"]]
    names = [str(name) for name in found["joint_names"]]
    order = [known.index(name) for name in names]
    seen = np.isfinite(found["points3d"]).all(axis=(1, 2))
    points = 1000 * found["points3d"]
    gaps = np.where(seen[:, None, None], 1000 * truth["points3d"][:, order], np.nan)
    pixels = truth["points2d"][:, order]
    root = [names.index("right_hip"), names.index("left_hip")]
    return PeerScores(
        float(seen.mean()),
        pck(found["points2d"], pixels, (root[0], names.index("left_shoulder"))),
        pa_mpjpe(points, gaps),
        n_mpjpe(points, gaps, root),
        acceleration_error(points, gaps, root),
    )
