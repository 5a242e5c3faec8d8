"""How the camera moves: a homography from every frame to the reference frame.

A camera that turns and zooms without travelling maps the background between any two frames by a
homography (Hartley and Zisserman, "Multiple View Geometry", 2nd ed., 8.4). Corners spread evenly
over a key picture are followed into each frame by pyramidal Lucas-Kanade (Bouguet 2000) and a
model is fitted by RANSAC, so that whatever moves on its own, the player first of all, is outvoted.
A similarity is fitted first; a full homography replaces it only where it explains the corners
clearly better, since its extra freedom otherwise drifts where there are no corners.

Frames are registered to key pictures, not to their predecessors: a new key picture is taken only
when the view has left all earlier ones, so errors add up per view, not per frame, and a camera that
comes back finds its old key picture. Letters and logos laid over the picture stand still while the
scene moves; edges that persist at one place of the picture in a minority of it are left out.

If no corner moves noticeably over the whole sequence, the camera is static and the path is
exactly the identity.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from keyrecon.camera import warp_points
from keyrecon.pictures import read_grey, shrinking
from keyrecon.progress import Progress, silent
from keyrecon.records import CameraPath
from keyrecon.video import Video

Grey = UInt8[np.ndarray, "h w"]

CORNERS = 240
"""Corners followed from a key picture."""
INLIER = 1.0
"""How far a corner may lie from the model, reduced px: the accuracy of Lucas-Kanade."""
LEAST_INLIERS = 12
"""Fewer agreeing corners say nothing about the camera."""
CLEARLY_BETTER = 0.8
"""A homography must bring the median residual below this share of a similarity's."""
PERSISTENT = 0.85
"""An edge that keeps its place and direction to this degree all along is laid over the picture
(or the camera is static)."""


FEW = 0.05
"""Share of the corners that may lie on overlays: so few are outvoted with the player."""


@dataclass(frozen=True)
class CameraOptions:
    """How the background is followed."""

    width: int = 480
    """Pictures are reduced to this width, px; smaller is faster and less exact."""
    static: float = 0.6
    """If background corners stay within this of their place in 95 % of the frames, the camera is
    static, px of the reduced picture."""
    leave: float = 0.3
    """A new key picture is taken when the view has moved by this share of the picture."""


@dataclass(frozen=True, eq=False)
class _Key:
    """A picture that others are registered to."""

    picture: Grey
    corners: Float[np.ndarray, "n 2"]
    to_start: Float[np.ndarray, "3 3"]


@dataclass(eq=False)
class _Overlay:
    """Running evidence of edges that keep their place in the picture."""

    gradient: Float[np.ndarray, "2 h w"] | None = None
    strength: Float[np.ndarray, "h w"] | None = None

    def add(self, grey: Grey) -> None:
        """Take one more picture into account."""
        soft = cv2.GaussianBlur(grey, (0, 0), 1.0)
        slope = np.stack([cv2.Sobel(soft, cv2.CV_32F, 1, 0), cv2.Sobel(soft, cv2.CV_32F, 0, 1)])
        size = np.hypot(*slope)
        self.gradient = slope if self.gradient is None else self.gradient + slope
        self.strength = size if self.strength is None else self.strength + size

    def mask(self) -> Bool[np.ndarray, "h w"]:
        """Where persistent edges lie, if they are few against those that do not persist."""
        strong = self.strength > np.percentile(self.strength, 90)
        persistent = strong & (np.hypot(*self.gradient) > PERSISTENT * self.strength)
        if persistent.sum() > 0.5 * strong.sum():
            return np.zeros(strong.shape, bool)
        size = max(3, strong.shape[1] // 60)
        return cv2.dilate(persistent.astype(np.uint8), np.ones((size, size))) > 0


@dataclass(eq=False)
class _Follower:
    """Registers one frame after the other."""

    options: CameraOptions
    forbidden: Bool[np.ndarray, "h w"] | None
    keys: list[_Key] = field(default_factory=list)
    current: int = 0

    def register(
        self, grey: Grey, guess: Float[np.ndarray, "3 3"]
    ) -> tuple[Float[np.ndarray, "3 3"], float]:
        """Homography from this frame to frame 0, and its trust; `guess` is the last frame's."""
        if not self.keys:
            self.keys.append(self._key(grey, np.eye(3)))
            return np.eye(3), 1.0
        self.current = self._nearest(guess, grey.shape)
        key = self.keys[self.current]
        moved, trust = _match(key, grey, np.linalg.inv(guess) @ key.to_start)
        if moved is None:
            # The view was cut or blurred: start a view of its own where we believe to be.
            self.keys.append(self._key(grey, guess))
            return guess, 0.0
        to_start = key.to_start @ np.linalg.inv(moved)
        to_start /= to_start[2, 2]
        if _displacement(moved, grey.shape) > self.options.leave or trust < 0.35:
            self.keys.append(self._key(grey, to_start))
        return to_start, trust

    def _key(self, grey: Grey, to_start: Float[np.ndarray, "3 3"]) -> _Key:
        return _Key(grey, _corners(grey, self.forbidden), to_start)

    def _nearest(self, to_start: Float[np.ndarray, "3 3"], shape: tuple[int, ...]) -> int:
        """The key picture whose view is nearest; the current one unless another is clearly so."""
        inverse = np.linalg.inv(to_start)
        apart = np.array([_displacement(inverse @ k.to_start, shape) for k in self.keys])
        best = int(apart.argmin())
        keep = self.current < len(apart) and apart[self.current] < apart[best] + 0.08
        return self.current if keep else best


def follow_camera(
    video: Video, options: CameraOptions = CameraOptions(), progress: Progress = silent
) -> CameraPath:
    """Homographies from every frame to the middle one, and how much to trust them.

    Exactly the identity for a static camera. Trust is low where the view was cut.
    """
    width = min(options.width, video.width)
    overlay = _Overlay()
    stride = max(1, len(video) // 64)
    pictures = progress(read_grey(video, width), "Following the camera", len(video))
    path, trust, keys = _follow(pictures, options, None, (overlay, stride))
    shape = (round(video.height * width / video.width), width)
    if _is_static(path, shape, options):
        return CameraPath(np.tile(np.eye(3), (len(video), 1, 1)), trust)
    forbidden = overlay.mask()
    if _hold(keys, forbidden) > FEW:
        pictures = progress(read_grey(video, width), "Following the camera", len(video))
        path, trust, _ = _follow(pictures, options, forbidden, None)
        if _is_static(path, shape, options):
            return CameraPath(np.tile(np.eye(3), (len(video), 1, 1)), trust)
    to_reference = np.linalg.inv(path[len(path) // 2]) @ path
    small = shrinking(width / video.width)
    full = np.linalg.inv(small) @ to_reference @ small
    return CameraPath(full / full[:, 2:, 2:], trust)


def _hold(keys: list[_Key], forbidden: Bool[np.ndarray, "h w"]) -> float:
    """Share of the corners of all key pictures that lie on something laid over the picture."""
    x, y = np.concatenate([k.corners for k in keys]).astype(int).T
    return float(forbidden[y, x].mean()) if len(x) else 0.0


def _follow(
    pictures: Iterable[Grey],
    options: CameraOptions,
    forbidden: Bool[np.ndarray, "h w"] | None,
    watch: tuple[_Overlay, int] | None,
) -> tuple[Float[np.ndarray, "T 3 3"], Float[np.ndarray, "T"], list[_Key]]:
    """Homographies to frame 0 in reduced pixels; `watch` collects evidence of overlays."""
    follower = _Follower(options, forbidden)
    guess, path, trust = np.eye(3), [], []
    for number, grey in enumerate(pictures):
        if watch and number % watch[1] == 0:
            watch[0].add(grey)
        guess, agreed = follower.register(grey, guess)
        path.append(guess)
        trust.append(agreed)
    return np.array(path), np.array(trust), follower.keys


def _corners(
    grey: Grey, forbidden: Bool[np.ndarray, "h w"] | None
) -> Float[np.ndarray, "n 2"]:
    """Corners spread over the picture: the best of each cell of a grid, weak ones left out."""
    mask = None if forbidden is None else (~forbidden).astype(np.uint8)
    response = cv2.cornerMinEigenVal(grey, 5)
    if mask is not None:
        response = response * mask
    cell = max(6, round(np.sqrt(grey.size / CORNERS)))
    rows, columns = grey.shape[0] // cell, grey.shape[1] // cell
    blocks = response[: rows * cell, : columns * cell]
    blocks = blocks.reshape(rows, cell, columns, cell).swapaxes(1, 2).reshape(rows, columns, -1)
    best = blocks.argmax(axis=2)
    y = np.arange(rows)[:, None] * cell + best // cell
    x = np.arange(columns) * cell + best % cell
    good = blocks.max(axis=2) > max(1e-6, 0.002 * float(response.max()))
    return np.stack([x[good], y[good]], axis=1).astype(np.float32)


def _match(
    key: _Key, grey: Grey, guess: Float[np.ndarray, "3 3"]
) -> tuple[Float[np.ndarray, "3 3"] | None, float]:
    """Homography from a key picture to this one, and its share of agreeing corners."""
    if len(key.corners) < LEAST_INLIERS:
        return None, 0.0
    start = warp_points(guess, key.corners.astype(float)).astype(np.float32)
    size = np.array(grey.shape[::-1])
    inside = ((start > 4) & (start < size - 5)).all(axis=1)
    if inside.sum() < LEAST_INLIERS:
        return None, 0.0
    source = np.ascontiguousarray(key.corners[inside])
    found, status, _ = cv2.calcOpticalFlowPyrLK(
        key.picture, grey, source, start[inside].copy(), winSize=(15, 15), maxLevel=3,
        criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 15, 0.02),
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )  # fmt: skip
    good = status.ravel() > 0
    model, inliers = _fit(source[good], found[good])
    return model, 0.0 if model is None else float(inliers) / int(inside.sum())


def _fit(
    source: Float[np.ndarray, "n 2"], target: Float[np.ndarray, "n 2"]
) -> tuple[Float[np.ndarray, "3 3"] | None, int]:
    """A similarity, or a homography where that is clearly better; and how many points agree."""
    if len(source) < LEAST_INLIERS:
        return None, 0
    similar, _ = cv2.estimateAffinePartial2D(
        source, target, method=cv2.RANSAC, ransacReprojThreshold=2 * INLIER, maxIters=500
    )
    if similar is None:
        return None, 0
    model = np.vstack([similar, [0, 0, 1]])
    error = np.linalg.norm(warp_points(model, source) - target, axis=1)
    # Four parameters more need many corners to be known well.
    if len(source) >= 5 * LEAST_INLIERS:
        full, _ = cv2.findHomography(source, target, cv2.RANSAC, INLIER, maxIters=500)
        if full is not None:
            other = np.linalg.norm(warp_points(full, source) - target, axis=1)
            if np.median(np.minimum(other, 3)) < CLEARLY_BETTER * np.median(np.minimum(error, 3)):
                model, error = full, other
    agree = int((error < 1.5 * INLIER).sum())
    return (None, 0) if agree < LEAST_INLIERS else (model, agree)


def _displacement(moved: Float[np.ndarray, "3 3"], shape: tuple[int, ...]) -> float:
    """How far a homography moves the picture's corners, as a share of its width."""
    height, width = shape[:2]
    corners = np.array([(0, 0), (width, 0), (width, height), (0, height)], float)
    return float(np.linalg.norm(warp_points(moved, corners) - corners, axis=1).mean() / width)


def _is_static(
    path: Float[np.ndarray, "T 3 3"], shape: tuple[int, int], options: CameraOptions
) -> bool:
    """Whether nothing in the picture is moved noticeably in nearly all frames."""
    height, width = shape
    share = np.array([(0.2, 0.2), (0.8, 0.2), (0.8, 0.8), (0.2, 0.8), (0.5, 0.5)])
    points = share * (width, height)
    middle = np.linalg.inv(path[len(path) // 2]) @ path
    moved = np.stack([warp_points(h, points) for h in middle]) - points
    return bool(np.percentile(np.linalg.norm(moved, axis=2).max(axis=1), 95) < options.static)
