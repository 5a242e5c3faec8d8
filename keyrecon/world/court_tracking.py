"""The camera of every frame: predicted by the camera's motion, corrected by the court's lines.

Between two frames a camera that turns and zooms maps the background by a homography
(`CameraPath`); the camera of the last frame carried along by it is off by a pixel or so, and one or
two steps on the distances across the lines bring it back. Where that motion and one that goes on
as before disagree, the one under which more lines lie on lines is believed. What the lines leave
open, in a close view of a single one, stays as foretold.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.records import CameraPath
from keyrecon.world.court import CourtModel
from keyrecon.world.line_fit import FIXED_CENTRE, LOOSE, LineFit, evaluate, fit_lines
from keyrecon.world.pinhole import Pinhole, carried_focal

SEARCHES = (6.0, 3.0)
"""px to both sides in which lines are looked for, first and second step."""
AGAIN = 12.0
"""px, where the camera was lost."""
SPACING, COARSE = 16.0, 0.2
"""px, and metres, between measured points: some 200 in a picture with a whole court."""
DRIFT = 2.0
"""px by which the camera's motion is off between two frames (Lucas-Kanade on pictures 480 wide)."""
ZOOM_DRIFT = 0.004
"""The same for the zoom, as a share of it."""
SURE_PATH = 0.35
"""Confidence of the camera's motion below which ten times as much is allowed for."""
MIN_SUPPORT, MIN_HITS = 0.5, 12
"""Share and number of the samples that hit in a frame whose camera is found."""


MOST_HELD = 100
"""Frames without the court that are held until it is found again."""
Grey = UInt8[np.ndarray, "h w"]


@dataclass(frozen=True, eq=False)
class TrackedViews:
    """A camera per frame, and which of them the lines bear out."""

    cameras: tuple[Pinhole, ...]
    found: np.ndarray


def carry_camera(camera: Pinhole, homography: Float[np.ndarray, "3 3"]) -> Pinhole:
    """The camera of another frame, from the homography of the picture into that frame's."""
    shift = np.array([[1, 0, -camera.principal[0]], [0, 1, -camera.principal[1]], [0, 0, 1.0]])
    moved = shift @ homography @ np.linalg.inv(shift)
    moved = moved @ np.diag([camera.focal, camera.focal, 1.0]) @ camera.rotation
    moved = moved / np.cbrt(np.linalg.det(moved))
    moved = moved / np.linalg.norm(moved[2])
    focal = float(carried_focal(camera, homography[None])[0])
    left, _, right = np.linalg.svd(np.diag([1 / focal, 1 / focal, 1.0]) @ moved)
    return replace(camera, focal=focal, rotation=left @ right)


def homography_between(path: CameraPath, start: int, end: int) -> Float[np.ndarray, "3 3"]:
    """Homography from the pixels of one frame to those of another."""
    homography = np.linalg.solve(path.to_reference[end], path.to_reference[start])
    return homography / homography[2, 2]


def track_court(
    greys: Iterable[Grey], path: CameraPath, known: Mapping[int, Pinhole], court: CourtModel
) -> TrackedViews:
    """Cameras of all frames, given those of some; `path` in the pixels of these pictures.

    Frames in which the court was lost are held until it is found again, and followed back from
    there.
    """
    court = replace(court, spacing=COARSE)
    cameras: list[Pinhole] = []
    found: list[bool] = []
    held: list[Grey] = []
    for t, grey in enumerate(greys):
        fit = _follow(grey, path, t, _nearest(cameras, found, known, t), court)
        cameras.append(fit.camera)
        found.append(is_seen(fit))
        if not found[-1]:
            held = [*held, grey][-MOST_HELD:]
            continue
        for back, picture in enumerate(reversed(held), start=1):
            after = cameras[t - back + 1 : t + 1][:2]
            again = _follow(picture, path, t - back, _Neighbours(t - back + 1, after), court)
            if not is_seen(again):
                break
            cameras[t - back], found[t - back] = again.camera, True
        held = []
    return TrackedViews(tuple(cameras), np.array(found))


@dataclass(frozen=True, eq=False)
class _Neighbours:
    """The nearest frame whose camera is known, and the one beyond it where that is known too."""

    frame: int
    cameras: list[Pinhole]


def _nearest(
    cameras: list[Pinhole], found: list[bool], known: Mapping[int, Pinhole], t: int
) -> _Neighbours:
    """What is known nearest to frame t."""
    if t in known:
        return _Neighbours(t, [known[t]])
    if found and found[-1]:
        run = 2 if len(found) > 1 and found[-2] else 1
        return _Neighbours(t - 1, cameras[-run:][::-1])
    seen = [k for k in range(max(0, t - MOST_HELD), t) if found[k]]
    nearest = min([*known, *seen[-1:]], key=lambda k: abs(k - t))
    return _Neighbours(nearest, [cameras[nearest] if nearest in seen else known[nearest]])


def _follow(
    grey: Grey, path: CameraPath, t: int, nearest: _Neighbours, court: CourtModel
) -> LineFit:
    """The camera of frame t from that of the nearest one known."""
    guess = carry_camera(nearest.cameras[0], homography_between(path, nearest.frame, t))
    guesses = [guess, nearest.cameras[0]]
    if len(nearest.cameras) > 1:
        guesses.append(_extrapolated(nearest.cameras[1], nearest.cameras[0]))
    spread = _spread(guess, path, nearest.frame, t)
    fit = _correct(grey, guesses, court, spread)
    if not is_seen(fit):
        fit = _correct(grey, guesses, court, spread, (AGAIN, *SEARCHES))
    return fit


def _extrapolated(before: Pinhole, last: Pinhole) -> Pinhole:
    """The camera that turns and zooms on as it did between the last two frames."""
    turn = last.rotation @ before.rotation.T
    return replace(last, focal=last.focal**2 / before.focal, rotation=turn @ last.rotation)


def check_still(greys: Iterable[Grey], camera: Pinhole, court: CourtModel) -> TrackedViews:
    """The one camera of a clip that stands still, and the frames in which its lines are seen."""
    court = replace(court, spacing=COARSE)
    found = [is_seen(evaluate(grey, camera, court, SPACING)) for grey in greys]
    return TrackedViews((camera,) * len(found), np.array(found))


def is_seen(fit: LineFit) -> bool:
    """Whether enough lines lie where the camera puts them."""
    return bool(fit.support >= MIN_SUPPORT and fit.hit.sum() >= MIN_HITS)


def _correct(
    grey: Grey,
    guesses: list[Pinhole],
    court: CourtModel,
    spread: Float[np.ndarray, "7"],
    searches: tuple[float, ...] = SEARCHES,
) -> LineFit:
    """The camera near the guess that lies best on the lines, brought onto them.

    The camera's motion between two frames may be off by tens of pixels in a corner of the picture
    where nothing was tracked; a camera that goes on as before is off where it is jerked.
    """
    guess = guesses[0]
    if max(_apart(guess, other, grey.shape) for other in guesses[1:]) > DRIFT:
        tried = [evaluate(grey, camera, court, 2 * SPACING) for camera in guesses]
        guess = max(tried, key=lambda fit: fit.evidence).camera
    return fit_lines(grey, guess, court, searches, FIXED_CENTRE, spread, SPACING, False)


def _apart(one: Pinhole, other: Pinhole, shape: tuple[int, ...]) -> float:
    """How far two views of one place are shifted at the corners of the picture's middle, px."""
    corners = np.array([(x, y) for x in (0.25, 0.75) for y in (0.25, 0.75)]) * shape[1::-1]
    rays = np.column_stack([(corners - one.principal) / one.focal, np.ones(4)]) @ one.rotation
    return float(np.linalg.norm(other.project(rays + other.centre) - corners, axis=1).max())


def _spread(camera: Pinhole, path: CameraPath, start: int, end: int) -> Float[np.ndarray, "7"]:
    """How far the camera may be from where the path has put it."""
    sure = min(path.confidence[start], path.confidence[end]) >= SURE_PATH
    steps = np.sqrt(min(max(1, abs(end - start)), 100)) * (1.0 if sure else 10.0)
    turn = steps * DRIFT / camera.focal
    return np.array([*LOOSE[:3], turn, turn, turn, steps * ZOOM_DRIFT])
