"""Pictures of a swing: key postures with the golfer on them, and the paths of club and hands."""

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.golf.records import FittedSwing, Observations
from keyrecon.report.golf_figure import CLUB, draw_from_above, draw_golfer
from keyrecon.report.pictures import jpeg_uri
from keyrecon.video import Video

HANDS = (0, 114, 178)
"""Blue of Okabe and Ito."""
WIDTH = 520
"""Of a picture in the page, px."""
ROOM = 0.12
"""Around the player, shares of his height."""
ABOVE = 260
"""Side of a view from above, px."""


def key_pictures(
    video: Video, fitted: FittedSwing, observations: Observations
) -> list[tuple[int, str, str]]:
    """Frame, picture with the golfer, and view from above, of the four key postures."""
    frames = np.clip(fitted.keys.round().astype(int), 0, len(video) - 1).tolist()
    part = _around_swing(video, fitted)
    rows = []
    for frame, picture in _chosen(video, frames):
        drawn = draw_golfer(picture, fitted, observations.camera, frame)[part]
        rows.append((frame, _small(drawn), jpeg_uri(draw_from_above(fitted, frame, ABOVE))))
    return rows


def overlay_strip(
    video: Video, fitted: FittedSwing, observations: Observations, count: int = 18
) -> list[tuple[int, str]]:
    """Frames evenly through the swing with the golfer on them."""
    first, last = fitted.keys[[0, 3]]
    frames = np.unique(np.linspace(first, last, count).round().astype(int))
    frames = frames[(frames >= 0) & (frames < len(video))].tolist()
    part = _around_swing(video, fitted)
    return [
        (frame, _small(draw_golfer(picture, fitted, observations.camera, frame)[part]))
        for frame, picture in _chosen(video, frames)
    ]


def path_picture(video: Video, fitted: FittedSwing, observations: Observations) -> str:
    """The paths of club head and hands over the picture at the hit; dots are what was seen."""
    hit = int(np.clip(round(float(fitted.keys[2])), 0, len(video) - 1))
    drawn = video.frame(hit).copy()
    swing = slice(max(0, int(fitted.keys[0])), int(np.ceil(fitted.keys[3])) + 1)
    for end, color in ((1, CLUB), (0, HANDS)):
        _draw_path(drawn, fitted.club_seen[swing, end], color)
        for point in observations.club[swing, end]:
            if np.isfinite(point).all():
                cv2.circle(drawn, _pixel(point), 3, color, -1, cv2.LINE_AA)
    return _small(drawn, 2 * WIDTH)


def _around_swing(video: Video, fitted: FittedSwing) -> tuple[slice, slice]:
    """The part of the picture, rows and columns, that the player is in at any time."""
    points = fitted.motion.points2d.reshape(-1, 2)
    room = ROOM * np.ptp(points[:, 1])
    low = np.maximum(points.min(axis=0) - room, 0).astype(int)
    high = np.minimum(points.max(axis=0) + room, (video.width, video.height)).astype(int)
    return slice(low[1], high[1]), slice(low[0], high[0])


def _draw_path(
    picture: UInt8[np.ndarray, "h w 3"], path: Float[np.ndarray, "n 2"], color: Sequence[int]
) -> None:
    line = np.round(np.clip(path, -1e4, 1e4)).astype(np.int32)
    cv2.polylines(picture, [line], False, (20, 20, 24), 4, cv2.LINE_AA)
    cv2.polylines(picture, [line], False, color, 2, cv2.LINE_AA)


def _pixel(point: Float[np.ndarray, "2"]) -> tuple[int, int]:
    x, y = np.round(np.clip(point, -1e4, 1e4)).astype(int).tolist()
    return x, y


def _chosen(video: Video, frames: list[int]) -> list[tuple[int, np.ndarray]]:
    """Frames by number, read in one pass; a number may occur twice."""
    wanted = set(frames)
    found = dict(zip(sorted(wanted), video.chosen_frames(wanted, max(frames)), strict=True))
    return [(frame, found[frame]) for frame in frames]


def _small(picture: UInt8[np.ndarray, "h w 3"], width: int = WIDTH) -> str:
    share = min(1.0, width / picture.shape[1])
    return jpeg_uri(cv2.resize(picture, None, fx=share, fy=share, interpolation=cv2.INTER_AREA))
