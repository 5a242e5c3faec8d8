"""What joints look like, learnt from marks."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from keyrecon.body import LSP14
from keyrecon.io.frame_reader import reduce_picture
from keyrecon.io.video import Video
from keyrecon.propagation.appearance import describe_player, learn_appearance, regular_frames
from keyrecon.propagation.body_frame import BodyFrame
from keyrecon.propagation.edge_template import AnnotatedPoses
from keyrecon.propagation.half_body import split_body
from keyrecon.propagation.limb_identity import appearance_gain
from keyrecon.propagation.limb_search import search_by_looks

LEGS = split_body(LSP14)[0]
ONE, OTHER = map(list, LEGS.sides)
SIZE, TALL, FRAMES = (400, 300), 200.0, 12
PINK, BLACK = (230, 60, 140), (20, 20, 20)


class Drawn(Video):
    """Pictures in memory."""

    def __init__(self, drawn):
        stamps = np.arange(len(drawn))
        high, wide = drawn[0].shape[:2]
        super().__init__(Path("none.mp4"), wide, high, stamps, stamps / 25, 25.0, 0, False, None)
        object.__setattr__(self, "drawn", drawn)

    def chosen_frames(self, numbers, last):
        """Some of them."""
        yield from (p for n, p in enumerate(self.frames(0, last + 1)) if n in numbers)

    def frames(self, start=0, stop=None, width=None):
        """Reduced to a width."""
        for picture in self.drawn[start:stop]:
            yield picture if width is None else reduce_picture(picture, width)


def replace_fps(video, fps):
    """The same pictures, faster."""
    object.__setattr__(video, "fps", fps)
    return video


def walk(at):
    """Two legs that stand at -.15 and .15 body heights at first, and change places."""
    joints = np.zeros((FRAMES, len(LEGS.joints)), complex)
    joints[:, ONE] = -at[:, None] + 1j * np.array([0.0, 0.2, 0.4])
    joints[:, OTHER] = at[:, None] + 1j * np.array([0.0, 0.2, 0.4])
    return joints


JOINTS = walk(np.linspace(0.15, -0.15, FRAMES))
BODY = BodyFrame(np.full(FRAMES, 200.0 + 120.0j), np.full(FRAMES, TALL))


def draw(joints, colors=(PINK, BLACK)):
    """Legs as thick lines on grass."""
    grass = np.random.default_rng(1).integers(90, 130, (FRAMES, SIZE[1], SIZE[0], 3), np.uint8)
    for t in range(FRAMES):
        for side, color in zip((ONE, OTHER), colors, strict=True):
            path = BODY.to_pixels(joints[t, side], t)
            cv2.polylines(grass[t], [np.rint(path).astype(np.int32)], False, color, 14)
    return Drawn(list(grass))


def marked_poses():
    """The first and the last frame."""
    marked = np.array([0, FRAMES - 1])
    known, longest = np.ones((2, len(LEGS.joints)), bool), np.full(len(LEGS.bones), np.inf)
    return AnnotatedPoses(LEGS, marked, JOINTS[marked], known, longest)


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
    found = search_by_looks(appearance, marked_poses(), trunk, 3)
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
    assert (appearance_gain(LEGS, right, 25.0)[apart] > 1).all()
    assert (appearance_gain(LEGS, wrong, 25.0)[apart] < -1).all()


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
