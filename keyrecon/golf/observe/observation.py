"""Everything that is seen of a swing before the motion model is fitted to it.

One pass separates the player from the scene, one over the full pictures finds bars that may be the
club's shaft, and one over reduced pictures, all at once in memory, follows joints and matches
points of the player's surface. The club tells when the swing passes its key postures.
"""

from dataclasses import dataclass, field

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from keyrecon.golf.clicks import GolfClicks, check_clicks
from keyrecon.golf.fit.residuals import SILHOUETTE_SCALE
from keyrecon.golf.observe.appearance_tracker import AppearanceOptions
from keyrecon.golf.observe.club import Club, ClubOptions, track_club
from keyrecon.golf.observe.foreground import Foreground, ForegroundOptions, separate_player
from keyrecon.golf.observe.joint_tracks import track_joints
from keyrecon.golf.observe.line_segments import (
    LineSegmentOptions,
    LineSegments,
    detect_line_segments,
    drop_static_segments,
)
from keyrecon.golf.observe.point_matches import MatchOptions, match_points
from keyrecon.golf.observe.shaft_hypotheses import ShaftHypotheses, ShaftOptions, propose_shafts
from keyrecon.golf.observe.swing_events import TimingOptions, find_key_frames, interpolate_times
from keyrecon.golf.records import Camera, Matches, Observations
from keyrecon.io.frame_reader import read_small, side_by_side
from keyrecon.io.video import Video
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.progress import Progress, silent
from keyrecon.segmentation.color_model import to_lab

FOCAL = 1.2
"""Focal length where nobody knows it, picture widths."""
ACROSS = 0.006
"""Standard deviation of the club across its shaft, player heights."""
TIP, NO_TIP, HEAD = 0.02, 0.12, 0.1
"""The same along it, of a hand end where the hands are, of one where the shaft may go on behind
the player, and of the head end, which contrast often cuts short."""
INTO_HANDS = 0.025
"""From where the shaft leaves the hands to between them, player heights."""
WHOLE = 2 / 3
"""Share of the usual area of the mask; a player who turns shows no less."""
SAMPLE = 0.03
"""Distance between samples of the mask, player heights."""


@dataclass(frozen=True)
class ObservationOptions:
    """How a video of a swing is looked at."""

    foreground: ForegroundOptions = field(default_factory=ForegroundOptions)
    """The player against the scene."""
    bars: LineSegmentOptions = field(default_factory=LineSegmentOptions)
    """Parts of the shaft."""
    shafts: ShaftOptions = field(default_factory=ShaftOptions)
    """What may be the club."""
    club: ClubOptions = field(default_factory=ClubOptions)
    """How the club moves."""
    timing: TimingOptions = field(default_factory=TimingOptions)
    """Key postures."""
    appearance: AppearanceOptions = field(default_factory=AppearanceOptions)
    """Head, knees and ankles."""
    matches: MatchOptions = field(default_factory=MatchOptions)
    """Points of the surface."""


def observe_swing(
    video: Video,
    clicks: GolfClicks,
    key_times: Float[np.ndarray, "4"],
    options: ObservationOptions = ObservationOptions(),
    progress: Progress = silent,
) -> Observations:
    """Observations of all frames; `key_times` are the normalised times of the key postures.

    Raises KeyreconError where the clicks do not fit the video or no swing is seen.
    """
    check_clicks(clicks, len(video), (video.width, video.height))
    foreground = separate_player(video, clicks, options.foreground, progress)
    club = find_club(video, foreground, clicks, options, progress)
    keys = find_key_frames(club, foreground.height, video.fps, options.timing)
    width = foreground.likely.shape[2]
    pictures = [to_lab(p) for p in progress(read_small(video, width), "Reading", len(video))]
    joints, spread = track_joints(
        pictures, foreground, clicks, video.fps, options.appearance, progress
    )
    bodies = [foreground.player(t) for t in range(len(video))]
    whole = find_whole(bodies)
    ends, along = _describe_club(club, foreground.height, (video.width, video.height))
    return Observations(
        camera=rough_camera(clicks),
        joints=joints,
        spread=spread,
        club=ends,
        club_spread=np.full(len(video), ACROSS * foreground.height),
        club_along=along,
        foreground=tuple(
            _sample_mask(body & kept, foreground) for body, kept in zip(bodies, whole, strict=True)
        ),
        away=tuple(
            _silhouette_distance(foreground, t, body) * kept
            for t, (body, kept) in enumerate(zip(bodies, whole, strict=True))
        ),
        matches=_match_all([p[..., 0] for p in pictures], bodies, foreground, options.matches),
        keys=keys,
        mu=interpolate_times(keys, key_times, len(video)),
        left_handed=clicks.left_handed,
    )


def rough_camera(clicks: GolfClicks) -> Camera:
    """The camera as far as it is known: a usual focal length, looking at the picture's middle."""
    width, height = clicks.size
    principal = clicks.principal or ((width - 1) / 2, (height - 1) / 2)
    return Camera(clicks.focal or FOCAL * width, np.array(principal, float))


def find_club(
    video: Video,
    foreground: Foreground,
    clicks: GolfClicks,
    options: ObservationOptions = ObservationOptions(),
    progress: Progress = silent,
) -> Club:
    """The club in every frame of a video."""

    def look(numbered: tuple[int, UInt8[np.ndarray, "h w"]]) -> LineSegments:
        frame, grey = numbered
        return detect_line_segments(np.ascontiguousarray(grey), foreground, frame, options.bars)

    pictures = progress(enumerate(video.grey_frames()), "Looking for the club", len(video))
    bars = drop_static_segments(list(side_by_side(look, pictures)), foreground.height)

    def suppose(numbered: tuple[int, LineSegments]) -> ShaftHypotheses:
        frame, own = numbered
        return propose_shafts(own, foreground, frame, clicks.shoulders, options.shafts)

    shafts = list(side_by_side(suppose, enumerate(bars)))
    return track_club(shafts, foreground.height, video.fps, options.club)


def _describe_club(
    club: Club, height: float, size: tuple[int, int]
) -> tuple[Float[np.ndarray, "T 2 2"], Float[np.ndarray, "T 2"]]:
    """Ends of the club where it was seen, and their deviations along the shaft, px."""
    ends = np.where(club.seen[:, None, None], club.ends, np.nan)
    unit = unit_vectors(ends[:, 1] - ends[:, 0], 1e-9)
    ends[:, 0] -= INTO_HANDS * height * unit
    border = 0.02 * height
    inside = ((ends[:, 1] > border) & (ends[:, 1] < np.array(size) - border)).all(axis=1)
    hands = np.where(club.tip, TIP, NO_TIP) * height
    return ends, np.stack([hands, np.where(inside, HEAD * height, np.inf)], axis=1)


def find_whole(bodies: list[Bool[np.ndarray, "h w"]]) -> Bool[np.ndarray, "T"]:
    """Frames whose mask has all of the player: one with clothes of the scene's colour loses parts.

    What such a mask leaves out is no reason to move the player elsewhere.
    """
    areas = np.array([body.sum() for body in bodies])
    return areas > WHOLE * np.median(areas)


def _sample_mask(body: Bool[np.ndarray, "h w"], foreground: Foreground) -> Float[np.ndarray, "n 2"]:
    """Points of a grid on the player, px of the video."""
    step = max(1, round(SAMPLE * foreground.height * foreground.shrink))
    y, x = np.nonzero(body[step // 2 :: step, step // 2 :: step])
    places = np.stack([x, y], axis=1) * step + step // 2
    return (places - (foreground.shrink - 1) / 2) / foreground.shrink


def _silhouette_distance(
    foreground: Foreground, frame: int, body: Bool[np.ndarray, "h w"]
) -> Float[np.ndarray, "y x"]:
    """Distance to the player in px of the video, on a coarser grid."""
    rest = (~(body | (foreground.mask(frame) > 0))).astype(np.uint8)
    distance = cv2.distanceTransform(rest, cv2.DIST_L2, 3) / foreground.shrink
    rows, columns = (max(2, round(s / foreground.shrink / SILHOUETTE_SCALE)) for s in rest.shape)
    return cv2.resize(distance, (columns, rows), interpolation=cv2.INTER_AREA).astype(float)


def _match_all(
    pictures: list[UInt8[np.ndarray, "h w"]],
    bodies: list[Bool[np.ndarray, "h w"]],
    foreground: Foreground,
    options: MatchOptions,
) -> Matches:
    """Points of the surface found again in the next frame, px of the video."""
    height = foreground.height * foreground.shrink

    def match(t: int) -> tuple[np.ndarray, np.ndarray]:
        return match_points(pictures[t], pictures[t + 1], bodies[t], height, options)

    pairs = list(side_by_side(match, range(len(pictures) - 1)))
    shift = (foreground.shrink - 1) / 2
    start, end = (
        (np.concatenate([p[k] for p in pairs]) - shift) / foreground.shrink for k in (0, 1)
    )
    return Matches(_repeated([len(p[0]) for p in pairs]), start, end)


def _repeated(counts: list[int]) -> Int[np.ndarray, "n"]:
    return np.repeat(np.arange(len(counts)), counts)
