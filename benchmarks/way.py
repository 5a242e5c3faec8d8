"""How well the player's way over the court is measured: length, top speed and top acceleration.

    python benchmarks/way.py FOLDER ...

takes rendered sequences as `benchmarks/accuracy.py --work` leaves them (truth.npz and cache/), puts
the last lifted motion of each on its ground by the true camera, and compares the way with the true
one, twelve seconds at a time, both averaged alike. Prints each sequence and, at the end, what
`keyrecon/world/run_measures.py` tells as the standard errors.
"""

import sys
from pathlib import Path

import numpy as np

from keyrecon.body import LSP14
from keyrecon.io.storage import load_record
from keyrecon.lifting.lifting import LiftResult
from keyrecon.records import Motion
from keyrecon.world.placement import place_motion
from keyrecon.world.records import WorldCamera, WorldMotion
from keyrecon.world.run_measures import TOP, run_velocity

TO_COURT = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Axes of rendered worlds (y up, net at negative z) to those of the court."""
PIECE = 12.0
"""Seconds that are measured at a time."""


def camera_and_points(truth: dict[str, np.ndarray]) -> tuple[WorldCamera, np.ndarray]:
    """The true camera and joints in the court's axes."""
    count, net = len(truth["focal"]), np.array([0, -11.885, 0])
    inner = np.zeros((count, 3, 3))
    inner[:, 0, 0] = inner[:, 1, 1] = truth["focal"]
    inner[:, :2, 2], inner[:, 2, 2] = truth["principal"], 1
    turn = truth["rotation"] @ TO_COURT.T
    shift = -turn @ (TO_COURT @ truth["center"] + net)
    sure = np.zeros((count, 3)), np.zeros(count), np.zeros(count)
    camera = WorldCamera(inner, turn, shift, np.ones(count, dtype=bool), *sure)
    world = np.einsum("tji,tnj->tni", truth["rotation"], truth["points3d"]) + truth["center"]
    return camera, world @ TO_COURT.T + net


def lifted(folder: Path, fps: float) -> Motion:
    """The last motion that was lifted."""
    file = max((folder / "cache").glob("lift-*.npz"), key=lambda path: path.stat().st_mtime)
    result: LiftResult = load_record(file)
    frames, joints = result.points3d.shape[:2]
    return Motion(
        LSP14, result.points3d, result.points2d, result.points2d, np.ones((frames, joints)),
        np.zeros((frames, joints), dtype=np.int64), result.scale, fps, np.arange(frames) / fps, "m",
        np.array([0]),
    )  # fmt: skip


def measures(world: WorldMotion, motion: Motion) -> np.ndarray:
    """Length, top speed and top acceleration of every piece."""
    velocity = run_velocity(world, motion)
    speed = np.linalg.norm(velocity, axis=1)
    acceleration = np.linalg.norm(np.gradient(velocity, motion.time, axis=0), axis=1)
    step = round(PIECE * motion.fps)
    rows = []
    for start in range(0, len(speed) - step + 1, step):
        own = slice(start, start + step)
        top = (np.percentile(values[own], TOP) for values in (speed, acceleration))
        rows.append([speed[own].sum() / motion.fps, *top])
    return np.array(rows)


def main() -> None:
    """Print the table."""
    hips = [LSP14.index("right_hip"), LSP14.index("left_hip")]
    true, found = [], []
    print(f"{'':<24}{'metres':>16}{'top, m/s':>16}{'top, m/s2':>16}")
    for folder in map(Path, sys.argv[1:]):
        with np.load(folder / "truth.npz") as stored:
            truth = dict(stored)
        motion = lifted(folder, float(truth["fps"]))
        camera, points = camera_and_points(truth)
        world = place_motion(motion, camera)
        if world is None:
            print(f"{folder.name:<24}no foot stands")
            continue
        contact = np.ones((len(points), 2), dtype=bool)
        true.append(measures(WorldMotion(points, points[:, hips].mean(1), contact, 1.0), motion))
        found.append(measures(world, motion))
        cells = zip(found[-1].mean(axis=0), true[-1].mean(axis=0), strict=True)
        print(f"{folder.name:<24}" + "".join(f"{a:8.2f} ({b:5.2f})" for a, b in cells))
    one, other = np.concatenate(found), np.concatenate(true)
    share = one / other
    off = np.sqrt(np.mean((share - 1) ** 2, axis=0))
    names = ("length", "top speed", "top acceleration")
    for name, error, times in zip(names, off, share.T, strict=True):
        print(f"{name} off by {error:.1%} ({times.min():.2f} to {times.max():.2f} times)")


if __name__ == "__main__":
    main()
