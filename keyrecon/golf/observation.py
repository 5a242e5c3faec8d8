"""Everything that is observed of a swing before the motion model is fitted to it.

Of all that the film shows (`scene`) those frames are taken in which a swing was found
(`candidates`). Its club, the cheapest path through what may be one, tells when it passes its key
postures. One pass over reduced pictures, all at once in memory, tracks joints, from the clicked
frame on wherever that is, and matches points of the player's surface. What a person marked holds
throughout (`marks`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from keyrecon.body import LSP14
from keyrecon.golf.candidates import choose_swing_frames, find_slow_motion, place_in_film
from keyrecon.golf.clicks import ClickedPose
from keyrecon.golf.fit.residuals import SILHOUETTE_STEP
from keyrecon.golf.fit.swing_search import SwingHypothesis
from keyrecon.golf.marks import (
    add_shafts,
    correct_tracks,
    hold_keys,
    hold_observations,
    hold_shafts,
    place_marks,
)
from keyrecon.golf.observe.appearance_tracker import AppearanceOptions
from keyrecon.golf.observe.club import Club, ClubOptions, ExpectedSwing, track_club
from keyrecon.golf.observe.film import Film
from keyrecon.golf.observe.foreground import Foreground, FrameForeground
from keyrecon.golf.observe.joint_tracks import TrackedJoints, track_joints
from keyrecon.golf.observe.point_matches import MatchOptions, match_points
from keyrecon.golf.observe.swing_timing import (
    TimingOptions,
    interpolate_times,
    refine_key_frames,
)
from keyrecon.golf.records import Matches, MotionModel, Observations, SwingMarks
from keyrecon.golf.scene import SwingScene, SwingSceneOptions
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

    scene: SwingSceneOptions = field(default_factory=SwingSceneOptions)
    """The player, and what may be his club."""
    club: ClubOptions = field(default_factory=ClubOptions)
    """How the club moves."""
    timing: TimingOptions = field(default_factory=TimingOptions)
    """Key postures."""
    appearance: AppearanceOptions = field(default_factory=AppearanceOptions)
    """Head, knees and ankles."""
    matches: MatchOptions = field(default_factory=MatchOptions)
    """Points of the surface."""
    find_slow_motion: bool = True
    """Whether a downswing that no golfer is so slow in shows slow motion; without, it is as slow as
    the times of the video have it."""


@dataclass(frozen=True, eq=False)
class ObservedSwing:
    """A swing that a film may show, and what is observed of it."""

    film: Film
    """The frames that were observed: those of the swing."""
    slow_motion: float
    """By how much the film is slowed down beyond what was told."""
    observations: Observations


@dataclass(frozen=True, eq=False)
class _Seen:
    """What is seen of a swing, and in the frames between it and the clicks."""

    film: Film
    """The swing's frames."""
    scene: SwingScene
    """Of all frames."""
    chosen: Int[np.ndarray, "T"]
    """Which of them are the swing's."""
    reach: Int[np.ndarray, "R"]
    """Which of them are tracked through: besides these all from the clicked one on."""
    marks: SwingMarks
    pose: ClickedPose
    """In the film, or at its end if it was clicked in no frame of the swing."""

    @property
    def height(self) -> float:
        """Of the player, px."""
        return self.scene.foreground.height


def observe_swing(
    video: Video,
    scene: SwingScene,
    hypothesis: SwingHypothesis,
    pose: ClickedPose,
    marks: SwingMarks,
    model: MotionModel,
    options: ObservationOptions = ObservationOptions(),
    progress: Progress = silent,
) -> ObservedSwing:
    """Observations of the frames in which a film of a video shows a swing by some hypothesis.

    `scene` is what the film shows, `pose` and `marks` are those of the file's frames.
    """
    film = scene.film
    slow_motion = 1.0
    if options.find_slow_motion:
        slow_motion = find_slow_motion(hypothesis.keys, film.fps)
    chosen = choose_swing_frames(hypothesis.keys, film, slow_motion)
    reach = _reach_to(round(float(film.film_index[pose.frame])), chosen)
    window, tracked = film.take(chosen, slow_motion), film.take(reach, slow_motion)
    placed = place_in_film(pose, window)
    seen = _Seen(window, scene, chosen, reach, place_marks(marks, window), placed)
    shown = tracked.open(video)
    small = read_small(shown, scene.foreground.likely.shape[2])
    pictures = [to_lab(p) for p in progress(small, "Reading", len(shown))]
    foreground = replace(scene.foreground, likely=scene.foreground.likely[reach])
    tracks = track_joints(
        pictures, foreground, place_in_film(pose, tracked), window.fps, options.appearance, progress
    )
    rows = np.searchsorted(reach, chosen)
    inside = TrackedJoints(tracks.joints[rows], tracks.spread[rows])
    if len(rows) != len(reach):
        seen = replace(seen, pose=_carry(placed, inside))
    swing = _time_swing(hypothesis, seen, model, options)
    observations = _observe([pictures[row] for row in rows], seen, inside, swing, options)
    return ObservedSwing(window, slow_motion, observations)


def _reach_to(clicked: int, chosen: Int[np.ndarray, "T"]) -> Int[np.ndarray, "R"]:
    """The frames of a swing and those between it and the clicked one, at the same steps."""
    first, last = int(chosen[0]), int(chosen[-1])
    step = int(chosen[1]) - first if len(chosen) > 1 else 1
    before = np.maximum(np.arange(first, min(first, clicked) - step, -step), min(first, clicked))
    after = np.minimum(np.arange(last, max(last, clicked) + step, step), max(last, clicked))
    return np.unique(np.concatenate([before, chosen, after]))


def _carry(pose: ClickedPose, tracks: TrackedJoints) -> ClickedPose:
    """Clicks that were made before or after a swing where they were tracked to, at its end.

    Those that were not tracked moved as the others did.
    """
    joints = pose.joints
    there = np.array([
        tracks.joints[joints.frame, LSP14.index(n)] if n in LSP14.names else (np.nan, np.nan)
        for n in joints.names
    ])  # fmt: skip
    known = np.isfinite(there).all(axis=1)
    moved = np.median((there - joints.places)[known], axis=0) if known.any() else np.zeros(2)
    places = np.where(known[:, None], there, joints.places + moved)
    return replace(pose, joints=replace(joints, places=places))


@dataclass(frozen=True, eq=False)
class _TimedSwing:
    """The club of a swing, and when it passes its key postures."""

    shaft: "_Shaft"
    keys: Float[np.ndarray, "4"]
    phase: Float[np.ndarray, "T"]


def _time_swing(
    hypothesis: SwingHypothesis, seen: _Seen, model: MotionModel, options: ObservationOptions
) -> _TimedSwing:
    """The club that was detected where a hypothesis has it, and key postures by that."""
    fps, chosen = seen.film.fps, seen.chosen
    earlier = place_marks(hypothesis.earlier, seen.film)
    shafts = add_shafts([seen.scene.shafts[t] for t in chosen], earlier, seen.height)
    shafts = hold_shafts(shafts, seen.marks)
    step = int(chosen[1] - chosen[0]) if len(chosen) > 1 else 1
    keys = (hypothesis.keys - chosen[0]) / step
    expected = ExpectedSwing(hypothesis.club[chosen], keys)
    club = track_club(shafts, seen.height, fps, options.club, expected)
    keys = hold_keys(refine_key_frames(club, keys, seen.height, fps, options.timing), seen.marks)
    phase = interpolate_times(keys, model.keys, len(chosen))
    return _TimedSwing(_describe_club(club, seen.height, seen.film.size), keys, phase)


def _observe(
    pictures: Sequence[UInt8[np.ndarray, "h w 3"]],
    seen: _Seen,
    tracks: TrackedJoints,
    swing: _TimedSwing,
    options: ObservationOptions,
) -> Observations:
    """All of it in one record; `pictures` are in Lab."""
    pose, marks = seen.pose, seen.marks
    foreground = replace(seen.scene.foreground, likely=seen.scene.foreground.likely[seen.chosen])
    players = list(seen.scene.players[seen.chosen])
    whole = find_whole(players)
    clicked = pose.frame if len(seen.reach) == len(seen.chosen) else None
    return hold_observations(Observations(
        camera=pose.camera,
        initial=pose.joints,
        height=pose.height,
        stature=pose.stature,
        joints=correct_tracks(tracks.joints, marks, clicked),
        spread=tracks.spread,
        club=swing.shaft.ends,
        club_spread=np.full(len(players), CLUB_SPREAD * seen.height),
        club_along=swing.shaft.along,
        foreground=tuple(
            _sample_mask(player & there, foreground)
            for player, there in zip(players, whole, strict=True)
        ),
        silhouette_distance=np.stack(
            [
                _silhouette_distance(foreground.frame(t), player) * np.float32(there)
                for t, (player, there) in enumerate(zip(players, whole, strict=True))
            ]
        ),
        matches=_match_all([p[..., 0] for p in pictures], players, foreground, options.matches),
        keys=swing.keys,
        phase=swing.phase,
        left_handed=pose.left_handed,
        marks=marks,
    ))  # fmt: skip


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
