"""What a marked body tells in place of clicks."""

import numpy as np

from keyrecon.body import LSP14
from keyrecon.records import Annotations, FlowTracks
from keyrecon.segmentation.marked_bodies import anchors_from_bodies, picks_from_bodies

STANDING = {
    "head_top": (100, 10), "neck": (100, 40),
    "right_shoulder": (80, 45), "left_shoulder": (120, 45),
    "right_elbow": (75, 80), "left_elbow": (125, 80),
    "right_wrist": (75, 110), "left_wrist": (125, 110),
    "right_hip": (90, 110), "left_hip": (110, 110),
    "right_knee": (90, 160), "left_knee": (110, 160),
    "right_ankle": (90, 210), "left_ankle": (110, 210),
}  # fmt: skip


def body(hidden=(), missing=()):
    """One marked frame, number 7."""
    joints = np.array([STANDING[name] for name in LSP14.names], dtype=float)[None]
    joints[0, [LSP14.index(name) for name in missing]] = np.nan
    visible = np.array([[name not in (*hidden, *missing) for name in LSP14.names]])
    signs = np.zeros((1, len(LSP14.bones)), dtype=np.int64)
    return Annotations(LSP14, np.array([7]), joints, visible, signs)


def test_head_and_shoes_are_clicked_beyond_neck_and_ankles():
    parts = {(p.part, round(p.x), round(p.y)) for p in picks_from_bodies(body(), (400, 300))}
    assert ("foot", 90, 219) in parts
    assert {y for part, _, y in parts if part == "head"} == {24}


def test_hidden_limbs_tell_no_colour_but_a_hidden_neck_still_tells_the_head():
    picks = picks_from_bodies(body(hidden=("neck", "right_wrist")), (400, 300))
    assert any(p.part == "head" for p in picks)
    assert sum(p.part == "forearm" for p in picks) == 2


def test_nothing_is_clicked_outside_the_picture():
    assert all(p.y < 200 for p in picks_from_bodies(body(), (400, 200)))


def test_anchors_are_centre_of_head_and_both_shoes():
    anchors = anchors_from_bodies(body())
    assert anchors.frames.tolist() == [7]
    assert anchors.marked.all()
    np.testing.assert_allclose(anchors.feet[0], [[90, 219], [110, 219]])
    assert np.isnan(anchors_from_bodies(body(missing=("left_ankle",))).feet).all()


def test_sure_flow_gives_further_anchors_that_nobody_marked():
    joints = np.tile(body().joints, (12, 1, 1))
    confidence = np.zeros(joints.shape[:2])
    confidence[8] = 0.9
    anchors = anchors_from_bodies(body(), FlowTracks(joints, confidence, confidence > 0))
    assert anchors.frames.tolist() == [7, 8]
    assert anchors.marked.tolist() == [True, False]


def test_a_body_is_footless_where_legs_are_marked_and_no_foot():
    legs = [f"{side}_{name}" for side in ("right", "left") for name in ("hip", "knee", "ankle")]
    feet = [name for name in legs if name.endswith("ankle")]
    assert anchors_from_bodies(body(missing=feet)).footless.all()
    assert not anchors_from_bodies(body(missing=feet[:1])).footless.any()
    assert not anchors_from_bodies(body(missing=legs)).footless.any()  # the upper half alone
