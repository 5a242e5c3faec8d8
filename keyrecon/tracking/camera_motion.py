"""How the camera moves: a homography from every frame to the reference frame.

A camera that turns and zooms without travelling maps the background between any two frames by a
homography (Hartley and Zisserman, "Multiple View Geometry", 2nd ed., 8.4).

Frames are registered to key pictures, not to their predecessors: a new key picture is taken only
when the view has left all earlier ones, so errors add up per view, not per frame, and a camera that
comes back finds its old key picture. While the camera rests, only a few frames are registered.
Letters and logos laid over the picture are left out (`static_overlay.py`), and where the light
changes (`exposure.py`), which Lucas-Kanade takes to stay, frames are registered again as if it had
not.

If no corner moves noticeably over the whole sequence, the camera is static and the path is
exactly the identity.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float

from keyrecon.io.frame_reader import in_threads, read_grey, shrinking
from keyrecon.io.held_video import with_exposure
from keyrecon.io.video import Video
from keyrecon.numerics.geometry import warp_points
from keyrecon.parallel_map import ParallelMap
from keyrecon.progress import Progress, silent
from keyrecon.ranges import within
from keyrecon.records import CameraPath, Shots
from keyrecon.segmentation.static_overlay import StaticOverlay
from keyrecon.tracking.exposure import ExposureMeter
from keyrecon.tracking.key_pictures import Grey, KeyPicture, Match, find_corners, match_key
from keyrecon.tracking.shots import CutDetector, RecentPictures, find_shots

Matrix = Float[np.ndarray, "3 3"]

MAX_OVERLAY_SHARE = 0.05
"""Share of the corners that may lie on overlays: so few are outvoted with the player. A quarter
more or less, others with it: at most 1.9 points, 2.4 mm on four clips; halved: no change."""
FRAMES_AT_REST = 4
"""Frames that share one registration while the camera rests: only the last is registered. A quarter
more or less, others with it: at most 1.9 points, 2.4 mm on four clips; halved: no change."""
MAX_REST_MOTION = 0.25
"""A camera that moves less over so many frames rests, reduced px; Lucas-Kanade errs by half. A
quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips; halved: no
change."""
KEY_HYSTERESIS = 0.08
"""A key picture is kept unless another is nearer by this share of the picture's width. A quarter
more or less, others with it: at most 1.9 points, 2.4 mm on four clips; halved: no change."""
MOST_HELD = 2**26
"""Bytes of reduced pictures that are kept in case they are needed a second time: 20 s at 25 frames
per second, or all of a shot. Of two minutes with 25 cuts the camera's motion takes 4.8 instead
of 6.6 ms per frame on two cores where shots are not decoded again."""
MOST_REPEATS = 3
"""How often frames are registered again where the light changes: it is measured along the path, and
the path found in evened light."""
MIN_CONFIDENCE = 0.35
"""Share of agreeing corners below which a key picture has nothing to say. A quarter more or less,
others with it: at most 1.9 points, 2.4 mm on four clips; halved: no change."""


@dataclass(frozen=True)
class CameraMotionOptions:
    """How the background is tracked."""

    width: Annotated[int, within(64, 4096)] = 480
    """Pictures are reduced to this width, px; smaller is faster and less exact.

    A quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips; halved: no
    change.
    """
    static: Annotated[float, within(0, 20)] = 0.6
    """The camera is taken to stand still if the background stays within this of its place in 95 %
    of the frames, px of the reduced picture.

    A quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips; halved: no
    change.
    """
    leave: Annotated[float, within(0.02, 1)] = 0.3
    """A new picture to compare with is taken when the view has moved by this share of the picture.

    A quarter more or less, others with it: at most 1.9 points, 2.4 mm on four clips; halved: no
    change.
    """


@dataclass(eq=False)
class _FeatureTracker:
    """Registers one frame after the other."""

    options: CameraMotionOptions
    overlaid: Bool[np.ndarray, "h w"] | None = None
    overlay: StaticOverlay = field(default_factory=StaticOverlay)
    exposure_meter: ExposureMeter = field(default_factory=ExposureMeter)
    keys: list[KeyPicture] = field(default_factory=list)
    current: int = 0
    lost: bool = False
    """Whether the newest key picture was begun where nothing agreed, and nothing has since."""

    def register(self, grey: Grey, guess: Matrix) -> tuple[Matrix, float]:
        """Homography to frame 0, and its confidence; `guess` is the last frame's."""
        if not self.keys:
            self.keys.append(self._key(grey, np.eye(3)))
            return np.eye(3), 1.0
        self.current = self._nearest(guess, grey.shape)
        key = self.keys[self.current]
        match = match_key(key, grey, np.linalg.inv(guess) @ key.to_start)
        if match is None and self.lost:
            key, match = self._match_lost(grey, guess)
        if match is None:
            self._begin_lost(grey, guess)
            return guess, 0.0
        self.overlay.count(grey.shape, match.moved, match.moves_along)
        to_start = _to_start(key, match)
        if match.confidence < MIN_CONFIDENCE:
            self._begin_lost(grey, to_start)
        elif self._leaves(match, grey):
            self.keys.append(self._key(grey, to_start))
            self.lost = False
        elif self.current == len(self.keys) - 1:
            self.lost = False
        return to_start, match.confidence

    def _match_lost(self, grey: Grey, guess: Matrix) -> tuple[KeyPicture, Match | None]:
        """The view that was begun in the last frame, and this frame in it if that is sure.

        Light that comes up, or a lens that finds its focus, leaves older views unlike what comes.
        """
        key = self.keys[-1]
        match = match_key(key, grey, np.linalg.inv(guess) @ key.to_start)
        if match is None or match.confidence < MIN_CONFIDENCE:
            return key, None
        self.current = len(self.keys) - 1
        return key, match

    def _begin_lost(self, grey: Grey, to_start: Matrix) -> None:
        """Begin a view where we believe to be: what was seen was cut, blurred, or shows nothing.

        Where that goes on there is one such view, not one for each frame.
        """
        if self.lost:
            self.keys.pop()
        self.keys.append(self._key(grey, to_start))
        self.lost = True

    def register_at_rest(self, grey: Grey, guess: Matrix) -> tuple[Matrix, float] | None:
        """The same for a frame a little later; None if the camera has moved since."""
        key = self.keys[self.current]
        match = match_key(key, grey, np.linalg.inv(guess) @ key.to_start)
        if match is None or self._leaves(match, grey):
            return None
        to_start = _to_start(key, match)
        step = _displacement(np.linalg.inv(guess) @ to_start, grey.shape)
        return None if step * grey.shape[1] > MAX_REST_MOTION else (to_start, match.confidence)

    def _leaves(self, match: Match, grey: Grey) -> bool:
        """Whether this frame shares too little with its key picture."""
        far = _displacement(match.model, grey.shape) > self.options.leave
        return far or match.confidence < MIN_CONFIDENCE

    def _key(self, grey: Grey, to_start: Float[np.ndarray, "3 3"]) -> KeyPicture:
        return KeyPicture(grey, find_corners(grey, self.overlaid), to_start)

    def _nearest(self, to_start: Float[np.ndarray, "3 3"], shape: tuple[int, ...]) -> int:
        """The key picture whose view is nearest; the current one unless another is clearly so."""
        inverse = np.linalg.inv(to_start)
        apart = np.array([_displacement(inverse @ k.to_start, shape) for k in self.keys])
        best = int(apart.argmin())
        keep = self.current < len(apart) and apart[self.current] < apart[best] + KEY_HYSTERESIS
        return self.current if keep else best


def _to_start(key: KeyPicture, match: Match) -> Float[np.ndarray, "3 3"]:
    """Homography to frame 0 by way of a key picture."""
    to_start = key.to_start @ np.linalg.inv(match.model)
    return to_start / to_start[2, 2]


def estimate_camera_motion(
    video: Video,
    options: CameraMotionOptions = CameraMotionOptions(),
    progress: Progress = silent,
    parallel_map: ParallelMap = in_threads,
) -> CameraPath:
    """Homographies from every frame to the middle one of its shot, and their confidence.

    Exactly the identity where the camera is static. Cuts to other shots are in `CameraPath.cuts`;
    `parallel_map` estimates the motion in shots while the next ones are searched for.
    """
    detector = CutDetector.at_rate(video.fps)
    # what is at hand here is not sent elsewhere, where decoding it again is cheaper
    recent = RecentPictures(MOST_HELD if parallel_map is in_threads else 0)
    watched = recent.watch(detector.watch(_read_reduced(video, options, progress)))
    path = _estimate_motion(video, options, progress, _first_shot(watched, detector), detector)
    if not detector.cuts and not video.file_starts:
        return path
    return _estimate_shots(video, options, watched, recent, detector, parallel_map)


def _join_exposures(paths: Sequence[CameraPath]) -> Float[np.ndarray, "T"] | None:
    """Of one shot after the other."""
    if all(path.exposure is None for path in paths):
        return None
    even = [np.ones(len(path.confidence)) for path in paths]
    known = [
        one if path.exposure is None else path.exposure
        for path, one in zip(paths, even, strict=True)
    ]
    return np.concatenate(known)


def estimate_shot_motion(
    video: Video,
    options: CameraMotionOptions = CameraMotionOptions(),
    pictures: Sequence[Grey] | None = None,
    progress: Progress = silent,
) -> CameraPath:
    """The same for a video that is known to be one shot, such as pictures far apart in time.

    With its reduced `pictures`, if they are at hand, it need not be decoded.
    """
    watched = _read_reduced(video, options, progress) if pictures is None else iter(pictures)
    return _estimate_motion(video, options, progress, watched)


def _reduced_width(video: Video, options: CameraMotionOptions) -> int:
    return min(options.width, video.width)


def _read_reduced(video: Video, options: CameraMotionOptions, progress: Progress) -> Iterator[Grey]:
    """The pictures in which the background is tracked."""
    pictures = read_grey(video, _reduced_width(video, options))
    return progress(pictures, "Estimating the camera's motion", len(video))


def _estimate_motion(
    video: Video,
    options: CameraMotionOptions,
    progress: Progress,
    watched: Iterator[Grey],
    detector: CutDetector | None = None,
) -> CameraPath:
    """As `estimate_shot_motion` with the pictures `watched`.

    Where a `detector` has found cuts in these, the path means nothing.
    """
    width = _reduced_width(video, options)
    shape = (round(video.height * width / video.width), width)
    tracker = _FeatureTracker(options, exposure_meter=ExposureMeter(video.black))
    held: list[Grey] | None = [] if len(video) * shape[0] * shape[1] <= MOST_HELD else None
    path, confidence = _register_all(_holding(watched, held), tracker, max(1, len(video) // 64))
    exposure = tracker.exposure_meter.exposure()
    if _is_static(path, shape, options):
        return _still(confidence, exposure)
    if detector is not None and detector.cuts:
        return CameraPath(path, confidence)
    corners = np.concatenate([key.corners for key in tracker.keys])
    hidden = tracker.overlay.share(corners) > MAX_OVERLAY_SHARE
    overlaid = tracker.overlay.mask() if hidden else None
    for _ in range(MOST_REPEATS if hidden or exposure is not None else 0):
        tracker = _FeatureTracker(options, overlaid, exposure_meter=ExposureMeter(video.black))
        again: Iterable[Grey]
        if exposure is None:
            again = held or _read_reduced(video, options, progress)
        else:
            again = _read_reduced(with_exposure(video, exposure), options, progress)
        path, confidence = _register_all(again, tracker)
        if exposure is None:
            break
        exposure = exposure * tracker.exposure_meter.factors()
        if tracker.exposure_meter.exposure() is None:
            break
    if _is_static(path, shape, options):
        return _still(confidence, exposure)
    to_reference = np.linalg.inv(path[len(path) // 2]) @ path
    small = shrinking(width / video.width)
    full = np.linalg.inv(small) @ to_reference @ small
    return CameraPath(full / full[:, 2:, 2:], confidence, exposure=exposure)


def _still(
    confidence: Float[np.ndarray, "T"], exposure: Float[np.ndarray, "T"] | None
) -> CameraPath:
    """The path of a camera that does not move."""
    return CameraPath(np.tile(np.eye(3), (len(confidence), 1, 1)), confidence, exposure=exposure)


def _first_shot(watched: Iterator[Grey], detector: CutDetector) -> Iterator[Grey]:
    """Pictures up to the first cut, or a little beyond; the others are still to be watched."""
    for grey in watched:
        if detector.cuts:
            return
        yield grey


def _estimate_shots(
    video: Video,
    options: CameraMotionOptions,
    watched: Iterator[Grey],
    recent: RecentPictures,
    detector: CutDetector,
    parallel_map: ParallelMap,
) -> CameraPath:
    """The motion in each shot, while the next ones are looked for in what is to be watched yet."""
    parts: list[slice] = []

    def begun() -> Iterator[tuple[Video, CameraMotionOptions, list[Grey] | None]]:
        for part in find_shots(watched, detector, video):
            parts.append(part)
            yield video.part(part), options, recent.take(part)

    moved = [*parallel_map(estimate_shot_motion, begun())]
    known = {part.start: (part.stop, path) for part, path in zip(parts, moved, strict=True)}
    cuts = tuple(sorted({*detector.cuts, *video.file_starts}))
    paths = []
    for part in Shots.between(cuts, len(video)).parts:
        stop, path = known.get(part.start, (None, None))
        if path is None or stop != part.stop:  # a dissolve that was found within another one
            path = estimate_shot_motion(video.part(part), options)
        paths.append(path)
    return CameraPath(
        np.concatenate([path.to_reference for path in paths]),
        np.concatenate([path.confidence for path in paths]),
        cuts,
        tuple(detector.dissolves),
        _join_exposures(paths),
    )


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
            _meter(tracker, waiting, path)
            waiting = []
    path += _register(tracker, waiting, [pose for pose, _ in path[-2:]])
    _meter(tracker, waiting, path)
    return np.array([pose for pose, _ in path]), np.array([confidence for _, confidence in path])


def _meter(tracker: _FeatureTracker, waiting: list[Grey], path: list[tuple[Matrix, float]]) -> None:
    """Measure the exposure of the frames at the end of the path."""
    for grey, (pose, _) in zip(waiting, path[len(path) - len(waiting) :], strict=True):
        tracker.exposure_meter.add(grey, pose)


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
