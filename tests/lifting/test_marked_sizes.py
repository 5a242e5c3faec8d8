"""How large marked bodies appear, by their bones alone."""

import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.lifting.marked_sizes import marked_heights
from keyrecon.records import Annotations, Shots

FRAMES = np.array([0, 60, 120, 180])
SIZES = np.array([200.0, 220.0, 300.0, 380.0])
"""Statures, px."""


def bodies(lower=()):
    """One body seen from the front, in four sizes; its legs are marked in the rows `lower` only."""
    across = {"shoulder": 0.11, "elbow": 0.16, "wrist": 0.2, "hip": 0.08, "knee": 0.09}
    down = {"shoulder": 0.03, "elbow": 0.21, "wrist": 0.35, "hip": 0.3, "knee": 0.55, "ankle": 0.79}
    places = {"neck": (0.0, 0.0), "head_top": (0.0, -0.17)}
    for joint, y in down.items():
        x = across.get(joint, 0.09)
        places |= {f"right_{joint}": (-x, y), f"left_{joint}": (x, y)}
    body = np.array([places[name] for name in LSP14.names])
    joints = SIZES[:, None, None] * body + [300.0, 200.0]
    hidden = ~np.isin(np.arange(len(SIZES)), lower)
    legs = [
        LSP14.index(f"{side}_{joint}") for side in ("right", "left") for joint in ("knee", "ankle")
    ]
    joints[np.ix_(hidden, legs)] = np.nan
    seen = np.isfinite(joints).all(axis=2)
    signs = np.zeros((len(SIZES), len(LSP14.bones)), dtype=np.int64)
    return Annotations(LSP14, FRAMES, joints, seen, signs)


def test_bodies_without_legs_have_their_sizes_against_those_with_legs():
    heights = marked_heights(bodies(lower=[0]), 200.0, 30.0, Shots.between((), 200))
    assert heights / heights[0] == pytest.approx(SIZES / SIZES[0], rel=0.1)


def test_a_body_of_few_bones_tells_nothing():
    marks = bodies()
    joints = marks.joints.copy()
    joints[1, [n for n, name in enumerate(LSP14.names) if name not in ("neck", "head_top")]] = (
        np.nan
    )
    fewer = Annotations(LSP14, FRAMES, joints, marks.visible, marks.nearer)
    heights = marked_heights(fewer, 200.0, 30.0, Shots.between((), 200))
    assert np.isnan(heights[1]) and np.isfinite(heights[[0, 2, 3]]).all()
