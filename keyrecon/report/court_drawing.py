"""The court's model drawn on a frame, so that a wrong camera is seen at a glance."""

from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from keyrecon.io.durable import write_durably
from keyrecon.world.court import CourtModel, tennis_court
from keyrecon.world.records import CourtCamera

GROUND, NET = (255, 40, 120), (0, 220, 255)
"""Colours of the lines on the ground and of the net's tape: neither is found on courts."""
SUBPIXEL = 4
QUALITY = 92


def draw_court(
    picture: UInt8[np.ndarray, "h w 3"],
    camera: CourtCamera,
    frame: int,
    court: CourtModel | None = None,
) -> UInt8[np.ndarray, "h w 3"]:
    """A copy of the picture with the model's lines; as it is where the camera was not found."""
    drawn = picture.copy()
    if not camera.found[frame]:
        return drawn
    court = court or tennis_court()
    pixels = camera.project(frame, court.points)
    limit = 4 * max(picture.shape)
    usable = np.isfinite(pixels).all(axis=1) & (np.abs(np.nan_to_num(pixels)) < limit).all(axis=1)
    thick = max(1, round(picture.shape[1] / 1280))
    for number in range(len(court.names)):
        of_line = np.flatnonzero((court.line == number) & usable)
        if len(of_line) < 2:
            continue
        way = np.rint(pixels[of_line] * 2**SUBPIXEL).astype(np.int32)
        color = NET if court.ends[number, :, 2].any() else GROUND
        cv2.polylines(drawn, [way[:, None]], False, color, thick, cv2.LINE_AA, SUBPIXEL)
    return drawn


def write_court_picture(path: Path, picture: UInt8[np.ndarray, "h w 3"]) -> None:
    """Write an RGB picture as JPEG."""
    turned = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
    encoded = cv2.imencode(".jpg", turned, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1]
    write_durably(path, encoded.tobytes())
