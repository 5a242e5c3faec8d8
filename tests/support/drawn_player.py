"""A drawn player on a patterned scene: exact places, for tests of finding and following."""

from pathlib import Path

import cv2
import numpy as np

from keyrecon.io.video import Video, open_video
from keyrecon.io.video_writer import write_video
from keyrecon.records import Pick

SIZE = (180, 320)
HEIGHT = 88.0
SKIN, SHIRT, SHORTS, SHOE = (215, 160, 130), (200, 40, 40), (30, 30, 90), (240, 220, 40)


def scene(seed: int = 0, size: tuple[int, int] = (240, 480)) -> np.ndarray:
    """A green scene with blocks and lines, larger than the picture."""
    generator = np.random.default_rng(seed)
    picture = np.full((*size, 3), (60, 120, 80), np.uint8)
    for _ in range(120):
        x, y = generator.integers(0, size[1]), generator.integers(0, size[0])
        shade = int(generator.integers(-35, 35))
        color = tuple(int(c) + shade for c in (60, 120, 80))
        cv2.rectangle(picture, (x, y), (x + 14, y + 10), color, -1)
    return cv2.GaussianBlur(picture, (3, 3), 0)


def draw_player(
    picture: np.ndarray, x: float, y: float, stride: float = 12.0, lift: float = 0.0
) -> None:
    """Draw the player with the centre of the head at x, y and the right foot lifted."""

    def at(dx: float, dy: float) -> tuple[int, int]:
        return round(x + dx), round(y + dy)

    for side in (-1, 1):
        low = HEIGHT - (lift if side == 1 else 0)
        cv2.line(picture, at(side * 5, 45), at(side * stride, low - 4), SKIN, 7)
        cv2.ellipse(picture, at(side * stride, low), (7, 4), 0, 0, 360, SHOE, -1)
        cv2.line(picture, at(side * 10, 12), at(side * 17, 38), SKIN, 5)
    cv2.rectangle(picture, at(-10, 8), at(10, 38), SHIRT, -1)
    cv2.rectangle(picture, at(-10, 38), at(10, 52), SHORTS, -1)
    cv2.circle(picture, at(0, 0), 6, SKIN, -1)


def draw_racket(picture: np.ndarray, x: float, y: float) -> None:
    """Draw a racket with strings of the colour of the shoes, below the right hand."""
    hand, strings = (round(x + 17), round(y + 38)), (round(x + 28), round(y + 58))
    cv2.line(picture, hand, strings, (40, 40, 44), 2)
    cv2.ellipse(picture, strings, (6, 9), -30, 0, 360, SHOE, -1)
    cv2.ellipse(picture, strings, (6, 9), -30, 0, 360, (40, 40, 44), 1)


def lifts(count: int) -> np.ndarray:
    """How high the right foot is: down at first, then lifted twice."""
    return 16 * np.maximum(0, np.sin(np.linspace(-np.pi, 3 * np.pi, count)))


def heads(count: int) -> np.ndarray:
    """Where the head is in the scene: from left to right and back."""
    along = np.sin(np.linspace(0, 2 * np.pi, count))
    return np.stack([240 + 70 * along, np.full(count, 85.0)], axis=1)


def corners(count: int, panning: bool) -> np.ndarray:
    """Where the picture's corner lies in the scene."""
    x = 80 + (50 * np.cos(np.linspace(0, 2 * np.pi, count)) if panning else np.zeros(count))
    return np.stack([x.round(), np.full(count, 30.0)], axis=1)


def film(
    path: Path, count: int, panning: bool = False, empty: bool = False, playing: bool = False
) -> Video:
    """A video of the player (or of the empty scene); the camera stands still or pans.

    While `playing`, the player holds a racket and lifts a foot.
    """
    lifted = lifts(count) if playing else np.zeros(count)

    def frames():
        for head, corner, lift in zip(heads(count), corners(count, panning), lifted, strict=True):
            picture = scene()
            if not empty:
                draw_player(picture, *head, lift=lift)
            if playing:
                draw_racket(picture, *head)
            x, y = corner.astype(int)
            yield picture[y : y + SIZE[0], x : x + SIZE[1]]

    write_video(path, frames(), 30.0, crf=18)
    return open_video(path)


def picks(count: int, panning: bool = False) -> tuple[Pick, ...]:
    """Clicks on every part in the first frame."""
    x, y = heads(count)[0] - corners(count, panning)[0]
    places = {
        "head": [(0, 0)], "foot": [(-12, HEIGHT), (12, HEIGHT)], "shirt": [(0, 20)],
        "shorts": [(0, 45)], "skin": [(-8, 60), (8, 60)],
    }  # fmt: skip
    return tuple(
        Pick(0, part, float(x + dx), float(y + dy))
        for part, spots in places.items()
        for dx, dy in spots
    )
