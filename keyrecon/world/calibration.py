"""The camera of every frame, calibrated on the lines of a tennis court.

A few frames from all over the clip are read first. In one of them (the median of all where the
camera stands still, so that players fade) the court is found from its lines alone, or from clicks.
From there the camera is carried to the others by its own motion, all of them are fitted together
with one centre, and then it is followed through all frames.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, UInt8

from keyrecon.errors import KeyreconError
from keyrecon.io.frame_reader import read_grey, shrinking
from keyrecon.io.video import Video
from keyrecon.numerics.geometry import warp_points
from keyrecon.progress import Progress, silent
from keyrecon.records import CameraPath, Shots
from keyrecon.timeline import part_of_path
from keyrecon.world.clicked_points import (
    FEWEST,
    TOLERANCE,
    ContradictoryClicks,
    camera_from_points,
    check_click,
    describe_wrong_click,
)
from keyrecon.world.court import CourtModel, CourtOptions, tennis_court
from keyrecon.world.court_finding import (
    ASK,
    MIN_SUPPORT,
    NO_COURT,
    ClickedPixels,
    CourtView,
    click_error,
    find_in_picture,
    from_near_half,
)
from keyrecon.world.court_tracking import (
    TrackedViews,
    carry_camera,
    check_still,
    homography_between,
    is_seen,
    track_court,
)
from keyrecon.world.joint_fit import JointFit, fit_views
from keyrecon.world.line_fit import FIXED_CENTRE, LOOSE, evaluate, fit_lines
from keyrecon.world.pinhole import Pinhole
from keyrecon.world.records import OF_CAMERA, CourtClick, WorldCamera

MEASURED_WIDTH = 1280
"""Width of the pictures in which lines are measured, px."""
ANEW = 6
"""Frames in which the court is looked for anew where the camera's motion has lost it: each takes
half a second."""
SAMPLED, TRIED = 24, 5
"""Frames that are fitted together, and frames in which the court is looked for."""
MEDIAN_OF = 9
"""Frames whose median shows a still camera's court without its players."""
MAX_SPREAD = 0.08
"""Standard deviation of the camera's place as a share of its distance from the court: beyond it
nothing in metres is worth telling."""
CLICK_SEARCHES = (14.0, 10.0, 7.0, 5.0, 4.0, 4.0)
"""px to both sides in which lines are looked for around a camera that was clicked."""


@dataclass(frozen=True)
class CalibrationOptions:
    """How the court is looked for."""

    court: CourtOptions = field(default_factory=CourtOptions)
    """How its lines are painted."""


@dataclass(frozen=True, eq=False)
class _Pictures:
    """Frames read beforehand, and the camera's motion in their pixels."""

    frames: tuple[int, ...]
    greys: tuple[UInt8[np.ndarray, "h w"], ...]
    path: CameraPath

    @property
    def still(self) -> bool:
        """Whether the camera stands still."""
        return bool((self.path.to_reference == np.eye(3)).all())

    def at(self, frame: int) -> UInt8[np.ndarray, "h w"]:
        """A frame that was read; of a still camera the median of them, without players."""
        return self._median if self.still else self.greys[self.frames.index(frame)]

    @cached_property
    def _median(self) -> UInt8[np.ndarray, "h w"]:
        """Of a few frames from all over the clip."""
        chosen = np.linspace(0, len(self.greys) - 1, min(MEDIAN_OF, len(self.greys)))
        stack = np.stack([self.greys[round(k)] for k in chosen])
        return np.median(stack, axis=0).astype(np.uint8)


def calibrate_court(
    video: Video,
    camera_path: CameraPath,
    clicks: Sequence[CourtClick] = (),
    options: CalibrationOptions = CalibrationOptions(),
    progress: Progress = silent,
) -> WorldCamera:
    """The camera of every frame of a clip that shows a tennis court.

    `camera_path` is the camera's motion (`estimate_camera_motion`). Clicks on named points
    (`keyrecon.world.court.POINTS`) help where the lines alone do not tell; four are enough. Of a
    video with cuts every shot is looked at by itself, and those from one place are found.
    Raises KeyreconError where no court is found or the clicks contradict one another.
    """
    for click in clicks:
        check_click(click, len(video), (video.width, video.height))
    if camera_path.cuts:
        return _calibrate_shots(video, camera_path, clicks, options, progress)
    return _calibrate_shot(video, camera_path, clicks, options, progress)


def _calibrate_shots(
    video: Video,
    path: CameraPath,
    clicks: Sequence[CourtClick],
    options: CalibrationOptions,
    progress: Progress,
) -> WorldCamera:
    """The same for shots between cuts, those of one place.

    Of clicked shots the one with most clicks says which place that is, else the longest that shows
    a court. Raises what was wrong with the first of them where none does.
    """
    parts = Shots.between(path.cuts, len(video)).parts
    inside = [[c for c in clicks if p.start <= c.frame < p.stop] for p in parts]
    order = sorted(
        range(len(parts)), key=lambda k: (-len(inside[k]), parts[k].start - parts[k].stop)
    )
    cameras: dict[int, WorldCamera] = {}
    faults: list[KeyreconError] = []
    elsewhere: list[int] = []
    for k in order:
        part, first = parts[k], parts[k].start
        own = [replace(click, frame=click.frame - first) for click in inside[k]]
        try:
            camera = _calibrate_shot(
                video.part(part), part_of_path(path, part), own, options, progress
            )
        except KeyreconError as fault:
            if own:
                raise
            faults.append(fault)
            continue
        if all(_same_place(camera, other) for other in cameras.values()):
            cameras[k] = camera
        else:
            elsewhere.append(first)
    if not cameras:
        raise faults[0]
    joined = _joined([cameras.get(k) for k in range(len(parts))], parts)
    return replace(joined, elsewhere=tuple(sorted(elsewhere)))


def _same_place(one: WorldCamera, other: WorldCamera) -> bool:
    """Whether both are of one camera that turned and zoomed."""
    here, there = (c.centre[np.flatnonzero(c.found)[0]] for c in (one, other))
    return bool(np.linalg.norm(here - there) <= MAX_SPREAD * np.linalg.norm(there))


def _joined(cameras: Sequence[WorldCamera | None], parts: Sequence[slice]) -> WorldCamera:
    """Cameras of shots one after another; None where there is none."""
    known = next(camera for camera in cameras if camera is not None)

    def values(name: str) -> np.ndarray:
        like = getattr(known, name)
        blank = False if like.dtype == bool else np.nan
        rows = [
            np.full((part.stop - part.start, *like.shape[1:]), blank, dtype=like.dtype)
            if camera is None
            else getattr(camera, name)
            for camera, part in zip(cameras, parts, strict=True)
        ]
        return np.concatenate(rows)

    inner, turn, shift, found, centre, focal, tilt = (values(name) for name in OF_CAMERA)
    return WorldCamera(inner, turn, shift, found, centre, focal, tilt)


def _calibrate_shot(
    video: Video,
    camera_path: CameraPath,
    clicks: Sequence[CourtClick],
    options: CalibrationOptions,
    progress: Progress,
) -> WorldCamera:
    court = tennis_court(options.court)
    width = min(MEASURED_WIDTH, video.width)
    pictures = _read_pictures(video, camera_path, width, {click.frame for click in clicks})
    small = shrinking(width / video.width)
    view = _find_court(pictures, court, _shrunk(clicks, small))
    if view.doubt:
        raise KeyreconError(view.doubt)
    frames, joint = _fit_together(pictures, view, court)
    if joint.sd_centre.max() > MAX_SPREAD * float(np.linalg.norm(view.camera.centre)):
        raise KeyreconError(
            f"The lines seen leave the camera's place open by {joint.sd_centre.max():.1f} m; {ASK}"
        )
    greys = progress(read_grey(video, width), "Following the court", len(video))
    if pictures.still:
        views = check_still(greys, joint.cameras[0], court)
    else:
        views = track_court(
            greys, pictures.path, dict(zip(frames, joint.cameras, strict=True)), court
        )
    return _camera(views, joint, 1 / small[0, 0])


def _read_pictures(video: Video, path: CameraPath, width: int, clicked: set[int]) -> _Pictures:
    """Frames from all over the clip and those with clicks, in one pass."""
    spread = np.linspace(0, len(video) - 1, SAMPLED).round().astype(int)
    wanted = sorted({*spread.tolist(), *clicked})
    chosen = set(wanted)
    greys = tuple(g for t, g in enumerate(read_grey(video, width)) if t in chosen)
    if not (path.to_reference == np.eye(3)).all():
        small = shrinking(width / video.width)
        path = CameraPath(small @ path.to_reference @ np.linalg.inv(small), path.confidence)
    return _Pictures(tuple(wanted), greys, path)


def _shrunk(clicks: Sequence[CourtClick], small: Float[np.ndarray, "3 3"]) -> list[CourtClick]:
    """Clicks in the pixels of the pictures that are measured."""
    moved = [warp_points(small, np.array([click.x, click.y])) for click in clicks]
    return [
        replace(click, x=float(x), y=float(y)) for click, (x, y) in zip(clicks, moved, strict=True)
    ]


def _find_court(pictures: _Pictures, court: CourtModel, clicks: Sequence[CourtClick]) -> CourtView:
    """The court in one frame: from clicks where there are enough, else from its lines alone."""
    view = _clicked_or_found(pictures, court, clicks)
    if view.doubt and clicks and (fault := _against_lines(pictures, court, clicks)):
        raise fault
    return view


def _clicked_or_found(
    pictures: _Pictures, court: CourtModel, clicks: Sequence[CourtClick]
) -> CourtView:
    if len(clicks) >= FEWEST:
        try:
            return _view_from_clicks(pictures, court, clicks)
        except ContradictoryClicks as fault:
            if len(clicks) > FEWEST:
                raise
            raise (_against_lines(pictures, court, clicks) or fault) from fault
    tried: list[CourtView] = []
    for frame in _likely_frames(pictures, clicks):
        clicked = _clicked(pictures, clicks, frame) if clicks else None
        view = find_in_picture(pictures.at(frame), court, frame, clicked)
        if not view.doubt:
            return view
        tried.append(view)
    return max(tried, key=lambda v: -np.inf if v.fit is None else v.fit.evidence)


def _likely_frames(pictures: _Pictures, clicks: Sequence[CourtClick]) -> Iterator[int]:
    """Frames in which to look for the court: a still clip's one picture, else a few."""
    middle = len(pictures.frames) // 2
    if pictures.still:
        yield pictures.frames[middle]
        return
    yield from sorted({click.frame for click in clicks})
    spread = np.linspace(0, len(pictures.frames) - 1, TRIED).round().astype(int)
    yield from (
        pictures.frames[k] for k in sorted(set(spread.tolist()), key=lambda k: abs(k - middle))
    )


def _clicked(pictures: _Pictures, clicks: Sequence[CourtClick], frame: int) -> ClickedPixels:
    """All clicks as they would lie in one frame."""
    pixels = [
        warp_points(
            homography_between(pictures.path, click.frame, frame), np.array([click.x, click.y])
        )
        for click in clicks
    ]
    return ClickedPixels(tuple(click.name for click in clicks), np.array(pixels))


def _view_from_clicks(
    pictures: _Pictures, court: CourtModel, clicks: Sequence[CourtClick]
) -> CourtView:
    """The camera that sees the clicked points, brought onto the lines where they bear it out.

    Raises KeyreconError for clicks that contradict one another, or the lines.
    """
    numbers = [click.frame for click in clicks]
    frame = max(set(numbers), key=lambda n: (numbers.count(n), -n))
    grey, clicked = pictures.at(frame), _clicked(pictures, clicks, frame)
    camera = from_near_half(camera_from_points(clicked.names, clicked.pixels, grey.shape))
    fit = fit_lines(grey, camera, court, CLICK_SEARCHES)
    limit = TOLERANCE * grey.shape[1]
    if fit.support >= MIN_SUPPORT and click_error(fit.camera, clicked).max() <= limit:
        return CourtView(frame, fit)
    plain = evaluate(grey, camera, court)
    if is_seen(plain):
        return CourtView(frame, plain)
    return CourtView(
        frame,
        plain,
        f"The clicked points put the court where only {plain.support:.0%} of its lines are seen; "
        "check the names of the points, or click more of them.",
    )


def _against_lines(
    pictures: _Pictures, court: CourtModel, clicks: Sequence[CourtClick]
) -> ContradictoryClicks | None:
    """The one click that contradicts a court found from its lines alone, where there is one."""
    frame = clicks[0].frame
    view = find_in_picture(pictures.at(frame), court, frame)
    if view.fit is None or view.doubt:
        return None
    clicked = _clicked(pictures, clicks, frame)
    away = click_error(view.camera, clicked) / pictures.at(frame).shape[1]
    wrong = int(away.argmax())
    if away[wrong] <= TOLERANCE or (np.delete(away, wrong) > TOLERANCE).any():
        return None
    return ContradictoryClicks(describe_wrong_click(clicked.names[wrong], away[wrong]))


def _fit_together(
    pictures: _Pictures, view: CourtView, court: CourtModel
) -> tuple[list[int], JointFit]:
    """Frames all over the clip with one centre, the view's own frame first."""
    frames, greys, cameras = [view.frame], [pictures.at(view.frame)], [view.camera]
    anew = ANEW
    others = sorted(pictures.frames, key=lambda k: abs(k - view.frame))[1:]
    for frame in [] if pictures.still else others:
        grey = pictures.at(frame)
        nearest = min(range(len(frames)), key=lambda k: abs(frames[k] - frame))
        guess = carry_camera(
            cameras[nearest], homography_between(pictures.path, frames[nearest], frame)
        )
        fit = fit_lines(grey, guess, court, free=FIXED_CENTRE, spread=LOOSE)
        if not is_seen(fit) and anew:
            anew -= 1
            located = find_in_picture(grey, court, frame)
            if located.fit is None or located.doubt or _elsewhere(located.camera, view.camera):
                continue
            fit = located.fit
        if is_seen(fit):
            frames, greys, cameras = [*frames, frame], [*greys, grey], [*cameras, fit.camera]
    return frames, fit_views(greys, cameras, court)


def _elsewhere(one: Pinhole, other: Pinhole) -> bool:
    """Whether two cameras stand in different places."""
    away = float(np.linalg.norm(one.centre - other.centre))
    return away > MAX_SPREAD * float(np.linalg.norm(other.centre))


def _camera(views: TrackedViews, joint: JointFit, scale: float) -> WorldCamera:
    """The result in the pixels of the video, `scale` times as many; NaN where not found."""
    if not views.found.any():
        raise KeyreconError(NO_COURT)
    full = [camera.resized(scale) for camera in views.cameras]
    focal = np.array([camera.focal for camera in full])
    inner = np.zeros((len(full), 3, 3))
    inner[:, 0, 0] = inner[:, 1, 1] = focal
    inner[:, :2, 2] = np.array([camera.principal for camera in full])
    inner[:, 2, 2] = 1
    rotation = np.array([camera.rotation for camera in full])
    shift = np.array([-camera.rotation @ camera.centre for camera in full])
    lost = ~views.found
    inner[lost], rotation[lost], shift[lost], focal[lost] = np.nan, np.nan, np.nan, np.nan
    spread = np.tile(joint.sd_centre, (len(full), 1))
    spread[lost] = np.nan
    untold = np.full(len(full), np.nan)
    return WorldCamera(
        inner, rotation, shift, views.found, spread, focal * joint.sd_log_focal, untold
    )
