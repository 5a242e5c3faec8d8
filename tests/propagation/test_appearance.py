"""What joints look like, learnt from marks."""

import cv2
import numpy as np
import pytest
from drawn_legs import (
    BODY,
    FRAMES,
    JOINTS,
    LEGS,
    ONE,
    OTHER,
    SIZE,
    Drawn,
    draw,
    marked_poses,
    replace_fps,
)

from keyrecon.propagation.appearance import describe_player, learn_appearance, regular_frames
from keyrecon.propagation.body_frame import BodyFrame
from keyrecon.propagation.bone_color import learn_bone_colors
from keyrecon.propagation.limb_identity import appearance_log_odds
from keyrecon.propagation.limb_search import search_by_appearance


@pytest.fixture(scope="module")
def appearance():
    features = describe_player(draw(JOINTS), BODY, np.arange(FRAMES))
    return learn_appearance(features, marked_poses(), JOINTS)


def test_a_joint_looks_like_its_mark_where_it_is_and_unlike_beside(appearance):
    both = np.stack([JOINTS, JOINTS + 0.15j, JOINTS + 0.3], axis=1)
    unlike = appearance.unlikeness(both)[2:4, :, 0][..., ONE]
    assert (unlike[:, 0] < unlike[:, 1:].min(axis=1)).all()


def test_the_middle_of_a_bone_looks_like_that_of_a_marked_one(appearance):
    both = np.stack([JOINTS, JOINTS + 0.3], axis=1)
    unlike = appearance.bone_unlikeness(both)[2:4, :, 0]
    shank = LEGS.bones.tolist().index(ONE[1:])
    assert (unlike[:, 0, shank] < unlike[:, 1, shank]).all()


def test_limbs_are_found_where_they_look_like_marked_ones(appearance):
    trunk = JOINTS.copy()
    trunk[:, [*ONE[1:], *OTHER[1:]]] = 9
    colors = learn_bone_colors(appearance.features, marked_poses(), JOINTS)
    found = search_by_appearance(appearance, colors, marked_poses(), trunk, 3)
    away = np.abs(found - JOINTS[:, None])[..., [*ONE, *OTHER]].max(axis=2)
    apart = np.abs(JOINTS[:, ONE[0]] - JOINTS[:, OTHER[0]]) > 0.15
    assert (away.min(axis=1)[apart] < 0.08).all()
    np.testing.assert_array_equal(found[..., ONE[0]], JOINTS[:, None, ONE[0]].repeat(3, axis=1))


def test_a_mark_is_alike_to_itself(appearance):
    assert appearance.unlikeness(JOINTS[:, None])[0, 0, 0] == pytest.approx(0, abs=1e-5)


def test_colour_tells_sides_that_outlines_do_not(appearance):
    apart = np.abs(JOINTS[:, ONE[0]] - JOINTS[:, OTHER[0]]) > 0.15
    right = appearance.unlikeness(JOINTS[:, None])[:, 0]
    wrong = appearance.unlikeness(JOINTS[:, None, LEGS.mirror])[:, 0]
    assert (appearance_log_odds(LEGS, right, 25.0)[apart] > 1).all()
    assert (appearance_log_odds(LEGS, wrong, 25.0)[apart] < -1).all()


def test_the_size_of_the_player_does_not_matter(appearance):
    larger = BodyFrame(1.5 * (BODY.origin + 0.5 + 0.5j) - (0.5 + 0.5j), 1.5 * BODY.height)
    size = (round(1.5 * SIZE[0]), round(1.5 * SIZE[1]))
    video = Drawn([cv2.resize(p, size, interpolation=cv2.INTER_LINEAR) for p in draw(JOINTS).drawn])
    found = describe_player(video, larger, np.arange(FRAMES)).cells
    apart = np.abs(found.astype(int) - appearance.features.cells)
    assert np.median(apart) <= 4


def test_of_a_fast_camera_no_more_frames_are_described_than_of_a_slow_one():
    every = Drawn(draw(JOINTS).drawn)
    fast = replace_fps(every, 120.0)
    np.testing.assert_array_equal(regular_frames(fast), [0, 4, 8])
