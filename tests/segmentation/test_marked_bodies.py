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
    unlike = np.zeros(joints.shape[:2])
    flow = FlowTracks(joints, confidence, confidence > 0, drift=unlike + 1, likeness=unlike)
    anchors = anchors_from_bodies(body(), flow)
    fixed = np.isfinite(anchors.head).all(axis=1)
    assert anchors.frames[fixed].tolist() == [7, 8]
    assert anchors.marked[fixed].tolist() == [True, False]
    assert not np.isfinite(anchors.followed_head).any()


def followed_body(drift, likeness):
    """What flow says of frame 8, where it leads every joint from the mark in frame 7: the fixed
    head, the one it leads to, and how doubtful that is; nothing where it is no anchor."""
    joints = np.tile(body().joints, (9, 1, 1))
    joints[:8] = np.nan
    values = [np.full(joints.shape[:2], v) for v in (0.0, drift, likeness)]
    flow = FlowTracks(joints, values[0], values[0] > 0, drift=values[1], likeness=values[2])
    anchors = anchors_from_bodies(body(), flow)
    if anchors.frames.tolist() == [7]:
        return None
    assert anchors.frames.tolist() == [7, 8]
    return tuple(value[1] for value in (anchors.head, anchors.followed_head, anchors.head_doubt))


def test_steps_that_led_back_fix_a_head_though_it_has_turned_and_looks_are_only_alike():
    head, led, _ = followed_body(drift=0.01, likeness=0.45)
    assert np.isfinite(head).all()
    assert np.isnan(led).all()


def test_a_head_that_flow_is_less_sure_of_is_likelier_the_less_it_drifted_and_the_more_alike():
    doubts = []
    for drift, likeness in ((0.03, 0.6), (0.1, 0.6), (0.1, 0.35)):
        head, led, doubt = followed_body(drift, likeness)
        assert np.isnan(head).all()
        assert np.isfinite(led).all()
        doubts.append(float(doubt))
    assert 0 < doubts[0] < doubts[1] < doubts[2] < 1


def test_two_feet_that_flow_has_in_one_place_are_not_fixed_for_their_looks():
    for together, fixed in ((False, True), (True, False)):
        joints = np.tile(body().joints, (9, 1, 1))
        if together:
            joints[:, LSP14.index("left_ankle")] = joints[:, LSP14.index("right_ankle")] + 3.0
        exact = np.full(joints.shape[:2], 0.01)
        flow = FlowTracks(joints, 0 * exact, exact > 1, drift=exact, likeness=50 * exact)
        anchors = anchors_from_bodies(body(), flow)
        assert np.isfinite(anchors.head[anchors.frames == 8]).all()
        assert np.isfinite(anchors.feet[anchors.frames == 8]).all() == fixed


def test_where_nothing_is_like_the_mark_flow_leads_nowhere():
    assert followed_body(drift=0.001, likeness=0.1) is None


def test_a_body_is_footless_where_legs_are_marked_and_no_foot():
    legs = [f"{side}_{name}" for side in ("right", "left") for name in ("hip", "knee", "ankle")]
    feet = [name for name in legs if name.endswith("ankle")]
    assert anchors_from_bodies(body(missing=feet)).footless.all()
    assert not anchors_from_bodies(body(missing=feet[:1])).footless.any()
    assert not anchors_from_bodies(body(missing=legs)).footless.any()  # the upper half alone
