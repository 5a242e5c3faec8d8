"""Matches made of rendered sequences: points with everything between them that matches have."""

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
    step: int = 1
    """Frames of the source from one picture to the next."""
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
    wanted = piece.first + piece.step * np.arange(own)
    shown = 0
    for picture in video.part(wanted).frames():
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


def join(pieces: Sequence[Piece], path: Path, size: tuple[int, int], fps: float) -> None:
    """Write the pieces one after the other."""
    write_video(path, (picture for piece in pieces for picture in pictures(piece, size)), fps)


def first_frames(pieces: Sequence[Piece]) -> list[int]:
    """Where each piece begins in the joined file."""
    return np.cumsum([0, *(piece.frames for piece in pieces[:-1])]).tolist()


def made_match(folder: Path, other: Path, length: int, starts: tuple[int, int]) -> list[Piece]:
    """Two points of a rendered sequence with everything between that matches have."""
    point = [Piece(PLAYER, length, folder / "video.mp4", first) for first in starts]
    return [
        point[0],
        Piece("close-up", 60, folder / "video.mp4", starts[0] + 40, focus=(0.5, 0.35)),
        Piece("black", 25),
        Piece("replay", 90, folder / "video.mp4", starts[0] + length // 2),
        Piece("other", 60, other / "video.mp4", 100),
        point[1],
    ]


POINT_SECONDS = 6, 14
"""How long the points of a long match are, in turn: a serve with its return, and a rally."""
BETWEEN = (
    ("close-up", "black", "replay", "other"),
    ("other",),
    ("black",),
    ("close-up",),
    ("other", "black"),
    ("close-up", "replay", "black"),
)
"""What follows a point, in turn. A replay shows the place of the point and stands beside none: a
cut to the same view of the same place is not found."""
BETWEEN_SECONDS = {"close-up": 2.4, "black": 1.0, "replay": 3.6, "other": 2.4}


def long_match(folder: Path, other: Path, minutes: float, fps: int = 25) -> list[Piece]:
    """Points of a rendered sequence of twice the rate, from places of it that differ."""
    rng = np.random.default_rng(0)
    source, strange = (open_video(path / "video.mp4") for path in (folder, other))
    pieces: list[Piece] = []
    while sum(piece.frames for piece in pieces) < 60 * minutes * fps:
        number = sum(piece.shows == PLAYER for piece in pieces)
        length = POINT_SECONDS[number % len(POINT_SECONDS)] * fps
        first = int(rng.integers(len(source) - 2 * length))
        pieces.append(Piece(PLAYER, length, source.path, first, 2))
        for shows in BETWEEN[number % len(BETWEEN)]:
            frames = round(BETWEEN_SECONDS[shows] * fps)
            if shows == "black":
                pieces.append(Piece(shows, frames))
                continue
            film = strange if shows == "other" else source
            first = int(rng.integers(len(film) - 2 * frames))
            pieces.append(Piece(shows, frames, film.path, first, 2, (0.5, 0.35)))
    return pieces
