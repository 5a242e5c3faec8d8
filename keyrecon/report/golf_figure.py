"""The golfer's volumetric primitives on a picture, and as seen from above (CVPR 2005, Fig. 1).

A tapered capsule looks like the hull of two discs; far ones are drawn before near ones.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.golf.records import Camera, Capsules, FittedSwing, Pose
from keyrecon.golf.skeleton import NAMES
from keyrecon.report.drawing import LEFT, RIGHT, SEAM, SUBPIXEL, TRUNK

CLUB = (213, 94, 0)
"""Vermillion of Okabe and Ito."""
BODY = (196, 190, 180)
FLOOR = (46, 52, 50)
REACH = 1.5
"""Metres from the player to the edge of the view from above."""


@dataclass(frozen=True, eq=False)
class Discs:
    """Both ends of every capsule as seen."""

    centres: Float[np.ndarray, "Q 2 2"]
    """px"""
    radii: Float[np.ndarray, "Q 2"]
    """px"""
    order: list[int]
    """Far to near."""


def draw_golfer(
    picture: UInt8[np.ndarray, "h w 3"], fitted: FittedSwing, camera: Camera, frame: int
) -> UInt8[np.ndarray, "h w 3"]:
    """A copy of the picture with translucent primitives and the club on it."""
    ends, radii = _place(fitted.capsules, fitted.pose, frame)
    scale = camera.focal / np.maximum(ends[..., 2:], 0.1)
    discs = Discs(
        ends[..., :2] * scale + camera.principal,
        radii * scale[..., 0],
        np.argsort(-ends[..., 2].mean(axis=1)).tolist(),
    )
    layer = picture.copy()
    _draw_discs(layer, discs, fitted.capsules)
    drawn = cv2.addWeighted(layer, 0.6, picture, 0.4, 0)
    _draw_club(drawn, fitted.club_seen[frame])
    return drawn


def draw_from_above(fitted: FittedSwing, frame: int, size: int) -> UInt8[np.ndarray, "size size 3"]:
    """The primitives from above: the camera is below the picture and looks up in it."""
    middle = fitted.pose.origins[0, 0]
    scale = size / (2 * REACH)

    def look(points: np.ndarray) -> np.ndarray:
        flat = (points - middle)[..., [0, 2]] * [1.0, -1.0]
        return flat * scale + size / 2

    ends, radii = _place(fitted.capsules, fitted.pose, frame)
    discs = Discs(look(ends), radii * scale, np.argsort(-ends[..., 1].mean(axis=1)).tolist())
    picture = np.full((size, size, 3), FLOOR, np.uint8)
    _draw_discs(picture, discs, fitted.capsules)
    _draw_club(picture, look(fitted.club[frame]))
    return picture


def _place(
    capsules: Capsules, pose: Pose, frame: int
) -> tuple[Float[np.ndarray, "Q 2 3"], Float[np.ndarray, "Q 2"]]:
    """Both ends in camera axes, and radii."""
    local = np.stack([capsules.start, capsules.end], axis=1)
    turned = local @ np.swapaxes(pose.rotations[frame, capsules.segment], 1, 2)
    return pose.origins[frame, capsules.segment][:, None] + turned, capsules.radii


def _draw_discs(picture: UInt8[np.ndarray, "h w 3"], discs: Discs, capsules: Capsules) -> None:
    around = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = np.stack([np.cos(around), np.sin(around)], axis=1)
    for q in discs.order:
        rims = discs.centres[q][:, None] + discs.radii[q][:, None, None] * ring
        hull = cv2.convexHull((rims.reshape(-1, 2) * 2**SUBPIXEL).astype(np.int32))
        name = NAMES[capsules.segment[q]]
        side = LEFT if name.startswith("left") else RIGHT if name.startswith("right") else BODY
        cv2.fillConvexPoly(picture, hull, side, cv2.LINE_AA, SUBPIXEL)
        cv2.polylines(picture, [hull], True, SEAM, 1, cv2.LINE_AA, SUBPIXEL)


def _draw_club(picture: UInt8[np.ndarray, "h w 3"], ends: Float[np.ndarray, "2 2"]) -> None:
    grip, head = (tuple(p) for p in (np.clip(ends, -9e3, 9e3) * 2**SUBPIXEL).astype(int).tolist())
    cv2.line(picture, grip, head, SEAM, 4, cv2.LINE_AA, SUBPIXEL)
    cv2.line(picture, grip, head, CLUB, 2, cv2.LINE_AA, SUBPIXEL)
    cv2.circle(picture, head, 4 * 2**SUBPIXEL, TRUNK, 1, cv2.LINE_AA, SUBPIXEL)
