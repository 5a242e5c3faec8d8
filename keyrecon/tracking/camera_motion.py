"""How the camera moves: a homography from every frame to the reference frame.

A camera that turns and zooms without travelling maps the background between any two frames by a
homography (Hartley and Zisserman, "Multiple View Geometry", 2nd ed., 8.4). Corners spread evenly
over a key picture are tracked into each frame by pyramidal Lucas-Kanade (Bouguet 2000) and a
model is fitted by RANSAC, so that whatever moves on its own, the player first of all, is outvoted.
A similarity is fitted first; a full homography replaces it only where it explains the corners
clearly better, since its extra freedom otherwise drifts where there are no corners. The RANSAC of
the homography is locally optimised (Chum, Matas and Kittler, DAGM 2003): a sample of four corners
carries their noise, and the best of many is refitted to all that agree with it.

Frames are registered to key pictures, not to their predecessors: a new key picture is taken only
when the view has left all earlier ones, so errors add up per view, not per frame, and a camera that
comes back finds its old key picture. While the camera rests, only a few frames are registered.
Letters and logos laid over the picture are left out (`static_overlay.py`).

If no corner moves noticeably over the whole sequence, the camera is static and the path is
exactly the identity.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Annotated

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from keyrecon.io.frame_reader import read_grey, shrinking, side_by_side
from keyrecon.io.video import Video
from keyrecon.numerics.geometry import warp_points
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within
from keyrecon.records import CameraPath, Shots
from keyrecon.segmentation.static_overlay import StaticOverlay
from keyrecon.tracking.shots import CutDetector

Grey = UInt8[np.ndarray, "h w"]
Matrix = Float[np.ndarray, "3 3"]

MAX_CORNERS = 240
"""Corners tracked from a key picture."""
INLIER_DISTANCE = 1.0
"""How far a corner may lie from where the camera's motion puts it, reduced px."""
AGREEING_DISTANCE = 0.35
"""How far a corner may lie from the homography that it is fitted to, reduced px: a few times what
Lucas-Kanade errs by. Beyond it are letters laid over the picture and limbs that move slowly.

Mean error of the path over 28 s of each of seven rendered videos of turning cameras, px: plain
RANSAC with 1 px .12 to 1.54; locally optimised with 1 px .10 to 1.43, with .35 .11 to .88, which is
.57 of the plain one's in the median, .96 at worst. On 12 s of them .18 and .25 gave what .35 did
within .06; .5 and .7 lay between in three of four.
"""
MIN_INLIERS = 12
"""Fewer agreeing corners say nothing about the camera."""
MAX_RESIDUAL_RATIO = 0.8
"""A homography must bring the median residual below this share of a similarity's."""
MAX_OVERLAY_SHARE = 0.05
"""Share of the corners that may lie on overlays: so few are outvoted with the player."""
MIN_SCENE_MOTION = 3.0
"""A corner that the model moves by so much shows whether it belongs to the scene, reduced px."""
FRAMES_AT_REST = 4
"""Frames that share one registration while the camera rests: only the last is registered."""
MAX_REST_MOTION = 0.25
"""A camera that moves less over so many frames rests, reduced px; Lucas-Kanade errs by half."""
KEY_HYSTERESIS = 0.08
"""A key picture is kept unless another is nearer by this share of the picture's width."""
MOST_HELD = 2**26
"""Bytes of reduced pictures that are kept in case they are needed a second time: 20 s at 25 frames
per second, or all of a shot."""
MIN_CONFIDENCE = 0.35
"""Share of agreeing corners below which a key picture has nothing to say."""


@dataclass(frozen=True)
class CameraMotionOptions:
    """How the background is tracked."""

    width: Annotated[int, within(64, 4096)] = 480
    """Pictures are reduced to this width, px; smaller is faster and less exact."""
    static: Annotated[float, within(0, 20)] = 0.6
    """The camera is taken to stand still if the background stays within this of its place in 95 %
    of the frames, px of the reduced picture."""
    leave: Annotated[float, within(0.02, 1)] = 0.3
    """A new picture to compare with is taken when the view has moved by this share of the picture.
    """


@dataclass(frozen=True, eq=False)
class _KeyPicture:
    """A picture that others are registered to."""

    picture: Grey
    corners: Float[np.ndarray, "n 2"]
    to_start: Float[np.ndarray, "3 3"]


@dataclass(frozen=True, eq=False)
class _Match:
    """How a key picture is registered to a frame."""

    model: Float[np.ndarray, "3 3"]
    confidence: float
    """Share of agreeing corners."""
    moved: Float[np.ndarray, "m 2"]
    """Corners of the key picture that the model moves noticeably."""
    moves_along: Bool[np.ndarray, "m"]
    """Whether they were tracked to where it puts them."""


@dataclass(eq=False)
class _FeatureTracker:
    """Registers one frame after the other."""

    options: CameraMotionOptions
    overlaid: Bool[np.ndarray, "h w"] | None = None
    overlay: StaticOverlay = field(default_factory=StaticOverlay)
    keys: list[_KeyPicture] = field(default_factory=list)
    current: int = 0

    def register(self, grey: Grey, guess: Matrix) -> tuple[Matrix, float]:
        """Homography to frame 0, and its confidence; `guess` is the last frame's."""
        if not self.keys:
            self.keys.append(self._key(grey, np.eye(3)))
            return np.eye(3), 1.0
        self.current = self._nearest(guess, grey.shape)
        key = self.keys[self.current]
        match = _match(key, grey, np.linalg.inv(guess) @ key.to_start)
        if match is None:
            # The view was cut or blurred: start a view of its own where we believe to be.
            self.keys.append(self._key(grey, guess))
            return guess, 0.0
        self.overlay.count(grey.shape, match.moved, match.moves_along)
        to_start = _to_start(key, match)
        if self._leaves(match, grey):
            self.keys.append(self._key(grey, to_start))
        return to_start, match.confidence

    def register_at_rest(self, grey: Grey, guess: Matrix) -> tuple[Matrix, float] | None:
        """The same for a frame a little later; None if the camera has moved since."""
        key = self.keys[self.current]
        match = _match(key, grey, np.linalg.inv(guess) @ key.to_start)
        if match is None or self._leaves(match, grey):
            return None
        to_start = _to_start(key, match)
        step = _displacement(np.linalg.inv(guess) @ to_start, grey.shape)
        return None if step * grey.shape[1] > MAX_REST_MOTION else (to_start, match.confidence)

    def _leaves(self, match: _Match, grey: Grey) -> bool:
        """Whether this frame shares too little with its key picture."""
        far = _displacement(match.model, grey.shape) > self.options.leave
        return far or match.confidence < MIN_CONFIDENCE

    def _key(self, grey: Grey, to_start: Float[np.ndarray, "3 3"]) -> _KeyPicture:
        return _KeyPicture(grey, _corners(grey, self.overlaid), to_start)

    def _nearest(self, to_start: Float[np.ndarray, "3 3"], shape: tuple[int, ...]) -> int:
        """The key picture whose view is nearest; the current one unless another is clearly so."""
        inverse = np.linalg.inv(to_start)
        apart = np.array([_displacement(inverse @ k.to_start, shape) for k in self.keys])
        best = int(apart.argmin())
        keep = self.current < len(apart) and apart[self.current] < apart[best] + KEY_HYSTERESIS
        return self.current if keep else best


def _to_start(key: _KeyPicture, match: _Match) -> Float[np.ndarray, "3 3"]:
    """Homography to frame 0 by way of a key picture."""
    to_start = key.to_start @ np.linalg.inv(match.model)
    return to_start / to_start[2, 2]


def estimate_camera_motion(
    video: Video, options: CameraMotionOptions = CameraMotionOptions(), progress: Progress = silent
) -> CameraPath:
    """Homographies from every frame to the middle one of its shot, and their confidence.

    Exactly the identity where the camera is static. Where the video cuts to another shot is told
    beside it (`CameraPath.cuts`).
    """
    detector = CutDetector()
    path = estimate_shot_motion(video, options, progress, detector)
    cuts = tuple(sorted({*detector.cuts, *video.joints}))
    if not cuts:
        return path
    shots = Shots.between(cuts, len(video))
    parts = [video.part(part) for part in shots.parts]
    moved = side_by_side(lambda part: estimate_shot_motion(part, options), parts)
    paths = [*progress(moved, "Estimating the camera's motion in each shot", len(parts))]
    return CameraPath(
        np.concatenate([path.to_reference for path in paths]),
        np.concatenate([path.confidence for path in paths]),
        cuts,
        tuple(detector.dissolves),
    )


def estimate_shot_motion(
    video: Video,
    options: CameraMotionOptions = CameraMotionOptions(),
    progress: Progress = silent,
    detector: CutDetector | None = None,
) -> CameraPath:
    """The same for a video that is known to be one shot, such as pictures far apart in time.

    A `detector` looks at all frames; where it finds cuts, the path means nothing.
    """
    width = min(options.width, video.width)
    shape = (round(video.height * width / video.width), width)

    def pictures() -> Iterator[Grey]:
        return progress(read_grey(video, width), "Estimating the camera's motion", len(video))

    tracker = _FeatureTracker(options)
    watched = pictures() if detector is None else _first_shot(pictures(), detector)
    held: list[Grey] | None = [] if len(video) * shape[0] * shape[1] <= MOST_HELD else None
    path, confidence = _register_all(_holding(watched, held), tracker, max(1, len(video) // 64))
    if _is_static(path, shape, options):
        return CameraPath(np.tile(np.eye(3), (len(path), 1, 1)), confidence)
    if detector is not None and detector.cuts:
        return CameraPath(path, confidence)
    if tracker.overlay.share(np.concatenate([k.corners for k in tracker.keys])) > MAX_OVERLAY_SHARE:
        tracker = _FeatureTracker(options, tracker.overlay.mask())
        path, confidence = _register_all(pictures() if held is None else held, tracker)
        if _is_static(path, shape, options):
            return CameraPath(np.tile(np.eye(3), (len(video), 1, 1)), confidence)
    to_reference = np.linalg.inv(path[len(path) // 2]) @ path
    small = shrinking(width / video.width)
    full = np.linalg.inv(small) @ to_reference @ small
    return CameraPath(full / full[:, 2:, 2:], confidence)


def _first_shot(pictures: Iterable[Grey], detector: CutDetector) -> Iterator[Grey]:
    """Pictures up to the first cut, or a little beyond; the detector sees all of them."""
    for grey in detector.watch(pictures):
        if not detector.cuts:
            yield grey


def _holding(pictures: Iterable[Grey], held: list[Grey] | None) -> Iterator[Grey]:
    """Pictures that are kept in a list on the way."""
    for grey in pictures:
        if held is not None:
            held.append(grey)
        yield grey


def _register_all(
    pictures: Iterable[Grey], tracker: _FeatureTracker, watch: int | None = None
) -> tuple[Float[np.ndarray, "T 3 3"], Float[np.ndarray, "T"]]:
    """Homographies to frame 0 in reduced pixels; evidence of overlays from each `watch`-th."""
    path: list[tuple[Matrix, float]] = []
    waiting: list[Grey] = []
    for number, grey in enumerate(pictures):
        if watch and number % watch == 0:
            tracker.overlay.add(grey)
        waiting.append(grey)
        if len(waiting) == FRAMES_AT_REST or len(path) < FRAMES_AT_REST:
            path += _register(tracker, waiting, [pose for pose, _ in path[-2:]])
            waiting = []
    path += _register(tracker, waiting, [pose for pose, _ in path[-2:]])
    return np.array([pose for pose, _ in path]), np.array([confidence for _, confidence in path])


def _register(
    tracker: _FeatureTracker, waiting: list[Grey], before: list[Matrix]
) -> list[tuple[Matrix, float]]:
    """Poses of frames in a row; while the camera rests, the last one tells those before it.

    `before` are the poses of up to two frames before them.
    """
    if len(before) == 2 and waiting:
        last, there = before
        step = _displacement(np.linalg.inv(last) @ there, waiting[0].shape)
        if step * waiting[0].shape[1] < MAX_REST_MOTION and (
            rest := tracker.register_at_rest(waiting[-1], there)
        ):
            along = np.linspace(0, 1, len(waiting) + 1)[1:]
            return [(there + share * (rest[0] - there), rest[1]) for share in along]
    registered: list[tuple[Matrix, float]] = []
    guess = before[-1] if before else np.eye(3)
    for grey in waiting:
        registered.append(tracker.register(grey, guess))
        guess = registered[-1][0]
    return registered


def _corners(grey: Grey, overlaid: Bool[np.ndarray, "h w"] | None) -> Float[np.ndarray, "n 2"]:
    """Corners spread over the picture: the best of each cell of a grid, weak ones left out."""
    mask = None if overlaid is None else (~overlaid).astype(np.uint8)
    response = cv2.cornerMinEigenVal(grey, 5)
    if mask is not None:
        response = response * mask
    cell = max(6, round(np.sqrt(grey.size / MAX_CORNERS)))
    rows, columns = grey.shape[0] // cell, grey.shape[1] // cell
    blocks = response[: rows * cell, : columns * cell]
    blocks = blocks.reshape(rows, cell, columns, cell).swapaxes(1, 2).reshape(rows, columns, -1)
    best = blocks.argmax(axis=2)
    y = np.arange(rows)[:, None] * cell + best // cell
    x = np.arange(columns) * cell + best % cell
    good = blocks.max(axis=2) > max(1e-6, 0.002 * float(response.max()))
    return np.stack([x[good], y[good]], axis=1).astype(np.float32)


def _match(key: _KeyPicture, grey: Grey, guess: Float[np.ndarray, "3 3"]) -> _Match | None:
    """Homography from a key picture to this one; None where too few corners agree."""
    if len(key.corners) < MIN_INLIERS:
        return None
    start = warp_points(guess, key.corners.astype(float)).astype(np.float32)
    size = np.array(grey.shape[::-1])
    inside = ((start > 4) & (start < size - 5)).all(axis=1)
    if inside.sum() < MIN_INLIERS:
        return None
    source = np.ascontiguousarray(key.corners[inside])
    tracked, status, _ = cv2.calcOpticalFlowPyrLK(
        key.picture, grey, source, start[inside].copy(), winSize=(15, 15), maxLevel=3,
        criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 15, 0.02),
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )  # fmt: skip
    good = status.ravel() > 0
    source, tracked = source[good], tracked[good]
    model = _fit(source, tracked)
    if model is None:
        return None
    put = warp_points(model, source)
    agrees = np.linalg.norm(put - tracked, axis=1) < 1.5 * INLIER_DISTANCE
    if agrees.sum() < MIN_INLIERS:
        return None
    moved = np.linalg.norm(put - source, axis=1) > MIN_SCENE_MOTION
    return _Match(model, float(agrees.sum()) / int(inside.sum()), source[moved], agrees[moved])


def _fit(
    source: Float[np.ndarray, "n 2"], target: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "3 3"] | None:
    """A similarity, or a homography where that is clearly better."""
    if len(source) < MIN_INLIERS:
        return None
    similar, _ = cv2.estimateAffinePartial2D(
        source, target, method=cv2.RANSAC, ransacReprojThreshold=2 * INLIER_DISTANCE, maxIters=500
    )
    if similar is None:
        return None
    model = np.vstack([similar, [0, 0, 1]])
    # Four parameters more need many corners to be known well.
    if len(source) < 5 * MIN_INLIERS:
        return model
    full, _ = cv2.findHomography(source, target, cv2.USAC_FAST, AGREEING_DISTANCE, maxIters=500)
    if full is None:
        return model
    error, other = (
        np.median(np.minimum(np.linalg.norm(warp_points(m, source) - target, axis=1), 3))
        for m in (model, full)
    )
    return full if other < MAX_RESIDUAL_RATIO * error else model


def _displacement(homography: Float[np.ndarray, "3 3"], shape: tuple[int, ...]) -> float:
    """How far a homography moves the picture's corners, as a share of its width."""
    height, width = shape[:2]
    corners = np.array([(0, 0), (width, 0), (width, height), (0, height)], float)
    return float(np.linalg.norm(warp_points(homography, corners) - corners, axis=1).mean() / width)


def _is_static(
    path: Float[np.ndarray, "T 3 3"], shape: tuple[int, int], options: CameraMotionOptions
) -> bool:
    """Whether nothing in the picture is moved noticeably in nearly all frames."""
    height, width = shape
    share = np.array([(0.2, 0.2), (0.8, 0.2), (0.8, 0.8), (0.2, 0.8), (0.5, 0.5)])
    points = share * (width, height)
    middle = np.linalg.inv(path[len(path) // 2]) @ path
    moved = np.stack([warp_points(h, points) for h in middle]) - points
    return bool(np.percentile(np.linalg.norm(moved, axis=2).max(axis=1), 95) < options.static)
