"""Captured motion on its court, without drawing it: contact, jumps and the way, in half a minute.

    python benchmarks/world_captured.py [--mocap DIR] [--only NAME ...] [--frames N]

The motions and cameras of the rendered sequences, the truth with slow noise in place of a lifting
(as in `benchmarks/world.py`, whose columns these are), the true camera. Then the way over the
ground, as a share of the true one's: in all, across the line of sight and along it; and along it
apart, feet (their middle) and hips above the feet, as slopes of the found velocity on the true one.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from sequences import DATA, TENNIS, Sequence, mocap_files
from world import ANKLES, HIPS, PLACED, TO_COURT, Truth, _place, lift_truth, true_camera

from keyrecon.io.formats.mocap import read_mocap
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.records import Motion
from keyrecon.synthetic.cameras import CameraPlanOptions, View, plan_camera
from keyrecon.synthetic.clips import JOINTS, JoinOptions, join_with_toes
from keyrecon.synthetic.contacts import find_contacts
from keyrecon.synthetic.court import NET_Z
from keyrecon.synthetic.figure import estimate_stature
from keyrecon.synthetic.sequence import SynthOptions
from keyrecon.timeline import PER_FRAME
from keyrecon.world.pinhole import Pinhole
from keyrecon.world.placement import place_motion
from keyrecon.world.records import WorldMotion
from keyrecon.world.run_measures import run_velocity


def capture(sequence: Sequence, mocap: Path) -> Truth:
    """What a rendered sequence tells of its motion and its camera."""
    size = sequence.width, round(sequence.width * 9 / 16)
    plan = CameraPlanOptions(View(sequence.camera), sequence.pan, *size, float(sequence.player))
    trim = SynthOptions().trim
    length = JoinOptions(sequence.seconds, sequence.fps)
    joined = join_with_toes(read_mocap(mocap_files(sequence, mocap), trim), length)
    points, toes = joined[:, :JOINTS], joined[:, JOINTS:]
    rng = np.random.default_rng([sequence.seed, 3])
    move = plan_camera(points, sequence.fps, estimate_stature(points), plan, rng)
    shift = np.array([0, NET_Z, 0])
    cameras = [
        Pinhole(float(f), move.principal, r @ TO_COURT.T, TO_COURT @ move.center + shift)
        for f, r in zip(move.focal, move.rotation, strict=True)
    ]
    contact = find_contacts(points[:, ANKLES], toes, sequence.fps)
    return Truth(cameras, points @ TO_COURT.T + shift, move.project(points), contact)


def way(true: np.ndarray, world: WorldMotion, motion: Motion, centre: np.ndarray) -> str:
    """Shares of the true way, and slopes."""
    hips, feet = true[:, HIPS].mean(axis=1), true[:, ANKLES].mean(axis=1)
    sight = unit_vectors((hips - centre)[:, :2])
    aside = sight[:, ::-1] * [-1, 1]
    found_feet = world.points[:, ANKLES].mean(axis=1)

    def pace(place: np.ndarray) -> np.ndarray:
        return run_velocity(replace(world, root=place), motion)

    def share(axis: np.ndarray) -> float:
        after, before = (np.abs((pace(p) * axis).sum(axis=1)).sum() for p in (world.root, hips))
        return float(after / before)

    def slope(found: np.ndarray, place: np.ndarray) -> float:
        after, before = ((pace(p) * sight).sum(axis=1) for p in (found, place))
        return float((after * before).sum() / (before**2).sum())

    length = np.linalg.norm(pace(world.root), axis=1).sum()
    length /= np.linalg.norm(pace(hips), axis=1).sum()
    above = slope(world.root - found_feet, hips - feet)
    return (
        f"{length:8.2f}{share(aside):8.2f}{share(sight):8.2f}"
        f"{slope(found_feet, feet):8.2f}{above:8.2f}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--mocap", type=Path, default=DATA / "mocap")
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--frames", type=int, default=600)
    told = parser.parse_args()
    ways = "".join(f"{head:>8}" for head in ("way", "across", "along", "feet", "hips"))
    print(f"{'captured':<24}{PLACED}{ways}")
    own = slice(0, told.frames)
    for sequence in TENNIS:
        if told.only and sequence.name not in told.only:
            continue
        truth = capture(sequence, told.mocap)
        motion = lift_truth(truth, true_camera(truth), 1)
        motion = replace(motion, **{name: getattr(motion, name)[own] for name in PER_FRAME})
        camera, true = true_camera(truth).part(own), truth.points[own]
        placed = _place(true, truth.contact[own], camera, motion)
        world = place_motion(motion, camera)
        row = "" if world is None else way(true, world, motion, camera.centre)
        print(f"{sequence.name:<24}{placed}{row}", flush=True)


if __name__ == "__main__":
    main()
