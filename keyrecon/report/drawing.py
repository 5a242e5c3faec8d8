"""Draw a pose on a picture, so that left, right, near and far can be told apart.

Left, right and trunk have colours that stay distinct for the colour-blind (Okabe and Ito, "Color
universal design", 2008). Bones are drawn far to near, each on a dark seam, so that a nearer limb
visibly crosses over a farther one. Thickness follows the size of the player. Marker shapes tell
where a joint comes from: a diamond was marked by a person, a disc was found in the picture, a
ring was filled in.
"""

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

from keyrecon.body import Skeleton
from keyrecon.records import SOURCES

LEFT, RIGHT, TRUNK = (86, 180, 233), (230, 159, 0), (245, 245, 245)
SEAM = (20, 20, 24)
CLUB = (213, 94, 0)
"""Vermillion of Okabe and Ito."""
SUBPIXEL = 4
"""OpenCV draws at 1 / 2**SUBPIXEL px."""
ARROW_RISE = 0.1
"""Of an arrow over the centre of a head, heights of the player's box: clear of the skull."""
BONE_SHARE = 0.016
"""Thickness of a bone as a share of the player's height; a real forearm is about .04."""


def joint_sides(skeleton: Skeleton) -> Int[np.ndarray, "J"]:
    """0 left, 1 right, 2 on the midline, for every joint."""
    sides = np.full(len(skeleton.names), 2)
    for left, right in skeleton.mirrored:
        sides[[left, right]] = 0, 1
    return sides


def drawn_bones(skeleton: Skeleton) -> Int[np.ndarray, "n 2"]:
    """Bones to draw: those of the tree, and the line between both hips that closes the trunk."""
    closing = [
        pair
        for pair in skeleton.mirrored
        if skeleton.is_lower[pair[0]] and skeleton.parents[pair[0]] == skeleton.parents[pair[1]]
    ]
    return np.concatenate([skeleton.bones, np.array(closing, dtype=np.int64).reshape(-1, 2)])


def bone_sides(skeleton: Skeleton) -> Int[np.ndarray, "n"]:
    """0 left, 1 right, 2 trunk, for every bone of `drawn_bones`; limbs begin below the root's
    children, so that shoulders and hips belong to the trunk.
    """
    sides, bones = joint_sides(skeleton), drawn_bones(skeleton)
    at_trunk = (bones[:, 0] == skeleton.root) | (sides[bones[:, 0]] != sides[bones[:, 1]])
    return np.where(at_trunk, 2, sides[bones[:, 1]])


def trunk_outline(skeleton: Skeleton) -> list[int]:
    """The joints around the trunk, in order: both shoulders and both hips; empty without them."""
    at_root = [pair for pair in skeleton.mirrored if skeleton.parents[pair[0]] == skeleton.root]
    upper = [pair for pair in at_root if not skeleton.is_lower[pair[0]]]
    lower = [pair for pair in at_root if skeleton.is_lower[pair[0]]]
    return [*upper[0], *lower[0][::-1]] if upper and lower else []


def head_bone(skeleton: Skeleton) -> list[int]:
    """The bone that holds the head: from the root to an end on the midline; empty without one."""
    middle = joint_sides(skeleton) == 2
    ends = [
        joint
        for joint, parent in enumerate(skeleton.parents)
        if parent == skeleton.root and middle[joint] and joint not in skeleton.parents
    ]
    return [skeleton.root, ends[0]] if ends else []


def draw_pose(
    picture: UInt8[np.ndarray, "h w 3"],
    points2d: Float[np.ndarray, "J 2"],
    skeleton: Skeleton,
    depth: Float[np.ndarray, "J"] | None = None,
    source: Int[np.ndarray, "J"] | None = None,
    height: float | None = None,
) -> UInt8[np.ndarray, "h w 3"]:
    """A copy of the picture with the pose on it; joints that are NaN are left out.

    `depth` grows away from the camera, in any unit; `source` indexes SOURCES; `height` is the
    player's size in px, taken from the pose itself where it is not given.
    """
    drawn = picture.copy()
    known = np.isfinite(points2d).all(axis=1)
    if not known.any():
        return drawn
    height = height or float(np.ptp(points2d[known], axis=0).max())
    height = min(height, 4.0 * max(picture.shape[:2]))
    thickness = max(1, round(BONE_SHARE * height))
    depth = np.zeros(len(points2d)) if depth is None else np.nan_to_num(depth)
    paint = _paint(skeleton)
    shown = np.where(known[:, None], points2d, 0)
    places: list[tuple[int, int]] = [(x, y) for x, y in _fixed_point(shown).tolist()]
    middles = depth[np.array(paint.bones)].mean(axis=1)
    for bone in np.argsort(-middles, kind="stable").tolist():
        start, stop = paint.bones[bone]
        if known[start] and known[stop]:
            _draw_bone(drawn, places[start], places[stop], paint.of_bones[bone], thickness)
    for joint in np.argsort(-depth, kind="stable").tolist():
        if not known[joint]:
            continue
        kind, color = SOURCES[1 if source is None else source[joint]], paint.of_joints[joint]
        if kind == "annotated":
            _draw_diamond(drawn, points2d[joint], color, thickness)
        else:
            _draw_disc(drawn, places[joint], kind == "interpolated", color, thickness)
    return drawn


@dataclass(frozen=True)
class _Paint:
    """What is drawn of a skeleton, and in which colours."""

    bones: list[list[int]]
    of_bones: list[list[int]]
    of_joints: list[list[int]]


@cache
def _paint(skeleton: Skeleton) -> _Paint:
    colors = np.array((LEFT, RIGHT, TRUNK))
    return _Paint(
        drawn_bones(skeleton).tolist(),
        colors[bone_sides(skeleton)].tolist(),
        colors[joint_sides(skeleton)].tolist(),
    )


def draw_club(picture: UInt8[np.ndarray, "h w 3"], ends: Float[np.ndarray, "2 2"]) -> None:
    """A golf club from between the hands to its head (px), drawn into the picture."""
    grip, head = (tuple(p) for p in (np.clip(ends, -9e3, 9e3) * 2**SUBPIXEL).astype(int).tolist())
    cv2.line(picture, grip, head, SEAM, 4, cv2.LINE_AA, SUBPIXEL)
    cv2.line(picture, grip, head, CLUB, 2, cv2.LINE_AA, SUBPIXEL)
    cv2.circle(picture, head, 4 * 2**SUBPIXEL, TRUNK, 1, cv2.LINE_AA, SUBPIXEL)


def _draw_bone(
    picture: UInt8[np.ndarray, "h w 3"],
    start: tuple[int, int],
    stop: tuple[int, int],
    color: list[int],
    thickness: int,
) -> None:
    """Ends as OpenCV's fixed-point numbers."""
    for paint, width in ((SEAM, thickness + max(2, round(0.6 * thickness))), (color, thickness)):
        cv2.line(picture, start, stop, paint, width, cv2.LINE_AA, SUBPIXEL)


def _draw_diamond(
    picture: UInt8[np.ndarray, "h w 3"],
    point: Float[np.ndarray, "2"],
    color: list[int],
    thickness: int,
) -> None:
    reach = 1.5 * _joint_radius(thickness)
    shape = [_fixed_point(point + reach * np.array([[0, -1], [1, 0], [0, 1], [-1, 0]]))]
    cv2.fillPoly(picture, shape, color, cv2.LINE_AA, SUBPIXEL)
    cv2.polylines(picture, shape, True, SEAM, 1, cv2.LINE_AA, SUBPIXEL)


def _draw_disc(
    picture: UInt8[np.ndarray, "h w 3"],
    center: tuple[int, int],
    ring: bool,
    color: list[int],
    thickness: int,
) -> None:
    """Or a ring; the centre as OpenCV's fixed-point numbers."""
    reach = round(_joint_radius(thickness) * 2**SUBPIXEL)
    fill, edge = (SEAM, color) if ring else (color, SEAM)
    cv2.circle(picture, center, reach, fill, -1, cv2.LINE_AA, SUBPIXEL)
    cv2.circle(picture, center, reach, edge, max(1, thickness // 3), cv2.LINE_AA, SUBPIXEL)


def _joint_radius(thickness: int) -> float:
    """px"""
    return 0.5 + 0.9 * thickness


def _fixed_point(points: Float[np.ndarray, "*n 2"]) -> Int[np.ndarray, "*n 2"]:
    """Coordinates as OpenCV's fixed-point numbers, kept in the range that it can clip."""
    return np.round(np.clip(points, -30000, 30000) * 2**SUBPIXEL).astype(np.int32)


def draw_brackets(
    picture: UInt8[np.ndarray, "h w 3"], box: Float[np.ndarray, "4"], head: Float[np.ndarray, "2"]
) -> UInt8[np.ndarray, "h w 3"]:
    """A copy of a picture with brackets at the corners of a player's box (x0, y0, x1, y1), px, and
    an arrow head over the player's head; without them where the box is unknown."""
    drawn = picture.copy()
    if not np.isfinite(box).all():
        return drawn
    rows, columns = picture.shape[:2]
    thick = max(1, round(rows / 360))
    low, high = (thick, thick), (columns - 1 - thick, rows - 1 - thick)
    x0, y0, x1, y1 = np.rint(np.clip(box, (*low, *low), (*high, *high))).astype(int).tolist()
    arm = max(3, round(0.12 * min(x1 - x0, y1 - y0)))
    shape = arm * np.array([(0, 0), (-1 / 3, -1 / 2), (1 / 3, -1 / 2)])
    tip = head - np.array([0, ARROW_RISE * (box[3] - box[1])])
    arrow = np.rint(tip + shape).astype(np.int32)
    corners = (x0, y0, 1, 1), (x1, y0, -1, 1), (x0, y1, 1, -1), (x1, y1, -1, -1)
    for color, width in ((SEAM, 3 * thick), (TRUNK, thick)):
        for x, y, right, down in corners:
            cv2.line(drawn, (x, y), (x + right * arm, y), color, width)
            cv2.line(drawn, (x, y), (x, y + down * arm), color, width)
        cv2.polylines(drawn, [arrow], True, color, width)
    cv2.fillPoly(drawn, [arrow], TRUNK)
    return drawn
