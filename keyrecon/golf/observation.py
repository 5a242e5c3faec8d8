"""Everything that is observed of a swing before the motion model is fitted to it.

One pass separates the player from the scene, one over the full pictures detects line segments that
may be the club's shaft, and one over reduced pictures, all at once in memory, tracks joints and
matches points of the player's surface. The club tells when the swing passes its key postures.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from keyrecon.golf.clicks import ClickedPose
from keyrecon.golf.fit.residuals import SILHOUETTE_STEP
from keyrecon.golf.observe.appearance_tracker import AppearanceOptions
from keyrecon.golf.observe.club import Club, ClubOptions, track_club
from keyrecon.golf.observe.foreground import (
    Foreground,
    ForegroundOptions,
    FrameForeground,
    separate_player,
)
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
from keyrecon.golf.records import Matches, Observations
from keyrecon.io.frame_reader import read_small, side_by_side
from keyrecon.io.video import Video
from keyrecon.numerics.geometry import unit_vectors
from keyrecon.progress import Progress, silent
from keyrecon.segmentation.color_model import to_lab

CLUB_SPREAD = 0.006
"""Standard deviation of the club across its shaft, player heights: a shaft's width. Chosen on
rendered swings, like all values here; see benchmarks/golf.py."""
TIP_SPREAD, HIDDEN_TIP_SPREAD, HEAD_SPREAD = 0.02, 0.12, 0.1
"""The same along it, of a hand end where the hands are, of one where the shaft may go on behind
the player, and of the head end, which contrast often cuts short."""
INTO_HANDS = 0.025
"""From where the shaft leaves the hands to between them, player heights: half a fist's breadth."""
PICTURE_RIM = 0.02
"""A head end nearer to the picture's border may lie outside, player heights."""
LEAST_AREA = 2 / 3
"""Share of the usual area of a whole mask; a player who turns shows no less."""
MASK_STEP = 0.03
"""Distance between samples of the mask, player heights: a forearm's width."""


@dataclass(frozen=True)
class ObservationOptions:
    """How a video of a swing is observed."""

    foreground: ForegroundOptions = field(default_factory=ForegroundOptions)
    """The player against the scene."""
    line_segments: LineSegmentOptions = field(default_factory=LineSegmentOptions)
    """Parts of the shaft."""
    shaft_hypotheses: ShaftOptions = field(default_factory=ShaftOptions)
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
    pose: ClickedPose,
    key_times: Float[np.ndarray, "4"],
    options: ObservationOptions = ObservationOptions(),
    progress: Progress = silent,
) -> Observations:
    """Observations of all frames; `key_times` are the normalised times of the key postures.

    Raises KeyreconError where the clicks lie on no player or no swing is observed.
    """
    foreground = separate_player(video, pose, options.foreground, progress)
    club = observe_club(video, foreground, pose.shoulders, options, progress)
    keys = find_key_frames(club, foreground.height, video.fps, options.timing)
    width = foreground.likely.shape[2]
    pictures = [to_lab(p) for p in progress(read_small(video, width), "Reading", len(video))]
    tracks = track_joints(pictures, foreground, pose, video.fps, options.appearance, progress)
    players = [foreground.frame(t).player() for t in range(len(video))]
    whole = find_whole(players)
    shaft = _describe_club(club, foreground.height, (video.width, video.height))
    return Observations(
        camera=pose.camera,
        initial=pose.joints,
        height=pose.height,
        stature=pose.stature,
        joints=tracks.joints,
        spread=tracks.spread,
        club=shaft.ends,
        club_spread=np.full(len(video), CLUB_SPREAD * foreground.height),
        club_along=shaft.along,
        foreground=tuple(
            _sample_mask(player & kept, foreground)
            for player, kept in zip(players, whole, strict=True)
        ),
        silhouette_distance=np.stack(
            [
                _silhouette_distance(foreground.frame(t), player) * np.float32(kept)
                for t, (player, kept) in enumerate(zip(players, whole, strict=True))
            ]
        ),
        matches=_match_all([p[..., 0] for p in pictures], players, foreground, options.matches),
        keys=keys,
        phase=interpolate_times(keys, key_times, len(video)),
        left_handed=pose.left_handed,
    )


def observe_club(
    video: Video,
    foreground: Foreground,
    shoulders: Float[np.ndarray, "2"],
    options: ObservationOptions = ObservationOptions(),
    progress: Progress = silent,
) -> Club:
    """The club in every frame of a video; `shoulders` is the middle between them, px."""

    def detect(numbered: tuple[int, UInt8[np.ndarray, "h w"]]) -> LineSegments:
        frame, grey = numbered
        return detect_line_segments(
            np.ascontiguousarray(grey), foreground.frame(frame), options.line_segments
        )

    pictures = progress(enumerate(video.grey_frames()), "Detecting the club", len(video))
    segments = drop_static_segments(list(side_by_side(detect, pictures)), foreground.height)

    def propose(numbered: tuple[int, LineSegments]) -> ShaftHypotheses:
        frame, of_frame = numbered
        return propose_shafts(
            of_frame, foreground.frame(frame), shoulders, options.shaft_hypotheses
        )

    shafts = list(side_by_side(propose, enumerate(segments)))
    return track_club(shafts, foreground.height, video.fps, options.club)


@dataclass(frozen=True, eq=False)
class _Shaft:
    """The club where it was detected, px."""

    ends: Float[np.ndarray, "T 2 2"]
    along: Float[np.ndarray, "T 2"]
    """Standard deviation of both ends along the shaft."""


def _describe_club(club: Club, height: float, size: tuple[int, int]) -> _Shaft:
    """Ends between the hands and at the head; `size` is that of the pictures."""
    ends = np.where(club.detected[:, None, None], club.ends, np.nan)
    unit = unit_vectors(ends[:, 1] - ends[:, 0], 1e-9)
    ends[:, 0] -= INTO_HANDS * height * unit
    rim = PICTURE_RIM * height
    inside = ((ends[:, 1] > rim) & (ends[:, 1] < np.array(size) - rim)).all(axis=1)
    hands = np.where(club.tip, TIP_SPREAD, HIDDEN_TIP_SPREAD) * height
    return _Shaft(ends, np.stack([hands, np.where(inside, HEAD_SPREAD * height, np.inf)], axis=1))


def find_whole(players: Sequence[Bool[np.ndarray, "h w"]]) -> Bool[np.ndarray, "T"]:
    """Frames whose mask has all of the player: one with clothes of the scene's colour loses parts.

    What such a mask leaves out is no reason to move the player elsewhere.
    """
    areas = np.array([player.sum() for player in players])
    return areas > LEAST_AREA * np.median(areas)


def _sample_mask(
    player: Bool[np.ndarray, "h w"], foreground: Foreground
) -> Float[np.ndarray, "n 2"]:
    """Points of a grid on the player, px of the video."""
    step = max(1, round(MASK_STEP * foreground.height * foreground.shrink))
    y, x = np.nonzero(player[step // 2 :: step, step // 2 :: step])
    places = np.stack([x, y], axis=1) * step + step // 2
    return (places - (foreground.shrink - 1) / 2) / foreground.shrink


def _silhouette_distance(
    foreground: FrameForeground, player: Bool[np.ndarray, "h w"]
) -> Float[np.ndarray, "y x"]:
    """Distance to the player in px of the video, on a coarser grid."""
    outside = (~(player | (foreground.mask() > 0))).astype(np.uint8)
    distance: Float[np.ndarray, "h w"] = cv2.distanceTransform(outside, cv2.DIST_L2, 3)
    rows, columns = (max(2, round(s / foreground.shrink / SILHOUETTE_STEP)) for s in outside.shape)
    return cv2.resize(distance / foreground.shrink, (columns, rows), interpolation=cv2.INTER_AREA)


def _match_all(
    pictures: Sequence[UInt8[np.ndarray, "h w"]],
    players: Sequence[Bool[np.ndarray, "h w"]],
    foreground: Foreground,
    options: MatchOptions,
) -> Matches:
    """Points of the surface matched in the next frame, px of the video."""
    height = foreground.height * foreground.shrink

    def match(t: int) -> tuple[np.ndarray, np.ndarray]:
        return match_points(pictures[t], pictures[t + 1], players[t], height, options)

    pairs = list(side_by_side(match, range(len(pictures) - 1)))
    shift = (foreground.shrink - 1) / 2
    start, end = (
        (np.concatenate([p[k] for p in pairs]) - shift) / foreground.shrink for k in (0, 1)
    )
    return Matches(np.repeat(np.arange(len(pairs)), [len(p[0]) for p in pairs]), start, end)
