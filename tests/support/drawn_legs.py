"""Two legs of two colours that are drawn on grass and change places."""

from pathlib import Path

import cv2
import numpy as np

from keyrecon.body import LSP14
from keyrecon.io.frame_reader import reduce_picture
from keyrecon.io.video import Video
from keyrecon.propagation.body_frame import BodyFrame
from keyrecon.propagation.edge_template import AnnotatedPoses
from keyrecon.propagation.half_body import split_body

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
