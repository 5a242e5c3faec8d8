"""A camera from named points of the court that a person clicked, and which click contradicts.

Four points are enough for place, direction and focal length with one number to spare; five tell
which one is wrong. For a focal length out of a wide range the pose is found by `cv2.solvePnP`, the
best is refined over all seven numbers.
"""

from collections.abc import Sequence
from difflib import get_close_matches

import cv2
import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from keyrecon.errors import KeyreconError
from keyrecon.world.court import POINTS
from keyrecon.world.pinhole import Pinhole
from keyrecon.world.records import CourtClick

FEWEST = 4
"""Clicks that tell a camera."""
TOLERANCE = 0.012
"""How far a click may lie from its point, as a share of the picture's width: 15 px of 1280. A
careful click is off by 3 px; beyond this it is on another point."""
CLICK_NOISE = 3.0
"""px, of a picture 1280 wide."""
ON_LINE, AWAY = 0.3, 2
"""Metres from a line within which a point lies on it, and points that must lie away from it."""
FOCAL_LENGTHS = np.geomspace(0.5, 10.0, 14)
"""Tried, in widths of the picture."""
USUAL_FOCAL, FOCAL_SPREAD = 1.5, 1.2
"""Focal lengths of cameras at courts, in widths, and the spread of their logarithm: it decides only
where four points leave the focal length open."""


class ContradictoryClicks(KeyreconError):
    """No camera sees the clicked points where they were clicked."""


def check_click(click: CourtClick, frames: int, size: tuple[int, int]) -> None:
    """Raise KeyreconError for a click on no point, no frame or beside the picture."""
    if click.name not in POINTS:
        near = get_close_matches(click.name, POINTS, 1)
        meant = f" (did you mean {near[0]}?)" if near else ""
        raise KeyreconError(
            f"The court has no point '{click.name}'{meant}; its points are {', '.join(POINTS)}."
        )
    if not 0 <= click.frame < frames:
        raise KeyreconError(
            f"Frame {click.frame} is outside the video, which has frames 0 to {frames - 1}."
        )
    if not (0 <= click.x < size[0] and 0 <= click.y < size[1]):
        raise KeyreconError(
            f"The point {click.name} clicked at {click.x:g},{click.y:g} in frame {click.frame} is "
            f"outside the picture of {size[0]}x{size[1]}."
        )


def camera_from_points(
    names: Sequence[str], pixels: Float[np.ndarray, "n 2"], shape: tuple[int, int]
) -> Pinhole:
    """The camera that sees named points at these pixels; they are all in one picture.

    Raises ContradictoryClicks where no camera can see them so, which names the click that does not
    fit the others where that can be told, and KeyreconError for points that leave the camera open.
    """
    _check_spread(names)
    camera, error = _fit(names, pixels, shape)
    limit = TOLERANCE * shape[1]
    if camera is not None and error.max() <= limit:
        return camera
    raise ContradictoryClicks(_contradiction(names, pixels, shape))


def _check_spread(names: Sequence[str]) -> None:
    """Raise KeyreconError where all points but one lie on one line of the court.

    Three on a line and one beside it are seven numbers for the camera's seven, none to spare: a
    side view of a baseline and two sidelines has no more.
    """
    points = np.array([POINTS[name] for name in dict.fromkeys(names)])
    for a, start in enumerate(points):
        for end in points[a + 1 :]:
            way = (end - start) / np.linalg.norm(end - start)
            beside = np.linalg.norm(np.cross(points - start, way), axis=1) > ON_LINE
            if beside.sum() < AWAY:
                raise KeyreconError(
                    f"The points clicked ({', '.join(dict.fromkeys(names))}) lie on one line of "
                    "the court but for one at most, which leaves the camera open; click two that "
                    "lie away from it, such as a service line's end or the net."
                )


def point_errors(
    camera: Pinhole, names: Sequence[str], pixels: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "n"]:
    """How far each point lies from where a camera sees it, px."""
    points = np.array([POINTS[name] for name in names])
    away = np.linalg.norm(camera.project(points) - pixels, axis=1)
    return np.nan_to_num(away, nan=1e6)


def _contradiction(
    names: Sequence[str], pixels: Float[np.ndarray, "n 2"], shape: tuple[int, int]
) -> str:
    """What is wrong with clicks that no camera can see together."""
    limit = TOLERANCE * shape[1]
    mirrored = [_other_side(name) for name in names]
    camera, error = _fit(mirrored, pixels, shape)
    if camera is not None and error.max() <= limit:
        # A court looks alike from both ends: seen from its far half, its ends are exchanged.
        which = "near and far" if camera.centre[1] > 0 else "left and right"
        return (
            f"The clicks show a court whose {which} are exchanged; name its points as seen "
            "from the camera's half, looking at the net."
        )
    if len(names) > FEWEST:
        blame = []
        for k in range(len(names)):
            others = [n for i, n in enumerate(names) if i != k]
            camera, error = _fit(others, np.delete(pixels, k, axis=0), shape)
            if camera is not None and error.max() <= limit:
                away = point_errors(camera, [names[k]], pixels[k : k + 1])[0]
                blame.append((float(error.max()), k, float(away)))
        if blame:
            _, k, away = min(blame)
            return describe_wrong_click(names[k], away / shape[1])
        return "The clicks contradict one another, more than one of them; click them again."
    return (
        f"The {len(names)} clicks ({', '.join(names)}) contradict one another; check their names, "
        "or click a fifth point to tell which one is wrong."
    )


def describe_wrong_click(name: str, away: float) -> str:
    """What is said of a click that lies so many widths of the picture beside its point."""
    far = f"{away:.1%} of the picture's width away" if away < 1 else "far outside the picture"
    return (
        f"The click on {name} contradicts the others and the lines: they put it {far}. Click it "
        "again, or leave it out."
    )


def _other_side(name: str) -> str:
    swap = {"left": "right", "right": "left"}
    return "-".join(swap.get(part, part) for part in name.split("-"))


def _fit(
    names: Sequence[str], pixels: Float[np.ndarray, "n 2"], shape: tuple[int, int]
) -> tuple[Pinhole | None, Float[np.ndarray, "n"]]:
    """The best camera above the ground, and how far each point is from it."""
    points = np.array([POINTS[name] for name in names])
    width = float(shape[1])
    principal = (np.array(shape[::-1]) - 1) / 2
    starts = [_pose(points, pixels, share * width, principal) for share in FOCAL_LENGTHS]
    above = [camera for camera in starts if camera is not None and camera.centre[2] > 0.2]
    if not above:
        return None, np.full(len(names), np.inf)
    above.sort(key=lambda camera: float(point_errors(camera, names, pixels).sum()))
    noise = CLICK_NOISE * width / 1280
    best: tuple[float, Pinhole] | None = None
    for start in above[:3]:

        def residual(x: np.ndarray, start: Pinhole = start) -> np.ndarray:
            camera = start.moved(x)
            away = np.nan_to_num(camera.project(points) - pixels, nan=1e4).ravel() / noise
            usual = np.log(camera.focal / width / USUAL_FOCAL) / FOCAL_SPREAD
            return np.append(away, usual)

        solved = least_squares(residual, np.zeros(7), x_scale=[1, 1, 1, 0.1, 0.1, 0.1, 0.1])
        if best is None or solved.cost < best[0]:
            best = float(solved.cost), start.moved(solved.x)
    if best is None or best[1].centre[2] <= 0.2:
        return None, np.full(len(names), np.inf)
    return best[1], point_errors(best[1], names, pixels)


def _pose(
    points: Float[np.ndarray, "n 3"],
    pixels: Float[np.ndarray, "n 2"],
    focal: float,
    principal: Float[np.ndarray, "2"],
) -> Pinhole | None:
    """Where a camera of this focal length stands that sees the points so."""
    inner = np.array([[focal, 0, principal[0]], [0, focal, principal[1]], [0, 0, 1.0]])
    done, turn, shift = cv2.solvePnP(
        points, pixels.astype(float), inner, np.zeros(4), flags=cv2.SOLVEPNP_SQPNP
    )
    if not done:
        return None
    rotation = cv2.Rodrigues(turn)[0].astype(float)
    return Pinhole(focal, principal, rotation, -rotation.T @ shift.ravel())
