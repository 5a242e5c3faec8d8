"""Videos of several shots: joined from points, close-ups, black frames and replays; made here, for

    python benchmarks/hours.py OUT --rendered SEQUENCE [SEQUENCE ...]     rendered points, held
        against the same points run one by one, and against their truth
    python benchmarks/hours.py OUT --real CLIP [CLIP ...]                 clips joined, black between

SEQUENCE is a folder of `accuracy.py --work` (video.mp4, picks.json, truth.npz).
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from keyrecon.io.video import open_video
from keyrecon.io.video_writer import write_video
from keyrecon.records import PLAYER


@dataclass(frozen=True)
class Piece:
    """What one shot is made of."""

    shows: str
    """`PLAYER`, 'close-up', 'black', 'replay' or 'other'."""
    frames: int
    """How long it is."""
    source: Path | None = None
    first: int = 0
    """Frame of the source."""
    focus: tuple[float, float] = (0.5, 0.5)
    """Middle of a close-up, shares of the picture."""


CLOSE_UP = 4.0
"""How much closer a close-up is: a player of 350 px becomes one of twice the picture's height."""
REPEATS = 3
"""Times that a replay shows every picture."""


def pictures(piece: Piece, size: tuple[int, int]) -> Iterator[np.ndarray]:
    """The pictures of a piece at a size (width, height)."""
    if piece.source is None:
        yield from [np.full((size[1], size[0], 3), 16, np.uint8)] * piece.frames
        return
    video = open_video(piece.source)
    own = -(-piece.frames // REPEATS) if piece.shows == "replay" else piece.frames
    repeats = REPEATS if piece.shows == "replay" else 1
    shown = 0
    for picture in video.frames(piece.first, piece.first + own):
        if piece.shows == "close-up":
            picture = _closer(picture, piece.focus)
        fitted = picture if picture.shape[1::-1] == size else _fit(picture, size)
        for _ in range(min(repeats, piece.frames - shown)):
            shown += 1
            yield fitted


def _closer(picture: np.ndarray, focus: tuple[float, float]) -> np.ndarray:
    height, width = picture.shape[:2]
    x, y = focus[0] * width, focus[1] * height
    way = np.array(
        [[CLOSE_UP, 0, width / 2 - CLOSE_UP * x], [0, CLOSE_UP, height / 2 - CLOSE_UP * y]]
    )
    return cv2.warpAffine(picture, way, (width, height), borderMode=cv2.BORDER_REFLECT)


def _fit(picture: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """The picture at a size, black beside it where its shape is another."""
    scale = min(size[0] / picture.shape[1], size[1] / picture.shape[0])
    small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    whole = np.full((size[1], size[0], 3), 16, np.uint8)
    y, x = (size[1] - small.shape[0]) // 2, (size[0] - small.shape[1]) // 2
    whole[y : y + small.shape[0], x : x + small.shape[1]] = small[: size[1], : size[0]]
    return whole


def join(pieces: Sequence[Piece], path: Path, size: tuple[int, int], fps: float) -> list[int]:
    """Write the pieces one after the other; the first frames of the shots."""
    write_video(path, (picture for piece in pieces for picture in pictures(piece, size)), fps)
    return np.cumsum([0, *(piece.frames for piece in pieces[:-1])]).tolist()


def made_match(folder: Path, other: Path, length: int, starts: tuple[int, int]) -> list[Piece]:
    """Two points of a rendered sequence with everything between that matches have."""
    point = [Piece(PLAYER, length, folder / "video.mp4", first) for first in starts]
    return [
        point[0],
        Piece("close-up", 60, folder / "video.mp4", starts[0] + 40, (0.5, 0.35)),
        Piece("black", 25),
        Piece("replay", 90, folder / "video.mp4", starts[0] + length // 2),
        Piece("other", 60, other / "video.mp4", 100),
        point[1],
    ]
