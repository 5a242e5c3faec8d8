"""What a result says of itself: where each joint comes from."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.io.formats.coco import write_coco_motion
from keyrecon.io.video import Video
from keyrecon.lifting.lifting import LiftResult
from keyrecon.pipeline import Options, assemble_motion, swing_prior_options
from keyrecon.records import SOURCES, Annotations, JointTracks
from keyrecon.report.summary import missing_shares

T, J = 6, 14
MARKED, UNSEEN, NOWHERE, SLIPPED, UNSEEN_SLIP = (0, 0), (1, 3), (2, 4), (3, 5), (4, 6)
"""A frame and a joint of each kind; all others are carried."""


@pytest.fixture
def motion():
    joints = np.random.default_rng(0).uniform(100, 300, (T, J, 2))
    confidence, rejected = np.full((T, J), 0.6), np.zeros((T, J), dtype=bool)
    confidence[UNSEEN] = confidence[UNSEEN_SLIP] = confidence[NOWHERE] = 0
    joints[NOWHERE] = np.nan
    rejected[SLIPPED] = rejected[UNSEEN_SLIP] = True
    placed = np.full((1, J, 2), np.nan)
    placed[0, MARKED[1]] = joints[MARKED]
    marks = Annotations(
        LSP14,
        np.array([0]),
        placed,
        np.isfinite(placed[..., 0]),
        np.zeros((1, len(LSP14.bones)), dtype=np.int64),
    )
    space = np.random.default_rng(1).normal(size=(T, J, 3))
    bones = np.zeros((1, len(LSP14.bones)))
    lifted = LiftResult(
        points3d=space,
        points2d=np.nan_to_num(joints, nan=150.0),
        scale=np.full(T, 100.0),
        lengths=LSP14.lengths,
        signs=bones.astype(np.int64),
        rejected=rejected,
    )
    frames = np.arange(T)
    video = Video(Path("v.mp4"), 640, 480, frames, frames / 25, 25.0, 0, False, None)
    carried = JointTracks(joints, confidence)
    return assemble_motion(video, marks, carried, lifted, None)


def test_a_joint_that_nothing_told_of_is_not_said_to_be_carried(motion):
    told = {where: SOURCES[motion.source[where]] for where in np.ndindex(T, J)}
    assert told.pop(MARKED) == "annotated"
    assert told.pop(SLIPPED) == "refined"
    assert {told.pop(w) for w in (UNSEEN, NOWHERE, UNSEEN_SLIP)} == {"interpolated"}
    assert {*told.values()} == {"propagated"}


def test_a_joint_that_nothing_told_of_counts_as_not_found(motion):
    found_nowhere = [UNSEEN[1], NOWHERE[1], UNSEEN_SLIP[1]]
    assert np.flatnonzero(missing_shares(motion)).tolist() == found_nowhere
    assert missing_shares(motion)[found_nowhere] == pytest.approx(1 / T)


def test_coco_has_a_joint_that_nothing_told_of_as_not_seen(motion, tmp_path):
    write_coco_motion(tmp_path / "m.json", motion, (640, 480))
    rows = json.loads((tmp_path / "m.json").read_text())["annotations"]
    seen = np.array([row["keypoints"] for row in rows]).reshape(T, J, 3)[..., 2]
    expected = np.full((T, J), 2)
    for where in (UNSEEN, NOWHERE, SLIPPED, UNSEEN_SLIP):
        expected[where] = 1
    assert (seen == expected).all()


def test_the_swing_prior_knows_the_lens_and_the_height_that_are_told():
    video = Video(Path("v.mp4"), 640, 480, np.arange(2), np.arange(2) / 25, 25.0, 0, False, None)
    usual = Options()
    assert swing_prior_options(usual, video) == usual.swing
    told = replace(usual, lift=replace(usual.lift, height=1.6, field_of_view=90.0))
    known = swing_prior_options(told, video)
    assert known.stature == 1.6
    assert known.focal == pytest.approx(0.5)
