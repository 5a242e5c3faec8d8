"""The posture table of keyrecon/lifting/priors/anatomy.py, from the captures it was made of.

    python benchmarks/posture_table.py [--mocap DIR]

Prints mean and covariance of limb directions in the form in which the module holds them. The
choices: five captures of different activities, all weighing the same however long they last; 0.3 s
dropped at either end, 50 poses a second; left limbs mirrored; the variance of unknown people and of
unsure trunks added; two decimals. The tennis captures are not among them, so that what is measured
on rendered tennis is measured on players whom the prior does not know.
"""

import argparse
from pathlib import Path

import numpy as np
from sequences import DATA

from keyrecon.app.depth_training import read_poses
from keyrecon.body import LSP14
from keyrecon.lifting.priors.anatomy import limb_axes, trunk_axes
from keyrecon.numerics.geometry import unit_vectors

CAPTURES = (
    "cmu/cmu_05_12_daz.bvh",  # a dance
    "cmu/cmu_10_06_daz.bvh",  # a kick at a ball
    "cmu/cmu_13_30_daz.bvh",  # jumping jacks with squats, and a jog
    "cmu/cmu_13_32_mb.bvh",  # a forward jump
    "golf/cmu_64_07_golf_swing.c3d",
)
SPREAD = 0.2
"""Standard deviation added to every direction cosine for other people and unsure trunks."""
LIMBS = {"arm": ("shoulder", "elbow", "wrist"), "leg": ("hip", "knee", "ankle")}


def limb_directions(joints: np.ndarray, kind: str) -> np.ndarray:
    """(2 T, 6): outward, up, forward of the upper and the lower bone, of both sides."""

    def joint(name: str) -> np.ndarray:
        return joints[:, LSP14.index(name)]

    corners = [f"{side}_{name}" for name in ("hip", "shoulder") for side in ("right", "left")]
    hips, shoulders, up = trunk_axes(np.stack([joint(c) - joint("neck") for c in corners], axis=1))
    rows = []
    for side, sign in (("right", 1), ("left", -1)):
        axes = limb_axes(shoulders if kind == "arm" else hips, up, sign)
        root, middle, end = (joint(f"{side}_{name}") for name in LIMBS[kind])
        bones = unit_vectors(middle - root), unit_vectors(end - middle)
        rows.append(np.stack([(bone * axis).sum(-1) for bone in bones for axis in axes], axis=1))
    return np.concatenate(rows)


def posture_moments(captures: list[np.ndarray], kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance over captures that weigh the same."""
    directions = [limb_directions(joints, kind) for joints in captures]
    mean = np.mean([d.mean(axis=0) for d in directions], axis=0)
    second = np.mean([d.T @ d / len(d) for d in directions], axis=0)
    return mean, second - np.outer(mean, mean) + SPREAD**2 * np.eye(6)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mocap", type=Path, default=DATA / "mocap")
    folder = parser.parse_args().mocap
    captures = [read_poses(folder / name) for name in CAPTURES]
    moments = {kind: posture_moments(captures, kind) for kind in LIMBS}
    print("_MEAN = {")
    for kind, (mean, _) in moments.items():
        print(f'    "{kind}": np.array({_row(mean)}),')
    print("}\n_COVARIANCE = {")
    for kind, (_, covariance) in moments.items():
        print(f'    "{kind}": np.array(\n        [')
        for row in covariance:
            print(f"            {_row(row)},")
        print("        ]\n    ),")
    print("}")


def _row(values: np.ndarray) -> str:
    return "[" + ", ".join(f"{value + 0.0:.2f}" for value in np.round(values, 2)) + "]"


if __name__ == "__main__":
    main()
